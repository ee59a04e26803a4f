"""What a soft reset leaves as it was, as MicroPython does: DMA that runs, the USB device, and the
levels of pins that PIO had.

Small, as it is loaded while DMA may still write into memory that is not its own any more: that of
before the reset lay behind what framestep.boot keeps for the REPL.
"""

import sys

from machine import mem32

# RP2040 datasheet 2.5.7, RP2350 12.6.10
_CONTROL = 0x50000010  # of a channel, without a trigger
_CHANNEL = 0x40
_ADDRESS = 0x50110000  # ADDR_ENDP, the USB device's address in the low 7 bits
_MARK = 0x50100FC8  # where framestep.hal.ports.usb_transfers leaves a mark, and which
_ALIVE = 0x1D7A5C3B

_stopped = False


def stop_dma():
    """Stop all DMA; once after each reset, since what runs later is somebody's. Takes 0.2 ms.

    DMX512 runs by DMA alone. It would go on with levels, and a list of what to do, in memory that
    is used for something else.
    """
    global _stopped
    if _stopped:
        return
    _stopped = True
    rp2350 = "RP2350" in sys.implementation._machine
    channels = 16 if rp2350 else 12
    # first of all, so that none hands over to another (erratum RP2350-E5)
    for channel in range(channels):
        mem32[_CONTROL + _CHANNEL * channel] = 0
    mem32[0x50000464 if rp2350 else 0x50000444] = (1 << channels) - 1  # CHAN_ABORT


def lower_pins():
    """Drive low whatever pin a PIO program had, which a soft reset has ended in the middle of a
    pulse, maybe: a servo would take what is left for one of some hundred milliseconds. To be called
    before any program is started anew."""
    rp2350 = "RP2350" in sys.implementation._machine
    clear, drive = (0xD0000020, 0xD0000038) if rp2350 else (0xD0000018, 0xD0000024)
    for pin in range(30):
        control = (0x40028004 if rp2350 else 0x40014004) + 8 * pin
        if mem32[control] & 31 in (6, 7, 8):  # PIO0 to PIO2
            mem32[clear] = 1 << pin
            mem32[drive] = 1 << pin
            mem32[control] = 5  # SIO


def usb_alive():
    """Whether the USB device with the protocol's port is still there: the host has given it an
    address, and framestep.hal.ports.usb_transfers has left its mark."""
    return bool(mem32[_ADDRESS] & 0x7F) and mem32[_MARK] == _ALIVE
