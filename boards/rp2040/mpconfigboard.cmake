# For MicroPython's build of the rp2 port: all boards with an RP2040 and a flash of 2 MB
set(PICO_BOARD "pico")
set(PICO_PLATFORM "rp2040")
include(${CMAKE_CURRENT_LIST_DIR}/../framestep.cmake)
