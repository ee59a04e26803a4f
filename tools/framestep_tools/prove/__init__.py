"""`framestep prove`: a board measures itself, without wires.

instrument  edges stamped by the chip: state machines that stand, and DMA
board       a board to measure, a real one or the emulated one: its protocol port and its REPL
"""
