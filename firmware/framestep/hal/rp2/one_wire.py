"""UARTs of drivers on a single pin each: two PIO state machines per pin, as the chip's UARTs cannot
use any pin.

One sends, and releases the line after each byte. The other receives everything: what is sent, and
the answer. The chip's pull-up holds the line high. The programs take eight cycles for a bit.
Telegrams are whole words of four bytes (io/tmc2209.py), so the receiver's FIFO takes eight words.
It begins a new word with each telegram sent.
"""

import rp2
from machine import Pin

from framestep.base.native import const, micropython, ptr8, ptr32

_CYCLES = const(8 * 115200)
# words from the start of a PIO block (RP2040 datasheet 3.7, RP2350 datasheet 11.7)
_FSTAT = const(1)
_TXF = const(4)
_RXF = const(8)
_TX_FULL = const(16)  # bit of FSTAT for state machine 0
_RX_EMPTY = const(8)


@rp2.asm_pio(
    sideset_init=rp2.PIO.IN_HIGH,
    out_init=rp2.PIO.IN_HIGH,
    set_init=rp2.PIO.IN_HIGH,
    out_shiftdir=rp2.PIO.SHIFT_RIGHT,
    fifo_join=rp2.PIO.JOIN_TX,
)
def talk():
    pull(block)
    set(pindirs, 1).side(1)
    set(x, 7).side(0)[7]  # start bit
    label("bit")
    out(pins, 1)[6]
    jmp(x_dec, "bit")
    nop().side(1)[7]  # stop bit
    set(pindirs, 0)


@rp2.asm_pio(
    in_shiftdir=rp2.PIO.SHIFT_RIGHT, autopush=True, push_thresh=32, fifo_join=rp2.PIO.JOIN_RX
)
def hear():
    wait(0, pin, 0)
    set(x, 7)[10]  # to the middle of the first bit
    label("bit")
    in_(pins, 1)
    jmp(x_dec, "bit")[6]  # the last time to the middle of the stop bit


@micropython.viper
def _send(machine: int, data: ptr8, count: int):
    block = 0x502
    block <<= 20  # 0x50200000; as a constant it would be an object
    registers = ptr32(block + ((machine >> 2) << 20))
    number = machine & 3
    full = 1 << (_TX_FULL + number)
    i = 0
    while i < count:
        if registers[_FSTAT] & full == 0:
            registers[_TXF + number] = data[i + 0]
        i += 1


@micropython.viper
def _receive(machine: int, data: ptr8, at: int, limit: int) -> int:
    block = 0x502
    block <<= 20
    registers = ptr32(block + ((machine >> 2) << 20))
    number = machine & 3
    empty = 1 << (_RX_EMPTY + number)
    count = 0
    while count + 4 <= limit:
        if registers[_FSTAT] & empty:
            break
        word = registers[_RXF + number]
        i = at + count
        data[i + 0] = word
        data[i + 1] = word >> 8
        data[i + 2] = word >> 16
        data[i + 3] = word >> 24
        count += 4
    return count


class OneWire:
    """See hal/contract.py, DriverWire."""

    def __init__(self, pins, motors):
        """pins: one per motor from the first on. Uses the state machines from the PIO block after
        the last motor's on."""
        self._first = first = (motors + 3) // 4 * 4
        self._hearing = []
        self._talking = []
        for i, number in enumerate(pins):
            line = Pin(number, Pin.IN, Pin.PULL_UP)
            hearing = rp2.StateMachine(first + 2 * i + 1, hear, freq=_CYCLES, in_base=line)
            talking = rp2.StateMachine(
                first + 2 * i, talk, freq=_CYCLES, sideset_base=line, out_base=line, set_base=line
            )
            hearing.active(1)
            talking.active(1)
            self._hearing.append(hearing)
            self._talking.append(talking)
        self._chosen = 0

    def select(self, motor):
        self._chosen = motor

    def send(self, buffer, count):
        self._hearing[self._chosen].restart()
        _send(self._first + 2 * self._chosen, buffer, count)

    def receive(self, buffer, at, limit):
        return _receive(self._first + 2 * self._chosen + 1, buffer, at, limit)
