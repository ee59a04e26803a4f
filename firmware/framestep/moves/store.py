"""The uploaded move: a position for every frame of every motor, in one block of memory taken at boot.

Memory. A motor gets a region when its first section comes; motors without data take none. A region is a row of
chunks of 128 frames:

    base, two half words | velocity, two half words | link | 64 half words, a byte for each frame

A frame's code is by how much the steps per frame have changed from the frame before: code by code it is added to the
velocity, and the velocity to the position, beginning with velocity and base. Its low eight bits lie in the chunk. Where
they do not hold every code of the chunk, its units hold two further bits of each, and so on, as many units as it takes:

    link | 16 half words, two bits for each frame

Units come from a pool that grows down from the end of the memory; links, 0 at the end, make a chain of a chunk's units.
With twelve of them a code has 32 bits and is the position itself; so is kept what moves outside of ± 2^29 steps or does
not fit fewer. The lowest code that so many bits can hold stands for a frame that has not been sent, and leaves velocity
and position alone. The velocity of a chunk is that from its first to its second frame sent, so a chunk's units depend
on nothing but its positions.

What fits. A frame costs 1.08 bytes a motor while the steps per frame change by at most 127 from one frame to the next,
and 1.34 up to 511. All frames of capacity_frames() fit if no motor's steps per frame change by more than 511 from one
frame to the next, which at 24 frames/s is 294 000 steps/s². Where they change by less, there is memory for
greater changes elsewhere, of any size.

Nothing but the constructor and take() allocates. Positions go through arrays, as they need not fit a small integer;
frame numbers and indexes are small integers. An index counts from 0 at the first frame of the range (field note 5.1).
"""

from array import array

from framestep.native import CPYTHON, const, micropython, ptr8, ptr16, ptr32
from framestep.results import ERR_GENERAL, ERR_RANGE, OK

# States
EMPTY = const(0)  # no upload
LOADING = const(1)  # begun, not finished
READY = const(2)

MOST_POSITIONS = const(257)  # of a section: what the largest frame holds

_FRAMES = const(128)  # of a chunk
_BASE = const(0)  # half words of a chunk
_VELOCITY = const(2)
_LINK = const(4)
_CODES = const(5)
_CHUNK = const(69)
_UNIT = const(17)  # half words of a unit: its link, its bits
_MOST_UNITS = const(12)  # of a chunk
_PER_CHUNK = const(86)  # half words that the capacity counts for a chunk: its own and a unit
_NOT_SENT = const(0x8080)  # two codes of a chunk without units
FARTHEST_FRAME = const(1000000)  # ± (field note 5.3): MOVE TIME, a thousand times it, is a small integer

# Words of the store's block
_HALVES = const(0)  # half words of the memory
_BOTTOM = const(1)  # those taken by regions
_FREE = const(2)  # first free unit of those that have been in use, the others hang on it; 0: none
_FREE_COUNT = const(3)
_USED = const(4)  # units that are or have been in use: number u lies u units before the end of the memory
_DRY = const(5)  # 1: nothing is written, only NEED is counted
_NEED = const(6)  # units that the changes so far would have taken
_COUNT = const(7)  # frames of the upload
_MOTORS = const(8)
_STATE = const(9)  # the same as `state`
_VALUES = const(10)  # positions of a chunk
_RUN = const(140)  # positions of a section, behind the two before them
_MOTOR = const(397)  # for each motor:
_REGION = const(0)  # where its chunks begin, half words; -1: no data
_SENT = const(1)  # frames sent without a gap, from the first on
_PAST = const(2)  # the frame after the last one sent; what lies behind has no content yet
_BEFORE = const(3)  # the position of the frame before the last one sent
_LAST = const(4)  # of the last one sent
_CURSOR = const(5)  # a frame read before, -1: none
_AT = const(6)  # its position
_PACE = const(7)  # and velocity
_MOTOR_WORDS = const(8)


@micropython.viper
def _room(words: ptr32) -> int:
    """Units that the pool can still give."""
    return words[_FREE_COUNT] + (words[_HALVES] - words[_BOTTOM]) // _UNIT - words[_USED]


