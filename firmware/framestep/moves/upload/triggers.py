"""The uploaded triggers of a move: which outputs are on at which frame.

Triggers are bits, in units of the pool that positions use as well (chunks.py). For each bit of
VALUES a unit has 224 frames; if the bit is off in all of them, there is no unit. So a trigger on
every frame takes 0.15 bytes a frame for each output. A unit, 17 half words:

    link | block, of 224 frames | number of the bit | 14 half words, the first frame lowest

The units form one chain, sorted by block.

Nothing but the constructor and allocate() allocates. Frame indexes are small integers. MASK and
VALUES go through arrays, since they need not be small. An index counts from 0 at the first frame of
the range (field note 5.1).
"""

from array import array

from framestep.base.native import const, micropython, ptr8, ptr16, ptr32
from framestep.base.results import ERR_GENERAL, ERR_RANGE, OK
from framestep.moves.upload.chunks import UNIT, fits, room
from framestep.moves.upload.light_codec import forget, locate, take
from framestep.moves.upload.light_levels import EMPTY, LOADING, MOST_FRAMES, READY

# Words of the block
_STATE = const(0)
_FRAMES = const(1)  # of the range
_HEAD = const(2)  # the first unit, 0: none
_CURSOR = const(3)  # a unit before the block used last, 0: none
_SENT = const(4)  # whether a message has come
_MASK = const(5)
_VALUE = const(6)  # of the frame being stored; it need not be a small integer
_WORDS = const(7)

_BLOCK_FRAMES = const(224)
_BLOCK = const(1)  # half words of a unit
_BIT = const(2)
_BITS = const(3)


@micropython.viper
def _inside(sent: ptr8, i: int, frames: int) -> int:
    """Return whether the frame at sent[i], at least 0, is one of the range's `frames`."""
    if sent[i + 3]:
        return 0
    frame = sent[i] | (sent[i + 1] << 8) | (sent[i + 2] << 16)
    return 1 if frame < frames else 0


@micropython.viper
def _before(words, memory, own, block: int) -> int:
    """Return the last unit of the blocks before `block`, 0 if there is none."""
    half = ptr16(memory)
    word = ptr32(own)
    unit = word[_CURSOR]
    if unit and half[int(locate(words, unit)) + _BLOCK] >= block:
        unit = 0
    after = half[int(locate(words, unit))] if unit else word[_HEAD]
    while after:
        at = int(locate(words, after))
        if half[at + _BLOCK] >= block:
            break
        unit = after
        after = half[at]
    word[_CURSOR] = unit
    return unit


@micropython.viper
def _insert(words, memory, own, before: int, block: int, bit: int):
    """Take a unit for a bit of a block, off in all frames, and insert it after `before`."""
    half = ptr16(memory)
    word = ptr32(own)
    unit = int(take(memory, words))
    at = int(locate(words, unit))
    i = at + UNIT
    while i > at:
        i -= 1
        half[i] = 0
    half[at + _BLOCK] = block
    half[at + _BIT] = bit
    if before:
        i = int(locate(words, before))
        half[at] = half[i]
        half[i] = unit
    else:
        half[at] = word[_HEAD]
        word[_HEAD] = unit


@micropython.viper
def _reserve(words, memory, own, frame: int) -> int:
    """Get a unit for each bit of _VALUE at this frame. Return 0 if there is no memory for one."""
    half = ptr16(memory)
    block = frame // _BLOCK_FRAMES
    before = int(_before(words, memory, own, block))
    unit = half[int(locate(words, before))] if before else ptr32(own)[_HEAD]
    has = 0
    while unit:
        at = int(locate(words, unit))
        if half[at + _BLOCK] != block:
            break
        # -1 << 31, as 1 << 31 would exceed 32 bits
        bit = half[at + _BIT]
        has |= (-1 if bit == 31 else 1) << bit
        unit = half[at]
    has = ptr32(own)[_VALUE] & (has ^ -1)
    bit = 0
    while bit < 32:
        if (has >> bit) & 1:
            if int(room(words)) == 0:
                return 0
            _insert(words, memory, own, before, block, bit)
        bit += 1
    return 1


@micropython.viper
def _write(words, memory, own, frame: int):
    """Set the bits of a frame, which have units, to the bits of _VALUE."""
    half = ptr16(memory)
    block = frame // _BLOCK_FRAMES
    unit = int(_before(words, memory, own, block))
    unit = half[int(locate(words, unit))] if unit else ptr32(own)[_HEAD]
    value = ptr32(own)[_VALUE]
    frame -= block * _BLOCK_FRAMES
    mask = 1 << (frame & 15)
    frame >>= 4
    while unit:
        at = int(locate(words, unit))
        if half[at + _BLOCK] != block:
            break
        i = at + _BITS + frame
        if (value >> half[at + _BIT]) & 1:
            half[i] = half[i] | mask
        else:
            half[i] = half[i] & (mask ^ 0xFFFF)
        unit = half[at]


