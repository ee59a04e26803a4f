"""The uploaded light levels of a move.

Levels are kept as changes, sorted by frame, then by channel, 6 bytes each:

    key, a word:         frame << 10 | (channel - 1) << 1 | 1 if frames that have not been sent
                         begin here
    value, a half word:  level before | level from here on << 8

A channel takes one change when its first level comes, one for each frame at which its level differs
from the frame before, and one for each gap. A gap ends with a change even if the level stays the
same, and a channel that has not been sent up to the end of the range ends with a gap. Frames in a
gap have the level before it. The first change of a channel has its own level as the level before
it, too: the frames before have that level. Since each change has the level on either side, a step
in either direction reads the changes of one frame and nothing else.

Nothing but the constructor and allocate() allocates. Frame indexes, channels (1 to 512) and levels
are small integers. An index counts from 0 at the first frame of the range (field note 5.1).
"""

from array import array

from framestep.copying import move_halves, move_words
from framestep.native import CPYTHON, const, micropython, ptr8, ptr16, ptr32
from framestep.results import ERR_GENERAL, ERR_RANGE, OK

CHANNELS = const(512)
MOST_FRAMES = const(0x10_0000)  # later frames are ignored: their keys would not fit a small integer

# States, of light levels and of triggers
EMPTY = const(0)
LOADING = const(1)
READY = const(2)

_FRAME_SHIFT = const(10)
_CHANNEL_BITS = const(0x3FE)
_GAP = const(1)
_MARKED = const(3)  # a channel that has data, and io.lights.MARK
# State of a channel: a level, plus this in a gap; -1, which has the bit too, before its first
# change
_UNSENT = const(0x100)

# Words of the block
_STATE = const(0)
_FRAMES = const(1)  # of the range
_CHANGES = const(2)  # held
_CAPACITY = const(3)  # changes that fit
_IN_USE = const(4)  # channels that have data
# A section that is being stored
_TAG = const(5)  # its channel, as in keys
_START = const(6)  # its first frame
_STOP = const(7)  # the frame after its last
_FROM = const(8)  # the changes from this to that one lie at its frames or at STOP
_TO = const(9)
_DROP = const(10)  # those of them that are the channel's
_BEFORE = const(11)  # state of the channel before START
_AFTER = const(12)  # at STOP
_ADD = const(13)  # changes that come in
_WORDS = const(14)


@micropython.viper
def first_key(keys: ptr32, stride: int, shift: int, count: int, frame: int) -> int:
    """The first of `count` sorted keys, every `stride` words, with key >> shift >= `frame`."""
    low = 0
    while low < count:
        middle = (low + count) >> 1
        if keys[middle * stride] >> shift < frame:
            low = middle + 1
        else:
            count = middle
    return low


@micropython.viper
def _last_of(i: int, low: int, keys: ptr32, tag: int) -> int:
    """The channel's last change in `low` to `i`, or -1."""
    while i > low:
        i -= 1
        if keys[i] & _CHANNEL_BITS == tag:
            return i
    return -1


@micropython.viper
def _next_of(i: int, high: int, keys: ptr32, tag: int) -> int:
    """The channel's first change in `i` to `high`, or -1."""
    while i < high:
        if keys[i] & _CHANNEL_BITS == tag:
            return i
        i += 1
    return -1


@micropython.viper
def _count_of(i: int, high: int, keys: ptr32, tag: int) -> int:
    """How many of the changes in `i` to `high` are the channel's."""
    count = 0
    while i < high:
        if keys[i] & _CHANNEL_BITS == tag:
            count += 1
        i += 1
    return count


@micropython.viper
def _count_edges(at: int, level: int, source: ptr8, count: int) -> int:
    """How often the level differs from the one before within `count` bytes from source[at] on."""
    end = at + count
    level = source[at]
    edges = 0
    while at < end:
        if source[at] != level:
            level = source[at]
            edges += 1
        at += 1
    return edges


@micropython.viper
def _plan(words, keys, values, source, at: int, count: int) -> int:
    """What storing a section drops and adds; 0 when it does not fit.

    Changes nothing but the words of the section.
    """
    word = ptr32(words)
    tag = word[_TAG]
    held = word[_CHANGES]
    low = int(first_key(keys, 1, _FRAME_SHIFT, held, word[_START]))
    high = held
    if word[_STOP] < word[_FRAMES]:
        high = int(first_key(keys, 1, _FRAME_SHIFT, held, word[_STOP] + 1))
    word[_FROM] = low
    word[_TO] = high
    word[_DROP] = int(_count_of(low, high, keys, tag))
    before = -1
    i = int(_last_of(low, 0, keys, tag))
    if i >= 0:
        before = (ptr16(values)[i] >> 8) | ((ptr32(keys)[i] & _GAP) << 8)
    after = before
    if word[_DROP]:
        i = int(_last_of(high, low, keys, tag))
        after = (ptr16(values)[i] >> 8) | ((ptr32(keys)[i] & _GAP) << 8)
    word[_BEFORE] = before
    word[_AFTER] = after
    add = int(_count_edges(at, 0, source, count))
    if before != ptr8(source)[at]:
        add += 1
    if word[_STOP] < word[_FRAMES] and after != ptr8(source)[at + count - 1]:
        add += 1
    word[_ADD] = add
    return 1 if held - word[_DROP] + add <= word[_CAPACITY] else 0


