"""The memory of an upload store, chunks and units, and how positions are read from it.

A motor's frames are in a region, a row of chunks of 128 frames:

    base, two half words | velocity, two half words | link | 64 half words, a byte for each frame

A frame's code is the change of the steps per frame at that frame. Code by code it is added to the
velocity, and the velocity to the position, beginning with the chunk's velocity and base. The low
eight bits of a code are in the chunk. If eight bits are too few for a code, the chunk gets units,
each of which adds two bits to every code:

    link | 16 half words, two bits for each frame

Units come from a pool that grows down from the end of the memory. Links, ending with 0, chain the
units of a chunk. With twelve units a code has 32 bits and is the position itself. Chunks that leave
± 2^29 steps, or that would not fit fewer bits, are kept in this form. The lowest code of a width
marks a frame that has not been sent; it does not change velocity and position. A chunk's velocity
is the step from its first to its second frame sent, so its units depend only on its positions.

The kernels here work on two blocks. `memory`, half words, has the chunks and units. `words`
(array('i')) has the counters below, two buffers and a record for each motor. `motor` is the index
of that record in `words`. If TRYING is set, a kernel writes nothing and only counts the units that
it would take: NEEDED, and its PEAK.

(Parameters `i`, `bits`, `code` and the like that come first and are passed as 0 are locals, because
viper keeps a kernel's first two parameters in registers on ARM.)
"""

from framestep.base.native import const, micropython, ptr8, ptr16, ptr32

CHUNK_FRAMES = const(128)
BASE = const(0)  # half words of a chunk
VELOCITY = const(2)
LINK = const(4)
CODES = const(5)
CHUNK = const(69)
UNIT = const(17)  # half words of a unit: link and bits
MOST_UNITS = const(12)  # of a chunk
NOT_SENT = const(0x8080)  # two codes of a chunk without units

MOST_POSITIONS = const(257)  # in a section: as many as the protocol's largest frame holds

# The block `words`. Constant indexes are below 256: MicroPython 1.26 for Xtensa loads a word at a
# word from a constant place beyond that with a wrong address.
SIZE = const(0)  # half words of the memory
BOTTOM = const(1)  # half words that regions take
FREE = const(2)  # first of a chain of free units that have been in use; 0: none
FREE_COUNT = const(3)
# units that are or have been in use; number u is u units before the end of the memory
USED = const(4)
TRYING = const(5)  # 1: write nothing, only count NEEDED
NEEDED = const(6)  # units that the changes so far would have taken
FRAMES = const(7)  # of the upload
MOTORS = const(8)
STATE = const(9)  # of the store
PEAK = const(10)  # the highest value of NEEDED
ASKED = const(11)  # bytes needed by what did not fit, 0: it did
LEFT = const(12)  # bytes that were free then
VALUES = const(13)  # positions of a chunk
SECTION = const(143)  # positions of a section, behind the two before them
RECORDS = const(400)  # a record for each motor:
REGION = const(0)  # index of its first chunk, half words; -1: no data
UNBROKEN = const(1)  # frames sent without a gap, from the first on
SENT_END = const(2)  # the frame after the last one sent; beyond it nothing has been written
BEFORE_LAST = const(3)  # position of the frame before the last one sent
LAST = const(4)  # position of the last frame sent
CURSOR = const(5)  # a frame that was read, -1: none
_CURSOR_POSITION = const(6)
_CURSOR_VELOCITY = const(7)
RECORD_WORDS = const(8)


@micropython.viper
def room(words: ptr32) -> int:
    """Return how many units the pool can still give."""
    return words[FREE_COUNT] + (words[SIZE] - words[BOTTOM]) // UNIT - words[USED]


@micropython.viper
def fits(words, units: int) -> int:
    """Return whether the pool can give `units` units. If not, set ASKED and LEFT."""
    word = ptr32(words)
    left = int(room(words))
    if units <= left:
        return 1
    word[ASKED] = 2 * UNIT * units
    word[LEFT] = 2 * UNIT * left
    return 0


@micropython.viper
def set_units(memory, words, chunk: int, units: int):
    """Give a chunk `units` units in all. The pool must have enough of them."""
    half = ptr16(memory)
    word = ptr32(words)
    top = word[SIZE]
    at = chunk + LINK
    if word[TRYING]:
        word[NEEDED] += units
        while half[at]:
            word[NEEDED] -= 1
            at = top - half[at] * UNIT
        if word[NEEDED] > word[PEAK]:
            word[PEAK] = word[NEEDED]
        return
    while units > 0:
        unit = half[at]
        if unit == 0:
            unit = word[FREE]
            if unit:
                word[FREE] = half[top - unit * UNIT]
                word[FREE_COUNT] -= 1
            else:
                word[USED] += 1
                unit = word[USED]
            half[at] = unit
            half[top - unit * UNIT] = 0
        at = top - unit * UNIT
        units -= 1
    unit = half[at]
    half[at] = 0
    while unit:
        at = top - unit * UNIT
        after = half[at]
        half[at] = word[FREE]
        word[FREE] = unit
        word[FREE_COUNT] += 1
        unit = after


