// Settings of the images of all boards
#define FRAMESTEP_AS_TEXT_(x) #x
#define FRAMESTEP_AS_TEXT(x) FRAMESTEP_AS_TEXT_(x)

// All boards with one chip have the same image. What differs is in a block before the file system, which tools write into
// the built image: firmware/image_board.py
#define MICROPY_HW_BOARD_NAME "framestep " FRAMESTEP_AS_TEXT(FRAMESTEP_VERSION)

// The highest clock that the board's flash bears; as pico-sdk has it, if the block is not there
// or does not say a clock from 20 to 133 MHz
#define FRAMESTEP_FLASH_HZ (*(const volatile unsigned int *)(XIP_BASE + MICROPY_HW_FLASH_STORAGE_BASE - 2048 + 12))
#define MICROPY_HW_FLASH_MAX_FREQ ((int)(FRAMESTEP_FLASH_HZ - 20000000u <= 113000000u ? FRAMESTEP_FLASH_HZ : SYS_CLK_HZ / PICO_FLASH_SPI_CLKDIV))

// Windows and macOS show this name for the ports; manufacturer, vendor and product IDs are MicroPython's
#define MICROPY_HW_USB_PRODUCT_FS_STRING "framestep"

// Size of the file system at the end of the flash, the same as in a stock MicroPython: files survive a new image.
// Tools and the emulator read it from the built image, which must end before it (framestep_tools.building.images checks).
#ifndef MICROPY_HW_FLASH_STORAGE_BYTES
#define MICROPY_HW_FLASH_STORAGE_BYTES (1408 * 1024)
#endif

// Size in bytes of the cache of name lookups; one byte per name
#define MICROPY_OPT_MAP_LOOKUP_CACHE_SIZE (512)