@micropython.viper
def _resize(memory, words, chunk: int, units: int) -> int:
    """Give a chunk so many units, the first of its own among them; 0 when DRY finds that the pool has not enough."""
    half = ptr16(memory)
    word = ptr32(words)
    top = word[_HALVES]
    at = chunk + _LINK
    if word[_DRY]:
        word[_NEED] += units
        while half[at]:
            word[_NEED] -= 1
            at = top - half[at] * _UNIT
        return 1 if word[_NEED] <= int(_room(words)) else 0
    while units > 0:
        unit = half[at]
        if unit == 0:
            unit = word[_FREE]
            if unit:
                word[_FREE] = half[top - unit * _UNIT]
                word[_FREE_COUNT] -= 1
            else:
                word[_USED] += 1
                unit = word[_USED]
            half[at] = unit
            half[top - unit * _UNIT] = 0
        at = top - unit * _UNIT
        units -= 1
    unit = half[at]
    half[at] = 0
    while unit:
        at = top - unit * _UNIT
        after = half[at]
        half[at] = word[_FREE]
        word[_FREE] = unit
        word[_FREE_COUNT] += 1
        unit = after
    return 1


@micropython.viper
def _pack(i: int, bits: int, memory: ptr16, words: ptr32, chunk: int, at: int, start: int, count: int):
    """Put what the chunk's bytes do not hold of `count` codes, words[start] on, into its units from frame `at` on.

    What the units hold of the frames behind is lost. (`i` and `bits` are parameters because viper keeps the first two
    in registers on ARM; what is passed does not matter.)
    """
    end = start + count
    shift = 0
    unit = memory[chunk + _LINK]
    while unit:
        to = words[_HALVES] - unit * _UNIT
        unit = memory[to]
        to += 1 + (at >> 3)
        place = (at & 7) << 1
        bits = memory[to] & (1 << place) - 1
        i = start
        while i < end:
            if place == 0 and end - i >= 8:
                bits = words[i] >> shift & 3
                bits |= (words[i + 1] >> shift & 3) << 2
                bits |= (words[i + 2] >> shift & 3) << 4
                bits |= (words[i + 3] >> shift & 3) << 6
                bits |= (words[i + 4] >> shift & 3) << 8
                bits |= (words[i + 5] >> shift & 3) << 10
                bits |= (words[i + 6] >> shift & 3) << 12
                bits |= (words[i + 7] >> shift & 3) << 14
                memory[to] = bits
                i += 8
                to += 1
                bits = 0
                continue
            bits |= (words[i + 0] >> shift & 3) << place
            i += 1
            place += 2
            if place == 16 or i == end:
                memory[to] = bits
                to += 1
                bits = 0
                place = 0
        shift += 2


if CPYTHON:

    def _fetch(words, frame, at, count):
        """Bring the `count` DWORDs at frame[at] into RUN."""
        words[_RUN : _RUN + count] = array("i", bytes(frame[at : at + 4 * count]))

    def _changes(words, i, memory, to, count):
        """Codes of `count` positions from words[i] on, which follow on the two before, into the bytes from `to` on.

        0 if all are within -64 to 63.
        """
        plane = ptr8(memory)
        wide = 0
        for k in range(count):
            code = words[i + k] - words[i + k - 1] - words[i + k - 1] + words[i + k - 2]
            plane[to + k] = code & 0xFF
            wide |= code + 64
        return 1 if wide >> 7 else 0

