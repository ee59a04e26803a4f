"""Frames in and out of byte buffers. Nothing here allocates once the reader and the writer are
made. Both are in one file, as they share the layout of a frame.

In both buffers a frame is in one piece, so payload fields are read and written in place, by their
offset. A DWORD of 2^30 and more would be an object on the board's heap. For such values `u30`,
`start_index` and `i32` return a special value. `copy_i32_to` and `put_i32s_from` copy any DWORD
between a payload and an array('i') without making a number of it.
"""

from array import array

from framestep.base.copying import copy_bytes
from framestep.base.native import const, micropython, ptr8, ptr32
from framestep.protocol.checksum import check_bytes, fletcher16
from framestep.protocol.messages import (
    FRAME_OVERHEAD,
    HEADER_BYTES,
    LARGEST_FRAME,
    LARGEST_PAYLOAD,
    MSG_FLAG_ACK,
)

# Results of FrameReader.poll()
NOTHING = const(0)
FRAME = const(1)
DAMAGED = const(2)

NOT_SMALL = const(-0x4000_0000)  # result of i32() for a value outside of ±(2^30 - 1)

# The reader's state words
NEXT = const(0)  # where the search goes on
FILL = const(1)  # end of the bytes in the buffer
_SIZE = const(2)
_HEAD = const(3)  # start of the frame found
_TYPE = const(4)
_LENGTH = const(5)

# The writer's state words
TAKE = const(0)  # first byte not yet taken
END = const(1)  # end of the last finished frame
_PUT = const(2)  # index of the next byte
_LIMIT = const(3)  # size of the buffer
_FULL = const(4)  # 1 if there was no room for a byte of this frame
_TAKEN = const(5)  # bytes taken so far, modulo 2^30

_D = const(0x44)
_F = const(0x46)


@micropython.viper
def _search(buffer: ptr8, state: ptr32) -> int:
    """Find the next whole frame from NEXT on, good or damaged. Return its size in bytes, or 0.

    NEXT skips bytes that cannot be the beginning of a frame.
    """
    at = state[NEXT]
    fill = state[FILL]
    while at < fill:
        if buffer[at] != _D:
            at += 1
            continue
        if fill - at < 2:
            break
        if buffer[at + 1] != _F:
            at += 1
            continue
        if fill - at < HEADER_BYTES:
            break
        length = buffer[at + 8] | (buffer[at + 9] << 8)
        if length > LARGEST_PAYLOAD:  # field note 1.6: skip the marker, no reply
            at += 2
            continue
        if fill - at < length + FRAME_OVERHEAD:
            break
        state[NEXT] = at
        state[_HEAD] = at
        state[_TYPE] = buffer[at + 6] | (buffer[at + 7] << 8)
        state[_LENGTH] = length
        return length + FRAME_OVERHEAD
    state[NEXT] = at
    return 0


