"""Measures the firmware on the emulated board against its goals: `make bench`.

All eight motors play an uploaded move with positions reported, and every figure comes from the
edges on the pins, the emulated clock, or counters of the runtime; FIGURES says how for each. The
board is run twice: with the model of the flash cache, which gives build/bench.json, and without.
TRUST says how far the emulator's computing times have been checked against a real board.

figures     the figures, their goals, and the table
moves       the moves that are played
session     a board that plays them, and how its edges are judged
measure     how each figure is measured
loops       passes of the main loop
"""
