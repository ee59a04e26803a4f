// Functions that LLVM calls: 64-bit integers and single floats (round to nearest, even), from 32-bit operations.
#include <stdint.h>
#include <stddef.h>

typedef union {
    uint64_t all;
    struct {
        uint32_t low, high;
    } part;
} wide;
typedef union {
    float f;
    uint32_t u;
} bits;

// ---------------------------------------------------------------- integers of 64 bits

uint64_t __muldi3(uint64_t a64, uint64_t b64) {
    wide a = {a64}, b = {b64}, r;
    uint32_t al = a.part.low & 0xffff, ah = a.part.low >> 16, bl = b.part.low & 0xffff, bh = b.part.low >> 16;
    uint32_t low = al * bl, mid1 = ah * bl, mid2 = al * bh, high = ah * bh;
    uint32_t mid = (low >> 16) + (mid1 & 0xffff) + (mid2 & 0xffff);
    r.part.low = (mid << 16) | (low & 0xffff);
    r.part.high =
        high + (mid1 >> 16) + (mid2 >> 16) + (mid >> 16) + a.part.low * b.part.high + a.part.high * b.part.low;
    return r.all;
}

uint64_t __ashldi3(uint64_t a64, int n) {
    wide a = {a64}, r;
    if (n >= 32) {
        r.part.high = a.part.low << (n & 31);
        r.part.low = 0;
    } else if (n) {
        r.part.high = a.part.high << n | a.part.low >> (32 - n);
        r.part.low = a.part.low << n;
    } else {
        r = a;
    }
    return r.all;
}

uint64_t __lshrdi3(uint64_t a64, int n) {
    wide a = {a64}, r;
    if (n >= 32) {
        r.part.low = a.part.high >> (n & 31);
        r.part.high = 0;
    } else if (n) {
        r.part.low = a.part.low >> n | a.part.high << (32 - n);
        r.part.high = a.part.high >> n;
    } else {
        r = a;
    }
    return r.all;
}

int64_t __ashrdi3(int64_t a64, int n) {
    wide a = {(uint64_t)a64}, r;
    if (n >= 32) {
        r.part.low = (int32_t)a.part.high >> (n & 31);
        r.part.high = (int32_t)a.part.high >> 31;
    } else if (n) {
        r.part.low = a.part.low >> n | a.part.high << (32 - n);
        r.part.high = (int32_t)a.part.high >> n;
    } else {
        r = a;
    }
    return (int64_t)r.all;
}

static uint64_t divide(uint64_t n64, uint64_t d64, uint64_t *rest) {
    wide n = {n64}, d = {d64}, q = {0}, r = {0};
    for (int i = 63; i >= 0; i--) {
        r.part.high = r.part.high << 1 | r.part.low >> 31;
        r.part.low = r.part.low << 1 | n.part.high >> 31;
        n.part.high = n.part.high << 1 | n.part.low >> 31;
        n.part.low <<= 1;
        q.part.high = q.part.high << 1 | q.part.low >> 31;
        q.part.low <<= 1;
        if (r.part.high > d.part.high || (r.part.high == d.part.high && r.part.low >= d.part.low)) {
            uint32_t low = r.part.low - d.part.low;
            r.part.high -= d.part.high + (low > r.part.low);
            r.part.low = low;
            q.part.low |= 1;
        }
    }
    *rest = r.all;
    return q.all;
}

uint64_t __udivdi3(uint64_t n, uint64_t d) {
    uint64_t r;
    return divide(n, d, &r);
}

uint64_t __umoddi3(uint64_t n, uint64_t d) {
    uint64_t r;
    divide(n, d, &r);
    return r;
}

int64_t __divdi3(int64_t n, int64_t d) {
    uint64_t r, q = divide(n < 0 ? -n : n, d < 0 ? -d : d, &r);
    return (n < 0) != (d < 0) ? -(int64_t)q : (int64_t)q;
}

int64_t __moddi3(int64_t n, int64_t d) {
    uint64_t r;
    divide(n < 0 ? -n : n, d < 0 ? -d : d, &r);
    return n < 0 ? -(int64_t)r : (int64_t)r;
}

// ---------------------------------------------------------------- floats

// sign, exponent and a mantissa of 24 bits shifted left by 3 (guard, round, sticky) become a float
static float pack(uint32_t sign, int exponent, uint32_t m) {
    bits r;
    if (!m) {
        r.u = sign;
        return r.f;
    }
    while (m >> 27) {
        m = m >> 1 | (m & 1);
        exponent++;
    }
    while (!(m >> 26)) {
        m <<= 1;
        exponent--;
    }
    if (exponent >= 255) {
        r.u = sign | 0x7f800000;
        return r.f;
    }
    if (exponent <= 0) {
        int n = 1 - exponent;
        m = n > 30 ? 1 : m >> n | ((m << (32 - n)) != 0);
        exponent = 0;
    }
    uint32_t rest = m & 7, u = m >> 3;
    u = exponent ? (u & 0x7fffff) | (uint32_t)exponent << 23 : u;
    if (rest > 4 || (rest == 4 && (u & 1))) {
        u++;
    }
    r.u = sign | u;
    return r.f;
}

