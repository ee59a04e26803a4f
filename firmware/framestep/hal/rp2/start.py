"""The start of an RP2040 or RP2350; unloaded once the board is up. See hal.contract.Start."""

import rp2
from machine import Pin

from framestep.hal import STACK
from framestep.hal.rp2 import pins
from framestep.soft_reset import stop_dma as clear  # noqa: F401

SPARE = 10 * 1024
SPENT = (
    "framestep.hal.flash_blocks",
    "framestep.hal.rp2.clock",
    "framestep.hal.rp2.peripherals",
    "framestep.hal.rp2.stack",
    "framestep.hal.ports.usb_descriptor",
    "framestep.hal.rp2.start",
    "framestep.hal.rp2.register_start",
    "framestep.pulse.shape",
)


def held(board):
    jumper = board.get("jumper")
    if jumper is not None and not Pin(jumper, Pin.IN, Pin.PULL_UP).value():
        return "the jumper is set"
    return "BOOTSEL is held" if rp2.bootsel_button() else None


def drivers_off(board, rig):
    pins.drivers_off(board, rig)
    if "registers" in board:
        from framestep.hal.rp2.register_start import clear

        clear(board["registers"])


def prepare(board):
    from framestep.hal.rp2.clock import set_clock
    from framestep.hal.rp2.stack import set_limit

    # A soft reset leaves the lower limit of REPL programs, too low for modules that import others.
    set_limit(STACK)
    set_clock(board["clock_mhz"])


def make(board, rig):
    from framestep.hal.rp2.hal import Rp2Hal

    return Rp2Hal(board, rig)


def release(block):
    from framestep.hal.rp2.hal import release

    release(block)
