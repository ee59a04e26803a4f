"""Clock of a lap: when each frame begins, in ticks and microseconds, without growing error."""

from framestep.base.clock import WRAP, after
from framestep.base.native import const

MICROSECONDS = const(1000000000)  # in 1000 seconds


class FrameClock:
    """Time of one frame after another: `tick` (modulo 2^29) and `us` within it.

    Frame N is round(N · 10^9 / fps_milli) microseconds after the first. Nothing allocates.
    """

    def __init__(self):
        self.tick = 0
        self.us = 0
        self.error = 0
        self.quotient = 0  # microseconds of a frame
        self.remainder = 0
        self.fps_milli = 1

    def begin(self, fps_milli, tick):
        """Set the time of the first frame to `tick`. fps_milli: 1 … 2^29 - 1."""
        self.tick = tick & WRAP
        self.us = 0
        self.error = fps_milli // 2
        self.quotient = MICROSECONDS // fps_milli
        self.remainder = MICROSECONDS % fps_milli
        self.fps_milli = fps_milli

    def advance(self):
        """Go on to the next frame."""
        us = self.us + self.quotient + self.longer()
        self.tick = after(self.tick, us // 1000)
        self.us = us % 1000

    def longer(self):
        """Return 1 if this frame takes a microsecond more than the quotient, else 0.

        Call it once per frame.
        """
        self.error += self.remainder
        if self.error >= self.fps_milli:
            self.error -= self.fps_milli
            return 1
        return 0
