"""The uploaded move: a position for every frame of every motor, in one block of memory taken at boot.

Memory. A motor gets a region when its first section comes; motors without data take none. A region is a row of
chunks of 64 frames:

    base, two half words | 64 half words, one a frame

base is even: the half words are differences from the frame before (the first from base), signed 16 bits. That holds
every move that a motor can follow at 24 frames/s, as it asks for less than 32768 steps from one frame to the next.
base is odd: some difference is greater; the half words are the low halves of the positions and base >> 1 is the place
of their high halves, taken from a pool that grows down from the end of the memory. A frame that has not been sent is
the difference -32768, or the position -2^31. Either is read in at most 64 steps.

So a frame costs 2.06 bytes a motor, and 4.06 where a chunk is kept whole.

Nothing but the constructor and take() allocates. Positions go through arrays, as they need not fit a small integer;
frame numbers and indexes are small integers. An index counts from 0 at the first frame of the range (field note 5.1).
"""

from array import array

from framestep.native import CPYTHON, const, micropython, ptr16, ptr32
from framestep.protocol.frames import copy_bytes
from framestep.protocol.messages import ERR_GENERAL, ERR_RANGE, OK

# States
EMPTY = const(0)  # no upload
LOADING = const(1)  # begun, not finished
READY = const(2)

MOST_POSITIONS = const(257)  # of a section: what the largest frame holds

_FRAMES = const(64)  # of a chunk
_CHUNK = const(66)  # half words of a chunk; its high halves in the pool take _FRAMES
_UNSENT = const(0x8000)
_RESERVE = const(64)  # this part of the memory is left for the pool when the capacity is computed
_FARTHEST = const(0x2000_0000)  # frame numbers lie within ± this, so that sums of them are small integers

# Words of the store's block
_BOTTOM = const(0)  # half words taken by regions
_TOP = const(1)  # lowest half word that the pool has taken since BEGIN
_FREE = const(2)  # first free entry of the pool, the others hang on it; half words / 64, 0: none
_FREE_COUNT = const(3)
_DRY = const(4)  # 0, or a chunk to write to instead: only NEED is counted
_NEED = const(5)  # entries that the changes so far would have taken from the pool
_COUNT = const(6)  # frames of the upload
_MOTORS = const(7)
_SPARE = const(8)  # the chunk for DRY
_STATE = const(9)  # the same as `state`
_VALUES = const(10)  # positions of a chunk
_RUN = const(74)  # positions of a section
_MOTOR = const(331)  # for each motor:
_REGION = const(0)  # where its chunks begin, half words; -1: no data
_MADE = const(1)  # chunks in use, from the first on
_SENT = const(2)  # frames sent without a gap, from the first on
_PAST = const(3)  # the frame after the last one sent
_LAST = const(4)  # the position sent for that last one
_MOTOR_WORDS = const(5)


@micropython.viper
def _prepare(memory: ptr16, region: int, made: int, needed: int, first: int, last: int):
    """Make the chunks from `made` to `needed` ones in which no frame has been sent.

    Those between `first` and `last` get no more than a base, as they will be overwritten whole.
    """
    while made < needed:
        at = region + made * _CHUNK
        memory[at] = 0
        memory[at + 1] = 0
        if made <= first or made == last:
            end = at + _CHUNK
            at += 2
            while at < end:
                memory[at] = _UNSENT
                memory[at + 1] = _UNSENT
                memory[at + 2] = _UNSENT
                memory[at + 3] = _UNSENT
                at += 4
        made += 1


