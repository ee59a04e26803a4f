"""The uploaded light levels of a move.

Each channel is a chain of units (light_codec.py) from the pool that positions use as well, so
lights can have all the memory that positions leave free. A frame of a channel takes next to nothing
if its level is constant or in a straight fade, and at most 1.21 bytes if it changes at random.
Frames that have not been sent take nothing.

Nothing but the constructor and allocate() allocates. Frame indexes, channels (1 to 512) and levels
are small integers. An index counts from 0 at the first frame of the range (field note 5.1).
"""

from array import array

from framestep.base.native import CPYTHON, const, micropython, ptr8, ptr16, ptr32
from framestep.base.results import ERR_GENERAL, ERR_RANGE, OK
from framestep.moves.upload.chunks import UNIT, fits
from framestep.moves.upload.light_codec import (
    BODY,
    COUNT,
    KIND,
    SCRATCH,
    SHAPE,
    SHORT,
    START,
    choose,
    cut_runs,
    first,
    forget,
    length,
    level_of,
    locate,
    put,
    put_run,
    take,
    trim_starts,
)

CHANNELS = const(512)
MOST_FRAMES = const(0x10_0000)  # later frames are ignored: a unit has 24 bits for a frame

# States, of light levels and of triggers
EMPTY = const(0)
LOADING = const(1)
READY = const(2)

_MARK = const(2)  # io.lights.MARK
_LONGEST = const(1030)  # levels in a section: as many as the protocol's largest frame holds
_SAVED = const(380)  # index of the copy of a unit to rewrite, after SCRATCH

# Words of the block, after those of the codec
_STATE = const(3)
_FRAMES = const(4)  # of the range
_IN_USE = const(5)  # channels that have data
_HOLD = const(6)  # frames after a section that get its final level
_WORDS = const(7)


@micropython.viper
def _decode(i: int, to: int, memory, words, at: int, end: int) -> int:
    """Write the levels of frames `i` to `end` of the unit at memory[at] to bytes from `to` on.

    Return the index of the byte after them.
    """
    levels = ptr8(words)
    while i < end:
        levels[to + 0] = int(level_of(0, i, memory, at))
        to += 1
        i += 1
    return to


@micropython.viper
def _needed(at: int, end: int, words, own) -> int:
    """Return how many units the levels `at` to `end`, and the frames that hold the last, take."""
    word = ptr32(own)
    units = 0
    word[KIND] = 0
    while at < end:
        choose(0, end, words, own, at)
        at += word[COUNT]
        units += 1
    if word[_HOLD] and word[KIND]:
        units += 1
    return units


@micropython.viper
def _hang(memory: ptr16, heads: ptr16, link: int, unit: int):
    """Continue a chain with `unit`. link: index of the unit before it, or minus the channel if it
    is the channel's first."""
    if link < 0:
        heads[0 - link] = unit
    else:
        memory[link] = unit


@micropython.viper
def _play(unit: int, index: int, memory, words, block, cursors, levels, marks) -> int:
    """levels[channel] = the level at frame `index` of each channel that has data.

    Channels whose level has changed get the bit MARK in `marks`. Return the first of them << 16 |
    the last, or 0 if there is none.
    """
    half = ptr16(memory)
    heads = ptr16(block)
    cursor = ptr16(cursors)
    level = ptr8(levels)
    mark = ptr8(marks)
    if index < 0:
        index = 0
    elif index > MOST_FRAMES:
        index = MOST_FRAMES
    top = int(locate(words, 0))
    first = 0
    last = 0
    channel = 0
    while channel < CHANNELS:
        channel += 1
        unit = heads[channel]
        if unit == 0:
            continue
        # inlined, as calls take long here: in the worst case this goes through all units
        if cursor[channel]:
            at = top - cursor[channel] * UNIT
            if index >= half[at + START] | ((half[at + SHAPE] & 0xFF) << 16):
                unit = cursor[channel]
        at = top - unit * UNIT
        start = half[at + START] | ((half[at + SHAPE] & 0xFF) << 16)
        after = half[at]
        while after:
            to = top - after * UNIT
            begins = half[to + START] | ((half[to + SHAPE] & 0xFF) << 16)
            if begins > index:
                break
            at = to
            start = begins
            unit = after
            after = half[at]
        cursor[channel] = unit
        if half[at + SHAPE] >> 8 == 1:  # constant
            now = half[at + BODY] & 0xFF
        else:
            now = int(level_of(0, index - start, memory, at))
        if now != level[channel]:
            level[channel] = now
            mark[channel] = _MARK
            last = channel
            if first == 0:
                first = channel
    return (first << 16) | last


