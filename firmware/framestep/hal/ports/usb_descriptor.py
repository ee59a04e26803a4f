"""USB descriptors of the device: the built-in serial port, and the protocol's."""

import struct

from framestep.base.native import const
from framestep.hal.ports.usb_transfers import PACKET

_PRODUCT_NAME = "framestep"  # Windows and macOS show this, and not the ports' names
_NAME = "framestep DMC"  # 40 characters at most (MICROPY_HW_USB_DESC_STR_MAX)

_FUNCTION = const(66)  # bytes of the second function

# index of the product's name in MicroPython's device descriptor (USBD_STR_PRODUCT)
_PRODUCT = const(2)


def descriptor(builtin):
    """Return the built-in configuration followed by a second CDC function (USB CDC 1.2, 5.2; USB
    2.0 ECN "IAD")."""
    own = builtin.desc_cfg
    # First, since the memory for moves begins behind it: the pieces below are free by then.
    whole = bytearray(len(own) + _FUNCTION)
    whole[: len(own)] = own
    control = builtin.itf_max
    notify = 0x80 | builtin.ep_max
    out = builtin.ep_max + 1
    name = builtin.str_max
    whole[len(own) :] = (
        struct.pack("<8B", 8, 11, control, 2, 2, 2, 0, name)  # the two interfaces belong together
        + struct.pack("<9B", 9, 4, control, 0, 1, 2, 2, 0, name)
        + struct.pack("<5B", 5, 0x24, 0, 0x20, 0x01)  # header, CDC 1.20
        + struct.pack("<5B", 5, 0x24, 1, 0, control + 1)  # call management
        + struct.pack("<4B", 4, 0x24, 2, 6)  # abstract control: line coding and state, break
        + struct.pack("<5B", 5, 0x24, 6, control, control + 1)  # union
        + struct.pack("<BBBBHB", 7, 5, notify, 3, 8, 16)
        + struct.pack("<9B", 9, 4, control + 1, 0, 2, 10, 0, 0, name)
        + struct.pack("<BBBBHB", 7, 5, out, 2, PACKET, 0)
        + struct.pack("<BBBBHB", 7, 5, 0x80 | out, 2, PACKET, 0)
    )
    struct.pack_into("<H", whole, 2, len(whole))
    whole[4] = control + 2  # interfaces
    return whole


class Strings:
    """String descriptors: the port's name and the product's; None for an index that MicroPython
    handles itself. Never raises."""

    def __init__(self, index):
        self.index = index

    def __getitem__(self, index):
        if index == _PRODUCT:
            return _PRODUCT_NAME
        return _NAME if index == self.index else None
