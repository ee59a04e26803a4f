// The host's services for the program: files of the computer, the command line, the exit.
#include <stdint.h>

enum { HOST_READ, HOST_WRITE, HOST_APPEND, HOST_UPDATE };

int host_open(const char *path, int mode);   // a handle, or -1
int host_stdin(void);  // a handle
int host_stdout(void);
void host_close(int handle);
int host_read(int handle, void *buffer, int count);  // how many bytes, 0 at the end, or -1
int host_write(int handle, const void *buffer, int count);  // the same
int host_seek(int handle, int place);  // from the beginning; negative if that fails
int host_command_line(char *buffer, int size);  // its words, each followed by a blank; negative if they do not fit
void host_exit(int status) __attribute__((noreturn));
uint64_t host_time_ns(void);  // a monotonic clock

#define CODE_BYTES (1 << 20)
extern uint32_t machine_code[CODE_BYTES / sizeof(uint32_t)];  // of .mpy files
