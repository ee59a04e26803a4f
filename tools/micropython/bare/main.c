// Runs one script: FIRMWARE HEAP_KB PATH[:PATH...] SCRIPT [ARGUMENT...], all without blanks.
//
// Its exit status is the script's: 0, the one of SystemExit, or 1 after an exception, whose traceback is printed.
#include <stdlib.h>
#include <string.h>
#include "py/builtin.h"
#include "py/compile.h"
#include "py/gc.h"
#include "py/mphal.h"
#include "py/objexcept.h"
#include "py/runtime.h"
#include "py/stackctrl.h"
#include "shared/runtime/gchelper.h"
#include "files.h"
#include "host.h"

#define LARGEST_HEAP (8 << 20)
#define STACK_BYTES (192 << 10)

enum { STATUS_UNCAUGHT = 3, STATUS_ABORTED = 5, STATUS_USAGE = 9 };

static uint32_t heap[LARGEST_HEAP / sizeof(uint32_t)];

// ---------------------------------------------------------------- time

#if CHIP_ESP32 // time is the simulated chip's

#include "../esp32/chip.h"

uint64_t mp_hal_time_ns(void) {
    return chip_now;
}

void mp_hal_delay_us(mp_uint_t us) {
    chip_advance((uint64_t)us * 1000);
}

#else

uint64_t mp_hal_time_ns(void) {
    return host_time_ns();
}

void mp_hal_delay_us(mp_uint_t us) {
    uint64_t end = host_time_ns() + (uint64_t)us * 1000;
    while (host_time_ns() < end) {
    }
}

#endif

mp_uint_t mp_hal_ticks_cpu(void) {
    return (mp_uint_t)host_time_ns();
}

mp_uint_t mp_hal_ticks_us(void) {
    return (mp_uint_t)(mp_hal_time_ns() / 1000);
}

mp_uint_t mp_hal_ticks_ms(void) {
    return (mp_uint_t)(mp_hal_time_ns() / 1000000);
}

void mp_hal_delay_ms(mp_uint_t ms) {
    while (ms--) {
        mp_hal_delay_us(1000);
        mp_handle_pending(true);
    }
}

// ---------------------------------------------------------------- memory

#if defined(__riscv)

char _stack_start[STACK_BYTES] __attribute__((aligned(16)));
__asm__ (".globl _stack_end\n .set _stack_end, _stack_start + 196608"); // STACK_BYTES
#define STACK_TOP (_stack_start + STACK_BYTES)

static void collect_stack(void) {
    gc_helper_collect_regs_and_stack();
}

#else // Linux provides one

static char *stack_top;
#define STACK_TOP stack_top

#if defined(__i386__)

static void collect_stack(void) {
    gc_helper_collect_regs_and_stack();
}

#else

void collect_windows(char *top);

static void collect_stack(void) {
    collect_windows(stack_top);
}

#endif

#endif

void gc_collect(void) {
    gc_collect_start();
    collect_stack();
    gc_collect_end();
    #if CHIP_ESP32
    chip_collected();
    #endif
}

// The machine code of .mpy files; as on an ESP32 it is freed by a soft reset only.
static size_t code_used;
uint32_t machine_code[CODE_BYTES / sizeof(uint32_t)] __attribute__((aligned(4096)));

void allocate_code(size_t bytes, void **place, size_t *taken) {
    *taken = (bytes + 3) & ~3;
    if (*taken > CODE_BYTES - code_used) {
        m_malloc_fail(bytes);
    }
    *place = (char *)machine_code + code_used;
    code_used += *taken;
}

size_t code_bytes(void) {
    return code_used;
}

void free_code(void) {
    code_used = 0;
}

// ---------------------------------------------------------------- start and end

void nlr_jump_fail(void *value) {
    mp_hal_stdout_tx_str("uncaught NLR\n");
    files_flush();
    host_exit(STATUS_UNCAUGHT);
}

#if !defined(__i386__) // there a C library has one
void abort(void) {
    host_exit(STATUS_ABORTED);
}
#endif

