"""The memory of an upload store: positions as changes of the steps per frame, in few bits.

A motor's frames lie in a region, a row of chunks of 128 frames:

    base, two half words | velocity, two half words | link | 64 half words, a byte for each frame

A frame's code is the change of the steps per frame at that frame: code by code it is added to the
velocity, and the velocity to the position, beginning with the chunk's velocity and base. The low
eight bits of a code lie in the chunk. If eight bits are too few for some code, the chunk gets
units, each adding two bits to every code:

    link | 16 half words, two bits for each frame

Units come from a pool that grows down from the end of the memory. Links, 0 at the end, chain the
units of a chunk. With twelve units a code has 32 bits and is the position itself; chunks that leave
± 2^29 steps, or that fit no fewer bits, are kept so. The lowest code of a width stands for a frame
that has not been sent, and leaves velocity and position alone. A chunk's velocity is that from its
first to its second frame sent, so its units depend on its positions only.

The kernels here work on two blocks: `memory`, half words, has the chunks and units; `words`
(array('i')) has the counters below, two buffers and a record for each motor. `motor` is the index
of that record in `words`. A kernel that is told to try first (TRY) writes nothing and only counts
the units that it would take.

(Parameters `i`, `bits`, `code` and the like that come first and are passed as 0 are locals: viper
keeps a kernel's first two parameters in registers on ARM.)
"""

from framestep.native import CPYTHON, const, micropython, ptr8, ptr16, ptr32

CHUNK_FRAMES = const(128)
_BASE = const(0)  # half words of a chunk
_VELOCITY = const(2)
_LINK = const(4)
_CODES = const(5)
CHUNK = const(69)
UNIT = const(17)  # half words of a unit: its link, its bits
MOST_UNITS = const(12)  # of a chunk
_NOT_SENT = const(0x8080)  # two codes of a chunk without units

MOST_POSITIONS = const(257)  # of a section: what the largest frame of the protocol holds

# The block `words`
SIZE = const(0)  # half words of the memory
BOTTOM = const(1)  # those that regions take
FREE = const(2)  # first free unit of those that have been in use, the others hang on it; 0: none
FREE_COUNT = const(3)
# units that are or have been in use: number u lies u units before the end of the memory
USED = const(4)
TRYING = const(5)  # 1: nothing is written, only NEEDED is counted
NEEDED = const(6)  # units that the changes so far would have taken
FRAMES = const(7)  # of the upload
MOTORS = const(8)
STATE = const(9)  # of the store
_VALUES = const(10)  # positions of a chunk
SECTION = const(140)  # positions of a section, behind the two before them
RECORDS = const(397)  # a record for each motor:
REGION = const(0)  # where its chunks begin, half words; -1: no data
UNBROKEN = const(1)  # frames sent without a gap, from the first on
SENT_END = const(2)  # the frame after the last one sent; what lies behind has no content yet
BEFORE_LAST = const(3)  # position of the frame before the last one sent
LAST = const(4)  # and of the last one sent
CURSOR = const(5)  # a frame read before, -1: none
_CURSOR_POSITION = const(6)
_CURSOR_VELOCITY = const(7)
RECORD_WORDS = const(8)


@micropython.viper
def room(words: ptr32) -> int:
    """Units that the pool can still give."""
    return words[FREE_COUNT] + (words[SIZE] - words[BOTTOM]) // UNIT - words[USED]


@micropython.viper
def _set_units(memory, words, chunk: int, units: int) -> int:
    """Give a chunk `units` units, some of which it may have; 0 if TRYING and there are too few."""
    half = ptr16(memory)
    word = ptr32(words)
    top = word[SIZE]
    at = chunk + _LINK
    if word[TRYING]:
        word[NEEDED] += units
        while half[at]:
            word[NEEDED] -= 1
            at = top - half[at] * UNIT
        return 1 if word[NEEDED] <= int(room(words)) else 0
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
    return 1


@micropython.viper
def _pack(
    i: int, bits: int, memory: ptr16, words: ptr32, chunk: int, at: int, start: int, count: int
):
    """Put the high bits of `count` codes, words[start] and on, into the chunk's units at frame
    `at`.

    What the units have for later frames is lost.
    """
    end = start + count
    shift = 0
    unit = memory[chunk + _LINK]
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


