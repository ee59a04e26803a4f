"""The time of a device that is not this computer's: how fast it runs, and how busy this computer
is that judges it.

No message of the protocol says when it was sent. So the times of frames, ramps and exposures are
taken when their bytes come in, and a computer that is held up then takes them late.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

HELD_UP_S = 0.02  # of the device's time; a third of what a frame may be late
_SLEEP_S = 0.005


class PacedPort:
    """A port on a device that runs at `speed` times real time, as `make sim ARGS="--speed 0.25"`
    does: `clock` and `timeout` are in the device's seconds. speed: more than 0."""

    def __init__(self, port: Any, speed: float):
        self.port = port
        self.speed = speed
        self.timeout: float | None = 1.0

    def clock(self) -> float:
        """The device's time in seconds, from any moment on."""
        return time.monotonic() * self.speed

    def read(self, size: int = 1) -> bytes:
        """As the port's own."""
        self.port.timeout = None if self.timeout is None else self.timeout / self.speed
        return self.port.read(size)

    def write(self, data: bytes) -> Any:
        """As the port's own."""
        return self.port.write(data)


class HoldUps:
    """Measures how late this process comes to its turn: a thread that sleeps for 5 ms again and
    again, and looks how long that took."""

    def __init__(
        self,
        speed: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ):
        self.speed = speed
        self._clock, self._sleep = clock, sleep
        self._worst_s = 0.0
        self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self) -> "HoldUps":
        """Begin to measure."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """End the thread."""
        self._ended = True
        self._thread.join()

    def take(self) -> float:
        """The longest since the last call, in seconds of the device's time."""
        worst, self._worst_s = self._worst_s, 0.0
        return worst * self.speed

    def look(self) -> None:
        """Sleep once and see."""
        before = self._clock()
        self._sleep(_SLEEP_S)
        self._worst_s = max(self._worst_s, self._clock() - before - _SLEEP_S)

    def _run(self) -> None:
        while not self._ended:
            self.look()
