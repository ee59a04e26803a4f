// Numbers, heap and machine code as on an ESP32; files and time from the host's calls.
#include <stddef.h>
#include <stdint.h>
#include <alloca.h>

#define MICROPY_CONFIG_ROM_LEVEL            (MICROPY_CONFIG_ROM_LEVEL_EXTRA_FEATURES)

#if defined(__riscv)
#define MICROPY_EMIT_RV32                   (1)
#define MICROPY_HW_MCU_NAME                 "rv32imc"
#elif defined(__i386__)
#define MICROPY_EMIT_X86                    (1)
#define MICROPY_HW_MCU_NAME                 "x86"
#else
#define MICROPY_EMIT_XTENSAWIN              (1)
#define MICROPY_NLR_SETJMP                  (1)
#define MICROPY_HW_MCU_NAME                 "xtensawin"
#endif

#define MICROPY_HW_BOARD_NAME               "QEMU"
#define MICROPY_PY_SYS_PLATFORM             "qemu"
#define MICROPY_LONGINT_IMPL                (MICROPY_LONGINT_IMPL_MPZ)
#define MICROPY_FLOAT_IMPL                  (MICROPY_FLOAT_IMPL_FLOAT)
#define MICROPY_PERSISTENT_CODE_LOAD        (1)
#define MICROPY_ENABLE_GC                   (1)
#define MICROPY_ENABLE_SCHEDULER            (1)
#define MICROPY_ENABLE_EMERGENCY_EXCEPTION_BUF (1)
#define MICROPY_EMERGENCY_EXCEPTION_BUF_SIZE (256)
#define MICROPY_ENABLE_EXTERNAL_IMPORT      (1)
#define MICROPY_HELPER_REPL                 (0)
#define MICROPY_KBD_EXCEPTION               (0)
#define MICROPY_PY_BUILTINS_INPUT           (0)
#define MICROPY_PY_IO                       (1)
#define MICROPY_PY_SYS_ARGV                 (1)
#define MICROPY_PY_SYS_STDFILES             (1)
#define MICROPY_PY_SYS_STDIO_BUFFER         (0)
#define MICROPY_PY_TIME                     (1)
#define MICROPY_PY_MACHINE                  (0)
#define MICROPY_PY_FRAMEBUF                 (0)

#if CHIP_ESP32
#include "../esp32/mpconfigchip.h"
#else
#define MICROPY_READER_POSIX                (1)
#define MICROPY_VFS                         (0)
#endif

// Machine code is outside of the heap, as on an ESP32 and in the unix port.
void allocate_code(size_t bytes, void **place, size_t *taken);
#define MP_PLAT_ALLOC_EXEC(bytes, place, taken) allocate_code(bytes, place, taken)
#define MP_PLAT_FREE_EXEC(place, bytes)

typedef int32_t mp_int_t;
typedef uint32_t mp_uint_t;
typedef long mp_off_t;
#define MP_SSIZE_MAX (0x7fffffff)
#define MP_NEED_LOG2 (1)
#define MP_STATE_PORT MP_STATE_VM
#define MICROPY_PORT_ROOT_POINTERS
