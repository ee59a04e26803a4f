"""DMX light levels: set at once, or ramped linearly (field note 8.1).

The HAL sends them. A channel ramps while its level and its target differ. Nothing allocates after
construction.
"""

from array import array

from framestep.base.copying import copy_bytes
from framestep.base.native import addressof, as_word, const, micropython, ptr8, ptr16, ptr32
from framestep.hal import CHANGED, CHANNELS

MARK = const(2)  # bit of a channel's byte in put_marked()
# channels updated in a pass: each channel gets its turn before a frame is sent
_PER_PASS = const(64)

_WRAP = const(0xFFFF)  # of the beginnings of ramps, ms; a ramp takes at most 60000

# Words of Lights.words, in addition to CHANGED
RAMPING = const(1)  # number of channels that ramp
_LENGTH = const(2)  # of a ramp, ms
_CURSOR = const(3)  # last channel updated


@micropython.viper
def _put(levels: ptr8, targets: ptr8, words: ptr32, first: int, source: ptr8, at: int, count: int):
    """Set levels and targets of `count` channels from `first` on to the bytes from source[at]
    on."""
    last = first + count
    c = first
    while c < last:
        level = source[at]
        old = levels[c + 0]
        if old ^ targets[c + 0]:
            words[RAMPING] = words[RAMPING] - 1
        targets[c + 0] = level
        if old ^ level:
            levels[c + 0] = level
            words[CHANGED] = 1
        at += 1
        c += 1


@micropython.viper
def _put_marked(
    levels: ptr8, targets: ptr8, words: ptr32, first: int, last: int, source: ptr8, marks: ptr8
):
    """Set the channels first … last whose bit MARK is set in `marks` to their byte in `source`."""
    c = first
    while c <= last:
        mark = marks[c + 0]
        if mark & MARK:
            marks[c + 0] = mark ^ MARK
            level = source[c + 0]
            old = levels[c + 0]
            if old ^ targets[c + 0]:
                words[RAMPING] = words[RAMPING] - 1
            targets[c + 0] = level
            if old ^ level:
                levels[c + 0] = level
                words[CHANGED] = 1
        c += 1


@micropython.viper
def _ramp(ramp: ptr32, words: ptr32, first: int, source: ptr8, at: int, count: int):
    """Begin ramps of `count` channels from `first` on to the bytes from source[at] on.

    ramp: the addresses of levels, targets, origins and beginnings, and the time, in this order.
    """
    levels = ptr8(ramp[0])
    targets = ptr8(ramp[1])
    origins = ptr8(ramp[2])
    begins = ptr16(ramp[3])
    now = ramp[4] & _WRAP
    last = first + count
    c = first
    while c < last:
        level = source[at]
        old = levels[c + 0]
        if old ^ targets[c + 0]:
            words[RAMPING] = words[RAMPING] - 1
        targets[c + 0] = level
        if old ^ level:
            words[RAMPING] = words[RAMPING] + 1
            origins[c + 0] = old
            begins[c + 0] = now
        at += 1
        c += 1


@micropython.viper
def _advance(ramp: ptr32, words: ptr32, now: int):
    """Update the ramps of the next _PER_PASS channels."""
    levels = ptr8(ramp[0])
    targets = ptr8(ramp[1])
    length = words[_LENGTH]
    c = words[_CURSOR]
    n = _PER_PASS
    while n:
        n -= 1
        c += 1
        if c > CHANNELS:
            c = 1
        target = targets[c + 0]
        if levels[c + 0] ^ target:
            begins = ptr16(ramp[3])
            passed = now - begins[c + 0] & _WRAP
            level = target
            if passed < length:
                origins = ptr8(ramp[2])
                level = origins[c + 0]
                if target > level:
                    level += (target - level) * passed // length
                else:
                    level -= (level - target) * passed // length
            if level ^ levels[c + 0]:
                levels[c + 0] = level
                words[CHANGED] = 1
                if level == target:
                    words[RAMPING] = words[RAMPING] - 1
    words[_CURSOR] = c


class Lights:
    """Channels 1 … count; `levels[channel]` is the present level. levels[0] is the start code, 0.

    count: 0 (no DMX here) or 512. ramp_ms: how long a ramp takes, 0 to 60000.
    """

    def __init__(self, count, ramp_ms):
        self.count = count
        self.levels = bytearray(CHANNELS + 1)
        self.words = array("i", (0, 0, ramp_ms, 0))
        self._targets = bytearray(CHANNELS + 1)
        ramping = CHANNELS + 1 if count and ramp_ms else 0
        self._origins = bytearray(ramping)
        self._begins = array("H", [0] * ramping)
        self._ramp = array("i", [0] * 5)
        for i, memory in enumerate((self.levels, self._targets, self._origins, self._begins)):
            self._ramp[i] = as_word(addressof(memory))
        self._one = bytearray(1)

    def level(self, channel):
        """Return the present level of a channel (1 … 512), 0 … 255."""
        return self.levels[channel]

    def set(self, channel, level):
        """Set one channel (1 … count) to a level at once, 0 … 255. Ends its ramp."""
        self._one[0] = level
        _put(self.levels, self._targets, self.words, channel, self._one, 0, 1)

    def put(self, channel, source, at, count):
        """Set `count` channels from `channel` on to the bytes from source[at] on, at once."""
        _put(self.levels, self._targets, self.words, channel, source, at, count)

    def put_marked(self, first, last, source, marks):
        """Set channels first … last whose bit MARK is set in marks[channel] to source[channel].

        Clears the marks. A single call for scattered channels; takes 0.6 µs a channel.
        """
        _put_marked(self.levels, self._targets, self.words, first, last, source, marks)

    def ramp(self, now, channel, source, at, count):
        """Like put(), but by ramps that begin at `now` (milliseconds modulo 2^29)."""
        if self.words[_LENGTH] == 0:
            _put(self.levels, self._targets, self.words, channel, source, at, count)
            return
        self._ramp[4] = now
        _ramp(self._ramp, self.words, channel, source, at, count)

    def fits(self, channel, count):
        """Return whether all these channels exist."""
        return 1 <= channel <= self.count and channel + count - 1 <= self.count

    def take(self, buffer):
        """Copy start code and levels into buffer[0 … CHANNELS], to be sent. Clears CHANGED."""
        self.words[CHANGED] = 0
        copy_bytes(buffer, 0, self.levels, 0, CHANNELS + 1)

    @property
    def adjusting(self):
        """Whether a channel ramps."""
        return self.words[RAMPING] != 0

    def poll(self, now):
        """Update the ramps: an eighth of the channels in each pass of the main loop."""
        if self.words[RAMPING]:
            _advance(self._ramp, self.words, now)
