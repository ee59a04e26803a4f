// Files of the computer as MicroPython's streams: open(), sys.stdin, sys.stdout, and files for import.
#include <fcntl.h>
#include <string.h>
#include <unistd.h>
#include "py/builtin.h"
#include "py/mperrno.h"
#include "py/mphal.h"
#include "py/runtime.h"
#include "py/stream.h"
#include "files.h"
#include "host.h"

typedef struct {
    mp_obj_base_t base;
    int handle;
} file_t;

static mp_uint_t file_read(mp_obj_t self, void *buffer, mp_uint_t size, int *error) {
    int count = host_read(((file_t *)MP_OBJ_TO_PTR(self))->handle, buffer, size);
    if (count < 0) {
        *error = MP_EIO;
        return MP_STREAM_ERROR;
    }
    return count;
}

static mp_uint_t file_write(mp_obj_t self, const void *buffer, mp_uint_t size, int *error) {
    int count = host_write(((file_t *)MP_OBJ_TO_PTR(self))->handle, buffer, size);
    if (count < 0) {
        *error = MP_EIO;
        return MP_STREAM_ERROR;
    }
    return count;
}

static mp_uint_t file_ioctl(mp_obj_t self, mp_uint_t request, uintptr_t arg, int *error) {
    file_t *file = MP_OBJ_TO_PTR(self);
    if (request == MP_STREAM_CLOSE) {
        if (file->handle >= 0) {
            host_close(file->handle);
        }
        file->handle = -1;
        return 0;
    }
    if (request == MP_STREAM_FLUSH) {
        return 0;
    }
    if (request == MP_STREAM_SEEK) {
        struct mp_stream_seek_t *seek = (void *)arg;
        if (seek->whence == MP_SEEK_SET && host_seek(file->handle, seek->offset) >= 0) {
            return 0;
        }
    }
    *error = MP_EINVAL;
    return MP_STREAM_ERROR;
}

static const mp_rom_map_elem_t file_names[] = {
    { MP_ROM_QSTR(MP_QSTR_read), MP_ROM_PTR(&mp_stream_read_obj) },
    { MP_ROM_QSTR(MP_QSTR_readinto), MP_ROM_PTR(&mp_stream_readinto_obj) },
    { MP_ROM_QSTR(MP_QSTR_readline), MP_ROM_PTR(&mp_stream_unbuffered_readline_obj) },
    { MP_ROM_QSTR(MP_QSTR_readlines), MP_ROM_PTR(&mp_stream_unbuffered_readlines_obj) },
    { MP_ROM_QSTR(MP_QSTR_write), MP_ROM_PTR(&mp_stream_write_obj) },
    { MP_ROM_QSTR(MP_QSTR_flush), MP_ROM_PTR(&mp_stream_flush_obj) },
    { MP_ROM_QSTR(MP_QSTR_seek), MP_ROM_PTR(&mp_stream_seek_obj) },
    { MP_ROM_QSTR(MP_QSTR_close), MP_ROM_PTR(&mp_stream_close_obj) },
    { MP_ROM_QSTR(MP_QSTR___del__), MP_ROM_PTR(&mp_stream_close_obj) },
    { MP_ROM_QSTR(MP_QSTR___enter__), MP_ROM_PTR(&mp_identity_obj) },
    { MP_ROM_QSTR(MP_QSTR___exit__), MP_ROM_PTR(&mp_stream___exit___obj) },
};
static MP_DEFINE_CONST_DICT(file_dict, file_names);
static const mp_stream_p_t binary_protocol = { .read = file_read, .write = file_write, .ioctl = file_ioctl };
static const mp_stream_p_t text_protocol = { .read = file_read, .write = file_write, .ioctl = file_ioctl, .is_text = true };
static MP_DEFINE_CONST_OBJ_TYPE(binary_type, MP_QSTR_FileIO, MP_TYPE_FLAG_ITER_IS_STREAM,
    protocol, &binary_protocol, locals_dict, &file_dict);
static MP_DEFINE_CONST_OBJ_TYPE(text_type, MP_QSTR_TextIOWrapper, MP_TYPE_FLAG_ITER_IS_STREAM,
    protocol, &text_protocol, locals_dict, &file_dict);

static mp_obj_t open_file(const char *path, const char *mode) {
    int handle = host_open(path, strchr(mode, 'w') ? HOST_WRITE : strchr(mode, 'a') ? HOST_APPEND : HOST_READ);
    if (handle < 0) {
        mp_raise_OSError(MP_ENOENT);
    }
    file_t *file = mp_obj_malloc_with_finaliser(file_t, strchr(mode, 'b') ? &binary_type : &text_type);
    file->handle = handle;
    return MP_OBJ_FROM_PTR(file);
}

