"""`make bench`: measure the firmware on the emulated board and compare it with its goals.

All eight motors play an uploaded move and report positions. Every figure comes from the edges on
the pins, the emulated clock, or counters of the runtime; FIGURES describes each. The board runs at
125 and 200 MHz with the model of the flash cache, which gives build/bench.json, and at 125 MHz
without it. TRUST says how far the emulator's computing times have been compared with a real board.

figures    the figures, their goals, and the table
moves      the moves to play
session    a board that plays them, and the judgement of its edges
measure    the measurement of each figure
main_loop  passes of the main loop

pico2, shift_registers and esp32 have the figures of other boards.
"""
