"""Writing positions into the memory of an upload store, whose layout is in chunks.py.

Positions become changes of the steps per frame, in as few bits as a chunk allows. The kernels work
on the same two blocks, and have the same parameters, as those of chunks.py.
"""

from framestep.base.native import CPYTHON, micropython, ptr8, ptr16, ptr32
from framestep.moves.upload import chunks
from framestep.moves.upload.chunks import fill, pack, set_units, unpack

if CPYTHON:

    def _changes(words, i, memory, to, count):
        """Write the codes of `count` positions, from words[i] on, to the bytes from `to` on.

        Return 0 if all codes are within -64 to 63.
        """
        plane = ptr8(memory)  # type: ignore[misc]
        wide = 0
        for k in range(count):
            code = words[i + k] - words[i + k - 1] - words[i + k - 1] + words[i + k - 2]
            plane[to + k] = code & 0xFF
            wide |= code + 64
        return 1 if wide >> 7 else 0

else:

    @micropython.viper
    def _changes(words: ptr32, i: int, memory: ptr8, to: int, count: int) -> int:
        # On ARM, viper keeps two locals in registers: here `words` is the address, `i` the code.
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
    """Write SECTION to frames `at` to `stop`, which follow frames without a gap, without units.

    Return 0, with nothing changed, if units are needed, or might be.
    """
    half = ptr16(memory)
    word = ptr32(words)
    word[chunks.SECTION - 2] = word[motor + chunks.BEFORE_LAST]
    word[chunks.SECTION - 1] = word[motor + chunks.LAST]
    i = chunks.SECTION
    while at < stop:
        chunk = word[motor + chunks.REGION] + (at >> 7) * chunks.CHUNK
        within = at & 127
        end = i + chunks.CHUNK_FRAMES - within
        if end > i + stop - at:
            end = i + stop - at
        at += end - i
        if within > 1:
            value = word[i - 1]
            velocity = value - word[i - 2]  # wraps
        else:
            # The chunk's velocity is the step from its first frame to its second, so the codes of
            # both are 0.
            i -= within
            value = word[i + 0]
            velocity = 0
            if i + 1 < end:
                velocity = word[i + 1] - value  # wraps
        # Small changes cannot reach 2^29 from here, so everything below fits a word.
        if ((value ^ (value >> 31)) >> 28) | ((velocity ^ (velocity >> 31)) >> 20):
            return 0
        if within < 2:
            half[chunk + chunks.BASE] = (value - velocity) & 0xFFFF
            half[chunk + chunks.BASE + 1] = ((value - velocity) >> 16) & 0xFFFF
            half[chunk + chunks.VELOCITY] = velocity & 0xFFFF
            half[chunk + chunks.VELOCITY + 1] = (velocity >> 16) & 0xFFFF
            half[chunk + chunks.LINK] = 0
            half[chunk + chunks.CODES] = 0
            within = 2
            i += 2
            if i > end:
                i = end
        if half[chunk + chunks.LINK]:
            return 0
        if int(_changes(words, i, memory, 2 * (chunk + chunks.CODES) + within, end - i)):
            return 0
        i = end
    word[motor + chunks.LAST] = word[i - 1]
    word[motor + chunks.BEFORE_LAST] = word[i - 2]
    return 1


@micropython.viper
def _encode(i: int, code: int, memory, words, chunk: int):
    """Encode VALUES into the chunk; destroys them. TRYING: only count the units."""
    half = ptr16(memory)
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    end = chunks.VALUES + chunks.CHUNK_FRAMES
    i = chunks.VALUES
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
    i = chunks.VALUES
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
    set_units(memory, words, chunk, (bits - 7) >> 1)
    if word[chunks.TRYING]:
        return
    half[chunk + chunks.BASE] = base & 0xFFFF
    half[chunk + chunks.BASE + 1] = (base >> 16) & 0xFFFF
    half[chunk + chunks.VELOCITY] = first & 0xFFFF
    half[chunk + chunks.VELOCITY + 1] = (first >> 16) & 0xFFFF
    plane = ptr8(memory)
    to = 2 * (chunk + chunks.CODES)
    i = chunks.VALUES
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
    pack(0, 0, memory, words, chunk, 0, chunks.VALUES, chunks.CHUNK_FRAMES)