class FrameReader:
    """Finds frames in a stream of bytes, however it is divided (field notes 1.6 to 1.8).

    After poll() has returned FRAME or DAMAGED these are valid until the next feed() or poll():
    `type`, `length` (of the payload, bytes), `head` and `payload` (offsets of frame and payload in
    `buffer`). Of a DAMAGED frame use only type and ID (at `head`), to answer ERR_CHECKSUM. The
    accessors take offsets within the payload and check nothing, so call messages.payload_fits()
    first.

    `waiting` counts the bytes that poll() has not yet used: 0 after the last frame; after NOTHING
    those of an incomplete frame. The caller watches the clock and calls drop_partial() if the rest
    does not come.
    """

    def __init__(self, size=LARGEST_FRAME + 44):
        """size: of the buffer in bytes, by default enough for a USB transfer.

        Raises ValueError below 1048 (field note 1.6).
        """
        if size < LARGEST_FRAME:
            raise ValueError(
                "a FrameReader needs a buffer of at least %d bytes, not %d" % (LARGEST_FRAME, size)
            )
        self.buffer = bytearray(size)
        self._state = array("i", (0, 0, size, 0, 0, 0))
        self.type = 0
        self.length = 0
        self.head = 0
        self.payload = HEADER_BYTES
        self.waiting = 0
        self.now = 0  # beginning of the pass that reads, ms; set by the caller

    @micropython.viper
    def feed(self, source, start: int, count: int) -> int:
        """Take up to `count` bytes of `source` from `start` on. Return how many it took.

        Offer the rest after the next poll(). Once poll() has returned NOTHING there is room for the
        rest of any frame.
        """
        state = ptr32(self._state)
        buffer = self.buffer
        at = state[NEXT]
        fill = state[FILL]
        if at == fill:
            # Nothing held: begin at the same alignment as the source, which copies fastest.
            fill = start & 3
            state[NEXT] = fill
        elif at > 0 and state[_SIZE] - fill < count:
            fill -= at
            copy_bytes(buffer, 0, buffer, at, fill)
            state[NEXT] = 0
        room = state[_SIZE] - fill
        if room < count:
            count = room
        copy_bytes(buffer, fill, source, start, count)
        state[FILL] = fill + count
        return count

    @micropython.viper
    def poll(self) -> int:
        """Find the next frame. Return FRAME, DAMAGED (wrong checksum) or NOTHING.

        Call it until it returns NOTHING or nothing is waiting.
        """
        buffer = self.buffer
        words = self._state
        size = int(_search(buffer, words))
        state = ptr32(words)
        at = state[NEXT]
        found = NOTHING
        if size:
            self.head = at
            self.payload = at + HEADER_BYTES
            self.type = state[_TYPE]
            self.length = state[_LENGTH]
            if int(fletcher16(buffer, at, size)):
                at += 2  # field note 1.6: a good frame inside a damaged one is found
                found = DAMAGED
            else:
                at += size
                found = FRAME
            state[NEXT] = at
        self.waiting = state[FILL] - at
        return found

    def drop_partial(self):
        """Drop the incomplete frame: skip its marker. poll() goes on with the bytes after it."""
        state = self._state
        skipped = state[FILL] - state[NEXT]
        state[NEXT] += 2 if skipped > 2 else skipped
        self.waiting = 0

    def clear(self):
        """Drop all bytes, for example after the port has been closed."""
        self._state[NEXT] = 0
        self._state[FILL] = 0
        self.waiting = 0
        self.now = 0

    @micropython.viper
    def u8(self, i: int) -> int:
        """Return the BYTE at payload offset `i`."""
        return ptr8(self.buffer)[int(self.payload) + i]

    @micropython.viper
    def u16(self, i: int) -> int:
        """Return the WORD at payload offset `i`, 0 to 65535."""
        buffer = ptr8(self.buffer)
        i += int(self.payload)
        return buffer[i] | (buffer[i + 1] << 8)

    @micropython.viper
    def i16(self, i: int) -> int:
        """Return the signed WORD at payload offset `i`."""
        buffer = ptr8(self.buffer)
        i += int(self.payload)
        return ((buffer[i] | (buffer[i + 1] << 8)) ^ 0x8000) - 0x8000

    @micropython.viper
    def u30(self, i: int) -> int:
        """Return the unsigned DWORD at payload offset `i`; -1 if it is 2^30 or more."""
        buffer = ptr8(self.buffer)
        i += int(self.payload)
        high = buffer[i + 3]
        if high >= 0x40:
            return -1
        return buffer[i] | (buffer[i + 1] << 8) | (buffer[i + 2] << 16) | (high << 24)

    @micropython.viper
    def start_index(self, i: int) -> int:
        """Return the DWORD at payload offset `i` without its high bit; -1 if it is 2^30 or more.

        See the specification, MSG_RT_UPLOAD_MOVE_AXIS.
        """
        buffer = ptr8(self.buffer)
        i += int(self.payload)
        high = buffer[i + 3] & 0x7F
        if high >= 0x40:
            return -1
        return buffer[i] | (buffer[i + 1] << 8) | (buffer[i + 2] << 16) | (high << 24)

    @micropython.viper
    def i32(self, i: int) -> int:
        """Return the signed DWORD at payload offset `i`, or NOT_SMALL outside of ±(2^30 - 1)."""
        buffer = ptr8(self.buffer)
        i += int(self.payload)
        high = (buffer[i + 3] ^ 0x80) - 0x80
        if high < -0x40 or high >= 0x40:
            return NOT_SMALL
        return buffer[i] | (buffer[i + 1] << 8) | (buffer[i + 2] << 16) | (high << 24)

    @micropython.viper
    def copy_i32_to(self, i: int, words: object, index: int):
        """Put the DWORD at payload offset `i` into `words[index]`, an array('i'); any value."""
        buffer = ptr8(self.buffer)
        i += int(self.payload)
        to = ptr32(words)
        to[index + 0] = (
            buffer[i]
            | (buffer[i + 1] << 8)
            | (buffer[i + 2] << 16)
            | (((buffer[i + 3] ^ 0x80) - 0x80) << 24)
        )


