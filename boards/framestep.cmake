# Settings of the images of all boards; for MicroPython's build of the rp2 port
set(MICROPY_FROZEN_MANIFEST ${CMAKE_CURRENT_LIST_DIR}/manifest.py)
# The boards' names show framestep's version
file(STRINGS ${CMAKE_CURRENT_LIST_DIR}/../firmware/framestep/reports.py FRAMESTEP_VERSION REGEX "^VERSION = ")
string(REGEX REPLACE "^VERSION = .([0-9]+), ([0-9]+), ([0-9]+).*" "\\1.\\2.\\3" FRAMESTEP_VERSION "${FRAMESTEP_VERSION}")
if(NOT FRAMESTEP_VERSION)
    message(FATAL_ERROR "firmware/framestep/reports.py has no VERSION")
endif()
list(APPEND MICROPY_DEF_BOARD FRAMESTEP_VERSION=${FRAMESTEP_VERSION})
# A panic of the SDK has no port to print on: it stops at once, without the SDK's printf
list(APPEND MICROPY_DEF_BOARD PICO_PANIC_FUNCTION=)
# Parts of MicroPython that are left out (headers are searched for in MICROPY_BOARD_DIR)
list(APPEND MICROPY_SOURCE_BOARD ${CMAKE_CURRENT_LIST_DIR}/help.c)
if(PICO_PLATFORM STREQUAL "rp2040")
    list(APPEND MICROPY_DEF_BOARD MP_CONFIGFILE="../rp2040_port.h")
    # eight machine.Timers at once instead of sixteen leave more memory for uploaded moves
    list(APPEND MICROPY_DEF_BOARD PICO_TIME_DEFAULT_ALARM_POOL_MAX_TIMERS=8)
else()
    list(APPEND MICROPY_DEF_BOARD MP_CONFIGFILE="../rp2350_port.h")
endif()
