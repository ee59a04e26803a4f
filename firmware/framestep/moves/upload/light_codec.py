"""Light levels of a channel in units of an upload store's pool (chunks.py).

A channel is a chain of units, sorted by frame. A unit, 17 half words:

    link | frame of its first level, 24 bits | shape, 8 bits | 14 half words

The shape is a kind and, for runs and plain levels, a number. A unit has a level for each frame of a
stretch, in the form that covers the most frames:

    runs    up to 7 runs of any length: level | frames << 8, two half words each. For levels that
            are constant or change rarely
    steps   the change from each frame to the next, minus the smallest change: 192 changes of 1 bit,
            96 of 2 or 48 of 4. The first two bytes are the number of frames and the first level,
            the third is the smallest change. A straight fade, however it is rounded, has changes of
            two neighboring sizes
    plain   28 levels as they are

Levels count modulo 256, so a change from 255 to 0 is a change of 1. A frame after a unit's stretch
and before the next unit has not been sent: it has the level before it. A unit is valid only up to
the next unit's first frame; the rest of it is void.

`words` and `memory` are those of chunks.py. The levels of a section are bytes of `words` from
SCRATCH on. `own` is the block of LightLevels.
"""

from framestep.base.native import const, micropython, ptr8, ptr16, ptr32
from framestep.moves.upload.chunks import FREE, FREE_COUNT, SIZE, UNIT, USED, VALUES

SCRATCH = const(VALUES * 4)  # bytes: up to 193 levels, a section, up to 193 levels
SHORT = const(193)  # most frames of steps
_STEPS = const(192)  # changes of 1 bit that a unit has
_MOST_RUNS = const(7)
_PLAIN = const(28)

# Kinds; with kind k = 1 to 3, steps have changes of 1 << (k - 1) bits
_KIND_RUNS = const(0)
_KIND_PLAIN = const(4)
# A unit's half words
START = const(1)
SHAPE = const(2)  # high byte; the low byte is of the start
BODY = const(3)
_CODES = const(5)

# Words of `own` that the codec uses
KIND = const(0)  # of the unit chosen by choose()
COUNT = const(1)  # its frames
LOW = const(2)  # its smallest change


@micropython.viper
def locate(words: ptr32, unit: int) -> int:
    """Return the index of unit `unit`, in half words."""
    return words[SIZE] - unit * UNIT


@micropython.viper
def take(memory: ptr16, words: ptr32) -> int:
    """Take a unit from the pool, which must have one (chunks.room)."""
    unit = words[FREE]
    if unit:
        words[FREE] = memory[words[SIZE] - unit * UNIT]
        words[FREE_COUNT] -= 1
    else:
        words[USED] += 1
        unit = words[USED]
    memory[words[SIZE] - unit * UNIT] = 0
    return unit


@micropython.viper
def forget(memory: ptr16, words: ptr32, unit: int):
    """Give a unit back to the pool."""
    memory[words[SIZE] - unit * UNIT] = words[FREE]
    words[FREE] = unit
    words[FREE_COUNT] += 1


@micropython.viper
def first(memory: ptr16, at: int) -> int:
    """Return the first frame of the unit at memory[at]."""
    return memory[at + START] | ((memory[at + SHAPE] & 0xFF) << 16)


@micropython.viper
def length(i: int, span: int, memory: ptr16, at: int) -> int:
    """Return for how many frames the unit at memory[at] has levels."""
    shape = memory[at + SHAPE] >> 8
    if shape >> 5 == _KIND_PLAIN:
        return shape & 31
    if shape >> 5:
        return memory[at + BODY] & 0xFF
    span = 0
    i = at + BODY + 2 * shape
    while i > at + BODY:
        i -= 2
        span += (memory[i + 0] >> 8) | (memory[i + 1] << 8)
    return span


@micropython.viper
def level_of(i: int, n: int, memory, at: int) -> int:
    """Return the level of frame `n` of the unit at memory[at], counted from its first frame. A
    frame after its last one has the level of the last."""
    half = ptr16(memory)
    shape = half[at + SHAPE] >> 8
    kind = shape >> 5
    if n < 0:
        n = 0
    if kind == _KIND_PLAIN:
        if n >= shape & 31:
            n = (shape & 31) - 1
        return ptr8(memory)[2 * (at + BODY) + n]
    i = at + BODY
    if kind == _KIND_RUNS:
        at = i + 2 * shape - 2
        while i < at:
            n -= (half[i + 0] >> 8) | (half[i + 1] << 8)
            if n < 0:
                break
            i += 2
        return half[i + 0] & 0xFF
    if n >= half[i + 0] & 0xFF:
        n = (half[i + 0] & 0xFF) - 1
    level = (half[i + 0] >> 8) + n * (half[i + 1] & 0xFF)
    i = at + _CODES
    n <<= kind - 1
    while n > 0:
        # the sum of all the codes of a half word at once
        bits = half[i + 0]
        if n < 16:
            bits &= (1 << n) - 1
        if kind == 1:
            bits -= (bits >> 1) & 0x5555
        if kind < 3:
            bits = (bits & 0x3333) + ((bits >> 2) & 0x3333)
        bits = (bits & 0x0F0F) + ((bits >> 4) & 0x0F0F)
        level += (bits & 0xFF) + (bits >> 8)
        i += 1
        n -= 16
    return level & 0xFF