if CPYTHON:

    def _changes(words, i, memory, to, count):
        """Write the codes of `count` positions, words[i] and on, to the bytes from `to` on.

        0 if all codes are within -64 to 63.
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
    def _changes(words: ptr32, i: int, memory: ptr8, to: int, count: int) -> int:
        # Of the two registers that viper has for locals on ARM `words` holds the place, `i` the
        # code.
        words = ptr32(int(words) + ((i - 2) << 2))
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
def append(i: int, end: int, memory, words, motor: int, at: int, stop: int) -> int:
    """Write SECTION to frames `at` to `stop`, behind frames without a gap, if no units are needed.

    0, and nothing has changed, if they need some, or might.
    """
    half = ptr16(memory)
    word = ptr32(words)
    word[SECTION - 2] = word[motor + BEFORE_LAST]
    word[SECTION - 1] = word[motor + LAST]
    i = SECTION
    while at < stop:
        chunk = word[motor + REGION] + (at >> 7) * CHUNK
        within = at & 127
        end = i + CHUNK_FRAMES - within
        if end > i + stop - at:
            end = i + stop - at
        at += end - i
        if within > 1:
            value = word[i - 1]
            velocity = value - word[i - 2]  # wraps
        else:
            # The chunk's velocity is that from its first frame to its second: the codes of both are
            # 0.
            i -= within
            value = word[i + 0]
            velocity = 0
            if i + 1 < end:
                velocity = word[i + 1] - value  # wraps
        # From here no way in small changes to 2^29: all of what follows fits a word.
        if ((value ^ (value >> 31)) >> 28) | ((velocity ^ (velocity >> 31)) >> 20):
            return 0
        if within < 2:
            half[chunk + _BASE] = (value - velocity) & 0xFFFF
            half[chunk + _BASE + 1] = ((value - velocity) >> 16) & 0xFFFF
            half[chunk + _VELOCITY] = velocity & 0xFFFF
            half[chunk + _VELOCITY + 1] = (velocity >> 16) & 0xFFFF
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
    word[motor + LAST] = word[i - 1]
    word[motor + BEFORE_LAST] = word[i - 2]
    return 1


@micropython.viper
def _encode(i: int, code: int, memory, words, chunk: int) -> int:
    """Encode VALUES, which are lost, into the chunk; 0 if TRYING and the pool has too few units."""
    half = ptr16(memory)
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    end = _VALUES + CHUNK_FRAMES
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
            far |= code ^ (code >> 31)
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
    if int(_set_units(memory, words, chunk, (bits - 7) >> 1)) == 0:
        return 0
    if word[TRYING]:
        return 1
    half[chunk + _BASE] = base & 0xFFFF
    half[chunk + _BASE + 1] = (base >> 16) & 0xFFFF
    half[chunk + _VELOCITY] = first & 0xFFFF
    half[chunk + _VELOCITY + 1] = (first >> 16) & 0xFFFF
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
    _pack(0, 0, memory, words, chunk, 0, _VALUES, CHUNK_FRAMES)
    return 1


@micropython.viper
def _fill(memory, words, chunk: int, position: int, codes: int):
    """Set all frames of the chunk to words[position], or with _NOT_SENT as `codes` to not sent."""
    half = ptr16(memory)
    word = ptr32(words)
    _set_units(memory, words, chunk, 0)
    if word[TRYING]:
        return
    half[chunk + _BASE] = word[position + 0] & 0xFFFF
    half[chunk + _BASE + 1] = (word[position + 0] >> 16) & 0xFFFF
    half[chunk + _VELOCITY] = 0
    half[chunk + _VELOCITY + 1] = 0
    at = chunk + _CODES
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

    -2^31 stands for a frame not sent.

    A frame outside the upload reads as the nearest one inside. The cursor is left where the next
    call begins if it asks for a window of five frames, one further on.
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
            value = memory[chunk + _BASE] | (((memory[chunk + _BASE + 1] ^ 0x8000) - 0x8000) << 16)
            velocity = memory[chunk + _VELOCITY] | (
                ((memory[chunk + _VELOCITY + 1] ^ 0x8000) - 0x8000) << 16
            )
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
                place = top - unit * UNIT
                unit = memory[place]
                more = (memory[place + 1 + ((frame & 127) >> 3)] >> ((frame & 7) << 1)) & 3
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
def _unpack(memory, words, motor: int, at: int):
    """Decode the chunk that begins at frame `at` into VALUES."""
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    count = word[motor + SENT_END] - at
    if count > CHUNK_FRAMES:
        count = CHUNK_FRAMES
    if count > 0:
        word[motor + CURSOR] = -1
        read(0, 0, memory, words, motor, at, count, words, _VALUES)
        word[motor + CURSOR] = -1
    i = _VALUES
    if count > 0:
        i += count
    while i < _VALUES + CHUNK_FRAMES:
        word[i] = unsent
        i += 1


@micropython.viper
def write(i: int, to: int, memory, words, motor: int, index: int, count: int, end: int) -> int:
    """Store the `count` positions of SECTION from `index` on, the last one up to `end`.

    0 if TRYING and they do not fit.
    """
    word = ptr32(words)
    stop = index + count
    last = SECTION + count - 1
    past = word[motor + SENT_END]
    at = (index if index < past else past) & -128
    while at < end:
        chunk = word[motor + REGION] + (at >> 7) * CHUNK
        behind = at + CHUNK_FRAMES
        if at >= past:
            ptr16(memory)[chunk + _LINK] = 0
        if at >= stop:  # from here on the motor is still
            _fill(memory, words, chunk, last, 0)
        elif at >= past and behind <= index:
            _fill(memory, words, chunk, last, _NOT_SENT)
        else:
            if index > at or end < behind:
                _unpack(memory, words, motor, at)
            i = SECTION
            to = _VALUES + index - at
            if index < at:
                i += at - index
                to = _VALUES
            stretch = to + last + 1 - i
            if stretch > _VALUES + CHUNK_FRAMES:
                stretch = _VALUES + CHUNK_FRAMES
            while to < stretch:
                word[to] = word[i + 0]
                i += 1
                to += 1
            stretch = _VALUES + end - at
            if stretch > _VALUES + CHUNK_FRAMES:
                stretch = _VALUES + CHUNK_FRAMES
            while to < stretch:
                word[to] = word[last]
                to += 1
            if int(_encode(0, 0, memory, words, chunk)) == 0:
                return 0
        at = behind
    return 1


@micropython.viper
def has_lowest(i: int, lowest: int, words: ptr32, count: int) -> int:
    """Whether -2^31, which stands for a frame not sent, is in SECTION."""
    lowest = -1
    lowest <<= 31
    i = SECTION + count
    while i > SECTION:
        i -= 1
        if words[i + 0] == lowest:
            return 1
    return 0


@micropython.viper
def fill_gaps(memory, words, motor: int) -> int:
    """Give frames not sent the position before them, leading ones the first; 0 if TRYING in
    vain."""
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    past = word[motor + SENT_END]
    begin = 0
    if word[motor + UNBROKEN] > 0:
        begin = (word[motor + UNBROKEN] - 1) & -128
    value = unsent
    at = begin
    while value == unsent:
        _unpack(memory, words, motor, at)
        i = _VALUES
        while i < _VALUES + CHUNK_FRAMES and value == unsent:
            value = word[i]
            i += 1
        at += CHUNK_FRAMES
    at = begin
    while at < word[FRAMES]:
        chunk = word[motor + REGION] + (at >> 7) * CHUNK
        if at >= past:
            word[SECTION] = value
            ptr16(memory)[chunk + _LINK] = 0
            _fill(memory, words, chunk, SECTION, 0)
        else:
            _unpack(memory, words, motor, at)
            gaps = 0
            end = _VALUES + CHUNK_FRAMES  # or that of the upload: what lies behind takes no units
            if word[FRAMES] - at < CHUNK_FRAMES:
                end = _VALUES + word[FRAMES] - at
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
        at += CHUNK_FRAMES
    return 1
