"""The protocol on the REPL's port: for boards without machine.USBDevice, or with `"ports": 1` in
rig.json.

The built-in port has only a blocking read. It shows whether a byte waits, but not how many. So a
frame is read in the steps in which its length becomes known: the first byte, the rest of the
header, then the payload in blocks, each in one call. A host that stops within a frame would hold
up the main loop. So after 10 ms padding bytes, from a stream on os.dupterm, end the read. They are
removed again, and the rest of that frame is read byte by byte, without waiting. If MicroPython does
not read that stream during a read (it does only on rp2), every frame is read byte by byte.

A Ctrl-C between frames gives the REPL back, as mpremote and Thonny expect: `poll()` raises
KeyboardInterrupt. Within a frame it is data. After bytes that belong to no frame it is noise, until
the line has been quiet for 50 ms.

DTR cannot be seen here. On rp2 `open` shows whether the host collects what is sent: it turns False
when a packet has waited for half a second, and True when the packet has gone. So a lost host is
noticed only while something is sent, such as position reports while motors move. Elsewhere `open`
is always True.
"""

import io
import os
import select
import sys
import time
from array import array

import micropython

from framestep.base.clock import WIDE_HALF, WIDE_WRAP
from framestep.base.native import const, ptr8, ptr32

if sys.platform == "rp2":
    from machine import Timer

    from framestep.hal.rp2 import usb as chip
else:
    chip = None

_D = const(0x44)
_F = const(0x46)
_CTRL_C = const(3)
_CR = const(13)
_LF = const(10)
_HEADER = const(10)
_OVERHEAD = const(12)  # header and check bytes
_LARGEST = const(1048)

# The buffer has the header and the first block, which end at _BODY, and then whole blocks. So the
# views for reading are made once, and a frame is in one piece.
_BLOCK = const(128)  # bytes of a frame read in one call; at worst as many calls of the filling
_HEAD = const(3)
_BODY = const(156)  # whole words
_SIZE = const(_BODY + 8 * _BLOCK)
_PACKET = const(64)  # bytes sent in one call
_PATIENCE_MS = const(10)  # time for a block before the filling begins
_WAKE_MS = const(5)  # period of interrupts that wake the processor while it waits in a read
_CALM_MS = const(50)  # quiet time after noise before Ctrl-C counts again
_COLLECT_MS = const(500)  # a host that listens collects a packet within this time

# IN endpoint of the built-in port: USBD_CDC_EP_IN, MicroPython's shared/tinyusb/tusb_config.h
_BUILTIN_IN = const(2)
_FREE = const(192)  # bytes that the built-in port accepts at once if nothing waits; it holds 256

# State words
_HAVE = const(0)  # bytes read of the present frame
_NEED = const(1)  # its size, once the header has been read
_LOW = const(2)  # the low byte of its length
_NOISE = const(3)  # 1 after bytes that belong to no frame
_NOISE_AT = const(4)  # time of the last of them, ticks_ms
_HELD = const(5)  # bytes in the buffer that the reader did not take
_HELD_AT = const(6)
_WORDS = const(7)

# Words of the filling
_BEGIN = const(0)  # where in the buffer the present read puts its bytes
_END = const(1)
_DEADLINE = const(2)  # ticks_ms
_GIVEN = const(3)
_FILLING_WORDS = const(4)

_ONE = 1  # an object, because a viper function cannot make one


@micropython.viper
def _nothing(_timer):
    pass


class _Filling(io.IOBase):
    """Ends a read at its deadline with padding bytes, as many as are missing.

    The host may go on sending, so that its bytes come between these. So the read's range of the
    buffer is cleared before. For each padding byte `after` notes where the zeros began when it was
    given: the next nonzero byte from there on is the padding byte.
    """

    def __init__(self, buffer):
        self.buffer = buffer
        self.words = array("i", [0] * _FILLING_WORDS)
        self.after = bytearray(_BLOCK)
        self._ticks = time.ticks_ms

    @micropython.viper
    def readinto(self, byte):
        w = ptr32(self.words)
        if (int(self._ticks()) - w[_DEADLINE]) & WIDE_WRAP >= WIDE_HALF:
            return None
        buffer = ptr8(self.buffer)
        begin = w[_BEGIN]
        end = w[_END]
        while end > begin and buffer[end - 1] == 0:
            end -= 1
        given = w[_GIVEN]
        ptr8(self.after)[given + 0] = end - begin
        w[_GIVEN] = given + 1
        ptr8(byte)[0] = 0xFF
        return _ONE

    def write(self, data):
        return len(data)

    def ioctl(self, request, argument):
        return 0