@micropython.viper
def _write(at: int, end: int, memory, words, own, heads, link: int, start: int) -> int:
    """Write the levels `at` to `end`, and the frames that hold the last of them, as units after
    `link`, as in _hang().

    Return the last unit's link, or `link` if there is none.
    """
    word = ptr32(own)
    hold = word[_HOLD]
    inside = 0
    while at < end:
        choose(0, end, words, own, at)
        unit = int(take(memory, words))
        _hang(memory, heads, link, unit)
        link = int(locate(words, unit))
        put(0, 0, memory, words, own, link, start, at)
        at += word[COUNT]
        start += word[COUNT]
        inside = word[COUNT]
    if hold and inside:
        if word[KIND]:
            unit = int(take(memory, words))
            _hang(memory, heads, link, unit)
            link = int(locate(words, unit))
            put_run(memory, link, start, ptr8(words)[end - 1], hold)
        else:
            cut_runs(0, 0, memory, link, inside, inside + hold)
    return link


class LightLevels:
    """Store and player of the light levels of an uploaded move.

    `ready`: whether a finished upload has levels; until finish() nothing is played.
    """

    def __init__(self, store=None):
        """store: as for allocate(), None: allocate later."""
        # for each channel: its first unit, and the one played last, 0 if there is none
        blank = bytes(2 * CHANNELS + 2)
        self._heads = array("H", blank) if CPYTHON else bytearray(blank)
        self._cursors = array("H", blank) if CPYTHON else bytearray(blank)
        self._levels = bytearray(CHANNELS + 1)  # for each channel: the level set last
        self._marks = bytearray(CHANNELS + 1)
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

    @property
    def channels(self):
        """How many channels have data."""
        return self._own[_IN_USE]

    @micropython.viper
    def clear(self):
        """Drop the upload."""
        own = ptr32(self._own)
        own[_STATE] = EMPTY
        own[_FRAMES] = 0
        own[_IN_USE] = 0
        heads = ptr16(self._heads)
        channel = 0
        while channel <= CHANNELS:
            heads[channel] = 0
            channel += 1
        self.ready = False

    def begin(self, frames):
        """Begin the upload of a range of `frames` frames; drops the old one.

        Nothing is stored beyond frame 2^20, some twelve hours of film.
        """
        self.clear()
        self._own[_FRAMES] = min(frames, MOST_FRAMES)
        self._own[_STATE] = LOADING

    @micropython.viper
    def store(self, channel: int, index: int, last: int, source, at: int, count: int) -> int:
        """Store `count` levels of a channel from frame `index` on (spec: MSG_RT_UPLOAD_MOVE_DMX).

        The levels are the bytes from source[at] on; those beyond the end of the range are ignored
        (field note 5.3). If `last`, the final one also goes to every frame after it, sent before or
        not. Sections may come in any order and repeatedly; the latest counts. A frame that is never
        sent keeps the level before it; frames before the first one sent have its level. ERR_GENERAL
        unless an upload has begun. ERR_RANGE for a section that begins outside the range, for
        channels other than 1 to 512, for a `last` section without a level, and if it needs more
        memory than there is. A refused section changes nothing.
        """
        own = self._own
        word = ptr32(own)
        frames = word[_FRAMES]
        if word[_STATE] != LOADING:
            return int(ERR_GENERAL)
        if channel < 1 or channel > CHANNELS or index < 0 or index >= frames:
            return int(ERR_RANGE)
        if count < 0 or count > _LONGEST:
            return int(ERR_RANGE)
        if count > frames - index:
            count = frames - index
        if count == 0:
            return int(ERR_RANGE) if last else int(OK)
        words = self._words
        memory = self._memory
        half = ptr16(memory)
        levels = ptr8(words)
        heads_ = self._heads
        heads = ptr16(heads_)
        stop = index + count
        word[_HOLD] = frames - stop if last else 0
        # the last unit that begins before the section, and the one before that
        unit = heads[channel]
        front = 0
        before = 0
        while unit and int(first(memory, int(locate(words, unit)))) < index:
            before = front
            front = unit
            unit = half[int(locate(words, unit))]
        # The units from here to `behind` are removed; `tail` may hold levels for frames after them.
        gone = unit
        tail = front
        freed = 0
        while unit and (last or int(first(memory, int(locate(words, unit)))) <= stop):
            tail = unit
            freed += 1
            unit = half[int(locate(words, unit))]
        behind = unit
        # If the unit just before is short, it is written again together with the section. If it is
        # long, it consists of runs, and the last run may be extended.
        to = SCRATCH
        start = index
        inside = 0  # frames that remain of a long unit before
        opened = 0
        if front:
            unit = int(locate(words, front))
            inside = index - int(first(memory, unit))
            if int(length(0, 0, memory, unit)) < inside:
                inside = 0  # there is a gap between
            elif inside <= SHORT:
                to = int(_decode(0, to, memory, words, unit, inside))
                start -= inside
                inside = 0
                opened = front
                front = before
                freed += 1
        begin = SCRATCH
        while count > 0:
            levels[to] = ptr8(source)[at]
            to += 1
            at += 1
            count -= 1
        # the unit after the section, similarly
        cut = 0
        if last == 0 and tail:
            unit = int(locate(words, tail))
            cut = stop - int(first(memory, unit))
            count = int(length(0, 0, memory, unit))
            if behind:
                before = int(first(memory, int(locate(words, behind)))) - stop + cut
                if count > before:
                    count = before
            if count - cut > SHORT:
                at = 0
                while at < UNIT:
                    ptr32(words)[_SAVED + at] = half[unit + at]
                    at += 1
            else:
                if count > cut:
                    to = int(_decode(cut, to, memory, words, unit, count))
                tail = 0
        else:
            tail = 0
        more = 0
        if inside:
            at = int(level_of(0, inside - 1, memory, int(locate(words, front))))
            while begin < to and levels[begin] == at:
                begin += 1
                more += 1
            start += more
            if begin == to:
                more += word[_HOLD]
        count = int(_needed(begin, to, words, own)) - freed
        if tail:
            count += 1
        if int(fits(words, count)) == 0:
            return int(ERR_RANGE)
        if opened:
            forget(memory, words, opened)
        while gone != behind:
            unit = half[int(locate(words, gone))]
            forget(memory, words, gone)
            gone = unit
        ptr16(self._cursors)[channel] = 0
        if heads[channel] == 0:
            word[_IN_USE] += 1
        link = -channel
        if front:
            link = int(locate(words, front))
            if inside:
                cut_runs(0, 0, memory, link, inside, inside + more)
        link = int(_write(begin, to, memory, words, own, heads_, link, start))
        if tail:
            unit = int(take(memory, words))
            _hang(memory, heads_, link, unit)
            link = int(locate(words, unit))
            at = 1
            while at < UNIT:
                half[link + at] = ptr32(words)[_SAVED + at]
                at += 1
            trim_starts(0, cut, memory, link, stop)
        _hang(memory, heads_, link, behind)
        return int(OK)

    def finish(self):
        """End the upload, if one has begun: it can then be played."""
        own = self._own
        if own[_STATE] == LOADING:
            own[_STATE] = READY
            self.ready = own[_IN_USE] > 0

    @micropython.viper
    def seek(self, index: int, lights):
        """Set every channel that has data to its level at frame `index` (lights: io.lights.Lights).

        Frames before the first have the level of the first, frames beyond the last the level of the
        last.
        """
        if ptr32(self._own)[_STATE] != READY:
            return
        heads = ptr16(self._heads)
        levels = self._levels
        marks = ptr8(self._marks)
        _play(0, index, self._memory, self._words, self._heads, self._cursors, levels, self._marks)
        channel = 1
        while channel <= CHANNELS:
            first = channel
            while channel <= CHANNELS and heads[channel]:
                marks[channel] = 0
                channel += 1
            if channel > first:
                lights.put(first, levels, first, channel - first)
            channel += 1

    @micropython.viper
    def step(self, index: int, lights):
        """Go from another frame to frame `index`: set only the channels whose level differs from
        what this store set last."""
        if ptr32(self._own)[_STATE] != READY:
            return
        levels = self._levels
        marks = self._marks
        changed = int(
            _play(0, index, self._memory, self._words, self._heads, self._cursors, levels, marks)
        )
        if changed:
            lights.put_marked(changed >> 16, changed & 0xFFFF, levels, marks)
