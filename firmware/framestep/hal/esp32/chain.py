"""Sends the words of hal/stream.py on an ESP32: by I2S into a chain of 74HC595.

The main loop calls serve() in every pass. I2S plays a ring of DMA buffers of 256 words each, and
accepts new ones whenever one has been played. serve() does ticks and hands over whole buffers until
it accepts no more. I2S does not report that it was fed too late, so that is derived from the clock:
if the ring came too close to its end, whatever moves faults and ramps down, and its position is
lost.

Bit n of a word is output n of the chain, counted from its first stage. Outputs 30 and 31 stay low.
All are low from the start of I2S until the first words come through the ring, and whenever the ring
has run out. So drivers need enable inputs that are off while low.
"""

from array import array
from select import POLLOUT, poll
from time import ticks_us

from machine import I2S, Pin

from framestep.base.clock import WIDE_WRAP
from framestep.base.native import const, micropython, ptr32
from framestep.pulse.stepper import moving

RATE = const(250000)  # words a second, one each 4 µs
WORDS = const(RATE // 1000)  # in a tick, as in pulse/stream_engine.py
FRAMES = const(256)  # words of a DMA buffer; MicroPython has no other
_BYTES = const(4)  # of a word
_SLOTS = const(4)  # buffers that there is memory for: what follows a fault takes most of it
_BUFFER_BITS = const(10)  # a buffer lasts 1 << this µs
_STILL = const(4)  # ticks within which motors at rest make their last pulses
_HELD = const(2)  # buffers without pulses after the ring ran out: time to paint the next ones

LEAST = const(8)  # buffers
MOST = const(40)

# Words of a count
_LAG = const(0)  # played buffers that have not been filled again
_WITHIN = const(1)  # µs since the last of them was played
_SEEN = const(2)  # ticks_us() then
_COUNT_WORDS = const(3)


@micropython.viper
def look(count: ptr32, now: int, filled: int) -> int:
    """Bring a count up to date and return its _LAG. now: ticks_us(). filled: buffers that have been
    filled since the last call."""
    within = ((now - count[_SEEN]) & WIDE_WRAP) + count[_WITHIN]
    count[_SEEN] = now
    count[_WITHIN] = within & ((1 << _BUFFER_BITS) - 1)
    lag = count[_LAG] + (within >> _BUFFER_BITS) - filled
    if lag < 0:
        lag = 0
    count[_LAG] = lag
    return lag


@micropython.viper
def move_down(words: ptr32, count: int, by: int):
    """words[0 : count] = words[by : by + count]"""
    i = 0
    while i < count:
        words[i] = words[i + by]
        i += 1


@micropython.viper
def move_up(words: ptr32, count: int, by: int):
    """words[by : by + count] = words[0 : count], and words[0] in front of them"""
    i = count
    while i:
        i -= 1
        words[i + by] = words[i]
    word = words[0]
    while i < by:
        words[i] = word
        i += 1


@micropython.viper
def end_pulses(words: ptr32, count: int, steps: int):
    """Clear the pulses that are high in words[0] to their ends. steps: the levels of step pins."""
    high = words[0] & (steps << 1)
    i = 0
    while i < count:
        high = high & words[i]
        if high == 0:
            break
        words[i] = words[i] ^ high
        i += 1


@micropython.viper
def hold_level(frames: ptr32, words: ptr32):
    """Fill FRAMES words with words[0]."""
    word = words[0]
    i = 0
    while i < FRAMES:
        frames[i] = word
        i += 1


class Chain:
    """Sender of a Stream's words. stream: with its kernel not yet attached; steps: the bits of its
    step pins; buffers: LEAST to MOST, 1.024 ms each. sck, ws, sd: pins. I2S begins at once.

    Nothing is lost if the main loop pauses for (buffers - 3) · 1.024 ms; a stop begins as much
    later. Raises ValueError if buffers is out of range, OSError if there is too little memory for
    DMA.
    """

    def __init__(self, stream, kernel, steps, buffers, sck, ws, sd):
        if not LEAST <= buffers <= MOST:
            raise ValueError("buffers: %d to %d" % (LEAST, MOST))
        self.buffers = buffers
        self._stream = stream
        self._state = kernel.state
        self._steps = 0
        for bit in steps:
            self._steps |= bit
        # The last word handed over, then painted words. I2S gets one slot at a time. After the last
        # slot the words that it has not got move to the front.
        self._words = array("i", [0] * (1 + _SLOTS * FRAMES + WORDS))
        self._slots = [
            memoryview(self._words)[1 + slot * FRAMES : 1 + (slot + 1) * FRAMES]
            for slot in range(_SLOTS)
        ]
        self._slot = 0  # to be handed over next
        self._end = 1  # index of the next word to be painted
        self._levels = array("i", [0] * FRAMES)  # without pulses
        self._full = 1 + FRAMES  # up to here it is painted if the slot is full
        self._count = array("i", [0] * _COUNT_WORDS)
        self._lost = 0
        stream.attach(kernel, self.ahead())
        self._fill = stream.fill
        self._muted = False  # pulses are left out
        self._still = 0  # ticks for which nothing has moved
        self._pins = Pin(sck), Pin(ws), Pin(sd)
        self._asking = poll()
        self._i2s = I2S(
            0,
            sck=self._pins[0],
            ws=self._pins[1],
            sd=self._pins[2],
            mode=I2S.TX,
            bits=16,
            format=I2S.STEREO,
            rate=RATE,
            ibuf=buffers * FRAMES * _BYTES,
        )
        self._asking.register(self._i2s, POLLOUT)
        self._began()

    def _began(self):
        """Reset the counters, as I2S begins to play, with zeros at first."""
        self._stopped = False
        self._slot = 0
        self._end = 1
        self._words[0] = 0
        self._full = 1 + FRAMES
        self._count[_LAG] = self._count[_WITHIN] = 0
        self._count[_SEEN] = ticks_us()
        self._asking.ipoll(0)  # makes writes take only what there is room for, without waiting

    def ahead(self):
        """Return how many ticks are done before their words are played, at most."""
        return (self.buffers + 2) * FRAMES // WORDS + 1

    def serve(self):
        """Do ticks while there is room for their words. To be called in each pass."""
        count = self._count
        filled = 0
        while not self._stopped:
            if look(count, ticks_us(), filled) >= self.buffers - 1:
                self._ran_out()
            # a slot's last early levels are painted with the next tick
            while self._end <= self._full:
                self._fill(self._words, self._end)
                self._end += WORDS
                if self._muted:
                    self._count_still()
            if not self._i2s.write(self._slots[self._slot]):  # there is no room
                count[_LAG] = 0
                return
            filled = 1
            self._slot += 1
            self._full += FRAMES
            if self._slot == _SLOTS:
                self._to_front()

    def _to_front(self):
        """Move the painted words that I2S has not got to the first slot."""
        by = self._slot * FRAMES
        self._slot = 0
        self._full = 1 + FRAMES
        self._end -= by
        move_down(self._words, self._end, by)

    def _ran_out(self):
        """The ring has run out, or is about to: hold all levels for a while and report to the
        kernel.

        The painted words follow after that, and a tick later the pulses that are still missing.
        """
        self._lost |= moving(self._state)
        room = self.buffers - 1  # what I2S keeps
        held = (self._count[_LAG] - room + _HELD) * FRAMES  # time in words
        self._count[_LAG] = room
        self._to_front()
        if self._end <= 1 + FRAMES + WORDS:  # otherwise nothing has been sent since the last time
            self._delay(held)
        hold_level(self._levels, self._words)
        left = _HELD
        while left and self._i2s.write(self._levels):
            left -= 1
        look(self._count, ticks_us(), _HELD - left)
        if left:
            self._count[_LAG] = 0

    def _delay(self, held):
        """Delay the painted words and the next ones by `held` words, on the grid of ticks. Pulses
        under way were cut off: count them as made."""
        words = self._words
        end_pulses(words, self._end, self._steps)
        ticks = (held + WORDS - 1) // WORDS
        over = ticks * WORDS - held
        move_up(words, self._end, over)
        self._end += over
        self._stream.miss(words, ticks, self._end)
        self._end += WORDS

    def _count_still(self):
        """Count the ticks for which nothing has moved."""
        if moving(self._state):
            self._still = 0
        elif self._still < _STILL:
            self._still += 1

    def cut(self):
        """End all pulses at once; the outputs stay as they are. Painted words are lost.

        There are no pulses until recovered() is true. Not to be called within another method.
        """
        self._i2s.deinit()
        self._stopped = True
        self._lost |= moving(self._state)
        self._stream.mute(True)
        self._muted = True
        self._still = 0

    def recovered(self):
        """After cut(): begin to send again. All outputs are low for the length of the ring, then as
        in the stream, without pulses. Return True once no motor moves and pulses are sent again."""
        if self._stopped:
            self._i2s.init(
                sck=self._pins[0],
                ws=self._pins[1],
                sd=self._pins[2],
                mode=I2S.TX,
                bits=16,
                format=I2S.STEREO,
                rate=RATE,
                ibuf=self.buffers * FRAMES * _BYTES,
            )
            self._began()
        if self._muted and self._still == _STILL:
            self._stream.mute(False)
            self._muted = False
        return not self._muted

    def take_lost(self):
        """Return the motors whose positions were lost since the last call, a bit each."""
        lost = self._lost | self._stream.take_lost_commands()
        self._lost = 0
        return lost

    def deinit(self):
        """End all pulses at once; the outputs stay as they are. Painted words are lost."""
        self._i2s.deinit()
        self._stopped = True
        self._lost |= moving(self._state)
