"""The uploaded light levels and triggers of a move.

Levels are kept as changes, sorted by frame, then by channel, 6 bytes each:

    key, a word:         frame << 10 | (channel - 1) << 1 | 1 if frames that have not been sent begin here
    value, a half word:  level before | level from here on << 8

So a channel takes one change when its first level comes, one for each frame at which its level differs from the frame
before, and one for each gap (a gap ends with a change, even if the level stays the same); a channel that has not been
sent up to the end of the range ends with a gap. Frames in a gap hold the level before it. The first change of a channel
has its own level before it as well: that is the level of the frames that precede it. With the level on either side, a
step in either direction reads the changes of one frame and nothing else.

Triggers are pairs of words sorted by frame: frame << 1 | 1 while a message is taken in that brought this frame, and
the values.

Nothing but the constructor allocates. Frame indexes, channels (1 to 512) and levels are small integers; MASK and VALUES
of triggers go through arrays, as they need not be. An index counts from 0 at the first frame of the range (field
note 5.1).
"""

from array import array

from framestep.native import CPYTHON, const, micropython, ptr8, ptr16, ptr32
from framestep.results import ERR_GENERAL, ERR_RANGE, OK

CHANNELS = const(512)
MOST_FRAMES = const(0x10_0000)  # what lies behind is not taken in: keys are small integers

# States
_EMPTY = const(0)
_LOADING = const(1)
_READY = const(2)

_FRAME_SHIFT = const(10)
_CHANNEL_BITS = const(0x3FE)
_GAP = const(1)
_MARKED = const(3)  # a channel that has data, and io.lights.MARK
# State of a channel: a level, plus this in a gap; -1, which has the bit too, before its first change
_UNSENT = const(0x100)

# Words of the store's block
_STATE = const(0)
_FRAMES = const(1)  # of the range
_CHANGES = const(2)  # held
_CAPACITY = const(3)  # changes that fit
_IN_USE = const(4)  # channels that have data
_MASK = const(5)
_TRIGGERS = const(6)  # frames held
_TRIGGER_CAPACITY = const(7)
_TRIGGERS_SENT = const(8)  # whether a message has come
# A section on its way in
_TAG = const(9)  # its channel, as in keys
_START = const(10)  # its first frame
_STOP = const(11)  # the frame after its last
_FROM = const(12)  # the changes from this to that one lie at its frames or at STOP
_TO = const(13)
_DROP = const(14)  # the channel's among them
_BEFORE = const(15)  # state of the channel before START
_AFTER = const(16)  # at STOP
_ADD = const(17)  # changes that come in
_WORDS = const(18)


if CPYTHON:

    def _move_words(to, at, count, words):
        """Move `count` words within an array('i'), from words[at] on to words[to] on; the places may overlap."""
        words[to : to + count] = words[at : at + count]

    def _move_halves(to, at, count, halves):
        """The same for half words."""
        halves[to : to + count] = halves[at : at + count]

else:

    @micropython.viper
    def _move_words(to: int, at: int, count: int, words: ptr32):
        # Viper keeps the first two parameters in registers on ARM: here they become addresses.
        if to < at:
            to = int(words) + (to << 2)
            at = int(words) + (at << 2)
            while count >= 4:
                ptr32(to)[0] = ptr32(at)[0]
                ptr32(to)[1] = ptr32(at)[1]
                ptr32(to)[2] = ptr32(at)[2]
                ptr32(to)[3] = ptr32(at)[3]
                to += 16
                at += 16
                count -= 4
            while count > 0:
                ptr32(to)[0] = ptr32(at)[0]
                to += 4
                at += 4
                count -= 1
        elif to > at:
            to = int(words) + (to + count << 2)
            at = int(words) + (at + count << 2)
            while count >= 4:
                to -= 16
                at -= 16
                ptr32(to)[3] = ptr32(at)[3]
                ptr32(to)[2] = ptr32(at)[2]
                ptr32(to)[1] = ptr32(at)[1]
                ptr32(to)[0] = ptr32(at)[0]
                count -= 4
            while count > 0:
                to -= 4
                at -= 4
                ptr32(to)[0] = ptr32(at)[0]
                count -= 1

    @micropython.viper
    def _move_halves(to: int, at: int, count: int, halves: ptr16):
        if to < at:
            to = int(halves) + (to << 1)
            at = int(halves) + (at << 1)
            while count >= 4:
                ptr16(to)[0] = ptr16(at)[0]
                ptr16(to)[1] = ptr16(at)[1]
                ptr16(to)[2] = ptr16(at)[2]
                ptr16(to)[3] = ptr16(at)[3]
                to += 8
                at += 8
                count -= 4
            while count > 0:
                ptr16(to)[0] = ptr16(at)[0]
                to += 2
                at += 2
                count -= 1
        elif to > at:
            to = int(halves) + (to + count << 1)
            at = int(halves) + (at + count << 1)
            while count >= 4:
                to -= 8
                at -= 8
                ptr16(to)[3] = ptr16(at)[3]
                ptr16(to)[2] = ptr16(at)[2]
                ptr16(to)[1] = ptr16(at)[1]
                ptr16(to)[0] = ptr16(at)[0]
                count -= 4
            while count > 0:
                to -= 2
                at -= 2
                ptr16(to)[0] = ptr16(at)[0]
                count -= 1


