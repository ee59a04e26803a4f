"""The port of the board's REPL as a terminal on the page."""

import codecs
import contextlib
import threading
from collections.abc import Callable

from ..client.open_port import close_port, open_port

_LOOK_S = 0.05  # the reader waits this long for a byte before it checks whether to end
_MOST = 4096


class ReplTerminal:
    """An open port of a REPL.

    on_text: called with its output, and blocks until the page has it; on_end: called with the
    reason if the port is gone. Both in a thread of its own.
    """

    def __init__(self, path: str, on_text: Callable[[str], None], on_end: Callable[[str], None]):
        """Open the port. Raises ToolError if that is not possible."""
        self._path = path
        self._on_text = on_text
        self._on_end = on_end
        self._closing = False
        self._port = open_port(path, _LOOK_S)
        self._reader = threading.Thread(target=self._read, name="repl-terminal", daemon=True)
        self._reader.start()

    def type(self, text: str) -> None:
        """Send what the user has typed. A port that is gone is reported by `on_end`."""
        with contextlib.suppress(OSError):
            self._port.write(text.encode())

    def close(self) -> None:
        """Close the port. Nothing is reported any more."""
        self._closing = True
        if threading.current_thread() is not self._reader:
            self._reader.join()
        close_port(self._port)

    def _read(self) -> None:
        decoder = codecs.getincrementaldecoder("utf-8")("replace")
        try:
            while not self._closing:
                data = self._port.read(1)
                if data:
                    data += self._port.read(min(self._port.in_waiting, _MOST))
                    self._on_text(decoder.decode(data))
        except Exception as error:
            # termios.error is no OSError, and not every system has a termios to import
            if not isinstance(error, OSError) and type(error).__module__ != "termios":
                raise
            if not self._closing:
                self._on_end(f"the connection to {self._path} broke off")