@micropython.viper
def choose(i: int, end: int, words, own: ptr32, at: int):
    """Choose the unit that covers the most of the levels `at` to `end` of `words`. Sets KIND, COUNT
    and LOW."""
    levels = ptr8(words)
    last = levels[at]
    runs = 1
    i = at + 1
    while i < end:
        if levels[i + 0] != last:
            if runs == _MOST_RUNS:
                break
            runs += 1
            last = levels[i + 0]
        i += 1
    best = i - at
    own[KIND] = _KIND_RUNS
    if i < end and best < SHORT:
        low = (((levels[at + 1] - levels[at]) + 128) & 0xFF) - 128
        high = low
        i = at + 1
        kind = 1
        while kind < _KIND_PLAIN and i < end:
            full = at + 1 + (_STEPS >> (kind - 1))
            if full > end:
                full = end
            while i < full:
                change = (((levels[i + 0] - levels[i - 1]) + 128) & 0xFF) - 128
                if (high if high > change else change) - (low if low < change else change) >> (
                    1 << (kind - 1)
                ):
                    break
                if change < low:
                    low = change
                if change > high:
                    high = change
                i += 1
            if i - at > best:
                best = i - at
                own[KIND] = kind
                own[LOW] = low
            kind += 1
        if best < _PLAIN and best < end - at:
            best = end - at if end - at < _PLAIN else _PLAIN
            own[KIND] = _KIND_PLAIN
    own[COUNT] = best


@micropython.viper
def put(i: int, end: int, memory, words, own: ptr32, to: int, start: int, at: int):
    """Write the unit that choose() chose, for the levels from `at` on, to memory[to]; `start` is
    its first frame."""
    half = ptr16(memory)
    levels = ptr8(words)
    kind = own[KIND]
    count = own[COUNT]
    half[to + START] = start & 0xFFFF
    start >>= 16
    end = at + count
    i = at
    at = to + BODY
    if kind == _KIND_RUNS:
        runs = 0
        while i < end:
            level = levels[i + 0]
            length = i
            while i < end and levels[i + 0] == level:
                i += 1
            length = i - length
            half[at] = level | ((length & 0xFF) << 8)
            half[at + 1] = length >> 8
            at += 2
            runs += 1
        half[to + SHAPE] = start | (runs << 8)
    elif kind == _KIND_PLAIN:
        half[to + SHAPE] = start | (_KIND_PLAIN << 13) | (count << 8)
        plane = ptr8(memory)
        at *= 2
        while i < end:
            plane[at] = levels[i + 0]
            at += 1
            i += 1
    else:
        half[to + SHAPE] = start | (kind << 13)
        half[at] = count | (levels[i + 0] << 8)
        low = own[LOW]
        half[at + 1] = low & 0xFF
        at = to + _CODES
        bits = 0
        shift = 0
        i += 1
        while i < end:
            bits |= ((levels[i + 0] - levels[i - 1] - low) & 0xFF) << shift
            shift += 1 << (kind - 1)
            i += 1
            if shift == 16 or i == end:
                half[at] = bits
                at += 1
                bits = 0
                shift = 0


@micropython.viper
def put_run(memory: ptr16, to: int, start: int, level: int, length: int):
    """Write a unit of a single run to memory[to]."""
    memory[to + START] = start & 0xFFFF
    memory[to + SHAPE] = (start >> 16) | 0x100
    memory[to + BODY] = level | ((length & 0xFF) << 8)
    memory[to + BODY + 1] = length >> 8


@micropython.viper
def cut_runs(i: int, before: int, memory: ptr16, at: int, inside: int, length: int):
    """Cut the unit of runs at memory[at] after its first `inside` frames, and extend its last run
    so that the unit has `length` frames."""
    before = 0
    i = at + BODY
    while True:
        behind = before + ((memory[i + 0] >> 8) | (memory[i + 1] << 8))
        if behind >= inside:
            break
        before = behind
        i += 2
    length -= before
    memory[i + 0] = (memory[i + 0] & 0xFF) | ((length & 0xFF) << 8)
    memory[i + 1] = length >> 8
    runs = (i - at - BODY + 2) >> 1
    memory[at + SHAPE] = (memory[at + SHAPE] & 0xFF) | (runs << 8)


@micropython.viper
def trim_starts(i: int, by: int, memory: ptr16, at: int, start: int):
    """Take the first `by` frames off the unit of runs at memory[at], which has more. `start` is its
    new first frame."""
    runs = memory[at + SHAPE] >> 8
    i = at + BODY
    while True:
        length = (memory[i + 0] >> 8) | (memory[i + 1] << 8)
        if length > by:
            break
        by -= length
        i += 2
        runs -= 1
    length -= by
    memory[i + 0] = (memory[i + 0] & 0xFF) | ((length & 0xFF) << 8)
    memory[i + 1] = length >> 8
    memory[at + START] = start & 0xFFFF
    memory[at + SHAPE] = (start >> 16) | (runs << 8)
    at += BODY
    runs += runs
    while runs > 0:
        memory[at] = memory[i + 0]
        at += 1
        i += 1
        runs -= 1