static int split(uint32_t u, uint32_t *m) { // exponent and mantissa
    int e = u >> 23 & 255;
    *m = (u & 0x7fffff) << 3;
    if (e) {
        *m |= 1 << 26;
    } else {
        e = 1;
    }
    return e;
}

static int odd(uint32_t u) {
    return (u & 0x7f800000) == 0x7f800000;
}

static int nan(uint32_t u) {
    return (u & 0x7fffffff) > 0x7f800000;
}

static float number(uint32_t u) {
    bits r;
    r.u = u;
    return r.f;
}

float __addsf3(float fa, float fb) {
    bits a = {fa}, b = {fb};
    if (odd(a.u) || odd(b.u)) {
        if (nan(a.u) || nan(b.u) || (odd(a.u) && odd(b.u) && a.u != b.u)) {
            return number(0x7fc00000);
        }
        return odd(a.u) ? fa : fb;
    }
    if ((a.u & 0x7fffffff) < (b.u & 0x7fffffff)) {
        bits t = a;
        a = b;
        b = t;
    }
    uint32_t ma, mb, sign = a.u & 0x80000000;
    int e = split(a.u, &ma), n = e - split(b.u, &mb);
    mb = n > 30 ? mb != 0 : n ? mb >> n | ((mb << (32 - n)) != 0) : mb;
    if ((a.u ^ b.u) >> 31) {
        if (ma == mb) {
            return number(0);
        }
        return pack(sign, e, ma - mb);
    }
    if (!(ma | mb)) {
        return number(sign);
    }
    return pack(sign, e, ma + mb);
}

float __subsf3(float a, float fb) {
    bits b = {fb};
    b.u ^= 0x80000000;
    return __addsf3(a, b.f);
}

float __negsf2(float fa) {
    bits a = {fa};
    a.u ^= 0x80000000;
    return a.f;
}

static uint32_t high(uint32_t a, uint32_t b, uint32_t *low) {
    wide r = {__muldi3(a, b)};
    *low = r.part.low;
    return r.part.high;
}

float __mulsf3(float fa, float fb) {
    bits a = {fa}, b = {fb};
    uint32_t sign = (a.u ^ b.u) & 0x80000000, ma, mb, low;
    if (odd(a.u) || odd(b.u)) {
        if (nan(a.u) || nan(b.u) || !(a.u << 1) || !(b.u << 1)) {
            return number(0x7fc00000);
        }
        return number(sign | 0x7f800000);
    }
    int e = split(a.u, &ma) + split(b.u, &mb) - 127;
    if (!ma || !mb) {
        return number(sign);
    }
    while (!(ma >> 26)) {
        ma <<= 1;
        e--;
    }
    while (!(mb >> 26)) {
        mb <<= 1;
        e--;
    }
    uint32_t m = high(ma << 3, mb << 3, &low); // 2^26 · 2^26 · 2^6 / 2^32
    return pack(sign, e, m | (low != 0));
}

float __divsf3(float fa, float fb) {
    bits a = {fa}, b = {fb};
    uint32_t sign = (a.u ^ b.u) & 0x80000000, ma, mb;
    if (nan(a.u) || nan(b.u) || (odd(a.u) && odd(b.u))) {
        return number(0x7fc00000);
    }
    if (odd(a.u)) {
        return number(sign | 0x7f800000);
    }
    if (odd(b.u)) {
        return number(sign);
    }
    int e = split(a.u, &ma) - split(b.u, &mb) + 127;
    if (!mb) {
        return number(ma ? sign | 0x7f800000 : 0x7fc00000);
    }
    if (!ma) {
        return number(sign);
    }
    while (!(ma >> 26)) {
        ma <<= 1;
        e--;
    }
    while (!(mb >> 26)) {
        mb <<= 1;
        e++;
    }
    if (ma < mb) {
        ma <<= 1;
        e--;
    }
    uint32_t q = 0;
    for (int i = 0; i < 27; i++) {
        q <<= 1;
        if (ma >= mb) {
            ma -= mb;
            q |= 1;
        }
        ma <<= 1;
    }
    return pack(sign, e, q | (ma != 0));
}

float __floatunsisf(uint32_t u) {
    return pack(0, 127 + 26, u);
}

