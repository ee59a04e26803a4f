"""What MicroPython leaves running across a soft reset: DMA, the USB device, and PIO's pins.

This module is small because it is loaded while DMA may still write into memory that it no longer
owns: into the heap of before the reset, which lay behind what framestep.boot keeps for the REPL.
"""

from machine import mem32

from framestep.hal.rp2 import chip

# RP2040 datasheet 2.5.7, RP2350 12.6.10
_CONTROL = 0x50000010  # a channel's control word, without a trigger
_CHANNEL = 0x40
_ADDRESS = 0x50110000  # ADDR_ENDP, the USB device's address in the low 7 bits
_MARK = 0x50100FC8  # framestep.hal.ports.usb_transfers writes _ALIVE here
_ALIVE = 0x1D7A5C3B

_stopped = False


def stop_dma():
    """Stop all DMA. Only the first call after a reset does so, as DMA started later is in use.
    Takes 0.2 ms.

    DMX512 runs by DMA alone. It would go on reading its levels and control blocks from memory that
    is now used for something else.
    """
    global _stopped
    if _stopped:
        return
    _stopped = True
    # all before the first abort, so that no channel starts another (erratum RP2350-E5)
    for channel in range(chip.DMA_CHANNELS):
        mem32[_CONTROL + _CHANNEL * channel] = 0
    mem32[chip.DMA_ABORT] = (1 << chip.DMA_CHANNELS) - 1


def lower_pins():
    """Drive low each pin that a PIO program had. Call it before any program starts again.

    The soft reset may have ended the program within a pulse; a servo would then see one of some
    hundred milliseconds. Where a change of level is a step, it stays (hal/rp2/edges.py).
    """
    high = mem32[chip.KEPT_PINS] & mem32[chip.LEVELS]
    for pin in range(30):
        control = (chip.IO_PAGE << 12) + 4 + 8 * pin
        if mem32[control] & 31 in (6, 7, 8):  # PIO0 to PIO2
            mem32[chip.OUT_SET if high >> pin & 1 else chip.OUT_CLEAR] = 1 << pin
            mem32[chip.DRIVE] = 1 << pin
            mem32[control] = 5  # SIO


def usb_alive():
    """Return whether the USB device with the protocol's port is still there: the host has given it
    an address, and framestep.hal.ports.usb_transfers has left its mark."""
    return bool(mem32[_ADDRESS] & 0x7F) and mem32[_MARK] == _ALIVE
