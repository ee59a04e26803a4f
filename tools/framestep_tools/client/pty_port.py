"""A pseudo-terminal that leads to a board's port. Windows has none."""

import contextlib
import os
import select
from importlib.util import find_spec

from ..errors import ToolError

CHUNK = 4096


def can_make_one() -> bool:
    """Return whether this system has pseudo-terminals."""
    try:
        return hasattr(os, "openpty") and all(find_spec(name) for name in ("termios", "tty"))
    except ValueError:  # a module that may not be imported
        return False


class PtyLink:
    """A pseudo-terminal. While its master is hung up, nobody has it open (Linux)."""

    def __init__(self) -> None:
        if not can_make_one():
            raise ToolError(
                "only Linux and macOS have pseudo-terminals, this system has none: use TCP"
            )
        import tty

        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, 0)

    def is_open(self, taken: bool) -> bool:
        return not any(events & select.POLLHUP for _, events in self._poll.poll(0))

    def read(self) -> bytes:
        with contextlib.suppress(BlockingIOError, OSError):  # EIO: the client has just disconnected
            return os.read(self._master, CHUNK)
        return b""

    def write(self, data: bytes) -> int:
        with contextlib.suppress(BlockingIOError, OSError):
            return os.write(self._master, data)
        return 0

    def readable(self) -> int | None:
        return None if not self.is_open(False) else self._master

    def close(self) -> None:
        os.close(self._master)
