// Arithmetic of the M33 that is too long to write in line: functions that code calls, of whole numbers of 32 bits, and of floats by the
// numbers of their registers.

import { STATE } from './emit.mjs';

/** Text of some, for assemble.mjs: name, text, parameters. Each may call those before it. */
export const TEXTS = [
  [
    'umull', // in halves of 16 bits
    'p=a&65535;q=a>>>16;x=b&65535;y=b>>>16;t=p*x;w=p*y;a=q*x;b=(t>>>16)+(w&65535)+(a&65535);' +
      'high=q*y+(w>>>16)+(a>>>16)+(b>>>16);return t&65535|b<<16;',
    ['a', 'b'],
  ],
  ['smull', 't=core.umull(a,b);high=high-(a<0?b:0)-(b<0?a:0);return t;', ['a', 'b']],
  ['add64', 'x=low+l;high=high+h+(x>>>0<low>>>0?1:0);return x;', ['low', 'l', 'h']],
  ['umlal', 'return core.add64(core.umull(a,b),l,h);', ['a', 'b', 'l', 'h']],
  ['smlal', 'return core.add64(core.smull(a,b),l,h);', ['a', 'b', 'l', 'h']],
  ['umaal', 'low=core.add64(core.umull(a,b),l,0);return core.add64(low,h,0);', ['a', 'b', 'l', 'h']],
];

