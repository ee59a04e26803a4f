"""When each frame of a pass begins, in ticks and microseconds; rounding does not add up."""

from framestep.base.clock import WRAP, after
from framestep.base.native import const

MICROSECONDS = const(1000000000)  # in 1000 seconds


class FrameClock:
    """The moment of one frame after another: `tick` (modulo 2^29) and `us` within it.

    Frame N lies round(N · 10^9 / fps_milli) microseconds after the first. Nothing allocates.
    """

    def __init__(self):
        self.tick = 0
        self.us = 0
        self.error = 0
        self.quotient = 0  # a frame's microseconds
        self.remainder = 0
        self.fps_milli = 1

    def begin(self, fps_milli, tick):
        """The first frame is at `tick`; fps_milli: 1 … 2^29 - 1."""
        self.tick = tick & WRAP
        self.us = 0
        self.error = fps_milli // 2
        self.quotient = MICROSECONDS // fps_milli
        self.remainder = MICROSECONDS % fps_milli
        self.fps_milli = fps_milli

    def advance(self):
        """On to the next frame."""
        us = self.us + self.quotient + self.longer()
        self.tick = after(self.tick, us // 1000)
        self.us = us % 1000

    def longer(self):
        """1 if the frame from here to the next takes a microsecond more than the quotient.

        Call it once per frame.
        """
        self.error += self.remainder
        if self.error >= self.fps_milli:
            self.error -= self.fps_milli
            return 1
        return 0
