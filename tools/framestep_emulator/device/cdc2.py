# A second USB serial port for MicroPython's rp2 port, in addition to the built-in one, with
# machine.USBDevice (MicroPython 1.23 and later). For the emulator's own tests, and as an example of
# the fastest way to receive bytes: a transfer goes directly into a caller's buffer, and ends when
# the buffer is full or a packet is short.
#
#     import cdc2
#     port = cdc2.CDC2(on_rx)      # on_rx(port, count): `count` bytes are in port.rx
#     port.start()
#
# start() makes the host see the device disappear and come back with two serial ports.

import struct

import machine
from micropython import const

_STAGE_SETUP = const(1)
_SET_LINE_CODING = const(0x20)
_GET_LINE_CODING = const(0x21)
_SET_CONTROL_LINE_STATE = const(0x22)


class CDC2:
    def __init__(self, on_rx, rx_size=1088):
        self.usb = machine.USBDevice()
        builtin = self.usb.BUILTIN_CDC
        self.itf = builtin.itf_max
        self.ep_note = 0x80 | builtin.ep_max
        self.ep_out = builtin.ep_max + 1
        self.ep_in = 0x80 | self.ep_out
        self.builtin = builtin
        self.on_rx = on_rx
        self.rx = bytearray(rx_size)
        self.dtr = False
        self.configured = False
        self.sending = False
        self.coding = bytearray(b"\x00\xc2\x01\x00\x00\x00\x08")

    def descriptor(self):
        itf = self.itf
        own = (
            # the two interfaces belong together
            struct.pack("<8B", 8, 11, itf, 2, 2, 2, 0, 0)
            # control interface with its class-specific descriptors and notification endpoint
            + struct.pack("<9B", 9, 4, itf, 0, 1, 2, 2, 0, 0)
            + struct.pack("<5B", 5, 0x24, 0, 0x20, 0x01)
            + struct.pack("<5B", 5, 0x24, 1, 0, itf + 1)
            + struct.pack("<4B", 4, 0x24, 2, 2)
            + struct.pack("<5B", 5, 0x24, 6, itf, itf + 1)
            + struct.pack("<BBBBHB", 7, 5, self.ep_note, 3, 8, 16)
            # data interface
            + struct.pack("<9B", 9, 4, itf + 1, 0, 2, 10, 0, 0, 0)
            + struct.pack("<BBBBHB", 7, 5, self.ep_out, 2, 64, 0)
            + struct.pack("<BBBBHB", 7, 5, self.ep_in, 2, 64, 0)
        )
        whole = bytearray(self.builtin.desc_cfg) + own
        struct.pack_into("<H", whole, 2, len(whole))
        whole[4] = itf + 2
        return whole

    def start(self):
        usb = self.usb
        usb.active(False)
        usb.builtin_driver = self.builtin
        usb.config(
            self.builtin.desc_dev,
            self.descriptor(),
            None,
            self._open,
            self._reset,
            self._control,
            self._xfer,
        )
        usb.active(True)

    # ---- callbacks of the USB stack

    def _open(self, _descriptor):
        self.configured = True
        self.sending = False
        self.arm()

    def _reset(self):
        self.configured = False
        self.dtr = False

    def _control(self, stage, request):
        kind, request, value, _index, _length = struct.unpack("<BBHHH", request)
        if stage != _STAGE_SETUP:
            return True
        if kind & 0x60 != 0x20:  # class requests only
            return False
        if request == _SET_LINE_CODING or request == _GET_LINE_CODING:
            return self.coding
        if request == _SET_CONTROL_LINE_STATE:
            self.dtr = bool(value & 1)
            return True
        return False

    def _xfer(self, ep, _result, count):
        if ep == self.ep_out:
            self.on_rx(self, count)
            self.arm()
        elif ep == self.ep_in:
            self.sending = False
        return True

    # ---- for the program

    def arm(self):
        """Receive the next bytes into self.rx."""
        if self.configured:
            self.usb.submit_xfer(self.ep_out, self.rx)

    def write(self, data):
        """Send data. Return False while the last transfer is under way. Keep data until it is
        done."""
        if not self.configured or self.sending:
            return False
        self.sending = True
        return self.usb.submit_xfer(self.ep_in, data)