else:

    @micropython.viper
    def _fetch(words: ptr32, frame: ptr8, at: int, count: int):
        # Viper keeps the first two parameters in registers on ARM: the places. Words are read where they are whole.
        words = ptr32(int(words) + _RUN * 4)
        at += int(frame)
        frame = ptr8(at & -4)
        at &= 3
        if at == 0:
            while count >= 4:
                words[0] = ptr32(frame)[0]
                words[1] = ptr32(frame)[1]
                words[2] = ptr32(frame)[2]
                words[3] = ptr32(frame)[3]
                words = ptr32(int(words) + 16)
                frame = ptr8(int(frame) + 16)
                count -= 4
        elif at == 1:
            while count >= 4:
                words[0] = frame[1] | ptr16(frame)[1] << 8 | ptr32(frame)[1] << 24
                words[1] = frame[5] | ptr16(frame)[3] << 8 | ptr32(frame)[2] << 24
                words[2] = frame[9] | ptr16(frame)[5] << 8 | ptr32(frame)[3] << 24
                words[3] = frame[13] | ptr16(frame)[7] << 8 | ptr32(frame)[4] << 24
                words = ptr32(int(words) + 16)
                frame = ptr8(int(frame) + 16)
                count -= 4
        elif at == 2:
            while count >= 4:
                words[0] = ptr16(frame)[1] | ptr32(frame)[1] << 16
                words[1] = ptr16(frame)[3] | ptr32(frame)[2] << 16
                words[2] = ptr16(frame)[5] | ptr32(frame)[3] << 16
                words[3] = ptr16(frame)[7] | ptr32(frame)[4] << 16
                words = ptr32(int(words) + 16)
                frame = ptr8(int(frame) + 16)
                count -= 4
        else:
            while count >= 4:
                words[0] = frame[3] | ptr32(frame)[1] << 8
                words[1] = frame[7] | ptr32(frame)[2] << 8
                words[2] = frame[11] | ptr32(frame)[3] << 8
                words[3] = frame[15] | ptr32(frame)[4] << 8
                words = ptr32(int(words) + 16)
                frame = ptr8(int(frame) + 16)
                count -= 4
        frame = ptr8(int(frame) + at)
        while count > 0:
            words[0] = frame[0] | frame[1] << 8 | frame[2] << 16 | frame[3] << 24
            words = ptr32(int(words) + 4)
            frame = ptr8(int(frame) + 4)
            count -= 1

    @micropython.viper
    def _changes(words: ptr32, i: int, memory: ptr8, to: int, count: int) -> int:
        # Of the two registers that viper has for locals on ARM `words` holds the place, `i` the code.
        words = ptr32(int(words) + (i - 2 << 2))
        memory = ptr8(int(memory) + to)
        wide = 0
        while count >= 4:
            i = words[2] - words[1] - words[1] + words[0]
            memory[0] = i
            wide |= i + 64
            i = words[3] - words[2] - words[2] + words[1]
            memory[1] = i
            wide |= i + 64
            i = words[4] - words[3] - words[3] + words[2]
            memory[2] = i
            wide |= i + 64
            i = words[5] - words[4] - words[4] + words[3]
            memory[3] = i
            wide |= i + 64
            words = ptr32(int(words) + 16)
            memory = ptr8(int(memory) + 4)
            count -= 4
        while count > 0:
            i = words[2] - words[1] - words[1] + words[0]
            memory[0] = i
            wide |= i + 64
            words = ptr32(int(words) + 4)
            memory = ptr8(int(memory) + 1)
            count -= 1
        return 1 if wide >> 7 else 0


@micropython.viper
def _append(i: int, end: int, memory, words, motor: int, at: int, stop: int) -> int:
    """Pack RUN into frames `at` to `stop`, which follow on frames sent without a gap, if their chunks need no units.

    0, and nothing has happened, if they do, or might. (`i` and `end`: as for _pack().)
    """
    half = ptr16(memory)
    word = ptr32(words)
    word[_RUN - 2] = word[motor + _BEFORE]
    word[_RUN - 1] = word[motor + _LAST]
    i = _RUN
    while at < stop:
        chunk = word[motor + _REGION] + (at >> 7) * _CHUNK
        within = at & 127
        end = i + _FRAMES - within
        if end > i + stop - at:
            end = i + stop - at
        at += end - i
        if within > 1:
            value = word[i - 1]
            velocity = value - word[i - 2]  # wraps
        else:
            # The chunk's velocity is that from its first frame to its second: the codes of both are 0.
            i -= within
            value = word[i + 0]
            velocity = 0
            if i + 1 < end:
                velocity = word[i + 1] - value  # wraps
        # From here no way in small changes to 2^29: all of what follows fits a word.
        if (value ^ value >> 31) >> 28 | (velocity ^ velocity >> 31) >> 20:
            return 0
        if within < 2:
            half[chunk + _BASE] = value - velocity & 0xFFFF
            half[chunk + _BASE + 1] = value - velocity >> 16 & 0xFFFF
            half[chunk + _VELOCITY] = velocity & 0xFFFF
            half[chunk + _VELOCITY + 1] = velocity >> 16 & 0xFFFF
            half[chunk + _LINK] = 0
            half[chunk + _CODES] = 0
            within = 2
            i += 2
            if i > end:
                i = end
        if half[chunk + _LINK]:
            return 0
        if int(_changes(words, i, memory, 2 * (chunk + _CODES) + within, end - i)):
            return 0
        i = end
    word[motor + _LAST] = word[i - 1]
    word[motor + _BEFORE] = word[i - 2]
    return 1