/** Return those with a result, and those without one. st, si: state and floats of the processor. */
export function arithmetic(st, si) {
  const s = new Float32Array(si.buffer, si.byteOffset, si.length);

  /** The value, if it fits into 32 bits; otherwise Q says that it did not. */
  const counted = (x) => {
    if (x !== (x | 0)) st[STATE.sticky] = 1;
    return x | 0;
  };
  const within = (x, low, high) => {
    const y = Math.max(low, Math.min(high, x));
    if (y !== x) st[STATE.sticky] = 1;
    return y | 0;
  };
  const ssat = (x, bits) => within(x, -(2 ** (bits - 1)), 2 ** (bits - 1) - 1);
  const usat = (x, bits) => within(x, 0, 2 ** bits - 1);
  /** Saturate both halves of a word. */
  const both = (x, saturate, bits) => (saturate((x << 16) >> 16, bits) & 0xffff) | (saturate(x >> 16, bits) << 16);

  /** mode 0: ties to even, 1: ties away, 2: up, 3: down, 4: to zero, 5: FPSCR */
  const rounded = (x, mode) => {
    switch (mode === 5 ? [0, 2, 3, 4][(st[STATE.fpscr] >> 22) & 3] : mode) {
      case 1: return x < 0 ? -Math.floor(-x + 0.5) : Math.floor(x + 0.5);
      case 2: return Math.ceil(x);
      case 3: return Math.floor(x);
      case 4: return Math.trunc(x);
    }
    const down = Math.floor(x);
    const rest = x - down;
    return rest < 0.5 ? down : rest > 0.5 ? down + 1 : down % 2 ? down + 1 : down;
  };
  const rint = (x, mode) => (!Number.isFinite(x) || x === 0 ? x : Math.abs(rounded(x, mode)) * (x < 0 ? -1 : 1));
  const compare = (a, b) => {
    const flags = a === b ? 6 : a < b ? 8 : a > b ? 2 : 3;
    st[STATE.fpscr] = (st[STATE.fpscr] & 0x0fffffff) | (flags << 28);
  };

  const values = {
    ssat,
    usat,
    ssat16: (x, bits) => both(x, ssat, bits),
    usat16: (x, bits) => both(x, usat, bits),
    rbit(x) {
      x = ((x & 0x55555555) << 1) | ((x >>> 1) & 0x55555555);
      x = ((x & 0x33333333) << 2) | ((x >>> 2) & 0x33333333);
      x = ((x & 0x0f0f0f0f) << 4) | ((x >>> 4) & 0x0f0f0f0f);
      x = ((x & 0x00ff00ff) << 8) | ((x >>> 8) & 0x00ff00ff);
      return (x << 16) | (x >>> 16);
    },
    sdiv: (a, b) => (b === 0 ? 0 : (a / b) | 0),
    udiv: (a, b) => (b === 0 ? 0 : ((a >>> 0) / (b >>> 0)) | 0),
    /** Add a product, or two. */
    plus: (a, b, c) => counted(a + b + c),
    plusTop: (a, b, c) => counted(c + Number(BigInt.asIntN(32, (BigInt(a) * BigInt(b)) >> 16n))),
    mulTop(a, b, c, round, subtract) {
      const product = BigInt(a) * BigInt(b);
      let x = (BigInt(c) << 32n) + (subtract ? -product : product);
      if (round) x += 0x80000000n;
      return Number(BigInt.asIntN(32, x >> 32n));
    },
    /** Add both products to h:l. */
    accumulate(one, other, l, h) {
      const x = one + other;
      const sum = (x >>> 0) + (l >>> 0);
      st[STATE.high] = (Math.floor(x / 2 ** 32) + h + (sum > 0xffffffff ? 1 : 0)) | 0;
      return sum | 0;
    },
    usad(a, b, c) {
      for (let i = 0; i < 32; i += 8) c += Math.abs(((a >>> i) & 255) - ((b >>> i) & 255));
      return c | 0;
    },
    addHalves: (a, b) => (((a & 0xffff) + (b & 0xffff)) & 0xffff) | (((a >>> 16) + (b >>> 16)) << 16),
    qadd(kind, n, m) {
      const twice = kind & 1 ? ssat(2 * n, 32) : n;
      return ssat(kind & 2 ? m - twice : m + twice, 32);
    },
    sel(n, m) {
      let x = 0;
      for (let i = 0; i < 4; i++) x |= ((st[STATE.ge] >> i) & 1 ? n : m) & (255 << (8 * i));
      return x;
    },
    parallel(op, kind, n, m) {
      // op 0 ADD8, 1 ADD16, 2 ASX, 4 SUB8, 5 SUB16, 6 SAX; kind 0 S, 1 Q, 2 SH, 4 U, 5 UQ, 6 UH
      const unsigned = kind >= 4;
      const bits = op === 0 || op === 4 ? 8 : 16;
      const lane = (x, i) => (unsigned ? (x >>> (bits * i)) & (2 ** bits - 1) : (x << (32 - bits * (i + 1))) >> (32 - bits));
      let result = 0;
      let ge = 0;
      const count = 32 / bits;
      for (let i = 0; i < count; i++) {
        const cross = op === 2 || op === 6;
        const minus = op === 4 || op === 5 || (op === 2 && i === 0) || (op === 6 && i === 1);
        const b = lane(m, cross ? 1 - i : i);
        let x = minus ? lane(n, i) - b : lane(n, i) + b;
        const good = unsigned && !minus ? x > 2 ** bits - 1 : x >= 0;
        if (good) ge |= (bits === 8 ? 1 : 3) << (bits === 8 ? i : 2 * i);
        if ((kind & 3) === 1) x = unsigned ? Math.max(0, Math.min(2 ** bits - 1, x)) : Math.max(-(2 ** (bits - 1)), Math.min(2 ** (bits - 1) - 1, x));
        else if ((kind & 3) === 2) x >>= 1;
        result |= (x & (2 ** bits - 1)) << (bits * i);
      }
      if ((kind & 3) === 0) st[STATE.ge] = ge;
      return result;
    },
    /** A float as a whole number; mode as above. */
    toInt(m, mode, signed) {
      const x = rint(s[m], mode);
      if (Number.isNaN(x)) return 0;
      const whole = Math.trunc(x);
      return signed ? Math.max(-0x80000000, Math.min(0x7fffffff, whole)) : Math.max(0, Math.min(0xffffffff, whole)) | 0;
    },
  };

  const product = (n, m) => Math.fround(s[n] * s[m]);
  const actions = {
    vmla: (d, n, m) => void (s[d] = s[d] + product(n, m)),
    vmls: (d, n, m) => void (s[d] = s[d] - product(n, m)),
    vnmls: (d, n, m) => void (s[d] = -s[d] + product(n, m)),
    vnmla: (d, n, m) => void (s[d] = -s[d] - product(n, m)),
    vmul: (d, n, m) => void (s[d] = s[n] * s[m]),
    vnmul: (d, n, m) => void (s[d] = -s[n] * s[m]),
    vadd: (d, n, m) => void (s[d] = s[n] + s[m]),
    vsub: (d, n, m) => void (s[d] = s[n] - s[m]),
    vdiv: (d, n, m) => void (s[d] = s[n] / s[m]),
    vfma: (d, n, m) => void (s[d] = fma(s[n], s[m], s[d])),
    vfms: (d, n, m) => void (s[d] = fma(-s[n], s[m], s[d])),
    vfnms: (d, n, m) => void (s[d] = fma(s[n], s[m], -s[d])),
    vfnma: (d, n, m) => void (s[d] = fma(-s[n], s[m], -s[d])),
    vsqrt: (d, m) => void (s[d] = Math.sqrt(s[m])),
    vmaxnm: (d, n, m) => void (s[d] = Number.isNaN(s[n]) ? s[m] : Number.isNaN(s[m]) ? s[n] : Math.max(s[n], s[m])),
    vminnm: (d, n, m) => void (s[d] = Number.isNaN(s[n]) ? s[m] : Number.isNaN(s[m]) ? s[n] : Math.min(s[n], s[m])),
    vcmp: (d, m) => compare(s[d], s[m]),
    vcmp0: (d) => compare(s[d], 0),
    vrint: (d, m, mode) => void (s[d] = rint(s[m], mode)),
    fromInt: (d, m, signed) => void (s[d] = signed ? si[m] : si[m] >>> 0),
    fixed(d, kind, size, bits) {
      const unsigned = kind & 1;
      if (kind < 12) {
        let x = si[d];
        if (size === 16) x = unsigned ? x & 0xffff : (x << 16) >> 16;
        else if (unsigned) x >>>= 0;
        s[d] = x / 2 ** bits;
      } else {
        let x = Math.trunc(s[d] * 2 ** bits);
        const low = unsigned ? 0 : -(2 ** (size - 1));
        const high = unsigned ? 2 ** size - 1 : 2 ** (size - 1) - 1;
        x = Number.isNaN(x) ? 0 : Math.max(low, Math.min(high, x));
        si[d] = x | 0;
      }
    },
  };
  return [actions, values];
}

/** One rounding: the product is exact in a double; the sum is rounded to odd before the last rounding. */
function fma(a, b, c) {
  const p = a * b;
  const sum = p + c;
  const single = Math.fround(sum);
  if (!Number.isFinite(sum) || single === sum) return single;
  // the error of the sum decides ties
  const bv = sum - p;
  const error = p - (sum - bv) + (c - bv);
  if (error === 0) return single;
  return Math.fround(nudge(sum, error));
}

const f64 = new Float64Array(1);
const u64 = new BigInt64Array(f64.buffer);

/** The double next to x in the direction of the error if x is even in its last place, so that no tie is left. */
function nudge(x, error) {
  f64[0] = x;
  if (u64[0] & 1n) return x;
  u64[0] += (x > 0) === (error > 0) ? 1n : -1n;
  return f64[0];
}
