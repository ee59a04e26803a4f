// The name that the REPL shows
#include "../framestep.h"
#define MICROPY_HW_BOARD_NAME FRAMESTEP_BOARD("BTT SKR Pico v1.0")