@micropython.viper
def _drop(keys: ptr32, values: ptr16, i: int, high: int, tag: int):
    """Take the channel's changes in `i` to `high` out; the others move to the front."""
    to = i
    while i < high:
        if keys[i] & _CHANNEL_BITS != tag:
            keys[to] = keys[i]
            values[to] = values[i]
            to += 1
        i += 1


@micropython.viper
def _merge(
    i: int, to: int, words: ptr32, keys: ptr32, values: ptr16, source: ptr8, at: int, count: int
):
    """Merge the section's changes into those from FROM to `i`, from the last one to the first.

    `to`: the end of the result.

    (`to` could be had here; the first two parameters are those that viper keeps in registers on
    ARM.)
    """
    add = to - i
    low = words[_FROM]
    # the level that a change leads to; the one behind the section stands for what follows
    n = count
    stop = words[_STOP]
    if stop == words[_FRAMES] or words[_AFTER] == source[at + count - 1]:
        n -= 1
    while add > 0:
        key = words[_TAG]
        if n == count:
            key |= stop << _FRAME_SHIFT
            value = source[at + count - 1]
            if words[_AFTER] & _UNSENT:
                key |= _GAP
                value |= value << 8
            else:
                value |= words[_AFTER] << 8
        else:
            value = source[at + n]
            if add == 1 and words[_BEFORE] != source[at]:
                n = 0  # the one that is left is that of the first frame
            while n > 0 and source[at + n - 1] == value:
                n -= 1
            key |= (words[_START] + n) << _FRAME_SHIFT
            value <<= 8
            if n > 0:
                value |= source[at + n - 1]
            elif words[_BEFORE] < 0:
                value |= value >> 8
            else:
                value |= words[_BEFORE] & 0xFF
        while i > low and keys[i - 1] > key:
            i -= 1
            to -= 1
            keys[to] = keys[i]
            values[to] = values[i]
        to -= 1
        keys[to] = key
        values[to] = value
        n -= 1
        add -= 1


@micropython.viper
def _fill_levels(levels: ptr8, keys: ptr32, values: ptr16, changes: int, at: int):
    """levels[channel] = the level between the changes before `at` and those from `at` on."""
    i = changes
    while i > at:
        i -= 1
        levels[((keys[i] & _CHANNEL_BITS) >> 1) + 1] = values[i] & 0xFF
    i = 0
    while i < at:
        levels[((keys[i] & _CHANNEL_BITS) >> 1) + 1] = values[i] >> 8
        i += 1


