"""`framestep prove`: a board measures itself, without wires.

instrument  edges stamped by the chip: state machines that stand, and DMA
board       a board to measure, a real one or the emulated one: its protocol port and its REPL
figures     the figures, and the verdict on each beside the emulated board's
measure     how each is measured
work        one measurement from its begin to its report
report      the report as a table, for programs and for an issue
"""