@micropython.viper
def _append(i: int, step: int, words: ptr32, memory: ptr16, at: int, stop: int, motor: int) -> int:
    """Pack RUN into frames `at` to `stop`, when nothing has been sent from `at` on; 0 when a difference does not fit.

    In order, as uploads come: without looking back. (`i` and `step` are parameters because viper keeps the first two in
    registers on ARM; what is passed does not matter.)
    """
    region = words[motor + _REGION]
    value = words[motor + _LAST]
    i = words[motor + _PAST]
    step = 0  # 1: the chunk has a frame before `at`, and `value` is the last
    if at & 63 and i > 0 and i - 1 >> 6 == at >> 6:
        step = 1
    i = _RUN
    while at < stop:
        to = region + (at >> 6) * _CHUNK
        if words[i] < -_FARTHEST:  # from above that, no way to -2^31 in a chunk's small differences
            return 0
        if step == 0:
            value = words[i] & -2
            memory[to] = value & 0xFFFF
            memory[to + 1] = value >> 16 & 0xFFFF
        elif memory[to] & 1:
            return 0
        to += 2 + (at & 63)
        end = i + _FRAMES - (at & 63)
        if end > i + stop - at:
            end = i + stop - at
        at += end - i
        while i < end:
            step = words[i] - value
            if step > 32767:
                return 0
            if step < -32767:
                return 0
            memory[to] = step & 0xFFFF
            value = words[i]
            to += 1
            i += 1
        step = 0
    words[motor + _LAST] = value
    return 1


@micropython.viper
def _unsend(memory: ptr16, region: int, at: int, stop: int):
    """Take back what _append() has left; it has not touched a chunk that is kept whole."""
    while at < stop:
        chunk = region + (at >> 6) * _CHUNK
        if memory[chunk] & 1 == 0:
            memory[chunk + 2 + (at & 63)] = _UNSENT
        at += 1


@micropython.viper
def _decode(memory: ptr16, words: ptr32, at: int):
    """Unpack the chunk at `at` into VALUES."""
    value = memory[at] | ((memory[at + 1] ^ 0x8000) - 0x8000) << 16
    to = _VALUES
    end = _VALUES + _FRAMES
    at += 2
    if value & 1:
        high = value >> 1
        while to < end:
            words[to] = memory[at] | ((memory[high] ^ 0x8000) - 0x8000) << 16
            to += 1
            at += 1
            high += 1
        return
    unsent = -1
    unsent <<= 31
    while to < end:
        step = memory[at]
        if step == _UNSENT:
            words[to] = unsent
        else:
            value += (step ^ 0x8000) - 0x8000
            words[to] = value
        to += 1
        at += 1


@micropython.viper
def _room(words: ptr32) -> int:
    """Entries that the pool can still give."""
    return words[_FREE_COUNT] + (words[_TOP] - words[_BOTTOM] >> 6)


@micropython.viper
def _take(memory: ptr16, words: ptr32) -> int:
    """A new entry of the pool; there is one."""
    free = words[_FREE]
    if free:
        words[_FREE] = memory[free << 6]
        words[_FREE_COUNT] -= 1
        return free << 6
    words[_TOP] -= _FRAMES
    return words[_TOP]


@micropython.viper
def _release(memory: ptr16, words: ptr32, at: int):
    """Give back to the pool what the chunk at `at` has of it."""
    if memory[at] & 1 == 0:
        return
    if words[_DRY]:
        words[_NEED] -= 1
        return
    entry = (memory[at] | memory[at + 1] << 16) >> 1
    memory[entry] = words[_FREE]
    words[_FREE] = entry >> 6
    words[_FREE_COUNT] += 1


