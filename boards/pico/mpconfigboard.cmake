# For MicroPython's build of the rp2 port (-DMICROPY_BOARD_DIR=boards/pico)
set(PICO_BOARD "pico")
set(PICO_PLATFORM "rp2040")
include(${CMAKE_CURRENT_LIST_DIR}/../framestep.cmake)