@micropython.viper
def _open(buffer: ptr8, state: ptr32, source: ptr8, head: int, kind: int):
    """Write a header without its length. Take its ID from the frame at `head` in `source`; 0 if
    `head` is -1.

    Bytes that wait to be taken move to the front if the largest frame would not fit after them.
    """
    at = state[END]
    taken = state[TAKE]
    if at == taken:
        at = 0
        state[END] = 0
        state[TAKE] = 0
    elif taken > 0 and state[_LIMIT] - at < LARGEST_PAYLOAD + FRAME_OVERHEAD:
        at -= taken
        i = 0
        while i < at:
            buffer[i] = buffer[i + taken]
            i += 1
        state[END] = at
        state[TAKE] = 0
    state[_PUT] = at
    if state[_LIMIT] - at < HEADER_BYTES:
        state[_FULL] = 1
        return
    state[_FULL] = 0
    state[_PUT] = at + HEADER_BYTES
    buffer[at] = _D
    buffer[at + 1] = _F
    if head < 0:
        buffer[at + 2] = 0
        buffer[at + 3] = 0
        buffer[at + 4] = 0
        buffer[at + 5] = 0
    else:
        buffer[at + 2] = source[head + 2]
        buffer[at + 3] = source[head + 3]
        buffer[at + 4] = source[head + 4]
        buffer[at + 5] = source[head + 5]
    buffer[at + 6] = kind & 0xFF
    buffer[at + 7] = (kind >> 8) & 0xFF


@micropython.viper
def _put(buffer: ptr8, state: ptr32, value: int, width: int):
    """Append the low `width` bytes of `value`."""
    at = state[_PUT]
    end = at + width
    if end > state[_LIMIT]:
        state[_FULL] = 1
        return
    state[_PUT] = end
    while at < end:
        buffer[at] = value & 0xFF
        value >>= 8
        at += 1


@micropython.viper
def _finish(buffer, words) -> bool:
    """Write length and check bytes. If the frame does not fit, drop it and return False."""
    state = ptr32(words)
    to = ptr8(buffer)
    start = state[END]
    at = state[_PUT]
    if state[_FULL] or state[_LIMIT] - at < 2:
        return False
    size = at - start
    to[start + 8] = (size - HEADER_BYTES) & 0xFF
    to[start + 9] = (size - HEADER_BYTES) >> 8
    check = int(check_bytes(fletcher16(buffer, start, size)))
    to[at] = check & 0xFF
    to[at + 1] = check >> 8
    state[END] = at + 2
    return True


@micropython.viper
def _text(buffer: ptr8, state: ptr32, text: ptr8, count: int, width: int):
    at = state[_PUT]
    if state[_LIMIT] - at < width:
        state[_FULL] = 1
        return
    state[_PUT] = at + width
    if count > width:
        count = width
    i = 0
    while i < count:
        buffer[at + i] = text[i + 0]
        i += 1
    while i < width:
        buffer[at + i] = 0
        i += 1


