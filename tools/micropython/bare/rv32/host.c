// Semihosting: calls that QEMU itself answers.
#include <string.h>
#include "../host.h"

enum { SYS_OPEN = 1, SYS_CLOSE = 2, SYS_WRITE = 5, SYS_READ = 6, SYS_SEEK = 10, SYS_GET_CMDLINE = 21, SYS_EXIT_EXTENDED = 32 };
enum { APPLICATION_EXIT = 0x20026 };
enum { MODE_READ = 1, MODE_UPDATE = 3, MODE_WRITE = 5, MODE_APPEND = 9, MODE_CONSOLE = 4 }; // "rb", "r+b", "wb", "ab", "w"

static int call(int what, const void *arguments) {
    register int a0 __asm__ ("a0") = what;
    register const void *a1 __asm__ ("a1") = arguments;
    __asm__ volatile (
        ".option push\n .option norvc\n .balign 16\n"
        "slli zero, zero, 0x1f\n ebreak\n srai zero, zero, 7\n"
        ".option pop" : "+r" (a0) : "r" (a1) : "memory");
    return a0;
}

int host_open(const char *path, int mode) {
    static const uint32_t modes[] = {
        [HOST_READ] = MODE_READ, [HOST_WRITE] = MODE_WRITE, [HOST_APPEND] = MODE_APPEND, [HOST_UPDATE] = MODE_UPDATE };
    const uint32_t words[] = { (uint32_t)path, modes[mode], strlen(path) };
    return call(SYS_OPEN, words);
}

int host_stdin(void) {
    return host_open("/dev/stdin", HOST_READ);
}

int host_stdout(void) {
    const uint32_t words[] = { (uint32_t)":tt", MODE_CONSOLE, 3 };
    return call(SYS_OPEN, words);
}

void host_close(int handle) {
    const uint32_t words[] = { handle };
    call(SYS_CLOSE, words);
}

int host_read(int handle, void *buffer, int count) {
    const uint32_t words[] = { handle, (uint32_t)buffer, count };
    int left = call(SYS_READ, words);
    return left < 0 ? -1 : count - left;
}

int host_write(int handle, const void *buffer, int count) {
    const uint32_t words[] = { handle, (uint32_t)buffer, count };
    int left = call(SYS_WRITE, words);
    return left < 0 ? -1 : count - left;
}

int host_seek(int handle, int place) {
    const uint32_t words[] = { handle, place };
    return call(SYS_SEEK, words);
}

int host_command_line(char *buffer, int size) {
    uint32_t words[] = { (uint32_t)buffer, size };
    return call(SYS_GET_CMDLINE, words) == 0 ? (int)words[1] : -1;
}

void host_exit(int status) {
    const uint32_t words[] = { APPLICATION_EXIT, status };
    for (;;) {
        call(SYS_EXIT_EXTENDED, words);
    }
}

uint64_t host_time_ns(void) {
    uint32_t high, low, again;
    do {
        __asm__ volatile ("rdcycleh %0\n rdcycle %1\n rdcycleh %2" : "=r" (high), "=r" (low), "=r" (again));
    } while (high != again);
    return (uint64_t)high << 32 | low;
}
