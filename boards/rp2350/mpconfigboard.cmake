# For MicroPython's build of the rp2 port: all boards with an RP2350, on its ARM cores
set(PICO_BOARD "pico2")
include(${CMAKE_CURRENT_LIST_DIR}/../framestep.cmake)