@micropython.viper
def _encode(i: int, code: int, memory, words, chunk: int) -> int:
    """Pack VALUES into the chunk; 0 when DRY finds that the pool has no room for it. VALUES are lost.

    (`i` and `code`: as for _pack().)
    """
    half = ptr16(memory)
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    end = _VALUES + _FRAMES
    i = _VALUES
    while i < end and word[i] == unsent:
        i += 1
    base = 0
    first = 0
    if i < end:
        base = word[i]
        i += 1
        while i < end and word[i] == unsent:
            i += 1
        if i < end:
            first = word[i] - base  # wraps
        base -= first  # wraps
    value = base
    velocity = first
    far = 0
    most = 0
    i = _VALUES
    while i < end:
        code = word[i]
        if code != unsent:
            far |= code ^ code >> 31
            code -= value  # wraps
            value += code  # wraps
            code -= velocity  # wraps
            velocity += code  # wraps
            sign = code >> 31
            most |= (code ^ sign) - sign  # wraps
        i += 1
    bits = 7  # of a code, without its sign
    if far >> 29 and most | first:
        bits = 31
    while bits < 31 and most >> bits:
        bits += 2
    if int(_resize(memory, words, chunk, bits - 7 >> 1)) == 0:
        return 0
    if word[_DRY]:
        return 1
    half[chunk + _BASE] = base & 0xFFFF
    half[chunk + _BASE + 1] = base >> 16 & 0xFFFF
    half[chunk + _VELOCITY] = first & 0xFFFF
    half[chunk + _VELOCITY + 1] = first >> 16 & 0xFFFF
    plane = ptr8(memory)
    to = 2 * (chunk + _CODES)
    i = _VALUES
    while i < end:
        code = word[i]
        if code == unsent:
            code = -1 << bits
        elif bits < 31:
            code -= base
            base += code
            code -= first
            first += code
        plane[to] = code & 0xFF
        word[i] = code >> 8
        to += 1
        i += 1
    _pack(0, 0, memory, words, chunk, 0, _VALUES, _FRAMES)
    return 1


@micropython.viper
def _fill(memory, words, chunk: int, position: int, codes: int):
    """Make every frame of the chunk the position words[position], or, with NOT_SENT as its codes, not sent."""
    half = ptr16(memory)
    word = ptr32(words)
    _resize(memory, words, chunk, 0)
    if word[_DRY]:
        return
    half[chunk + _BASE] = word[position + 0] & 0xFFFF
    half[chunk + _BASE + 1] = word[position + 0] >> 16 & 0xFFFF
    half[chunk + _VELOCITY] = 0
    half[chunk + _VELOCITY + 1] = 0
    at = chunk + _CODES
    end = chunk + _CHUNK
    while at < end:
        half[at] = codes
        half[at + 1] = codes
        half[at + 2] = codes
        half[at + 3] = codes
        at += 4


@micropython.viper
def _read(frame: int, code: int, memory: ptr16, words: ptr32, motor: int, index: int, count: int, to: ptr32, k: int):
    """Positions of `count` frames from `index` on into to[k], to[k + 1], ...; -2^31 for a frame not sent.

    Outside of the upload that of the nearest frame. The cursor comes to lie where a window of five frames that moves
    with these begins. (`frame` and `code`: as for _pack().)
    """
    plane = ptr8(memory)
    top = words[_HALVES]
    unsent = -1
    unsent <<= 31
    frame = words[motor + _CURSOR]
    value = words[motor + _AT]
    velocity = words[motor + _PACE]
    shown = value
    chunk = words[motor + _REGION] + (frame >> 7) * _CHUNK
    mark = index
    if count > 5:
        mark += count - 5
    while count > 0:
        want = index
        if want < 0:
            want = 0
        elif want >= words[_COUNT]:
            want = words[_COUNT] - 1
        if want >> 7 != frame >> 7 or frame - want > want & 127:
            frame = (want & -128) - 1
            chunk = words[motor + _REGION] + (want >> 7) * _CHUNK
            value = memory[chunk + _BASE] | ((memory[chunk + _BASE + 1] ^ 0x8000) - 0x8000) << 16
            velocity = memory[chunk + _VELOCITY] | ((memory[chunk + _VELOCITY + 1] ^ 0x8000) - 0x8000) << 16
        while frame != want:
            back = 1
            if frame < want:
                back = 0
                frame += 1
            code = plane[2 * (chunk + _CODES) + (frame & 127)]
            unit = memory[chunk + _LINK]
            bits = 8
            if unit == 0:
                code = (code ^ 0x80) - 0x80
            while unit:
                at = top - unit * _UNIT
                unit = memory[at]
                more = memory[at + 1 + ((frame & 127) >> 3)] >> ((frame & 7) << 1) & 3
                if unit == 0:
                    more = (more ^ 2) - 2  # the sign
                code |= more << bits
                bits += 2
            if back and bits == 32:  # no way back: once more from the chunk's start
                frame = (want & -128) - 1
            elif back:
                value -= velocity
                velocity -= code
                frame -= 1
            elif code == -1 << bits - 1:
                shown = unsent
                continue
            elif bits == 32:
                value = code
            else:
                velocity += code
                value += velocity
            shown = value
        to[k] = shown
        if index == mark:
            words[motor + _CURSOR] = frame
            words[motor + _AT] = value
            words[motor + _PACE] = velocity
        k += 1
        index += 1
        count -= 1


