// The name that the REPL shows, and what framestep's image leaves of the flash for files
#include "../framestep.h"
#define MICROPY_HW_BOARD_NAME FRAMESTEP_BOARD("FYSETC ERB")
#define MICROPY_HW_FLASH_STORAGE_BYTES (1408 * 1024)

// Bytes of the cache that tells where a name was found last, one for a name
#define MICROPY_OPT_MAP_LOOKUP_CACHE_SIZE (512)
