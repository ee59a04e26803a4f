// The size of the file system, and the name that the REPL shows
#define MICROPY_HW_FLASH_STORAGE_BYTES (PICO_FLASH_SIZE_BYTES - 1024 * 1024)
#include "../framestep.h"
#define MICROPY_HW_BOARD_NAME FRAMESTEP_BOARD("Raspberry Pi Pico 2")
