"""Time of a device: its speed, and how late this computer measures it.

No message of the protocol says when it was sent. So frames, ramps and exposures get the time at
which their bytes arrive. A computer that is held up at that moment measures them late.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

HELD_UP_S = 0.02  # of the device's time; a third of a frame's allowed lateness
_SLEEP_S = 0.005


class PacedPort:
    """A port of a device that runs at `speed` times real time, as with
    `make sim ARGS="--speed 0.25"`. `clock` and `timeout` are in the device's seconds. speed: more
    than 0."""

    def __init__(self, port: Any, speed: float):
        self.port = port
        self.speed = speed
        self.timeout: float | None = 1.0

    def clock(self) -> float:
        """Return the device's time in seconds, from an arbitrary moment."""
        return time.monotonic() * self.speed

    def read(self, size: int = 1) -> bytes:
        """Forward to the port."""
        self.port.timeout = None if self.timeout is None else self.timeout / self.speed
        return self.port.read(size)

    def write(self, data: bytes) -> Any:
        """Forward to the port."""
        return self.port.write(data)


class HoldUps:
    """Measures how late this process gets its turn: a thread repeatedly sleeps for 5 ms and
    measures the time."""

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
        """Start measuring."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """End the thread."""
        self._ended = True
        self._thread.join()

    def take(self) -> float:
        """Return the longest hold-up since the last call, in seconds of the device's time."""
        worst, self._worst_s = self._worst_s, 0.0
        return worst * self.speed

    def look(self) -> None:
        """Sleep once and measure."""
        before = self._clock()
        self._sleep(_SLEEP_S)
        self._worst_s = max(self._worst_s, self._clock() - before - _SLEEP_S)

    def _run(self) -> None:
        while not self._ended:
            self.look()
