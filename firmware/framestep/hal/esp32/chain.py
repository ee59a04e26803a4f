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
from time import ticks_diff, ticks_us

from machine import I2S, Pin

from framestep.base.native import const, micropython, ptr32
from framestep.pulse.stepper import moving

RATE = const(250000)  # words a second, one each 4 µs
WORDS = const(RATE // 1000)  # in a tick, as in pulse/stream_engine.py
FRAMES = const(256)  # words of a DMA buffer; MicroPython has no other
_BYTES = const(4)  # of a word
_BUFFER_US = const(1024)
_STILL = const(4)  # ticks within which motors at rest make their last pulses
_HELD = const(2)  # buffers without pulses after the ring ran out: time to paint the next ones

LEAST = const(8)  # buffers
MOST = const(40)


@micropython.viper
def to_frames(frames: ptr32, words: ptr32):
    """Convert FRAMES words to 16-bit samples of Philips format, left and right. words[FRAMES] must
    be there.

    Data is a clock late and the chain latches in the middle of a frame, so its upper bits are those
    of the next word.
    """
    i = 0
    word = words[0]
    while i < FRAMES:
        after = words[i + 1]
        frames[i] = (word & 0x7FFF) << 1 | (after >> 15) << 16
        word = after
        i += 1


@micropython.viper
def hold_frames(frames: ptr32, word: int):
    """Fill FRAMES samples with the same word."""
    i = 0
    while i < FRAMES:
        frames[i] = (word & 0x7FFF) << 1 | (word >> 15) << 16
        i += 1


@micropython.viper
def move_down(words: ptr32, count: int, by: int):
    """words[0 : count] = words[by : by + count]"""
    i = 0
    while i < count:
        words[i] = words[i + by]
        i += 1


@micropython.viper
def move_up(words: ptr32, count: int, by: int, word: int):
    """words[by : by + count] = words[0 : count], with `word` in front of them"""
    i = count
    while i:
        i -= 1
        words[i + by] = words[i]
    while i < by:
        words[i] = word
        i += 1


@micropython.viper
def leave_out(words: ptr32, first: int, steps: int):
    """Clear these bits in a tick's words, from words[first] on."""
    i = first
    while i < first + WORDS:
        words[i] = (words[i] | steps) ^ steps
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
        # a tick, the rest of another, and at a fault as much again
        self._words = array("i", [0] * (FRAMES + 3 * WORDS + FRAMES))
        self._count = 0  # painted words among them
        self._frames = bytearray(FRAMES * _BYTES)
        self._ready = False  # they hold the first of these words
        self._last = 0  # last word handed over
        self._lag = 0  # played buffers that have not been filled again
        self._within = 0  # µs since the last of them was played
        self._lost = 0
        stream.attach(kernel, self.ahead())
        self._masked = False  # pulses are left out
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
        self._count = 0
        self._ready = False
        self._lag = 0
        self._within = 0
        self._seen = ticks_us()
        self._asking.ipoll(0)  # makes writes take only what there is room for, without waiting

    def ahead(self):
        """Return how many ticks are done before their words are played, at most."""
        return (self.buffers + 2) * FRAMES // WORDS + 1

    def serve(self):
        """Do ticks while there is room for their words. To be called in each pass."""
        while not self._stopped:
            self._look()
            if self._lag >= self.buffers - 1:
                self._ran_out()
            while self._count <= FRAMES:
                self._stream.fill(self._words, 1, self._count)
                if self._masked:
                    self._mask()
                self._count += WORDS
            if not self._ready:
                to_frames(self._frames, self._words)
                self._ready = True
            if not self._hand_over():
                return
            self._last = self._words[FRAMES - 1]
            self._count -= FRAMES
            move_down(self._words, self._count, FRAMES)
            self._ready = False

    def _look(self):
        """Count the buffers that have been played in the meantime."""
        now = ticks_us()
        self._within += ticks_diff(now, self._seen)
        self._seen = now
        played = self._within // _BUFFER_US
        self._within -= played * _BUFFER_US
        self._lag += played

    def _hand_over(self):
        """Give the frames to I2S. Return False if there is no room."""
        if not self._i2s.write(self._frames):
            self._lag = 0
            return False
        self._look()
        if self._lag >= self.buffers:
            # it was played while it was being written
            self._lost |= moving(self._state)
        if self._lag:
            self._lag -= 1
        return True

    def _ran_out(self):
        """The ring has run out, or is about to: hold all levels for a while and report to the
        kernel.

        The painted words follow after that, and a tick later the pulses that are still missing.
        """
        self._lost |= moving(self._state)
        room = self.buffers - 1  # what I2S keeps
        held = (self._lag - room + _HELD) * FRAMES  # time in words
        self._lag = room
        level = self._last & ~self._steps
        if self._count <= FRAMES + WORDS:  # otherwise nothing has been sent since the last time
            self._delay(held, level)
        self._hold(level)

    def _delay(self, held, level):
        """Delay the painted words and the next ones by `held` words, on the grid of ticks."""
        words = self._words
        # The upper half of the next word has been out for a frame, and pulses under way were cut
        # off: count both as made.
        made = (self._last | words[0] & ~0x7FFF) & self._steps
        i = 0
        while i < self._count:
            made &= words[i]
            if not made:
                break
            words[i] ^= made
            i += 1
        ticks = (held + WORDS - 1) // WORDS
        over = ticks * WORDS - held
        move_up(words, self._count, over, level)
        self._count += over
        self._stream.miss(words, ticks, self._count)
        self._count += WORDS

    def _hold(self, level):
        """Hand over buffers of levels."""
        hold_frames(self._frames, level)
        self._ready = False
        left = _HELD
        while left:
            left -= 1
            if left == 0:
                # the upper half of the next word
                after = self._words[0] >> 15
                self._frames[FRAMES * _BYTES - 2] = after & 0xFF
                self._frames[FRAMES * _BYTES - 1] = after >> 8
            if not self._hand_over():
                return

    def _mask(self):
        """Leave the pulses out of the last painted tick."""
        leave_out(self._words, self._count, self._steps)
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
        self._masked = True
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
        self._masked = self._still < _STILL
        return not self._masked

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
