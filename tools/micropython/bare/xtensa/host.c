// System calls of qemu-xtensa, which is a Linux, and the part of a C library that they and main.c need.
#include <stddef.h>
#include <string.h>
#include "../host.h"

enum { SYS_OPEN = 8, SYS_CLOSE = 9, SYS_READ = 12, SYS_WRITE = 13, SYS_LSEEK = 15, SYS_EXIT_GROUP = 119, SYS_GETTIMEOFDAY = 192 };
enum { FLAGS_READ = 0, FLAGS_UPDATE = 2, FLAGS_WRITE = 01101, FLAGS_APPEND = 02101 }; // write-only, create, and truncate or append

static int argc;
static char **argv;

static int call(int number, int a, int b, int c) {
    register int r2 __asm__ ("a2") = number;
    register int r6 __asm__ ("a6") = a;
    register int r3 __asm__ ("a3") = b;
    register int r4 __asm__ ("a4") = c;
    __asm__ volatile ("syscall" : "+r" (r2) : "r" (r6), "r" (r3), "r" (r4) : "memory");
    return r2;
}

static int or_failed(int result) {
    return result < 0 ? -1 : result; // Linux gives the error's number, negative
}

int host_open(const char *path, int mode) {
    static const int flags[] = {
        [HOST_READ] = FLAGS_READ, [HOST_WRITE] = FLAGS_WRITE, [HOST_APPEND] = FLAGS_APPEND, [HOST_UPDATE] = FLAGS_UPDATE };
    return or_failed(call(SYS_OPEN, (int)path, flags[mode], 0644));
}

int host_stdin(void) {
    return 0;
}

int host_stdout(void) {
    return 1;
}

void host_close(int handle) {
    call(SYS_CLOSE, handle, 0, 0);
}

int host_read(int handle, void *buffer, int count) {
    return or_failed(call(SYS_READ, handle, (int)buffer, count));
}

int host_write(int handle, const void *buffer, int count) {
    return or_failed(call(SYS_WRITE, handle, (int)buffer, count));
}

int host_seek(int handle, int place) {
    return call(SYS_LSEEK, handle, place, 0);
}

int host_command_line(char *buffer, int size) {
    int at = 0;
    for (int i = 0; i < argc; i++) {
        int length = strlen(argv[i]);
        if (at + length + 2 > size) {
            return -1;
        }
        memcpy(buffer + at, argv[i], length);
        at += length;
        buffer[at++] = ' ';
    }
    buffer[at] = 0;
    return at;
}

void host_exit(int status) {
    for (;;) {
        call(SYS_EXIT_GROUP, status, 0, 0);
    }
}

uint64_t host_time_ns(void) {
    int time[2];
    call(SYS_GETTIMEOFDAY, (int)time, 0, 0);
    return (uint64_t)(uint32_t)time[0] * 1000000000u + (uint32_t)time[1] * 1000u;
}

void bare_main(void);

// Called by start.S with the stack as Linux leaves it.
void linux_main(int *stack) {
    argc = stack[0];
    argv = (char **)(stack + 1);
    bare_main();
}

unsigned long strtoul(const char *text, char **end, int base) {
    unsigned long number = 0;
    while (*text >= '0' && *text <= '9') {
        number = number * 10 + *text++ - '0';
    }
    return number;
}

int *__errno_location(void) {
    static int number;
    return &number;
}

// The roots of the garbage collector: the stack and the registers. Registers of older calls are in windows; eight more
// calls put them all on the stack.
extern void gc_collect_root(void **from, size_t words);

static void __attribute__((noinline)) collect_from_below(volatile unsigned calls, char *top) {
    if (calls) {
        collect_from_below(calls - 1, top);
    } else {
        volatile uint32_t here = (uint32_t)__builtin_frame_address(0);
        gc_collect_root((void **)(here - 64), (top - (char *)here + 64) / sizeof(void *));
    }
}

void collect_windows(char *top) {
    collect_from_below(8, top);
}
