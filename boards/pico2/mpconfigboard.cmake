# The RP2350's ARM cores; for MicroPython's build of the rp2 port (-DMICROPY_BOARD_DIR=boards/pico2)
set(PICO_BOARD "pico2")
include(${CMAKE_CURRENT_LIST_DIR}/../framestep.cmake)