class FrameWriter:
    """Holds outgoing frames until the port takes their bytes.

    Call begin(), add the fields one by one, and call end(); only then does take() return the frame.
    If there is no room for a frame, it is dropped as a whole: end() returns False, and no part of
    it is sent. One frame is written at a time, of at most 1048 bytes. take() and clear() may be
    called between any two of these steps, for example from a scheduled callback.
    """

    def __init__(self, size=4096):
        """size: of the buffer in bytes. Raises ValueError if the largest frame would not fit."""
        if size < LARGEST_FRAME:
            raise ValueError(
                "a FrameWriter needs a buffer of at least %d bytes, not %d" % (LARGEST_FRAME, size)
            )
        self._buffer = bytearray(size)
        self._state = array("i", (0, 0, 0, size, 1, 0))

    @property
    @micropython.viper
    def pending(self) -> int:
        """Bytes of finished frames that wait to be taken."""
        state = ptr32(self._state)
        return state[END] - state[TAKE]

    @property
    def taken(self):
        """Bytes taken so far, modulo 2^30."""
        return self._state[_TAKEN]

    @micropython.viper
    def room(self) -> int:
        """Return the largest payload for a frame begun now, in bytes; negative if not even an empty
        frame fits."""
        state = ptr32(self._state)
        room = state[_LIMIT] - state[END] + state[TAKE] - FRAME_OVERHEAD
        return room if room < LARGEST_PAYLOAD else LARGEST_PAYLOAD

    @micropython.viper
    def begin(self, kind: int, reader):
        """Begin a frame of type `kind` with the ID of the frame in `reader`, or ID 0 for None
        (field note 1.3)."""
        buffer = self._buffer
        if reader:
            _open(buffer, self._state, reader.buffer, reader.head, kind)
        else:
            _open(buffer, self._state, buffer, -1, kind)

    @micropython.viper
    def u8(self, value: int):
        """Append the low BYTE of `value`, a small integer; negative ones as two's complement."""
        _put(self._buffer, self._state, value, 1)

    @micropython.viper
    def u16(self, value: int):
        """Append the low WORD of `value`; otherwise like u8()."""
        _put(self._buffer, self._state, value, 2)

    @micropython.viper
    def u32(self, value: int):
        """Append `value` as a DWORD; otherwise like u8()."""
        _put(self._buffer, self._state, value, 4)

    @micropython.viper
    def put_i32s_from(self, words: object, index: int, count: int):
        """Append `count` elements of an array('i') from `words[index]` on as DWORDs; any values."""
        state = ptr32(self._state)
        at = state[_PUT]
        index <<= 2
        end = at + (count << 2)
        if end > state[_LIMIT]:
            state[_FULL] = 1
            return
        state[_PUT] = end
        source = ptr8(words)
        buffer = ptr8(self._buffer)
        while at < end:
            buffer[at] = source[index + 0]
            at += 1
            index += 1

    @micropython.viper
    def text(self, text, width: int):
        """Append bytes cut or filled with zeros to `width`."""
        _text(self._buffer, self._state, text, len(text), width)

    @micropython.viper
    def end(self) -> bool:
        """Finish the frame. Return True, or False if it did not fit and has been dropped."""
        return bool(_finish(self._buffer, self._state))

    @micropython.viper
    def ack(self, reader, code: int, dword_acks: int) -> bool:
        """Write a complete acknowledgement of the frame in `reader`. Return as end().

        code: sent as a WORD, or as a DWORD if `dword_acks` (field note 1.4).
        """
        buffer = self._buffer
        words = self._state
        _open(buffer, words, reader.buffer, reader.head, int(reader.type) | MSG_FLAG_ACK)
        _put(buffer, words, code, 4 if dword_acks else 2)
        return bool(_finish(buffer, words))

    @micropython.viper
    def take(self, to, limit: int) -> int:
        """Move up to `limit` bytes of finished frames to the start of `to`. Return how many."""
        state = ptr32(self._state)
        at = state[TAKE]
        count = state[END] - at
        if count > limit:
            count = limit
        if count > 0:
            copy_bytes(to, 0, self._buffer, at, count)
            state[TAKE] = at + count
            state[_TAKEN] = (state[_TAKEN] + count) & 0x3FFFFFFF
        return count

    def clear(self):
        """Drop all bytes not yet taken. A frame that has begun is dropped when it ends."""
        state = self._state
        state[TAKE] = state[END]
        state[_FULL] = 1