@micropython.viper
def _encode(memory, words, at: int) -> int:
    """Pack VALUES into the chunk at `at`; 0 when DRY finds that the pool has no room for it."""
    half = ptr16(memory)
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    dry = word[_DRY]
    chunk = dry if dry else at
    end = _VALUES + _FRAMES
    i = _VALUES
    while i < end and word[i] == unsent:
        i += 1
    base = 0
    if i < end:
        base = word[i] & -2
    value = base
    to = chunk + 2
    i = _VALUES
    while i < end:
        step = word[i]
        if step == unsent:
            step = _UNSENT
        else:
            step -= value
            if step > 32767 or step < -32767:
                break
            value += step
        half[to] = step & 0xFFFF
        to += 1
        i += 1
    if i == end:
        _release(memory, words, at)
        half[chunk] = base & 0xFFFF
        half[chunk + 1] = base >> 16 & 0xFFFF
        return 1
    old = half[at] & 1
    if dry:
        if old == 0:
            word[_NEED] += 1
        return 1 if word[_NEED] <= int(_room(words)) else 0
    if old:
        high = (half[at] | half[at + 1] << 16) >> 1
    else:
        high = int(_take(memory, words))
        half[at] = (high << 1 | 1) & 0xFFFF
        half[at + 1] = high >> 15
    to = at + 2
    i = _VALUES
    while i < end:
        value = word[i]
        half[to] = value & 0xFFFF
        half[high] = value >> 16 & 0xFFFF
        to += 1
        high += 1
        i += 1
    return 1


@micropython.viper
def _still(memory, words, at: int):
    """Make every frame of the chunk at `at` VALUES[0]."""
    _release(memory, words, at)
    value = ptr32(words)[_VALUES]
    if ptr32(words)[_DRY]:
        return
    half = ptr16(memory)
    half[at] = value & 0xFFFE
    half[at + 1] = value >> 16 & 0xFFFF
    end = at + _CHUNK
    at += 2
    first = at
    while at < end:
        half[at] = 0
        half[at + 1] = 0
        half[at + 2] = 0
        half[at + 3] = 0
        at += 4
    half[first] = value & 1


@micropython.viper
def _write(memory, words, motor: int, at: int, count: int, end: int) -> int:
    """Put the `count` positions of RUN in from `at` on, the last again until `end`; 0 when DRY finds no room."""
    word = ptr32(words)
    run = _RUN
    last = _RUN + count - 1
    region = word[motor + _REGION]
    if end >= word[motor + _PAST] and word[_DRY] == 0:
        word[motor + _LAST] = word[last]
    while at < end:
        chunk = region + (at >> 6) * _CHUNK
        i = _VALUES + (at & 63)
        stop = i + end - at
        if stop > _VALUES + _FRAMES:
            stop = _VALUES + _FRAMES
        at += stop - i
        if run > last and i == _VALUES:  # from here on the motor is still
            word[_VALUES] = word[last]
            _still(memory, words, chunk)
            continue
        if stop - i < _FRAMES:
            _decode(memory, words, chunk)
        while i < stop and run <= last:
            word[i] = word[run]
            run += 1
            i += 1
        while i < stop:
            word[i] = word[last]
            i += 1
        if int(_encode(memory, words, chunk)) == 0:
            return 0
    return 1


@micropython.viper
def _has_lowest(words: ptr32, count: int) -> int:
    """Whether -2^31, which stands for a frame not sent, is in RUN."""
    lowest = -1
    lowest <<= 31
    i = _RUN
    while i < _RUN + count:
        if words[i] == lowest:
            return 1
        i += 1
    return 0


@micropython.viper
def _hold(memory, words, motor: int, chunks: int) -> int:
    """Give frames not sent the position before them, the leading ones the first; 0 when DRY finds no room."""
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    end = _VALUES + _FRAMES
    value = unsent
    region = word[motor + _REGION]
    _prepare(memory, region, word[motor + _MADE], chunks, -1, -1)
    at = 0
    if word[motor + _SENT] > 0:
        at = word[motor + _SENT] - 1 >> 6
    chunk = at
    while chunk < chunks and value == unsent:
        _decode(memory, words, region + chunk * _CHUNK)
        i = _VALUES
        while i < end and value == unsent:
            value = word[i]
            i += 1
        chunk += 1
    past = word[motor + _PAST] + 63 >> 6
    while at < chunks:
        if at >= past:
            word[_VALUES] = value
            _still(memory, words, region + at * _CHUNK)
            at += 1
            continue
        _decode(memory, words, region + at * _CHUNK)
        gaps = 0
        i = _VALUES
        while i < end:
            if word[i] == unsent:
                word[i] = value
                gaps = 1
            else:
                value = word[i]
            i += 1
        if gaps:
            if int(_encode(memory, words, region + at * _CHUNK)) == 0:
                return 0
        at += 1
    return 1