// ---------------------------------------------------------------- import

static bool is_there(const char *path) {
    int handle = host_open(path, HOST_READ);
    if (handle < 0) {
        return false;
    }
    host_close(handle);
    return true;
}

static bool ends_with(const char *text, const char *end) {
    size_t length = strlen(text), last = strlen(end);
    return length >= last && strcmp(text + length - last, end) == 0;
}

// The host calls do not recognize folders; a folder that can be imported is recognized by its files.
static mp_import_stat_t import_stat(const char *path) {
    static const char *const inside[] = { "/__init__.mpy", "/__init__.py" };
    char name[300];
    if (ends_with(path, ".py") || ends_with(path, ".mpy")) {
        return is_there(path) ? MP_IMPORT_STAT_FILE : MP_IMPORT_STAT_NO_EXIST;
    }
    size_t length = strlen(path);
    if (length > sizeof name - 20) {
        return MP_IMPORT_STAT_NO_EXIST;
    }
    for (size_t i = 0; i < MP_ARRAY_SIZE(inside); i++) {
        memcpy(name, path, length);
        strcpy(name + length, inside[i]);
        if (is_there(name)) {
            return MP_IMPORT_STAT_DIR;
        }
    }
    return MP_IMPORT_STAT_NO_EXIST;
}

#if MICROPY_VFS

#include "extmod/vfs.h"

// The computer's files as a file system: of a script it is the root.
static mp_import_stat_t computer_import_stat(void *self, const char *path) {
    return import_stat(path);
}

static mp_obj_t computer_open(mp_obj_t self, mp_obj_t path, mp_obj_t mode) {
    return open_file(mp_obj_str_get_str(path), mp_obj_str_get_str(mode));
}
static MP_DEFINE_CONST_FUN_OBJ_3(computer_open_obj, computer_open);

static mp_obj_t computer_mount(mp_obj_t self, mp_obj_t readonly, mp_obj_t format) {
    return mp_const_none;
}
static MP_DEFINE_CONST_FUN_OBJ_3(computer_mount_obj, computer_mount);

static const mp_rom_map_elem_t computer_names[] = {
    { MP_ROM_QSTR(MP_QSTR_open), MP_ROM_PTR(&computer_open_obj) },
    { MP_ROM_QSTR(MP_QSTR_mount), MP_ROM_PTR(&computer_mount_obj) },
};
static MP_DEFINE_CONST_DICT(computer_dict, computer_names);
static const mp_vfs_proto_t computer_protocol = { .import_stat = computer_import_stat };
static MP_DEFINE_CONST_OBJ_TYPE(computer_type, MP_QSTR_VfsComputer, MP_TYPE_FLAG_NONE,
    protocol, &computer_protocol, locals_dict, &computer_dict);
static const mp_obj_base_t computer = { &computer_type };

void files_mount(void) {
    mp_vfs_mount_and_chdir_protected(MP_OBJ_FROM_PTR(&computer), MP_OBJ_NEW_QSTR(MP_QSTR__slash_));
}

#else

static mp_obj_t builtin_open(size_t count, const mp_obj_t *args, mp_map_t *kw_args) {
    return open_file(mp_obj_str_get_str(args[0]), count > 1 ? mp_obj_str_get_str(args[1]) : "r");
}
MP_DEFINE_CONST_FUN_OBJ_KW(mp_builtin_open_obj, 1, builtin_open);

mp_import_stat_t mp_import_stat(const char *path) {
    return import_stat(path);
}

void files_mount(void) {
}

// MicroPython's reader of source and .mpy files calls this.
int open(const char *path, int flags, ...) {
    return host_open(path, HOST_READ);
}

int close(int handle) {
    host_close(handle);
    return 0;
}

ssize_t read(int handle, void *buffer, size_t count) {
    return host_read(handle, buffer, count);
}

#endif

// ---------------------------------------------------------------- standard input and output

#if CHIP_ESP32

#include "../esp32/chip.h"

// The chip's own, when its UART is on (shared/runtime/sys_stdio_mphal.c).
static mp_uint_t stdin_read(mp_obj_t self, void *buffer, mp_uint_t size, int *error) {
    if (!uart_on) {
        return file_read(self, buffer, size, error);
    }
    for (mp_uint_t i = 0; i < size; i++) {
        ((uint8_t *)buffer)[i] = uart_read();
    }
    return size;
}

static mp_uint_t stdin_ioctl(mp_obj_t self, mp_uint_t request, uintptr_t arg, int *error) {
    return uart_on && request == MP_STREAM_POLL ? uart_poll(arg) : file_ioctl(self, request, arg, error);
}

#else

