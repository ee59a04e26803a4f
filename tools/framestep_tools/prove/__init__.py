"""`framestep lab prove`: a board measures itself, without wires.

pin_capture        edges stamped by the chip: unused or idle state machines, and DMA
borrowed_machines  parts of the chip that are borrowed for it, and given back
stamp_program      the program with which a state machine watches a pin
chips              registers, where chips differ
machine_choice     which motors are measured, and which state machines watch them
board              a board to measure, real or emulated: its protocol port and its REPL
check              whether anything keeps motors from moving, before any does
flash              times of the flash
figures            the figures, and the verdict on each against the emulated board's
measure            all of them, one after the other
collector          the common part of all measurements
pins               edges, pulses, runs
processor          the interrupt, answers, memory
measurement        one measurement from its start to its report
report             the report as a table, for programs and for an issue
"""