@micropython.viper
def _unpack(memory, words, motor: int, at: int):
    """VALUES of the chunk that begins at frame `at`."""
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    count = word[motor + _PAST] - at
    if count > _FRAMES:
        count = _FRAMES
    if count > 0:
        word[motor + _CURSOR] = -1
        _read(0, 0, memory, words, motor, at, count, words, _VALUES)
        word[motor + _CURSOR] = -1
    i = _VALUES
    if count > 0:
        i += count
    while i < _VALUES + _FRAMES:
        word[i] = unsent
        i += 1


@micropython.viper
def _write(i: int, to: int, memory, words, motor: int, index: int, count: int, end: int) -> int:
    """Put the `count` positions of RUN in from `index` on, the last again until `end`; 0 when DRY finds no room.

    (`i` and `to`: as for _pack().)
    """
    word = ptr32(words)
    stop = index + count
    last = _RUN + count - 1
    past = word[motor + _PAST]
    at = (index if index < past else past) & -128
    while at < end:
        chunk = word[motor + _REGION] + (at >> 7) * _CHUNK
        behind = at + _FRAMES
        if at >= past:
            ptr16(memory)[chunk + _LINK] = 0
        if at >= stop:  # from here on the motor is still
            _fill(memory, words, chunk, last, 0)
        elif at >= past and behind <= index:
            _fill(memory, words, chunk, last, _NOT_SENT)
        else:
            if index > at or end < behind:
                _unpack(memory, words, motor, at)
            i = _RUN
            to = _VALUES + index - at
            if index < at:
                i += at - index
                to = _VALUES
            stretch = to + last + 1 - i
            if stretch > _VALUES + _FRAMES:
                stretch = _VALUES + _FRAMES
            while to < stretch:
                word[to] = word[i + 0]
                i += 1
                to += 1
            stretch = _VALUES + end - at
            if stretch > _VALUES + _FRAMES:
                stretch = _VALUES + _FRAMES
            while to < stretch:
                word[to] = word[last]
                to += 1
            if int(_encode(0, 0, memory, words, chunk)) == 0:
                return 0
        at = behind
    return 1


@micropython.viper
def _has_lowest(i: int, lowest: int, words: ptr32, count: int) -> int:
    """Whether -2^31, which stands for a frame not sent, is in RUN. (`i` and `lowest`: as for _pack().)"""
    lowest = -1
    lowest <<= 31
    i = _RUN + count
    while i > _RUN:
        i -= 1
        if words[i + 0] == lowest:
            return 1
    return 0