#define uart_on false
#define uart_write(text, length)
#define uart_read() 4 // end of input: there is no REPL
#define uart_poll(flags) 0
#define stdin_read file_read
#define stdin_ioctl file_ioctl

#endif

static const mp_stream_p_t stdin_binary_protocol = { .read = stdin_read, .write = file_write, .ioctl = stdin_ioctl };
static const mp_stream_p_t stdin_text_protocol =
    { .read = stdin_read, .write = file_write, .ioctl = stdin_ioctl, .is_text = true };
static MP_DEFINE_CONST_OBJ_TYPE(stdin_binary_type, MP_QSTR_FileIO, MP_TYPE_FLAG_ITER_IS_STREAM,
    protocol, &stdin_binary_protocol, locals_dict, &file_dict);
static file_t stdin_bytes = { { &stdin_binary_type }, -1 };

static void stdin_attr(mp_obj_t self, qstr name, mp_obj_t *found) {
    if (found[0] != MP_OBJ_NULL) {
        return;
    }
    if (name == MP_QSTR_buffer) {
        found[0] = MP_OBJ_FROM_PTR(&stdin_bytes);
    } else {
        found[1] = MP_OBJ_SENTINEL; // look up the type's own names
    }
}
static MP_DEFINE_CONST_OBJ_TYPE(stdin_type, MP_QSTR_TextIOWrapper, MP_TYPE_FLAG_ITER_IS_STREAM,
    attr, stdin_attr, protocol, &stdin_text_protocol, locals_dict, &file_dict);
file_t mp_sys_stdin_obj = { { &stdin_type }, -1 };

static int stdout_handle;
static char printed[4096];
static size_t printed_count;

void files_flush(void) {
    if (printed_count) {
        host_write(stdout_handle, printed, printed_count);
    }
    printed_count = 0;
}

mp_uint_t mp_hal_stdout_tx_strn(const char *text, size_t length) {
    if (uart_on) {
        uart_write(text, length);
        return length;
    }
    for (size_t i = 0; i < length; i++) {
        printed[printed_count++] = text[i];
        if (printed_count == sizeof printed) {
            files_flush();
        }
    }
    return length;
}

// On a UART a new line also needs a carriage return.
void mp_hal_stdout_tx_strn_cooked(const char *text, size_t length) {
    if (!uart_on) {
        mp_hal_stdout_tx_strn(text, length);
        return;
    }
    for (; length; text++, length--) {
        if (*text == '\n') {
            uart_write("\r", 1);
        }
        uart_write(text, 1);
    }
}

void mp_hal_stdout_tx_str(const char *text) {
    mp_hal_stdout_tx_strn(text, strlen(text));
}

int mp_hal_stdin_rx_chr(void) {
    return uart_read();
}

uintptr_t mp_hal_stdio_poll(uintptr_t flags) {
    return uart_poll(flags);
}

extern const mp_obj_base_t mp_sys_stdout_obj;

static mp_uint_t stdout_write(mp_obj_t self, const void *buffer, mp_uint_t size, int *error) {
    if (MP_OBJ_TO_PTR(self) == &mp_sys_stdout_obj) {
        mp_hal_stdout_tx_strn_cooked(buffer, size);
        return size;
    }
    return mp_hal_stdout_tx_strn(buffer, size);
}

static mp_uint_t stdout_ioctl(mp_obj_t self, mp_uint_t request, uintptr_t arg, int *error) {
    files_flush();
    return request == MP_STREAM_POLL ? uart_poll(arg) : 0;
}
static const mp_stream_p_t stdout_protocol = { .write = stdout_write, .ioctl = stdout_ioctl };
static mp_obj_base_t stdout_bytes;

static void stdout_attr(mp_obj_t self, qstr name, mp_obj_t *found) {
    if (found[0] != MP_OBJ_NULL) {
        return;
    }
    if (name == MP_QSTR_buffer) {
        found[0] = MP_OBJ_FROM_PTR(&stdout_bytes);
    } else {
        found[1] = MP_OBJ_SENTINEL;
    }
}
static MP_DEFINE_CONST_OBJ_TYPE(stdout_type, MP_QSTR_TextIOWrapper, MP_TYPE_FLAG_NONE,
    attr, stdout_attr, protocol, &stdout_protocol, locals_dict, &file_dict);
static mp_obj_base_t stdout_bytes = { &stdout_type };
const mp_obj_base_t mp_sys_stdout_obj = { &stdout_type };
const mp_obj_base_t mp_sys_stderr_obj = { &stdout_type };

void files_init(void) {
    stdout_handle = host_stdout();
    mp_sys_stdin_obj.handle = stdin_bytes.handle = host_stdin();
}
