// Settings of the images of all boards
#define FRAMESTEP_AS_TEXT_(x) #x
#define FRAMESTEP_AS_TEXT(x) FRAMESTEP_AS_TEXT_(x)
#define FRAMESTEP_BOARD(name) name " with framestep " FRAMESTEP_AS_TEXT(FRAMESTEP_VERSION)

// Windows and macOS show this name for the ports; manufacturer, vendor and product IDs are MicroPython's
#define MICROPY_HW_USB_PRODUCT_FS_STRING "framestep"

// Size of the file system at the end of the flash, the same as in a stock MicroPython: files survive a new image.
// Tools and the emulator read it from the built image, which must end before it (framestep_tools.building.images checks).
#ifndef MICROPY_HW_FLASH_STORAGE_BYTES
#define MICROPY_HW_FLASH_STORAGE_BYTES (1408 * 1024)
#endif

// Size in bytes of the cache of name lookups; one byte per name
#define MICROPY_OPT_MAP_LOOKUP_CACHE_SIZE (512)
