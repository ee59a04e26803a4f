# Eight PIO state machines that emit pulse trains on pins 0, 2, ..., with a direction on the pin
# after each. A word: direction (1 bit), pulses - 1 (11), half period (20). A period is 2 * half + 7
# cycles of 200 ns.

import rp2
from machine import Pin


@rp2.asm_pio(
    set_init=rp2.PIO.OUT_LOW,
    out_init=rp2.PIO.OUT_LOW,
    fifo_join=rp2.PIO.JOIN_TX,
    out_shiftdir=rp2.PIO.SHIFT_RIGHT,
)
def pulses():
    wrap_target()
    pull(block)
    out(pins, 1)
    out(x, 11)
    mov(isr, osr)
    label("pulse")
    mov(y, isr)
    set(pins, 1)
    label("high")
    jmp(y_dec, "high")
    set(pins, 0)
    mov(y, isr)
    label("low")
    jmp(y_dec, "low")
    jmp(x_dec, "pulse")
    wrap()


sms = [
    rp2.StateMachine(i, pulses, freq=5_000_000, set_base=Pin(2 * i), out_base=Pin(2 * i + 1))
    for i in range(8)
]
for sm in sms:
    sm.active(1)
