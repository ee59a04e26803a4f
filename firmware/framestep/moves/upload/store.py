"""The uploaded move: a position for every frame of every motor, in one block of memory.

A motor gets a region of that memory with its first section; motors without data take none.
chunks.py describes how positions are kept in a region, codec.py writes them.

What fits. A frame takes 1.08 bytes for each motor while the steps per frame change by at most 127
from one frame to the next, and 1.34 bytes up to 511. All frames of capacity_frames() fit if no
motor's steps per frame change by more than 511 from one frame to the next, which at 24 frames/s is
294 000 steps/s². If they change by less, there is memory for greater changes elsewhere, of any
size.

Nothing but the constructor and allocate() allocates. Positions go through arrays, since they need
not fit a small integer; frame numbers and indexes are small integers. An index counts from 0 at the
first frame of the range (field note 5.1).
"""

from array import array

from framestep.base.copying import copy_dwords
from framestep.base.native import CPYTHON, const, micropython, ptr32
from framestep.base.results import ERR_GENERAL, ERR_RANGE, OK
from framestep.moves.upload import chunks
from framestep.moves.upload.chunks import fits, read, room
from framestep.moves.upload.codec import append, fill_gaps, has_lowest, write

# States
EMPTY = const(0)  # no upload
LOADING = const(1)  # begun, not finished
READY = const(2)

# ± (field note 5.3): MOVE TIME, a thousand times this, is still a small integer
FARTHEST_FRAME = const(1000000)
# half words that the capacity counts for a chunk: the chunk's own and a unit
_PER_CHUNK = const(chunks.CHUNK + chunks.UNIT)


