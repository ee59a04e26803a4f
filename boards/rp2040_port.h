// MicroPython's settings for the rp2 port, without parts that a motion controller does not need: an RP2040's image must end
// before the file system at 640 kB.
#include "rp2350_port.h"

#undef MICROPY_PY_CRYPTOLIB
#define MICROPY_PY_CRYPTOLIB (0) // AES
#undef MICROPY_PY_HASHLIB_SHA1
#define MICROPY_PY_HASHLIB_SHA1 (0) // SHA-256 stays: the tools compare files by it
#undef MICROPY_VFS_FAT
#define MICROPY_VFS_FAT (0) // SD cards
#undef MICROPY_PY_MACHINE_I2C_TARGET
#define MICROPY_PY_MACHINE_I2C_TARGET (0)
#undef MICROPY_PY_MACHINE_I2S
#define MICROPY_PY_MACHINE_I2S (0) // sound
#undef MICROPY_PY_HEAPQ
#define MICROPY_PY_HEAPQ (0)
#define MICROPY_PY_FRAMEBUF (0) // displays
#define MICROPY_PY_MATH_SPECIAL_FUNCTIONS (0) // math.erf, gamma, sinh and so on
#undef MICROPY_EMIT_INLINE_THUMB
#define MICROPY_EMIT_INLINE_THUMB (0) // @micropython.asm_thumb
#define MICROPY_NO_NATIVE_COMPILER // @micropython.native gives bytecode, viper is refused; see patches/image
#define MICROPY_PY_BUILTINS_COMPLEX (0) // complex numbers and cmath
#define MICROPY_PY_CMATH (0)
// The REPL's buffers are half as large as the port's, for more uploaded frames; USB holds back what does not fit
#define MICROPY_HW_STDIN_BUFFER_LEN (256)
#define CFG_TUD_CDC_RX_BUFSIZE (128)
#define CFG_TUD_CDC_TX_BUFSIZE (128)
// Endpoints 0 to 7, not to 15, for the same reason; two serial ports take 0 to 4
#define CFG_TUD_ENDPPOINT_MAX (8)