@micropython.viper
def pack(
    i: int, bits: int, memory: ptr16, words: ptr32, chunk: int, at: int, start: int, count: int
):
    """Put the high bits of `count` codes, from words[start] on, into the chunk's units at frame
    `at`.

    Destroys what the units have for later frames.
    """
    end = start + count
    shift = 0
    unit = memory[chunk + LINK]
    while unit:
        to = words[SIZE] - unit * UNIT
        unit = memory[to]
        to += 1 + (at >> 3)
        place = (at & 7) << 1
        bits = memory[to] & ((1 << place) - 1)
        i = start
        while i < end:
            if place == 0 and end - i >= 8:
                bits = (words[i] >> shift) & 3
                bits |= ((words[i + 1] >> shift) & 3) << 2
                bits |= ((words[i + 2] >> shift) & 3) << 4
                bits |= ((words[i + 3] >> shift) & 3) << 6
                bits |= ((words[i + 4] >> shift) & 3) << 8
                bits |= ((words[i + 5] >> shift) & 3) << 10
                bits |= ((words[i + 6] >> shift) & 3) << 12
                bits |= ((words[i + 7] >> shift) & 3) << 14
                memory[to] = bits
                i += 8
                to += 1
                bits = 0
                continue
            bits |= ((words[i + 0] >> shift) & 3) << place
            i += 1
            place += 2
            if place == 16 or i == end:
                memory[to] = bits
                to += 1
                bits = 0
                place = 0
        shift += 2


@micropython.viper
def fill(memory, words, chunk: int, position: int, codes: int):
    """Set all frames of the chunk to words[position], or to not sent if `codes` is NOT_SENT."""
    half = ptr16(memory)
    word = ptr32(words)
    set_units(memory, words, chunk, 0)
    if word[TRYING]:
        return
    half[chunk + BASE] = word[position + 0] & 0xFFFF
    half[chunk + BASE + 1] = (word[position + 0] >> 16) & 0xFFFF
    half[chunk + VELOCITY] = 0
    half[chunk + VELOCITY + 1] = 0
    at = chunk + CODES
    end = chunk + CHUNK
    while at < end:
        half[at] = codes
        half[at + 1] = codes
        half[at + 2] = codes
        half[at + 3] = codes
        at += 4


@micropython.viper
def read(
    frame: int,
    code: int,
    memory: ptr16,
    words: ptr32,
    motor: int,
    index: int,
    count: int,
    out: ptr32,
    at: int,
):
    """Read the positions of `count` frames from `index` on into out[at], out[at + 1], ...

    A frame not sent reads as -2^31, a frame outside the upload as the nearest one inside. The
    cursor is left where the next call begins if that reads a window of five frames, one frame
    further on.
    """
    plane = ptr8(memory)
    top = words[SIZE]
    unsent = -1
    unsent <<= 31
    frame = words[motor + CURSOR]
    value = words[motor + _CURSOR_POSITION]
    velocity = words[motor + _CURSOR_VELOCITY]
    shown = value
    chunk = words[motor + REGION] + (frame >> 7) * CHUNK
    mark = index
    if count > 5:
        mark += count - 5
    while count > 0:
        want = index
        if want < 0:
            want = 0
        elif want >= words[FRAMES]:
            want = words[FRAMES] - 1
        if want >> 7 != frame >> 7 or frame - want > want & 127:
            frame = (want & -128) - 1
            chunk = words[motor + REGION] + (want >> 7) * CHUNK
            value = memory[chunk + BASE] | (((memory[chunk + BASE + 1] ^ 0x8000) - 0x8000) << 16)
            velocity = memory[chunk + VELOCITY] | (
                ((memory[chunk + VELOCITY + 1] ^ 0x8000) - 0x8000) << 16
            )
        while frame != want:
            back = 1
            if frame < want:
                back = 0
                frame += 1
            code = plane[2 * (chunk + CODES) + (frame & 127)]
            unit = memory[chunk + LINK]
            bits = 8
            if unit == 0:
                code = (code ^ 0x80) - 0x80
            while unit:
                place = top - unit * UNIT
                unit = memory[place]
                more = (memory[place + 1 + ((frame & 127) >> 3)] >> ((frame & 7) << 1)) & 3
                if unit == 0:
                    more = (more ^ 2) - 2  # the sign
                code |= more << bits
                bits += 2
            if back and bits == 32:  # no way back: start again from the chunk's beginning
                frame = (want & -128) - 1
            elif back:
                value -= velocity
                velocity -= code
                frame -= 1
            elif code == -1 << (bits - 1):
                shown = unsent
                continue
            elif bits == 32:
                value = code
            else:
                velocity += code
                value += velocity
            shown = value
        out[at] = shown
        if index == mark:
            words[motor + CURSOR] = frame
            words[motor + _CURSOR_POSITION] = value
            words[motor + _CURSOR_VELOCITY] = velocity
        at += 1
        index += 1
        count -= 1


@micropython.viper
def unpack(memory, words, motor: int, at: int):
    """Decode the chunk that begins at frame `at` into VALUES."""
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    count = word[motor + SENT_END] - at
    if count > CHUNK_FRAMES:
        count = CHUNK_FRAMES
    if count > 0:
        word[motor + CURSOR] = -1
        read(0, 0, memory, words, motor, at, count, words, VALUES)
        word[motor + CURSOR] = -1
    i = VALUES
    if count > 0:
        i += count
    while i < VALUES + CHUNK_FRAMES:
        word[i] = unsent
        i += 1
