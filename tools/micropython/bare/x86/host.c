// The host's calls are those of this computer's C library.
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>
#include "../host.h"

void bare_main(void);

static char **arguments;

int host_open(const char *path, int mode) {
    static const int flags[] = {
        [HOST_READ] = O_RDONLY, [HOST_WRITE] = O_WRONLY | O_CREAT | O_TRUNC,
        [HOST_APPEND] = O_WRONLY | O_CREAT | O_APPEND, [HOST_UPDATE] = O_RDWR };
    return open(path, flags[mode], 0644);
}

int host_stdin(void) {
    return STDIN_FILENO;
}

int host_stdout(void) {
    return STDOUT_FILENO;
}

void host_close(int handle) {
    close(handle);
}

int host_read(int handle, void *buffer, int count) {
    return read(handle, buffer, count);
}

int host_write(int handle, const void *buffer, int count) {
    return write(handle, buffer, count);
}

int host_seek(int handle, int place) {
    return lseek(handle, place, SEEK_SET);
}

int host_command_line(char *buffer, int size) {
    int used = 0;
    for (char **word = arguments; *word; word++) {
        used += snprintf(buffer + used, size - used, "%s ", *word);
        if (used >= size) {
            return -1;
        }
    }
    return used;
}

void host_exit(int status) {
    _exit(status);
}

uint64_t host_time_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1000000000ull + now.tv_nsec;
}

int main(int argc, char **argv) {
    arguments = argv;
    if (mprotect(machine_code, CODE_BYTES, PROT_READ | PROT_WRITE | PROT_EXEC) != 0) {
        perror("no memory for machine code");
        return 1;
    }
    bare_main();
}
