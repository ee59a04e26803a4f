"""Pins of the RP2040 and RP2350 through the single-cycle IO block (RP2040 datasheet 2.3.1.7, RP2350
3.1.11).

Only pins 0 to 29, whose bits fit a small integer.
"""

from time import ticks_diff, ticks_ms

from machine import Pin, disable_irq, enable_irq

from framestep.base.native import const, micropython, ptr32
from framestep.hal.rp2 import chip

_GPIO_IN = const(1)  # words from the start of SIO
_USB_PAGE = const(0x50110)  # of 4 kB (RP2040 datasheet 4.1.4)
_MUXING = const(29)  # words from its start
_TO_DIGITAL_PAD = const(4)  # the line comes from a pin
_PATIENCE_MS = const(50)

_stuck = False  # USB has held a pin for too long


@micropython.viper
def drive(high: int, low: int):
    """Drive the pins of these bits high and low."""
    sio = 0xD00
    sio <<= 20  # 0xD0000000; as a constant it would be an object
    ptr32(sio)[chip.OUT_SET_WORD] = high
    ptr32(sio)[chip.OUT_CLEAR_WORD] = low


@micropython.viper
def levels() -> int:
    """Return the levels of pins 0 to 29, one bit each."""
    sio = 0xD00
    sio <<= 20
    return ptr32(sio)[_GPIO_IN] & 0x3FFFFFFF


@micropython.viper
def held() -> bool:
    """Return whether USB holds a pin at present, see hal/rp2/pin_guard.py."""
    page = _USB_PAGE
    page <<= 12  # as a constant it would be an object
    return ptr32(page)[_MUXING] & _TO_DIGITAL_PAD != 0


def free():
    """Turn interrupts off at a moment when USB holds no pin. Return the state for enable_irq().

    USB holds one for a millisecond or two. If it goes on, say so once and wait no more.
    """
    global _stuck
    begun = ticks_ms()
    state = disable_irq()
    while held() and not _stuck:
        enable_irq(state)
        if ticks_diff(ticks_ms(), begun) >= _PATIENCE_MS:
            _stuck = True
            print("framestep: USB does not let go of GPIO 15, so do not use that pin")
        state = disable_irq()
    return state


def enable_pins(board):
    """Return the numbers of the drivers' enable pins."""
    enable = board["enable"]
    return enable if isinstance(enable, list) else [enable]


def drivers_off(board, rig):
    """Switch all drivers off. Return their enable pins."""
    state = free()
    pins = enable_pins(board)
    found = [
        Pin(pin, Pin.OUT, value=0 if rig.motor(i)["enable_high"] else 1)
        for i, pin in enumerate(pins)
    ]
    enable_irq(state)
    return found
