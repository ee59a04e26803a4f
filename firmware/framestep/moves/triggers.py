"""The uploaded triggers of a move: which outputs are on at which frame.

Triggers are pairs of words sorted by frame: frame << 1 | 1 while a message is being stored that
brought this frame, and the values.

Nothing but the constructor and allocate() allocates. Frame indexes are small integers; MASK and
VALUES go through arrays, since they need not be. An index counts from 0 at the first frame of the
range (field note 5.1).
"""

from array import array

from framestep.copying import move_words
from framestep.moves.light_levels import EMPTY, LOADING, MOST_FRAMES, READY, first_key
from framestep.native import CPYTHON, const, micropython, ptr8, ptr32
from framestep.results import ERR_GENERAL, ERR_RANGE, OK

# Words of the block
_STATE = const(0)
_FRAMES = const(1)  # of the range
_HELD = const(2)  # frames held
_CAPACITY = const(3)  # frames that fit
_SENT = const(4)  # whether a message has come
_MASK = const(5)
_WORDS = const(6)


@micropython.viper
def _reserve(words, table, source, at: int, count: int) -> int:
    """Make a marked entry for each new frame; frames past the end of the range are left out.

    0 if one does not fit or lies before the range, or if the first one lies past the end.
    """
    word = ptr32(words)
    entries = ptr32(table)
    sent = ptr8(source)
    first = at
    end = at + count * 8
    while at < end:
        frame = sent[at] | (sent[at + 1] << 8) | (sent[at + 2] << 16)
        if sent[at + 3] or frame >= word[_FRAMES]:
            if at == first or sent[at + 3] >> 7:
                return 0
            at += 8
            continue
        held = word[_HELD]
        i = int(first_key(table, 2, 1, held, frame))
        if i == held or entries[i * 2] >> 1 != frame:
            if held == word[_CAPACITY]:
                return 0
            move_words(i * 2 + 2, i * 2, (held - i) * 2, table)
            entries[i * 2] = (frame << 1) | 1
            word[_HELD] = held + 1
        at += 8
    return 1


@micropython.viper
def _remove_marked(words: ptr32, table: ptr32):
    """Remove the marked entries."""
    held = words[_HELD]
    to = 0
    i = 0
    while i < held:
        if table[i * 2] & 1 == 0:
            table[to * 2] = table[i * 2]
            table[to * 2 + 1] = table[i * 2 + 1]
            to += 1
        i += 1
    words[_HELD] = to


class Triggers:
    """Stores the triggers of an uploaded move and reads them.

    `ready`: whether a finished upload has triggers; until finish() none are read.
    """

    def __init__(self, frames=0):
        """frames: as for allocate()."""
        self._words = array("i", [0] * _WORDS)
        self.allocate(frames)

    def allocate(self, frames):
        """Allocate room for `frames` frames with triggers, 8 bytes each. Clears the store."""
        self._table = array("i", bytes(8 * frames)) if CPYTHON else bytearray(8 * frames)
        self._words[_CAPACITY] = frames
        self.clear()

    @property
    def room(self):
        """How many frames with triggers fit."""
        return self._words[_CAPACITY]

    def clear(self):
        """Forget the upload."""
        words = self._words
        words[_STATE] = EMPTY
        words[_FRAMES] = 0
        words[_HELD] = 0
        words[_SENT] = 0
        words[_MASK] = 0
        self.ready = False

    def begin(self, frames):
        """Begin the upload of a range of `frames` frames; the old one is gone."""
        self.clear()
        self._words[_FRAMES] = min(frames, MOST_FRAMES)
        self._words[_STATE] = LOADING

    @micropython.viper
    def store(self, mask, source, at: int, count: int) -> int:
        """Store the values of `count` frames (spec: MSG_RT_UPLOAD_MOVE_TRIGGERS).

        mask: an array('i') with MASK in its first word. The pairs of FRAME and VALUES, DWORDs, lie
        from source[at] on. Frames that are not sent have no trigger on; for a frame sent again, and
        for MASK, the latest counts. ERR_GENERAL unless an upload has begun. ERR_RANGE if the first
        frame lies past the range, if any lies before it, and for more frames than fit. A refused
        message changes nothing.
        """
        words = self._words
        table = self._table
        word = ptr32(words)
        if word[_STATE] != LOADING:
            return int(ERR_GENERAL)
        if count < 0:
            return int(ERR_RANGE)
        if int(_reserve(words, table, source, at, count)) == 0:
            _remove_marked(words, table)
            return int(ERR_RANGE)
        sent = ptr8(source)
        entries = ptr32(table)
        held = word[_HELD]
        while count > 0:
            frame = sent[at] | (sent[at + 1] << 8) | (sent[at + 2] << 16)
            if sent[at + 3] == 0 and frame < word[_FRAMES]:
                i = int(first_key(table, 2, 1, held, frame)) * 2
                entries[i] = frame << 1
                entries[i + 1] = (
                    sent[at + 4]
                    | (sent[at + 5] << 8)
                    | (sent[at + 6] << 16)
                    | (((sent[at + 7] ^ 0x80) - 0x80) << 24)
                )
            at += 8
            count -= 1
        word[_MASK] = ptr32(mask)[0]
        word[_SENT] = 1
        return int(OK)

    def finish(self):
        """End the upload, if one has begun: from now on it can be played."""
        words = self._words
        if words[_STATE] == LOADING:
            words[_STATE] = READY
            self.ready = words[_SENT] > 0

    @micropython.viper
    def mask_to(self, words, at: int):
        """Put the MASK of the triggers into the array('i') words[at]; 0 where there are none."""
        word = ptr32(self._words)
        to = ptr32(words)
        to[at] = word[_MASK] if word[_STATE] == READY else 0

    @micropython.viper
    def values_to(self, index: int, words, at: int):
        """words[at] = the VALUES of frame `index` as they were sent, 0 if there are none."""
        word = ptr32(self._words)
        table = self._table
        to = ptr32(words)
        to[at] = 0
        if word[_STATE] != READY:
            return
        held = word[_HELD]
        i = int(first_key(table, 2, 1, held, index))
        entries = ptr32(table)
        if i < held and entries[i * 2] >> 1 == index:
            to[at] = entries[i * 2 + 1]