@micropython.viper
def write(i: int, to: int, memory, words, motor: int, index: int, count: int, end: int):
    """Store the `count` positions of SECTION from `index` on, the last one in all up to `end`."""
    word = ptr32(words)
    stop = index + count
    last = chunks.SECTION + count - 1
    past = word[motor + chunks.SENT_END]
    at = (index if index < past else past) & -128
    while at < end:
        chunk = word[motor + chunks.REGION] + (at >> 7) * chunks.CHUNK
        behind = at + chunks.CHUNK_FRAMES
        if at >= past:
            ptr16(memory)[chunk + chunks.LINK] = 0
        if at >= stop:  # from here on the motor keeps its position
            fill(memory, words, chunk, last, 0)
        elif at >= past and behind <= index:
            fill(memory, words, chunk, last, chunks.NOT_SENT)
        else:
            if index > at or end < behind:
                unpack(memory, words, motor, at)
            i = chunks.SECTION
            to = chunks.VALUES + index - at
            if index < at:
                i += at - index
                to = chunks.VALUES
            stretch = to + last + 1 - i
            if stretch > chunks.VALUES + chunks.CHUNK_FRAMES:
                stretch = chunks.VALUES + chunks.CHUNK_FRAMES
            while to < stretch:
                word[to] = word[i + 0]
                i += 1
                to += 1
            stretch = chunks.VALUES + end - at
            if stretch > chunks.VALUES + chunks.CHUNK_FRAMES:
                stretch = chunks.VALUES + chunks.CHUNK_FRAMES
            while to < stretch:
                word[to] = word[last]
                to += 1
            _encode(0, 0, memory, words, chunk)
        at = behind


@micropython.viper
def has_lowest(i: int, lowest: int, words: ptr32, count: int) -> int:
    """Return whether -2^31, which marks a frame not sent, is in SECTION."""
    lowest = -1
    lowest <<= 31
    i = chunks.SECTION + count
    while i > chunks.SECTION:
        i -= 1
        if words[i + 0] == lowest:
            return 1
    return 0


@micropython.viper
def fill_gaps(memory, words, motor: int):
    """Give frames not sent the position before them, and leading ones the first position."""
    word = ptr32(words)
    unsent = -1
    unsent <<= 31
    past = word[motor + chunks.SENT_END]
    begin = 0
    if word[motor + chunks.UNBROKEN] > 0:
        begin = (word[motor + chunks.UNBROKEN] - 1) & -128
    value = unsent
    at = begin
    while value == unsent:
        unpack(memory, words, motor, at)
        i = chunks.VALUES
        while i < chunks.VALUES + chunks.CHUNK_FRAMES and value == unsent:
            value = word[i]
            i += 1
        at += chunks.CHUNK_FRAMES
    at = begin
    while at < word[chunks.FRAMES]:
        chunk = word[motor + chunks.REGION] + (at >> 7) * chunks.CHUNK
        if at >= past:
            word[chunks.SECTION] = value
            ptr16(memory)[chunk + chunks.LINK] = 0
            fill(memory, words, chunk, chunks.SECTION, 0)
        else:
            unpack(memory, words, motor, at)
            gaps = 0
            end = (
                chunks.VALUES + chunks.CHUNK_FRAMES
            )  # or the end of the upload: frames beyond it need no units
            if word[chunks.FRAMES] - at < chunks.CHUNK_FRAMES:
                end = chunks.VALUES + word[chunks.FRAMES] - at
            i = chunks.VALUES
            while i < end:
                if word[i] == unsent:
                    word[i] = value
                    gaps = 1
                else:
                    value = word[i]
                i += 1
            if gaps:
                _encode(0, 0, memory, words, chunk)
        at += chunks.CHUNK_FRAMES