@micropython.viper
def _hold(memory, words, motor: int) -> int:
    """Give frames not sent the position before them, the leading ones the first; 0 when DRY finds no room."""
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    past = word[motor + _PAST]
    begin = 0
    if word[motor + _SENT] > 0:
        begin = word[motor + _SENT] - 1 & -128
    value = unsent
    at = begin
    while value == unsent:
        _unpack(memory, words, motor, at)
        i = _VALUES
        while i < _VALUES + _FRAMES and value == unsent:
            value = word[i]
            i += 1
        at += _FRAMES
    at = begin
    while at < word[_COUNT]:
        chunk = word[motor + _REGION] + (at >> 7) * _CHUNK
        if at >= past:
            word[_RUN] = value
            ptr16(memory)[chunk + _LINK] = 0
            _fill(memory, words, chunk, _RUN, 0)
        else:
            _unpack(memory, words, motor, at)
            gaps = 0
            end = _VALUES + _FRAMES  # or that of the upload: what lies behind takes no units
            if word[_COUNT] - at < _FRAMES:
                end = _VALUES + word[_COUNT] - at
            i = _VALUES
            while i < end:
                if word[i] == unsent:
                    word[i] = value
                    gaps = 1
                else:
                    value = word[i]
                i += 1
            if gaps:
                if int(_encode(0, 0, memory, words, chunk)) == 0:
                    return 0
        at += _FRAMES
    return 1