@micropython.viper
def _sweep(words, memory, own):
    """Give back the units whose bit is off in all frames."""
    half = ptr16(memory)
    word = ptr32(own)
    word[_CURSOR] = 0
    link = 0
    unit = word[_HEAD]
    while unit:
        at = int(locate(words, unit))
        after = half[at]
        on = 0
        i = at + UNIT
        while i > at + _BITS:
            i -= 1
            on |= half[i]
        if on:
            link = at
        else:
            forget(memory, words, unit)
            if link:
                half[link] = after
            else:
                word[_HEAD] = after
        unit = after


class Triggers:
    """Store of the triggers of an uploaded move.

    `ready`: whether a finished upload has triggers; until finish() none are read.
    """

    def __init__(self, store=None):
        """store: as for allocate(), None: allocate later."""
        self._own = array("i", [0] * _WORDS)
        self._memory = self._words = None
        self.clear()
        if store:
            self.allocate(store)

    def allocate(self, store):
        """Share the memory of an UploadStore, which must be allocated.

        Whenever the store is emptied, this must be emptied as well, by begin() or clear().
        """
        self._memory = store.memory
        self._words = store.words

    def clear(self):
        """Drop the upload."""
        own = self._own
        for i in range(_WORDS):
            own[i] = 0
        own[_STATE] = EMPTY
        self.ready = False

    def begin(self, frames):
        """Begin the upload of a range of `frames` frames; drops the old one."""
        self.clear()
        self._own[_FRAMES] = min(frames, MOST_FRAMES)
        self._own[_STATE] = LOADING

    @micropython.viper
    def store(self, mask, source, at: int, count: int) -> int:
        """Store the values of `count` frames (spec: MSG_RT_UPLOAD_MOVE_TRIGGERS).

        mask: an array('i') with MASK in its first word. The pairs of FRAME and VALUES are DWORDs
        from source[at] on. Frames that are not sent have no trigger on. For a frame sent again, and
        for MASK, the latest message counts. ERR_GENERAL unless an upload has begun. ERR_RANGE if
        the first frame is beyond the range, if any frame is before it, and if they need more memory
        than there is. A refused message changes nothing.
        """
        own = self._own
        words = self._words
        memory = self._memory
        word = ptr32(own)
        if word[_STATE] != LOADING:
            return int(ERR_GENERAL)
        if count < 0:
            return int(ERR_RANGE)
        sent = ptr8(source)
        end = at + count * 8
        i = at
        while i < end:
            if sent[i + 3] >> 7:
                return int(ERR_RANGE)
            if i == at and int(_inside(source, i, word[_FRAMES])) == 0:
                return int(ERR_RANGE)
            i += 8
        # twice: the first time only to get memory for all of them
        writing = 0
        while writing < 2:
            i = at
            while i < end:
                if int(_inside(source, i, word[_FRAMES])):
                    frame = sent[i] | (sent[i + 1] << 8) | (sent[i + 2] << 16)
                    word[_VALUE] = (
                        sent[i + 4]
                        | (sent[i + 5] << 8)
                        | (sent[i + 6] << 16)
                        | (((sent[i + 7] ^ 0x80) - 0x80) << 24)
                    )
                    if writing:
                        _write(words, memory, own, frame)
                    elif int(_reserve(words, memory, own, frame)) == 0:
                        _sweep(words, memory, own)
                        fits(words, int(room(words)) + 1)  # notes a need of at least that much
                        return int(ERR_RANGE)
                i += 8
            writing += 1
        word[_MASK] = ptr32(mask)[0]
        word[_SENT] = 1
        return int(OK)

    def finish(self):
        """End the upload, if one has begun: it can then be played."""
        own = self._own
        if own[_STATE] == LOADING:
            own[_STATE] = READY
            self.ready = own[_SENT] > 0

    @micropython.viper
    def mask_to(self, words, at: int):
        """Put the MASK of the triggers into the array('i') words[at]; 0 if there are none."""
        word = ptr32(self._own)
        to = ptr32(words)
        to[at] = word[_MASK] if word[_STATE] == READY else 0

    @micropython.viper
    def values_to(self, index: int, words, at: int):
        """Put the VALUES of frame `index` as sent into words[at]; 0 if there are none."""
        own = self._own
        memory = self._memory
        shared = self._words
        word = ptr32(own)
        to = ptr32(words)
        to[at] = 0
        if word[_STATE] != READY or index < 0 or index >= word[_FRAMES]:
            return
        half = ptr16(memory)
        block = index // _BLOCK_FRAMES
        unit = int(_before(shared, memory, own, block))
        unit = half[int(locate(shared, unit))] if unit else word[_HEAD]
        index -= block * _BLOCK_FRAMES
        value = 0
        while unit:
            i = int(locate(shared, unit))
            if half[i + _BLOCK] != block:
                break
            if (half[i + _BITS + (index >> 4)] >> (index & 15)) & 1:
                value |= (-1 if half[i + _BIT] == 31 else 1) << half[i + _BIT]
            unit = half[i]
        to[at] = value