@micropython.viper
def _read(memory: ptr16, to: ptr32, region: int, index: int, count: int, k: int, frames: int):
    """Positions of `count` frames from `index` on into to[k], to[k + 1], ...; beyond an end, that of the end."""
    value = 0
    high = 0
    at = 0  # half word of `frame`
    frame = -1
    while count > 0:
        want = index
        if want < 0:
            want = 0
        elif want >= frames:
            want = frames - 1
        if want >> 6 != frame >> 6:
            frame = want & -64
            at = region + (frame >> 6) * _CHUNK
            value = memory[at] | ((memory[at + 1] ^ 0x8000) - 0x8000) << 16
            high = 0
            if value & 1:
                high = value >> 1
            frame -= 1
            at += 1
        if high:
            at += want - frame
            frame = want
            value = memory[at] | ((memory[high + (want & 63)] ^ 0x8000) - 0x8000) << 16
        else:
            while frame < want:
                frame += 1
                at += 1
                value += (memory[at] ^ 0x8000) - 0x8000
        to[k] = value
        k += 1
        index += 1
        count -= 1


def bytes_for(motors, frames):
    """The memory that makes UploadStore.capacity_frames(motors) at least `frames`."""
    halves = motors * _CHUNK * ((frames + 63) // 64)
    return 2 * ((halves + _RESERVE - 2) // (_RESERVE - 1) * _RESERVE + _CHUNK)


class UploadStore:
    """Takes in an uploaded move and gives its positions.

    `state` is EMPTY, LOADING or READY, `start` and `end` are the first and the last scene frame. A request that is
    refused changes nothing (field note 5.3). Motors are counted from 0.
    """

    def __init__(self, motors, memory_bytes=0):
        """For `motors` motors; `memory_bytes` as for take(), 0: not yet."""
        self.motors = motors
        self._halves = 0  # of the memory; behind them lies the chunk for DRY
        self._limit = 0
        self._memory = None
        self._words = array("i", [0] * (_MOTOR + _MOTOR_WORDS * motors))
        self._bytes = memoryview(self._words).cast("B") if CPYTHON else self._words
        self._words[_MOTORS] = motors
        self.clear()
        if memory_bytes:
            self.take(memory_bytes)

    def take(self, memory_bytes):
        """Take that much memory and keep it; ValueError if not a chunk for each motor fits. Allocates one block."""
        halves = (memory_bytes // 2 - _CHUNK) // 64 * 64
        self._halves = halves
        chunks = self._chunks(self.motors)
        if chunks < 1:
            raise ValueError(
                "an upload of %d motors needs %d bytes or more, not %d"
                % (self.motors, bytes_for(self.motors, 1), memory_bytes)
            )
        self._limit = chunks * _FRAMES
        # On the board a bytearray is what the heap gives without a copy.
        self._memory = array("H", bytes(2 * (halves + _CHUNK))) if CPYTHON else bytearray(2 * (halves + _CHUNK))
        self._words[_SPARE] = halves
        self.clear()

    def _chunks(self, motors):
        return (self._halves - self._halves // _RESERVE) // (motors * _CHUNK)

    def capacity_frames(self, motors):
        """Frames that fit if this many motors have data and none jumps by more than 32767 steps from frame to frame."""
        return self._chunks(motors) * _FRAMES

    def clear(self):
        """Forget the upload."""
        self.state = EMPTY
        self.start = 0
        self.end = 0
        words = self._words
        words[_BOTTOM] = 0
        words[_TOP] = self._halves
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
        start, and frames beyond ± 2^29.
        """
        if not (-_FARTHEST < start <= end < _FARTHEST) or end - start >= self._limit:
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

        They are the DWORDs at payload offset `offset` of the reader's frame. If `last`, the final one also goes to
        every frame after it, sent before or not. Sections may come in any order and again: what comes last counts.
        ERR_GENERAL unless an upload has begun; ERR_RANGE for frames outside it, for a `last` section without a
        position, for the position -2^31, and when jumps from frame to frame need more memory than there is.
        """
        memory = self._memory
        words = self._words
        word = ptr32(words)
        frames = word[_COUNT]
        if word[_STATE] != LOADING:
            return int(ERR_GENERAL)
        if motor < 0 or motor >= word[_MOTORS] or index < 0 or index >= frames:
            return int(ERR_RANGE)
        if count < 0 or count > frames - index or count > MOST_POSITIONS:
            return int(ERR_RANGE)
        if count == 0:
            return int(ERR_RANGE) if last else int(OK)
        copy_bytes(self._bytes, _RUN * 4, reader.buffer, int(reader.payload) + offset, count * 4)
        motor = _MOTOR + motor * _MOTOR_WORDS
        bottom = word[_BOTTOM]
        fresh = word[motor + _REGION] < 0
        if fresh:
            size = (frames + 63 >> 6) * _CHUNK
            if bottom + size > word[_TOP]:
                return int(ERR_RANGE)
            word[_BOTTOM] = bottom + size
            word[motor + _REGION] = bottom
            word[motor + _MADE] = 0
            word[motor + _SENT] = 0
            word[motor + _PAST] = 0
        region = word[motor + _REGION]
        stop = index + count
        end = frames if last else stop
        made = word[motor + _MADE]
        needed = end + 63 >> 6
        if made < needed:
            _prepare(memory, region, made, needed, index >> 6, stop >> 6)
        stored = 0
        if index >= word[motor + _PAST] and end == stop:
            stored = int(_append(0, 0, words, memory, index, end, motor))
            if stored == 0:
                _unsend(memory, region, index, end)
        if stored == 0:
            if int(_has_lowest(words, count)) == 0:
                stored = 1
                if int(_room(words)) < (stop - 1 >> 6) - (index >> 6) + 1:
                    word[_DRY] = word[_SPARE]
                    word[_NEED] = 0
                    stored = int(_write(memory, words, motor, index, count, end))
                    word[_DRY] = 0
            if stored == 0:
                if fresh:
                    word[_BOTTOM] = bottom
                    word[motor + _REGION] = -1
                return int(ERR_RANGE)
            _write(memory, words, motor, index, count, end)
        if made < needed:
            word[motor + _MADE] = needed
        if index <= word[motor + _SENT] and end > word[motor + _SENT]:
            word[motor + _SENT] = end
        if end > word[motor + _PAST]:
            word[motor + _PAST] = end
        return int(OK)

    def finish(self):
        """End the upload (spec: MSG_RT_UPLOAD_MOVE_END).

        A frame that has not been sent holds the position of the frame before it, and before the first frame sent, of
        that one. ERR_GENERAL unless an upload has begun; ERR_RANGE when that needs more memory than there is.
        """
        if self.state == EMPTY:
            return ERR_GENERAL
        if self.state == LOADING:
            if not self._fill(self._halves):
                return ERR_RANGE
            self._fill(0)
            self._words[_STATE] = READY
            self.state = READY
        return OK

    def _fill(self, dry):
        words = self._words
        frames = words[_COUNT]
        words[_NEED] = 0
        words[_DRY] = dry
        fits = 1
        for motor in range(_MOTOR, len(words), _MOTOR_WORDS):
            if words[motor + _REGION] >= 0 and words[motor + _SENT] < frames and fits:
                fits = _hold(self._memory, words, motor, frames + 63 >> 6)
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
        own = ptr32(self._words)
        region = own[_MOTOR + motor * _MOTOR_WORDS + _REGION]
        if region < 0 or own[_STATE] != READY:
            return False
        _read(self._memory, words, region, index, count, k, own[_COUNT])
        return True