float __floatsisf(int32_t n) {
    bits r = {__floatunsisf(n < 0 ? 0u - (uint32_t)n : (uint32_t)n)};
    if (n < 0) {
        r.u |= 0x80000000;
    }
    return r.f;
}

float __floatundisf(uint64_t n) {
    wide w = {n};
    int e = 127 + 26;
    if (!w.part.high) {
        return __floatunsisf(w.part.low);
    }
    while (w.part.high) {
        w.part.low = w.part.low >> 1 | (w.part.low & 1) | w.part.high << 31;
        w.part.high >>= 1;
        e++;
    }
    return pack(0, e + 5, w.part.low >> 5 | ((w.part.low & 31) != 0));
}

float __floatdisf(int64_t n) {
    bits r = {__floatundisf(n < 0 ? 0 - (uint64_t)n : (uint64_t)n)};
    if (n < 0) {
        r.u |= 0x80000000;
    }
    return r.f;
}

uint32_t __fixunssfsi(float f) {
    bits a = {f};
    int e = (a.u >> 23 & 255) - 150;
    uint32_t m = (a.u & 0x7fffff) | 0x800000;
    if (a.u >> 31 || e < -23) {
        return 0;
    }
    if (e > 8) {
        return 0xffffffff;
    }
    return e < 0 ? m >> -e : m << e;
}

int32_t __fixsfsi(float f) {
    bits a = {f};
    uint32_t sign = a.u >> 31;
    a.u &= 0x7fffffff;
    if ((a.u >> 23) >= 158) {
        return sign ? (int32_t)0x80000000 : 0x7fffffff;
    }
    int32_t n = (int32_t)__fixunssfsi(a.f);
    return sign ? -n : n;
}

static int order(float fa, float fb, int unordered) {
    bits a = {fa}, b = {fb};
    if (nan(a.u) || nan(b.u)) {
        return unordered;
    }
    if (!((a.u | b.u) << 1)) {
        return 0;
    }
    int32_t x = (int32_t)a.u, y = (int32_t)b.u;
    x ^= x >> 31 & 0x7fffffff;
    y ^= y >> 31 & 0x7fffffff;
    return x < y ? -1 : x > y;
}

int __eqsf2(float a, float b) {
    return order(a, b, 1);
}

int __nesf2(float a, float b) {
    return order(a, b, 1);
}

int __ltsf2(float a, float b) {
    return order(a, b, 1);
}

int __lesf2(float a, float b) {
    return order(a, b, 1);
}

int __gtsf2(float a, float b) {
    return order(a, b, -1);
}

int __gesf2(float a, float b) {
    return order(a, b, -1);
}

int __unordsf2(float fa, float fb) {
    bits a = {fa}, b = {fb};
    return nan(a.u) || nan(b.u);
}

float fabsf(float f) {
    bits a = {f};
    a.u &= 0x7fffffff;
    return a.f;
}

float copysignf(float f, float g) {
    bits a = {f}, b = {g};
    a.u = (a.u & 0x7fffffff) | (b.u & 0x80000000);
    return a.f;
}

float nanf(const char *text) {
    return number(0x7fc00000);
}

int __finitef(float f) {
    bits a = {f};
    return !odd(a.u);
}

char *strrchr(const char *s, int c) {
    const char *found = NULL;
    for (;; s++) {
        if (*s == (char)c) {
            found = s;
        }
        if (!*s) {
            return (char *)found;
        }
    }
}

// doubles are only passed on
uint64_t __extendsfdf2(float f) {
    bits a = {f};
    wide r = {0};
    uint32_t e = a.u >> 23 & 255;
    r.part.low = a.u << 29;
    r.part.high = (a.u & 0x80000000) | ((e == 255 ? 2047 : e ? e + 896 : 0) << 20) | (a.u >> 3 & 0xfffff);
    return r.all;
}

float __truncdfsf2(uint64_t d) {
    wide a = {d};
    int e = (int)(a.part.high >> 20 & 2047);
    uint32_t sign = a.part.high & 0x80000000;
    uint32_t m = (a.part.high & 0xfffff) << 3 | a.part.low >> 29;
    if (e == 2047) {
        return number(sign | 0x7f800000 | m);
    }
    if (!e) {
        return number(sign);
    }
    return pack(sign, e - 896, (m | 0x800000) << 3 | (a.part.low >> 26 & 7) | ((a.part.low << 6) != 0));
}

uint64_t __floatsidf(int32_t n) {
    return __extendsfdf2(__floatsisf(n));
}

uint64_t __floatunsidf(uint32_t n) {
    return __extendsfdf2(__floatunsisf(n));
}

int32_t __fixdfsi(uint64_t d) {
    return __fixsfsi(__truncdfsf2(d));
}

int abs(int n) {
    return n < 0 ? -n : n;
}