def bytes_for(motors, frames):
    """The memory that makes UploadStore.capacity_frames(motors) at least `frames`."""
    return 2 * motors * _PER_CHUNK * ((frames + _FRAMES - 1) // _FRAMES)


class UploadStore:
    """Takes in an uploaded move and gives its positions.

    `state` is EMPTY, LOADING or READY, `start` and `end` are the first and the last scene frame. A request that is
    refused changes nothing (field note 5.3). Motors are counted from 0.
    """

    def __init__(self, motors, memory_bytes=0):
        """For `motors` motors; `memory_bytes` as for take(), 0: not yet."""
        self.motors = motors
        self._limit = 0
        self._memory = None
        self._words = array("i", [0] * (_MOTOR + _MOTOR_WORDS * motors))
        self._words[_MOTORS] = motors
        self.clear()
        if memory_bytes:
            self.take(memory_bytes)

    def take(self, memory_bytes):
        """Take that much memory and keep it; ValueError if not a chunk for each motor fits. Allocates one block."""
        self._words[_HALVES] = memory_bytes // 2
        self._limit = self.capacity_frames(self.motors)
        if self._limit < 1:
            raise ValueError(
                "an upload of %d motors needs %d bytes or more, not %d"
                % (self.motors, bytes_for(self.motors, 1), memory_bytes)
            )
        # On the board a bytearray is what the heap gives without a copy.
        self._memory = array("H", bytes(memory_bytes // 2 * 2)) if CPYTHON else bytearray(memory_bytes // 2 * 2)
        self.clear()

    def capacity_frames(self, motors):
        """Frames that fit if this many motors have data and no steps per frame change by more than 511 at once."""
        return self._words[_HALVES] // (motors * _PER_CHUNK) * _FRAMES

    def clear(self):
        """Forget the upload."""
        self.state = EMPTY
        self.start = 0
        self.end = 0
        words = self._words
        words[_BOTTOM] = 0
        words[_USED] = 0
        words[_FREE] = 0
        words[_FREE_COUNT] = 0
        words[_DRY] = 0
        words[_COUNT] = 0
        words[_STATE] = EMPTY
        for motor in range(_MOTOR, len(words), _MOTOR_WORDS):
            words[motor + _REGION] = -1

    def begin(self, start, end):
        """Begin the upload of scene frames `start` to `end` (spec: MSG_RT_UPLOAD_MOVE_BEGIN); the old one is gone.

        Frame numbers are small integers and may be negative. ERR_RANGE for more frames than fit, an end before the
        start, and frames beyond ± FARTHEST_FRAME.
        """
        if not (-FARTHEST_FRAME <= start <= end <= FARTHEST_FRAME) or end - start >= self._limit:
            return ERR_RANGE
        self.clear()
        self.state = LOADING
        self.start = start
        self.end = end
        self._words[_COUNT] = end - start + 1
        self._words[_STATE] = LOADING
        return OK

    @micropython.viper
    def section(self, motor: int, index: int, last: int, reader, offset: int, count: int) -> int:
        """Store `count` positions of a motor from frame `index` on (spec: MSG_RT_UPLOAD_MOVE_AXIS).

        They are the DWORDs at payload offset `offset` of the reader's frame; those past the end of the range are
        ignored (field note 5.3). If `last`, the final one also goes to every frame after it, sent before or not.
        Sections may come in any order and again: what comes last counts.
        ERR_GENERAL unless an upload has begun; ERR_RANGE for a section that begins outside it, for a `last` section
        without a position, for the position -2^31, and when what changes from frame to frame needs more memory than
        there is.
        """
        memory = self._memory
        words = self._words
        word = ptr32(words)
        frames = word[_COUNT]
        if word[_STATE] != LOADING:
            return int(ERR_GENERAL)
        if motor < 0 or motor >= word[_MOTORS] or index < 0 or index >= frames:
            return int(ERR_RANGE)
        if count > frames - index:
            count = frames - index
        if count < 0 or count > MOST_POSITIONS:
            return int(ERR_RANGE)
        if count == 0:
            return int(ERR_RANGE) if last else int(OK)
        _fetch(words, reader.buffer, int(reader.payload) + offset, count)
        motor = _MOTOR + motor * _MOTOR_WORDS
        bottom = word[_BOTTOM]
        fresh = word[motor + _REGION] < 0
        if fresh:
            size = (frames + _FRAMES - 1 >> 7) * _CHUNK
            if bottom + size > word[_HALVES] - word[_USED] * _UNIT:
                return int(ERR_RANGE)
            word[_BOTTOM] = bottom + size
            word[motor + _REGION] = bottom
            word[motor + _SENT] = 0
            word[motor + _PAST] = 0
            word[motor + _LAST] = 0
            word[motor + _BEFORE] = 0
        past = word[motor + _PAST]
        stop = index + count
        end = frames if last else stop
        if index == past and index == word[motor + _SENT] and end == stop:
            if int(_append(0, 0, memory, words, motor, index, stop)):
                word[motor + _SENT] = stop
                word[motor + _PAST] = stop
                return int(OK)
        fits = 0
        if int(_has_lowest(0, 0, words, count)) == 0:
            fits = 1
            if int(_room(words)) < ((stop - 1 >> 7) - (index >> 7) + 2) * _MOST_UNITS:
                word[_DRY] = 1
                word[_NEED] = 0
                fits = int(_write(0, 0, memory, words, motor, index, count, end))
                word[_DRY] = 0
        if fits == 0:
            if fresh:
                word[_BOTTOM] = bottom
                word[motor + _REGION] = -1
            return int(ERR_RANGE)
        _write(0, 0, memory, words, motor, index, count, end)
        if end > past:
            past = end
            word[motor + _PAST] = end
        if index <= word[motor + _SENT] and end > word[motor + _SENT]:
            word[motor + _SENT] = end
        word[motor + _CURSOR] = -1
        _read(0, 0, memory, words, motor, past - 2, 2, words, motor + _BEFORE)
        word[motor + _CURSOR] = -1
        return int(OK)

    def finish(self):
        """End the upload (spec: MSG_RT_UPLOAD_MOVE_END).

        A frame that has not been sent holds the position of the frame before it, and before the first frame sent, of
        that one. ERR_GENERAL unless an upload has begun; ERR_RANGE when that needs more memory than there is.
        """
        if self.state == EMPTY:
            return ERR_GENERAL
        if self.state == LOADING:
            if not self._hold(1):
                return ERR_RANGE
            self._hold(0)
            self._words[_STATE] = READY
            self.state = READY
        return OK

    def _hold(self, dry):
        words = self._words
        words[_NEED] = 0
        words[_DRY] = dry
        fits = 1
        for motor in range(_MOTOR, len(words), _MOTOR_WORDS):
            if words[motor + _REGION] >= 0 and words[motor + _SENT] < words[_COUNT] and fits:
                fits = _hold(self._memory, words, motor)
            words[motor + _CURSOR] = -1
        words[_DRY] = 0
        return fits

    def has(self, motor):
        """Whether the motor has uploaded positions."""
        return self._words[_MOTOR + motor * _MOTOR_WORDS + _REGION] >= 0

    def position(self, motor, index, words, k):
        """Put the motor's position at frame `index` into words[k]. As for positions()."""
        return self.positions(motor, index, 1, words, k)

    @micropython.viper
    def positions(self, motor: int, index: int, count: int, words, k: int) -> bool:
        """Put the positions of `count` frames from `index` on into the array('i') `words` from words[k] on.

        Before the first frame stands the position of the first, beyond the last that of the last. False, and nothing
        written, unless the upload is READY and the motor has data.
        """
        own = self._words
        word = ptr32(own)
        motor = _MOTOR + motor * _MOTOR_WORDS
        if word[motor + _REGION] < 0 or word[_STATE] != READY:
            return False
        _read(0, 0, self._memory, own, motor, index, count, words, k)
        return True
