"""The page's requests to the board's REPL: the rig file, and the processor's load.

Everything goes through framestep_tools.board.repl_device, which resets nothing while motors move.
The methods of BoardWork block, one at a time, and raise ToolError.
"""

import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from typing import Any

from ..board import rig_file
from ..board.repl_device import RIG_FILE, Device, Moving
from ..board.restart import greeting
from ..board.rig_change import RigChange
from ..errors import ToolError
from .repl_scripts import LIVE, LIVE_BEGIN, LIVE_END, LOAD
from .repl_terminal import ReplTerminal

_NO_REPL = (
    "this board shows no second port for its REPL; name one with --repl, "
    "or edit the file with framestep rig edit"
)
_TAKEN = "the page itself uses the REPL, for the rig file or the load"


class NoRepl(ToolError):
    """The board has no port for its REPL."""


class BoardWork:
    """The REPL of the board with the protocol's port `protocol`. `path`: the REPL's port, or
    None. prompt_only: there is a terminal, and no scripts can be run."""

    def __init__(self, path: str | None, protocol: str, prompt_only: bool = False):
        self.path = path
        self.protocol = protocol
        self.runs_scripts = path is not None and not prompt_only
        self._watched: Device | None = None  # stays open while the load is watched
        self._terminal: ReplTerminal | None = None
        self._end_terminal: Callable[[str], None] = lambda why: None
        self._one = threading.Lock()

    def read_rig(self) -> dict[str, Any]:
        """Return the board's rig file as {"text": …}; "{}" if it has none."""
        with self._device() as device:
            content = device.read(RIG_FILE)
        text = "{}\n" if content is None else content.decode(errors="replace")
        return {"text": text, "there": content is not None}

    def check_rig(self, text: str) -> dict[str, Any]:
        """Check whether the board would accept this rig file. Return its greeting or the
        mistake."""
        with self._device() as device:
            board = device.board()
        given = rig_file.parse(_bare(text), "rig.json")
        found = rig_file.check(given, board, "rig.json")
        return {
            "text": f"valid for {board['name']}: {found.name.decode()!r}, "
            f"{len(found.motors)} motor{'s' * (len(found.motors) != 1)} set"
            + "".join(f"; {warning}" for warning in rig_file.warnings(given, board))
        }

    def write_rig(self, text: str) -> dict[str, Any]:
        """Put a rig file onto the board and restart it; see RigChange. A file with a mistake
        changes nothing. The protocol's port must be closed meanwhile."""
        content = _bare(text)
        with self._device() as device:
            board = device.board()
            found = rig_file.check(rig_file.parse(content, "rig.json"), board, "rig.json")
            change = RigChange(device, content)
        return {"text": greeting(*change.see(self._device, self.protocol, found.ports))}

    def check_at_rest(self) -> None:
        """Raise Moving if motors move or are about to: then the port must stay open."""
        with self._device() as device:
            if device.state.moving:
                raise Moving("motors move, or a run is prepared; nothing has been changed")

    def load(self) -> dict[str, Any]:
        """Return the output of `timing()` on the REPL: the interrupt's share, its lateness,
        queues."""
        with self._device() as device:
            said = device.run(LOAD).rpartition("\x02")[2]
        return {"lines": [line.strip() for line in said.splitlines() if line.strip()]}

    def live(self) -> dict[str, Any]:
        """Return the load as {"figures": numbers of repl.figures.live}, for repeated calls.

        The port stays open until `rest`, or until another request.
        """
        with self._one:
            self._close_terminal(_TAKEN)
            if self._watched is None:
                device = self._open()
                device.connect()
                self._watched = device
                self._ask(LIVE_BEGIN)
            said = self._ask(LIVE).rpartition("\x02")[2].strip()
        try:
            return {"figures": json.loads(said)}
        except ValueError:
            raise ToolError(said) from None  # the board's reason

    def rest(self) -> dict[str, Any]:
        """Stop watching the load."""
        with self._one:
            self._close_watched()
        return {}

    # ---- the terminal

    def open_terminal(self, on_text: Callable[[str], None], on_end: Callable[[str], None]) -> None:
        """Open the port as a terminal until `close_terminal`, or until another request. on_end:
        called with the reason when it is closed for another request, or the port is gone."""
        with self._one:
            self._close_watched()
            self._close_terminal("the terminal was opened again")
            if self.path is None:
                raise NoRepl(_NO_REPL)
            self._terminal = ReplTerminal(self.path, on_text, on_end)
            self._end_terminal = on_end

    def type(self, text: str) -> None:
        """Send what was typed into the terminal."""
        if self._terminal:
            self._terminal.type(text)

    def close_terminal(self) -> dict[str, Any]:
        """Close the terminal and say nothing about it."""
        with self._one:
            self._close_terminal(None)
        return {}

    def _close_terminal(self, why: str | None) -> None:
        terminal, self._terminal = self._terminal, None
        if terminal:
            terminal.close()
            if why:
                self._end_terminal(why)

    def _ask(self, script: str) -> str:
        assert self._watched
        try:
            return self._watched.run(script)
        except BaseException:
            self._close_watched()
            raise

    def _close_watched(self) -> None:
        device, self._watched = self._watched, None
        if device:
            with contextlib.suppress(ToolError):  # the board may be gone
                device.run(LIVE_END)
            device.close()

    @contextlib.contextmanager
    def _device(self) -> Iterator[Device]:
        with self._one:
            self._close_watched()
            self._close_terminal(_TAKEN)
            with self._open() as device:
                yield device

    def _open(self) -> Device:
        if self.path is None or not self.runs_scripts:
            raise NoRepl(_NO_REPL)
        return Device(self.path)


def _bare(text: str) -> bytes:
    """Return a rig file's text for a board, without comments."""
    return rig_file.for_board(text.encode())
