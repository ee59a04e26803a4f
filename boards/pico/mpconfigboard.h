// The name that the REPL shows
#include "../framestep.h"
#define MICROPY_HW_BOARD_NAME FRAMESTEP_BOARD("Raspberry Pi Pico")

// Its flash, a W25Q16JV, bears 133 MHz
#define MICROPY_HW_FLASH_MAX_FREQ (133000000)