class LightLevels:
    """Stores the light levels of an uploaded move and plays them.

    `ready`: whether a finished upload has levels; until finish() nothing is played.
    """

    def __init__(self, changes=0):
        """changes: as for allocate()."""
        # by channel: 1 if it has data, _MARKED while a step sets it
        self._used = bytearray(CHANNELS + 1)
        self._levels = bytearray(CHANNELS + 1)  # by channel: on their way to the lights
        self._words = array("i", [0] * _WORDS)
        self.allocate(changes)

    def allocate(self, changes):
        """Allocate room for `changes` changes of level, 6 bytes each; what was stored is gone."""
        # On the board a bytearray is what the heap gives without a copy.
        self._keys = array("i", bytes(4 * changes)) if CPYTHON else bytearray(4 * changes)
        self._values = array("H", bytes(2 * changes)) if CPYTHON else bytearray(2 * changes)
        self._words[_CAPACITY] = changes
        self.clear()

    @property
    def channels(self):
        """How many channels have data."""
        return self._words[_IN_USE]

    @property
    def room(self):
        """How many changes of level fit."""
        return self._words[_CAPACITY]

    @micropython.viper
    def clear(self):
        """Forget the upload."""
        word = ptr32(self._words)
        word[_STATE] = EMPTY
        word[_FRAMES] = 0
        word[_CHANGES] = 0
        word[_IN_USE] = 0
        used = ptr8(self._used)
        channel = 0
        while channel <= CHANNELS:
            used[channel] = 0
            channel += 1
        self.ready = False

    def begin(self, frames):
        """Begin the upload of a range of `frames` frames; the old one is gone.

        Nothing is stored beyond frame 2^20, some twelve hours of film.
        """
        self.clear()
        self._words[_FRAMES] = min(frames, MOST_FRAMES)
        self._words[_STATE] = LOADING

    @micropython.viper
    def store(self, channel: int, index: int, last: int, source, at: int, count: int) -> int:
        """Store `count` levels of a channel from frame `index` on (spec: MSG_RT_UPLOAD_MOVE_DMX).

        The levels are the bytes from source[at] on; those past the end of the range are ignored
        (field note 5.3). If `last`, the final one also goes to every frame after it, sent before or
        not. Sections may come in any order and again: the latest counts. A frame that is never sent
        holds the level before it, and frames before the first one sent hold the level of that.
        ERR_GENERAL unless an upload has begun. ERR_RANGE for a section that begins outside the
        range, for channels other than 1 to 512, for a `last` section without a level, and for more
        changes than fit. A refused section changes nothing.
        """
        words = self._words
        word = ptr32(words)
        frames = word[_FRAMES]
        if word[_STATE] != LOADING:
            return int(ERR_GENERAL)
        if channel < 1 or channel > CHANNELS or index < 0 or index >= frames:
            return int(ERR_RANGE)
        if count < 0:
            return int(ERR_RANGE)
        if count > frames - index:
            count = frames - index
        if count == 0:
            return int(ERR_RANGE) if last else int(OK)
        keys = self._keys
        values = self._values
        tag = (channel - 1) << 1
        word[_TAG] = tag
        word[_START] = index
        word[_STOP] = frames if last else index + count
        if int(_plan(words, keys, values, source, at, count)) == 0:
            return int(ERR_RANGE)
        high = word[_TO]
        held = word[_CHANGES]
        more = word[_ADD] - word[_DROP]
        if word[_DROP]:
            _drop(keys, values, word[_FROM], high, tag)
        move_words(high + more, high, held - high, keys)
        move_halves(high + more, high, held - high, values)
        _merge(high - word[_DROP], high + more, words, keys, values, source, at, count)
        word[_CHANGES] = held + more
        # the gap behind holds another level now, and so does the change that ends it
        if word[_AFTER] & _UNSENT:
            i = int(_next_of(high + more, held + more, keys, tag))
            if i >= 0:
                value = ptr16(values)
                value[i] = (value[i] & 0xFF00) | ptr8(source)[at + count - 1]
        used = ptr8(self._used)
        if used[channel] == 0:
            used[channel] = 1
            word[_IN_USE] = word[_IN_USE] + 1
        return int(OK)

    def finish(self):
        """End the upload, if one has begun: from now on it can be played."""
        words = self._words
        if words[_STATE] == LOADING:
            words[_STATE] = READY
            self.ready = words[_IN_USE] > 0

    @micropython.viper
    def seek(self, index: int, lights):
        """Set every channel that has data to its level at frame `index` (lights: io.lights.Lights).

        Frames before the first have the level of the first, frames beyond the last that of the
        last.
        """
        word = ptr32(self._words)
        if word[_STATE] != READY:
            return
        levels = self._levels
        keys = self._keys
        changes = word[_CHANGES]
        if index < 0:
            index = 0
        elif index > MOST_FRAMES:
            index = MOST_FRAMES
        at = int(first_key(keys, 1, _FRAME_SHIFT, changes, index + 1))
        _fill_levels(levels, keys, self._values, changes, at)
        used = ptr8(self._used)
        channel = 1
        while channel <= CHANNELS:
            first = channel
            while channel <= CHANNELS and used[channel]:
                channel += 1
            if channel > first:
                lights.put(first, levels, first, channel - first)
            channel += 1

    @micropython.viper
    def step(self, index: int, backward: int, lights):
        """Go to frame `index` from the one before, or if `backward` after: set the channels that
        differ."""
        word = ptr32(self._words)
        if word[_STATE] != READY:
            return
        levels = self._levels
        used = self._used
        keys = self._keys
        if backward:
            index += 1
        changes = word[_CHANGES]
        i = int(first_key(keys, 1, _FRAME_SHIFT, changes, index))
        key = ptr32(keys)
        value = ptr16(self._values)
        level = ptr8(levels)
        marks = ptr8(used)
        first = 0
        channel = 0
        while i < changes and key[i] >> _FRAME_SHIFT == index:
            old = value[i] & 0xFF
            new = value[i] >> 8
            if old != new:
                channel = ((key[i] & _CHANNEL_BITS) >> 1) + 1
                if first == 0:
                    first = channel
                level[channel] = old if backward else new
                marks[channel] = _MARKED
            i += 1
        if channel:
            lights.put_marked(first, channel, levels, used)
