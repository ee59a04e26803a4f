"""Steps on both edges, for drivers that are set up for them (TMC2209: dedge): a PIO program that
changes the step pin's level at each step. pulses.py has the program for all other drivers.

    command to first edge    gap + 9
    edge to edge             gap + 9, and 4 more if another command begins in between
    wait only                gap + 9

X holds the pin's level, also from one command to the next. ISR counts the steps.

Any change of the level is a step to the driver, so the pin keeps the level that it has when the
program starts. A soft reset leaves the level as well (soft_reset.py), because the driver still has
its settings then, and counts edges while it is off, too. After power-up the level is low until the
first step, and the driver does not step on falling edges before it is set up (io/tmc2209.py), which
begins later than this program. A reset of the chip alone lets go of the pin. If it was high, the
driver makes one step; the motor is off then, and its position is no longer known.
"""

import rp2
from machine import Pin

from framestep.base.native import const
from framestep.hal.rp2.pins import levels

_SET_X = const(0xE020)  # the instruction set(x, 0)


@rp2.asm_pio(
    sideset_init=rp2.PIO.OUT_LOW,
    out_init=rp2.PIO.OUT_LOW,
    out_shiftdir=rp2.PIO.SHIFT_RIGHT,
    fifo_join=rp2.PIO.JOIN_TX,
)
def step_edges():
    label("command")
    pull(block)
    out(pins, 1)  # direction
    out(isr, 9)[1]  # steps
    wrap_target()
    mov(y, osr)  # the gap: the width is 0
    label("gap")
    jmp(y_dec, "gap")
    mov(y, isr)
    jmp(y_dec, "step")
    jmp("command")  # no steps: the command was a wait
    label("step")
    jmp(x_dec, "fall")
    set(x, 1).side(1)
    jmp("made")
    label("fall")
    nop().side(0)[1]
    label("made")
    mov(isr, y)
    jmp(not_y, "command")
    wrap()


def edge_machine(number, hz, step, turn):
    """Return a motor's state machine. step: number of its pin; turn: the Pin of its direction."""
    level = levels() >> step & 1
    # what sideset_init has become
    step_edges[-1] = rp2.PIO.OUT_HIGH if level else rp2.PIO.OUT_LOW  # type: ignore[index]
    machine = rp2.StateMachine(
        number,
        step_edges,
        freq=hz,
        sideset_base=Pin(step, Pin.OUT, value=level),
        out_base=turn,
    )
    machine.exec(_SET_X | level)
    return machine
