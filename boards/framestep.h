// What the images of all boards have in common
#define FRAMESTEP_AS_TEXT_(x) #x
#define FRAMESTEP_AS_TEXT(x) FRAMESTEP_AS_TEXT_(x)
#define FRAMESTEP_BOARD(name) name " with framestep " FRAMESTEP_AS_TEXT(FRAMESTEP_VERSION)

// What Windows and macOS show of the ports; manufacturer, vendor and product IDs are MicroPython's
#define MICROPY_HW_USB_PRODUCT_FS_STRING "framestep"