class StdinPort:
    """The protocol port in single-port mode. Nothing allocates after `start()`.

    `open` and `openings` are like those of UsbPort, as far as they can be known here (see the head
    of this file). The reader needs the attribute `waiting` of protocol.frames.FrameReader: how many
    bytes of an incomplete frame it holds.
    """

    answer = False

    def __init__(self):
        self._buffer = bytearray(_SIZE)
        self._filling = _Filling(self._buffer)
        self._filling_words = self._filling.words
        view = memoryview(self._buffer)
        self._first = view[_HEAD : _HEAD + 1]
        self._header = view[_HEAD + 1 : _HEAD + _HEADER]  # without its first byte
        self._starts = [view[_BODY - n : _BODY] for n in range(_BLOCK + 1)]
        self._blocks = [view[at : at + _BLOCK] for at in range(_BODY, _SIZE, _BLOCK)]
        self._out = bytearray(_PACKET)
        view = memoryview(self._out)
        self._packets = [view[:n] for n in range(_PACKET + 1)]
        self._state = array("i", [0] * _WORDS)
        self._readinto = sys.stdin.buffer.readinto  # type: ignore[union-attr]
        self._write = sys.stdout.buffer.write
        self._ticks = time.ticks_ms
        self._dupterm = os.dupterm  # type: ignore[attr-defined]
        self._input = select.poll()
        self._output = select.poll()
        self._timer = None
        self._bus = chip.BusWatch() if chip else None
        self._sent_at = 0
        self.open = True
        self.openings = 1

    def start(self):
        """Take the port over: Ctrl-C no longer interrupts, but is read."""
        self._input.register(sys.stdin, select.POLLIN)
        self._output.register(sys.stdout, select.POLLOUT)
        self._input.ipoll(0)  # allocates its result, once
        self._output.ipoll(0)
        micropython.kbd_intr(-1)
        if chip:
            self._timer = Timer(period=_WAKE_MS, mode=Timer.PERIODIC, callback=_nothing, hard=True)  # type: ignore[call-overload]

    def stop(self):
        """Give the port back to the REPL."""
        if self._timer:
            self._timer.deinit()
            self._timer = None
        micropython.kbd_intr(_CTRL_C)

    # ------------------------------------------------------------ in

    @micropython.viper
    def poll(self, reader) -> int:
        """Offer received bytes, on rp2 a frame at most, to `reader.feed(buffer, start, count) ->
        taken`. Return how many it took.

        A frame that has begun to come is read to its end. That takes as long as the host needs for
        it, or 10 to 20 ms if the host stops half-way. Raises KeyboardInterrupt to give the REPL
        back. Before the next call the reader must have found all frames in the bytes that it took
        (FrameReader.poll() returns NOTHING).
        """
        s = ptr32(self._state)
        moved = 0
        if s[_HELD]:
            moved = int(self._give(reader, s[_HELD_AT], s[_HELD]))
            if s[_HELD]:
                return moved
        if not next(self._input.ipoll(0), None):
            if s[_NOISE]:
                self._calm()
            return moved
        if s[_HAVE] and not reader.waiting:  # the reader's owner has dropped the frame
            s[_HAVE] = 0
        if s[_HAVE] == 0:
            self._readinto(self._first)
            if chip and ptr8(self._buffer)[_HEAD] == _D:
                terminal = self._dupterm(self._filling)
                try:
                    moved += int(self._read_frame(reader))
                finally:
                    self._dupterm(terminal)
                return moved
        return moved + int(self._read_bytes(reader))

    @micropython.viper
    def _give(self, reader, at: int, count: int) -> int:
        s = ptr32(self._state)
        taken = int(reader.feed(self._buffer, at, count))
        s[_HELD_AT] = at + taken
        s[_HELD] = count - taken
        return taken

    @micropython.viper
    def _read_frame(self, reader) -> int:
        """Read the rest of the header and then of the frame, in blocks. The first byte is in the
        buffer."""
        s = ptr32(self._state)
        buffer = ptr8(self._buffer)
        have = 1 + int(self._fill(self._header, _HEAD + 1, _HEADER - 1))
        s[_HAVE] = have
        s[_LOW] = buffer[_HEAD + 8]
        need = _OVERHEAD + s[_LOW] + (buffer[_HEAD + 9] << 8)
        if have > 1 and buffer[_HEAD + 1] != _F or have == _HEADER and need > _LARGEST:
            self._lost()
            return int(self._give(reader, _HEAD, have))
        if have < _HEADER:
            return int(self._give(reader, _HEAD, have))
        s[_NEED] = need
        wanted = ((need - _HEADER - 1) & (_BLOCK - 1)) + 1
        at = _BODY - wanted
        start = at - _HEADER
        view = self._starts[wanted]
        blocks = self._blocks
        block = 0
        while True:
            count = int(self._fill(view, at, wanted))
            have += count
            at += count
            if count < wanted or have == need:
                break
            wanted = _BLOCK
            view = blocks[block]
            block += 1
        i = 0
        while i < _HEADER:
            buffer[start + i] = buffer[_HEAD + i]
            i += 1
        s[_HAVE] = have
        if have == need:
            s[_HAVE] = 0
            s[_NOISE] = 0
        return int(self._give(reader, start, have))

    @micropython.viper
    def _fill(self, view, at: int, wanted: int) -> int:
        """Read `wanted` bytes into `view`, which begins at `at` in the buffer. Return how many
        came: fewer if the host stops half-way."""
        buffer = ptr8(self._buffer)
        i = at & -4
        end = at + wanted
        while i < end:
            ptr32(int(buffer) + i)[0] = 0
            i += 4
        w = ptr32(self._filling_words)
        w[_BEGIN] = at
        w[_END] = end
        w[_DEADLINE] = int(self._ticks()) + _PATIENCE_MS
        w[_GIVEN] = 0
        self._readinto(view)
        given = w[_GIVEN]
        if given == 0:
            return wanted
        after = ptr8(self._filling.after)
        i = at
        to = at
        found = 0
        while i < end:
            if found < given and i - at >= after[found] and buffer[i]:
                found += 1
            else:
                buffer[to] = buffer[i]
                to += 1
            i += 1
        return to - at

    @micropython.viper
    def _read_bytes(self, reader) -> int:
        """Read waiting bytes one by one, to the end of a frame. Outside of a frame the first byte
        is in the buffer."""
        s = ptr32(self._state)
        buffer = ptr8(self._buffer)
        count = 0
        fetch = s[_HAVE] > 0
        while count < _BLOCK:
            if fetch:
                if not next(self._input.ipoll(0), None):
                    break
                self._readinto(self._first)
            fetch = True
            byte = buffer[_HEAD]
            buffer[_BODY + count] = byte
            count += 1
            have = s[_HAVE] + 1
            s[_HAVE] = have
            if have == 1:
                if byte != _D:
                    s[_HAVE] = 0
                    if byte == _CTRL_C and s[_NOISE] == 0 and not reader.waiting:
                        self.stop()
                        raise KeyboardInterrupt
                    if byte != _CR and byte != _LF:  # mpremote sends a CR before its Ctrl-C
                        self._lost()
            elif have == 2:
                if byte != _F:
                    self._lost()
            elif have == _HEADER - 1:
                s[_LOW] = byte
            elif have == _HEADER:
                s[_NEED] = _OVERHEAD + s[_LOW] + (byte << 8)
                if s[_NEED] > _LARGEST:
                    self._lost()
            elif have > _HEADER and have == s[_NEED]:
                s[_HAVE] = 0
                s[_NOISE] = 0
                if chip:
                    break
        return int(self._give(reader, _BODY, count))

    def _lost(self):
        """Note that it is unknown where the next frame begins."""
        state = self._state
        state[_HAVE] = 0
        state[_NOISE] = 1
        state[_NOISE_AT] = time.ticks_ms()

    def _calm(self):
        if time.ticks_diff(time.ticks_ms(), self._state[_NOISE_AT]) > _CALM_MS:
            self._state[_NOISE] = 0

    # ------------------------------------------------------------ out

    def glance(self):
        pass

    def look_for_stop(self):
        pass

    def send(self, writer):
        """Send what `writer.take(buffer, limit) -> count` provides, as far as there is room. Never
        waits.

        While the port is closed, everything is dropped.
        """
        room = _PACKET
        if not chip:
            if not next(self._output.ipoll(0), None):
                return
        elif self._collected():
            room = _FREE
        else:
            if not self.open:
                while writer.take(self._out, _PACKET):
                    pass
            return
        while room:
            count = writer.take(self._out, _PACKET)
            if not count:
                return
            self._write(self._packets[count])
            self._sent_at = time.ticks_ms()
            room -= _PACKET

    def _collected(self):
        """Return whether the host has collected what was sent to it. Updates `open`."""
        if self._bus.dead():
            self.open = False
        elif not chip.packet_waits(_BUILTIN_IN):
            if not self.open:
                self.open = True
                self.openings += 1
            return True
        elif self.open and time.ticks_diff(time.ticks_ms(), self._sent_at) > _COLLECT_MS:
            self.open = False
        return False