def bytes_for(motors, frames):
    """Return the memory that makes UploadStore.capacity_frames(motors) at least `frames`."""
    return 2 * motors * _PER_CHUNK * ((frames + chunks.CHUNK_FRAMES - 1) // chunks.CHUNK_FRAMES)


class UploadStore:
    """Store of an uploaded move.

    `state` is EMPTY, LOADING or READY, `start` and `end` are the first and the last scene frame. A
    refused request changes nothing (field note 5.3). Motors are counted from 0.
    """

    def __init__(self, motors, memory_bytes=0):
        """motors: their number. memory_bytes: as for allocate(), 0: allocate later."""
        self.motors = motors
        self._limit = 0
        self._memory = None
        self._words = array("i", [0] * (chunks.RECORDS + chunks.RECORD_WORDS * motors))
        self._words[chunks.MOTORS] = motors
        self.clear()
        if memory_bytes:
            self.allocate(memory_bytes)

    def allocate(self, memory_bytes):
        """Allocate the memory, for good. Raises ValueError if not even a chunk for each motor fits.

        Allocates one block.
        """
        self._words[chunks.SIZE] = memory_bytes // 2
        self._limit = self.capacity_frames(self.motors)
        if self._limit < 1:
            raise ValueError(
                "an upload of %d motors needs %d bytes or more, not %d"
                % (self.motors, bytes_for(self.motors, 1), memory_bytes)
            )
        # On the board only a bytearray gets its memory from the heap without a copy.
        self._memory = (
            array("H", bytes(memory_bytes // 2 * 2))
            if CPYTHON
            else bytearray(memory_bytes // 2 * 2)
        )
        self.clear()

    def capacity_frames(self, motors):
        """Return how many frames fit for this many motors if no steps per frame change by more than
        511."""
        return self._words[chunks.SIZE] // (motors * _PER_CHUNK) * chunks.CHUNK_FRAMES

    def clear(self):
        """Drop the upload."""
        self.state = EMPTY
        self.start = 0
        self.end = 0
        words = self._words
        words[chunks.BOTTOM] = 0
        words[chunks.USED] = 0
        words[chunks.FREE] = 0
        words[chunks.FREE_COUNT] = 0
        words[chunks.TRYING] = 0
        words[chunks.ASKED] = 0
        words[chunks.FRAMES] = 0
        words[chunks.STATE] = EMPTY
        for motor in range(chunks.RECORDS, len(words), chunks.RECORD_WORDS):
            words[motor + chunks.REGION] = -1

    @property
    def memory(self):
        """The memory of chunks and units, which light levels and triggers share."""
        return self._memory

    @property
    def words(self):
        """The counters and buffers of that memory (chunks.py)."""
        return self._words

    def begin(self, start, end):
        """Begin the upload of scene frames `start` to `end` (spec: MSG_RT_UPLOAD_MOVE_BEGIN).

        Drops the old upload. Frame numbers are small integers and may be negative. ERR_RANGE for
        more frames than fit, an end before the start, and frames beyond ± FARTHEST_FRAME.
        """
        if not (-FARTHEST_FRAME <= start <= end <= FARTHEST_FRAME) or end - start >= self._limit:
            return ERR_RANGE
        self.clear()
        self.state = LOADING
        self.start = start
        self.end = end
        self._words[chunks.FRAMES] = end - start + 1
        self._words[chunks.STATE] = LOADING
        return OK

    @micropython.viper
    def section(self, motor: int, index: int, last: int, buffer, at: int, count: int) -> int:
        """Store `count` positions of a motor from frame `index` on (spec: MSG_RT_UPLOAD_MOVE_AXIS).

        The positions are the DWORDs from buffer[at] on; those beyond the end of the range are
        ignored (field note 5.3). If `last`, the final one also goes to every frame after it, sent
        before or not. Sections may come in any order and repeatedly; the latest counts. ERR_GENERAL
        unless an upload has begun. ERR_RANGE for a section that begins outside the range, for a
        `last` section without a position, for the position -2^31, and if the changes from frame to
        frame need more memory than there is: ASKED and LEFT of `words` say how much.
        """
        memory = self._memory
        words = self._words
        word = ptr32(words)
        frames = word[chunks.FRAMES]
        if word[chunks.STATE] != LOADING:
            return int(ERR_GENERAL)
        if motor < 0 or motor >= word[chunks.MOTORS] or index < 0 or index >= frames:
            return int(ERR_RANGE)
        if count > frames - index:
            count = frames - index
        if count < 0 or count > chunks.MOST_POSITIONS:
            return int(ERR_RANGE)
        if count == 0:
            return int(ERR_RANGE) if last else int(OK)
        copy_dwords(words, buffer, chunks.SECTION, at, count)
        motor = chunks.RECORDS + motor * chunks.RECORD_WORDS
        bottom = word[chunks.BOTTOM]
        fresh = word[motor + chunks.REGION] < 0
        if fresh:
            size = ((frames + chunks.CHUNK_FRAMES - 1) >> 7) * chunks.CHUNK
            end = word[chunks.SIZE] - word[chunks.USED] * chunks.UNIT
            if bottom + size > end:
                word[chunks.ASKED] = 2 * size
                word[chunks.LEFT] = 2 * (end - bottom)
                return int(ERR_RANGE)
            word[chunks.BOTTOM] = bottom + size
            word[motor + chunks.REGION] = bottom
            word[motor + chunks.UNBROKEN] = 0
            word[motor + chunks.SENT_END] = 0
            word[motor + chunks.LAST] = 0
            word[motor + chunks.BEFORE_LAST] = 0
        past = word[motor + chunks.SENT_END]
        stop = index + count
        end = frames if last else stop
        if index == past and index == word[motor + chunks.UNBROKEN] and end == stop:
            if int(append(0, 0, memory, words, motor, index, stop)):
                word[motor + chunks.UNBROKEN] = stop
                word[motor + chunks.SENT_END] = stop
                return int(OK)
        good = 0
        if int(has_lowest(0, 0, words, count)) == 0:
            good = 1
            if int(room(words)) < (((stop - 1) >> 7) - (index >> 7) + 2) * chunks.MOST_UNITS:
                word[chunks.TRYING] = 1
                word[chunks.NEEDED] = 0
                word[chunks.PEAK] = 0
                write(0, 0, memory, words, motor, index, count, end)
                word[chunks.TRYING] = 0
                good = int(fits(words, word[chunks.PEAK]))
        if good == 0:
            if fresh:
                word[chunks.BOTTOM] = bottom
                word[motor + chunks.REGION] = -1
            return int(ERR_RANGE)
        write(0, 0, memory, words, motor, index, count, end)
        if end > past:
            past = end
            word[motor + chunks.SENT_END] = end
        if index <= word[motor + chunks.UNBROKEN] and end > word[motor + chunks.UNBROKEN]:
            word[motor + chunks.UNBROKEN] = end
        word[motor + chunks.CURSOR] = -1
        read(0, 0, memory, words, motor, past - 2, 2, words, motor + chunks.BEFORE_LAST)
        word[motor + chunks.CURSOR] = -1
        return int(OK)

    def finish(self):
        """End the upload (spec: MSG_RT_UPLOAD_MOVE_END).

        A frame that has not been sent keeps the position of the frame before it. Frames before the
        first one sent get its position. ERR_GENERAL unless an upload has begun; ERR_RANGE if this
        needs more memory than there is.
        """
        if self.state == EMPTY:
            return ERR_GENERAL
        if self.state == LOADING:
            words = self._words
            words[chunks.NEEDED] = 0
            words[chunks.PEAK] = 0
            # the first time only to find out whether it fits
            for trying in (1, 0):
                words[chunks.TRYING] = trying
                for motor in range(chunks.RECORDS, len(words), chunks.RECORD_WORDS):
                    if (
                        words[motor + chunks.REGION] >= 0
                        and words[motor + chunks.UNBROKEN] < words[chunks.FRAMES]
                    ):
                        fill_gaps(self._memory, words, motor)
                    words[motor + chunks.CURSOR] = -1
                if trying and not fits(words, words[chunks.PEAK]):
                    words[chunks.TRYING] = 0
                    return ERR_RANGE
            words[chunks.STATE] = READY
            self.state = READY
        return OK

    def has(self, motor):
        """Return whether the motor has uploaded positions."""
        return self._words[chunks.RECORDS + motor * chunks.RECORD_WORDS + chunks.REGION] >= 0

    def position(self, motor, index, words, at):
        """Put the motor's position at frame `index` into words[at]; see positions()."""
        return self.positions(motor, index, 1, words, at)

    @micropython.viper
    def positions(self, motor: int, index: int, count: int, words, at: int) -> bool:
        """Put the positions of `count` frames from `index` on into words[at], ..., an array('i').

        Frames before the first have the position of the first, frames beyond the last the position
        of the last. Return False, and write nothing, unless the upload is READY and the motor has
        data.
        """
        own = self._words
        word = ptr32(own)
        motor = chunks.RECORDS + motor * chunks.RECORD_WORDS
        if word[motor + chunks.REGION] < 0 or word[chunks.STATE] != READY:
            return False
        read(0, 0, self._memory, own, motor, index, count, words, at)
        return True