@micropython.viper
def _first_at(words: ptr32, stride: int, shift: int, count: int, frame: int) -> int:
    """The first of `count` sorted keys, every `stride` words, that is of `frame` (key >> shift) or a later one."""
    low = 0
    while low < count:
        middle = low + count >> 1
        if words[middle * stride] >> shift < frame:
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
    """What storing a section drops and adds; 0 when it does not fit. Changes nothing but the words of the section."""
    word = ptr32(words)
    tag = word[_TAG]
    held = word[_CHANGES]
    low = int(_first_at(keys, 1, _FRAME_SHIFT, held, word[_START]))
    high = held
    if word[_STOP] < word[_FRAMES]:
        high = int(_first_at(keys, 1, _FRAME_SHIFT, held, word[_STOP] + 1))
    word[_FROM] = low
    word[_TO] = high
    word[_DROP] = int(_count_of(low, high, keys, tag))
    before = -1
    i = int(_last_of(low, 0, keys, tag))
    if i >= 0:
        before = ptr16(values)[i] >> 8 | (ptr32(keys)[i] & _GAP) << 8
    after = before
    if word[_DROP]:
        i = int(_last_of(high, low, keys, tag))
        after = ptr16(values)[i] >> 8 | (ptr32(keys)[i] & _GAP) << 8
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
def _merge(i: int, to: int, words: ptr32, keys: ptr32, values: ptr16, source: ptr8, at: int, count: int):
    """Put the section's changes among those from FROM to `i`, from the last one to the first; `to` is behind it all.

    (`to` could be had here; the first two parameters are those that viper keeps in registers on ARM.)
    """
    add = to - i
    low = words[_FROM]
    n = count  # the level that a change leads to; the one behind the section stands for what follows
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
            key |= words[_START] + n << _FRAME_SHIFT
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
    """Put the levels that stand between the changes before `at` and those from it on into levels[channel]."""
    i = changes
    while i > at:
        i -= 1
        levels[((keys[i] & _CHANNEL_BITS) >> 1) + 1] = values[i] & 0xFF
    i = 0
    while i < at:
        levels[((keys[i] & _CHANNEL_BITS) >> 1) + 1] = values[i] >> 8
        i += 1


@micropython.viper
def _reserve(words, table, source, at: int, count: int) -> int:
    """Make an entry, marked, for each frame sent that has none; 0 when one does not fit, or lies before the range, or
    when the first lies past its end. Others there are left out."""
    word = ptr32(words)
    entries = ptr32(table)
    sent = ptr8(source)
    first = at
    end = at + count * 8
    while at < end:
        frame = sent[at] | sent[at + 1] << 8 | sent[at + 2] << 16
        if sent[at + 3] or frame >= word[_FRAMES]:
            if at == first or sent[at + 3] >> 7:
                return 0
            at += 8
            continue
        held = word[_TRIGGERS]
        i = int(_first_at(table, 2, 1, held, frame))
        if i == held or entries[i * 2] >> 1 != frame:
            if held == word[_TRIGGER_CAPACITY]:
                return 0
            _move_words(i * 2 + 2, i * 2, (held - i) * 2, table)
            entries[i * 2] = frame << 1 | 1
            word[_TRIGGERS] = held + 1
        at += 8
    return 1