// Returns the next word up to a separator, or NULL; cuts the text up. (strtok keeps its place in the thread's own
// memory, and there are no threads.)
static char *next_word(char **at, char separator) {
    char *word = *at;
    while (*word == separator) {
        word++;
    }
    if (!*word) {
        return NULL;
    }
    char *end = word;
    while (*end && *end != separator) {
        end++;
    }
    *at = *end ? end + 1 : end;
    *end = 0;
    return word;
}

static int run(const char *path) {
    nlr_buf_t nlr;
    if (nlr_push(&nlr) == 0) {
        mp_lexer_t *lexer = mp_lexer_new_from_file(qstr_from_str(path));
        qstr name = lexer->source_name;
        mp_store_global(MP_QSTR___file__, MP_OBJ_NEW_QSTR(name));
        mp_parse_tree_t tree = mp_parse(lexer, MP_PARSE_FILE_INPUT);
        mp_call_function_0(mp_compile(&tree, name, false));
        nlr_pop();
        return 0;
    }
    mp_obj_t exception = MP_OBJ_FROM_PTR(nlr.ret_val);
    const mp_obj_type_t *type = ((mp_obj_base_t *)nlr.ret_val)->type;
    if (mp_obj_is_subclass_fast(MP_OBJ_FROM_PTR(type), MP_OBJ_FROM_PTR(&mp_type_SystemExit))) {
        mp_obj_t value = mp_obj_exception_get_value(exception);
        return value == mp_const_none ? 0 : mp_obj_is_small_int(value) ? MP_OBJ_SMALL_INT_VALUE(value) : 1;
    }
    #if CHIP_ESP32
    uart_on = false; // output goes to the computer again
    #endif
    mp_obj_print_exception(&mp_plat_print, exception);
    return 1;
}

static mp_obj_t text(const char *from, size_t length) {
    return mp_obj_new_str(from, length);
}

static void set_paths(char *paths, const char *script) {
    mp_sys_path = mp_obj_new_list(0, NULL);
    const char *slash = strrchr(script, '/');
    mp_obj_list_append(mp_sys_path, text(script, slash ? slash - script : 0));
    for (char *path = next_word(&paths, ':'); path; path = next_word(&paths, ':')) {
        mp_obj_list_append(mp_sys_path, text(path, strlen(path)));
    }
    mp_obj_list_append(mp_sys_path, MP_OBJ_NEW_QSTR(MP_QSTR__dot_frozen));
}

void bare_main(void) {
    static char line[8192];
    static char *words[200];
    size_t count = 0;
    #if !defined(__riscv)
    stack_top = __builtin_frame_address(0);
    #endif
    files_init();
    if (host_command_line(line, sizeof line) < 0) {
        host_exit(STATUS_USAGE);
    }
    char *at = line;
    while (count < MP_ARRAY_SIZE(words) && (words[count] = next_word(&at, ' '))) {
        count++;
    }
    if (count < 4) {
        mp_hal_stdout_tx_str("usage: FIRMWARE HEAP_KB PATHS SCRIPT [ARGUMENTS]\n");
        files_flush();
        host_exit(STATUS_USAGE);
    }
    size_t bytes = MIN(strtoul(words[1], NULL, 10) << 10, LARGEST_HEAP);
    mp_stack_set_top(STACK_TOP);
    mp_stack_set_limit(STACK_BYTES - 8192);
    #if CHIP_ESP32
    if (strcmp(words[2], "board") == 0) {
        board_boot(heap, bytes, words + 3);
    }
    #endif
    gc_init(heap, (char *)heap + bytes);
    mp_init();
    files_mount();
    set_paths(words[2], words[3]);
    mp_obj_list_init(MP_OBJ_TO_PTR(mp_sys_argv), 0);
    for (size_t i = 3; i < count; i++) {
        mp_obj_list_append(mp_sys_argv, text(words[i], strlen(words[i])));
    }
    int status = run(words[3]);
    files_flush();
    host_exit(status);
}
