"""`framestep prove`: a board measures itself, without wires.

instrument  edges stamped by the chip: state machines that are free or stand, and DMA
borrowed    what of the chip is borrowed for it, and given back
watching    the program with which a state machine watches a pin
chips       registers, where chips differ
layout      which motors are measured, and which state machines watch them
board       a board to measure, a real one or the emulated one: its protocol port and its REPL
check       what would keep motors from moving, asked before any does
flash       how long the flash takes
figures     the figures, and the verdict on each beside the emulated board's
measure     all of them, one after the other
gathering   what every measurement has
pins        edges, pulses, runs
processor   the interrupt, answers, memory
work        one measurement from its begin to its report
report      the report as a table, for programs and for an issue
"""