@micropython.viper
def _take_back(words: ptr32, table: ptr32):
    """Take the marked entries out."""
    held = words[_TRIGGERS]
    to = 0
    i = 0
    while i < held:
        if table[i * 2] & 1 == 0:
            table[to * 2] = table[i * 2]
            table[to * 2 + 1] = table[i * 2 + 1]
            to += 1
        i += 1
    words[_TRIGGERS] = to


def _memory(code, size, count):
    """An array of `count` zeros; on the board a bytearray, which the heap gives without a copy."""
    return array(code, bytes(size * count)) if CPYTHON else bytearray(size * count)


class CueStore:
    """Takes in the light levels and triggers of an uploaded move and plays them.

    `has_levels` and `has_triggers`: whether a finished upload has any; before finish() nothing is played.
    """

    def __init__(self, changes=4096, triggers=512):
        """Room for `changes` changes of level (6 bytes each) and `triggers` frames with triggers (8 bytes each)."""
        self._used = bytearray(CHANNELS + 1)  # by channel: 1 if it has data, _MARKED while a step sets it
        self._levels = bytearray(CHANNELS + 1)  # by channel: on their way to the lights
        self._words = array("i", [0] * _WORDS)
        self.take(changes, triggers)

    def take(self, changes, triggers):
        """Another amount of room, as for the constructor; what is held is gone. Allocates."""
        self._keys = _memory("i", 4, changes)
        self._values = _memory("H", 2, changes)
        self._table = _memory("i", 4, 2 * triggers)
        self._words[_CAPACITY] = changes
        self._words[_TRIGGER_CAPACITY] = triggers
        self.clear()

    @property
    def channels(self):
        """How many channels have data."""
        return self._words[_IN_USE]

    @property
    def room(self):
        """(changes of level, frames with triggers) that fit. Allocates."""
        return self._words[_CAPACITY], self._words[_TRIGGER_CAPACITY]

    @micropython.viper
    def clear(self):
        """Forget the upload."""
        word = ptr32(self._words)
        word[_STATE] = _EMPTY
        word[_FRAMES] = 0
        word[_CHANGES] = 0
        word[_IN_USE] = 0
        word[_MASK] = 0
        word[_TRIGGERS] = 0
        word[_TRIGGERS_SENT] = 0
        used = ptr8(self._used)
        i = 0
        while i <= CHANNELS:
            used[i] = 0
            i += 1
        self.has_levels = False
        self.has_triggers = False

    def begin(self, frames):
        """Begin the upload of a range of `frames` frames; the old one is gone.

        Nothing is stored beyond frame 2^20, some twelve hours of film.
        """
        self.clear()
        self._words[_FRAMES] = frames if frames < MOST_FRAMES else MOST_FRAMES
        self._words[_STATE] = _LOADING

    @micropython.viper
    def levels(self, channel: int, index: int, last: int, reader, offset: int, count: int) -> int:
        """Store `count` levels of a channel from frame `index` on (spec: MSG_RT_UPLOAD_MOVE_DMX).

        They are the bytes at payload offset `offset` of the reader's frame; those past the end of the range are ignored
        (field note 5.3). If `last`, the final one also goes to every frame after it, sent before or not. Sections may
        come in any order and again: what comes last counts. A frame that is never sent holds the level before it, and
        before the first frame sent, that one's.
        ERR_GENERAL unless an upload has begun; ERR_RANGE for a section that begins outside it, for other channels than
        1 to 512, for a `last` section without a level, and when there are more changes than fit. What is refused
        changes nothing.
        """
        words = self._words
        word = ptr32(words)
        frames = word[_FRAMES]
        if word[_STATE] != _LOADING:
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
        source = reader.buffer
        at = int(reader.payload) + offset
        tag = channel - 1 << 1
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
        _move_words(high + more, high, held - high, keys)
        _move_halves(high + more, high, held - high, values)
        _merge(high - word[_DROP], high + more, words, keys, values, source, at, count)
        word[_CHANGES] = held + more
        if word[_AFTER] & _UNSENT:  # the gap behind holds another level now, and so does the change that ends it
            i = int(_next_of(high + more, held + more, keys, tag))
            if i >= 0:
                value = ptr16(values)
                value[i] = value[i] & 0xFF00 | ptr8(source)[at + count - 1]
        used = ptr8(self._used)
        if used[channel] == 0:
            used[channel] = 1
            word[_IN_USE] = word[_IN_USE] + 1
        return int(OK)

    @micropython.viper
    def triggers(self, reader, offset: int, count: int) -> int:
        """Store the values of `count` frames (spec: MSG_RT_UPLOAD_MOVE_TRIGGERS).

        MASK is the DWORD at payload offset 0 of the reader's frame; pairs of FRAME and VALUES begin at `offset`. Frames
        that are not sent have no trigger on; for one sent again, and for MASK, what comes last counts.
        ERR_GENERAL unless an upload has begun; ERR_RANGE for frames outside it and for more frames than fit. What is
        refused changes nothing.
        """
        words = self._words
        table = self._table
        source = reader.buffer
        word = ptr32(words)
        if word[_STATE] != _LOADING:
            return int(ERR_GENERAL)
        if count < 0:
            return int(ERR_RANGE)
        at = int(reader.payload) + offset
        if int(_reserve(words, table, source, at, count)) == 0:
            _take_back(words, table)
            return int(ERR_RANGE)
        sent = ptr8(source)
        entries = ptr32(table)
        held = word[_TRIGGERS]
        while count > 0:
            frame = sent[at] | sent[at + 1] << 8 | sent[at + 2] << 16
            if sent[at + 3] == 0 and frame < word[_FRAMES]:
                i = int(_first_at(table, 2, 1, held, frame)) * 2
                entries[i] = frame << 1
                entries[i + 1] = (
                    sent[at + 4] | sent[at + 5] << 8 | sent[at + 6] << 16 | ((sent[at + 7] ^ 0x80) - 0x80) << 24
                )
            at += 8
            count -= 1
        reader.word_to(0, words, _MASK)
        word[_TRIGGERS_SENT] = 1
        return int(OK)

    def finish(self):
        """End the upload, if one has begun: from now on it can be played."""
        words = self._words
        if words[_STATE] == _LOADING:
            words[_STATE] = _READY
            self.has_levels = words[_IN_USE] > 0
            self.has_triggers = words[_TRIGGERS_SENT] > 0

    @micropython.viper
    def seek(self, index: int, lights):
        """Set every channel that has data to its level at frame `index` (lights: io.lights.Lights).

        Before the first frame stands the level of the first, beyond the last that of the last.
        """
        word = ptr32(self._words)
        if word[_STATE] != _READY:
            return
        levels = self._levels
        keys = self._keys
        changes = word[_CHANGES]
        if index < 0:
            index = 0
        elif index > MOST_FRAMES:
            index = MOST_FRAMES
        at = int(_first_at(keys, 1, _FRAME_SHIFT, changes, index + 1))
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
        """Go on to frame `index` from index - 1, or if `backward` from index + 1: set the channels that differ."""
        word = ptr32(self._words)
        if word[_STATE] != _READY:
            return
        levels = self._levels
        used = self._used
        keys = self._keys
        if backward:
            index += 1
        changes = word[_CHANGES]
        i = int(_first_at(keys, 1, _FRAME_SHIFT, changes, index))
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

    @micropython.viper
    def trigger_mask_to(self, words, k: int):
        """Put the MASK of the triggers into the array('i') words[k]; 0 where there are none."""
        word = ptr32(self._words)
        to = ptr32(words)
        to[k] = word[_MASK] if word[_STATE] == _READY else 0

    @micropython.viper
    def trigger_values_to(self, index: int, words, k: int):
        """Put the VALUES of frame `index`, as they were sent, into the array('i') words[k]; 0 where there are none."""
        word = ptr32(self._words)
        table = self._table
        to = ptr32(words)
        to[k] = 0
        if word[_STATE] != _READY:
            return
        held = word[_TRIGGERS]
        i = int(_first_at(table, 2, 1, held, index))
        entries = ptr32(table)
        if i < held and entries[i * 2] >> 1 == index:
            to[k] = entries[i * 2 + 1]
