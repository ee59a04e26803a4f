"""The start of an ESP32; unloaded once the board is up. See hal.contract.Start."""

from gc import mem_free

import machine
from machine import Pin

from framestep.base.native import const

_CHAIN = const(64)  # pin number of the chain's output 0
_OUTPUTS = const(32)

# The REPL's commands are not in flash. Without PSRAM there is no memory to spare for all of them.
SPARE = (32 if mem_free() > 700_000 else 10) * 1024
SPENT = ("framestep.hal.flash_blocks", "framestep.hal.esp32.start")


def clear():
    """Do nothing: MicroPython ends I2S at a soft reset."""


def held(board):
    for key, why in (("jumper", "the jumper is set"), ("button", "BOOT is held")):
        if key in board and not Pin(board[key], Pin.IN, Pin.PULL_UP).value():
            return why
    return None


def drivers_off(board, rig):
    """At power-up the shift registers hold random bits. Fill them by hand, because I2S begins only
    when all is loaded."""
    enable = board["enable"]
    word = 0
    for i, pin in enumerate(enable if isinstance(enable, list) else [enable]):
        if not rig.motor(i)["enable_high"]:
            word |= 1 << (pin - _CHAIN)
    chain = board["chain"]
    sck, ws, sd = [Pin(chain[key], Pin.OUT, value=0) for key in ("sck", "ws", "sd")]
    for bit in range(_OUTPUTS - 1, -1, -1):
        sd((word >> bit) & 1)
        sck(1)
        sck(0)
    ws(1)
    ws(0)


def prepare(board):
    hz = board["clock_mhz"] * 1000000
    if machine.freq() != hz:
        machine.freq(hz)


def make(board, rig):
    from framestep.hal.esp32.hal import Esp32Hal

    return Esp32Hal(board, rig)


def release(block):
    """Do nothing: it is enough to drop the block, because memory need not be in one piece here."""
