"""Pulse engine of the RP2040 and RP2350: one PIO state machine per motor.

The program executes the commands of engine.py at the full system clock. The constants in engine.py
come from its cycle counts:

    command to first rising edge   gap + 8
    pulse high                     H = 50 + 25·width + 425·rounds
    rising edge to rising edge     gap + 6 + H
    wait only                      gap + 9

The rounds make pulses up to 50 µs long. A state machine has no register left to count them. So the
program shifts a bit out of its OSR in each round, until the OSR counts as empty, which is after as
many bits as the machine's threshold for pulls says. The gap has taken 18 of these bits.

Motors whose drivers step on both edges have the program of edges.py, which fits next to this one.
"""

import rp2
from machine import Pin, mem32

from framestep.base.native import const, micropython, ptr32
from framestep.hal.rp2.chip import KEPT_PINS
from framestep.hal.rp2.pin_guard import Claim
from framestep.pulse.engine import WIDTHS

# Start of the transmit FIFOs of a PIO block, four bytes per state machine (RP2040 datasheet 3.7)
_PIO_BASE = (0x50200000, 0x50300000, 0x50400000)
_TXF = 0x10
_FDEBUG = const(2)  # word of a PIO block
_GAP_BITS = const(18)
_TX_OVER = const(0x000F0000)  # a command was written to a full FIFO, one bit per state machine


@rp2.asm_pio(
    set_init=rp2.PIO.OUT_LOW,
    out_init=rp2.PIO.OUT_LOW,
    out_shiftdir=rp2.PIO.SHIFT_RIGHT,
    fifo_join=rp2.PIO.JOIN_TX,
)
def step_pulses():
    label("command")
    pull(block)
    out(pins, 1)  # direction
    out(x, 9)  # pulses
    mov(isr, osr)  # gap and width, kept for each pulse
    wrap_target()
    mov(osr, isr)
    out(y, 18)
    label("gap")
    jmp(y_dec, "gap")
    jmp(x_dec, "pulse")
    jmp("command")  # no pulses: the command was a wait
    label("pulse")
    set(pins, 1)
    mov(y, osr)[22]  # the width; no bits are left beyond it
    label("high")
    jmp(y_dec, "high")[24]
    jmp(not_osre, "round")
    set(pins, 0)
    jmp(not_x, "command")
    wrap()
    label("round")
    out(null, 1)
    set(y, 15)[21]
    jmp("high")


class PulseEngine:
    """State machines from 0 on for the motors in order; four motors per PIO block."""

    def __init__(self, step_pins, direction_pins, hz, shapes):
        """hz: clock of the programs, cycles per second. shapes: of each motor, from
        pulse_shape()."""
        self.machines = []
        kept = 0
        for i, step in enumerate(step_pins):
            with Claim(step, direction_pins[i]):
                turn = Pin(direction_pins[i], Pin.OUT, value=0)
                if shapes[i][-1]:
                    from framestep.hal.rp2.edges import edge_machine

                    machine = edge_machine(i, hz, step, turn)
                    kept |= 1 << step
                else:
                    machine = rp2.StateMachine(
                        i,
                        step_pulses,
                        freq=hz,
                        pull_thresh=_GAP_BITS + shapes[i][0] // WIDTHS,
                        set_base=Pin(step, Pin.OUT, value=0),
                        out_base=turn,
                    )
            machine.active(1)
            self.machines.append(machine)
        mem32[KEPT_PINS] = kept

    def fifo(self, motor):
        """Return the address to which the motor's commands are written."""
        return _PIO_BASE[motor >> 2] + _TXF + 4 * (motor & 3)


@micropython.viper
def lost_commands(motors: int) -> int:
    """Return the motors that have lost a command to a full FIFO since the last call, one bit
    each."""
    lost = 0
    bit = 0
    block = 0x502
    block <<= 20  # 0x50200000; as a constant it would be an object
    while motors > 0:
        fdebug = ptr32(block)
        over = fdebug[_FDEBUG] & _TX_OVER
        if over:
            fdebug[_FDEBUG] = over
            lost |= (over >> 16) << bit
        block += 0x100000
        bit += 4
        motors -= 4
    return lost
