"""What the page asks of the board's other port, the REPL: its rig file, and what a tick costs.

Everything goes through framestep_tools.board.repl_device, which resets nothing while motors
move. The methods of BoardWork block, one at a time; ToolError says what is wrong.
"""

import contextlib
import json
import threading
from collections.abc import Iterator
from typing import Any

from ..board import rig_file
from ..board.repl_device import RIG_FILE, Device, Moving
from ..board.restart import greeting
from ..board.rig_change import RigChange
from ..errors import ToolError
from .scripts import LIVE, LIVE_BEGIN, LIVE_END, LOAD


class NoRepl(ToolError):
    """The board shows no port for its REPL."""


class BoardWork:
    """The REPL of the board that has the protocol's port `protocol`; `path` is None where there is
    no REPL port."""

    def __init__(self, path: str | None, protocol: str):
        self.path = path
        self.protocol = protocol
        self._watched: Device | None = None  # kept open while the load is watched
        self._one = threading.Lock()

    def read_rig(self) -> dict[str, Any]:
        """The rig file as the board has it, {"text": …}; "{}" where it has none."""
        with self._device() as device:
            content = device.read(RIG_FILE)
        text = "{}\n" if content is None else content.decode(errors="replace")
        return {"text": text, "there": content is not None}

    def check_rig(self, text: str) -> dict[str, Any]:
        """Whether the board would take this rig file; says what it makes of it."""
        with self._device() as device:
            board = device.board()
        found = rig_file.check(rig_file.parse(_bare(text), "rig.json"), board, "rig.json")
        return {
            "text": f"valid for {board['name']}: {found.name.decode()!r}, "
            f"{len(found.motors)} motors set"
        }

    def write_rig(self, text: str) -> dict[str, Any]:
        """Put a rig file onto the board and restart it; see RigChange. Nothing is changed where
        the file has a mistake. The protocol's port must be closed meanwhile."""
        content = _bare(text)
        with self._device() as device:
            board = device.board()
            found = rig_file.check(rig_file.parse(content, "rig.json"), board, "rig.json")
            change = RigChange(device, content)
        return {"text": greeting(*change.see(self._device, self.protocol, found.ports))}

    def see_that_all_stands(self) -> None:
        """Moving where motors move or are about to: then the port must stay open."""
        with self._device() as device:
            if device.state.moving:
                raise Moving("motors move, or a run is prepared; nothing has been changed")

    def load(self) -> dict[str, Any]:
        """What `timing()` prints on the REPL: the interrupt's share, its lateness, the queues."""
        with self._device() as device:
            said = device.run(LOAD).rpartition("\x02")[2]
        return {"lines": [line.strip() for line in said.splitlines() if line.strip()]}

    def live(self) -> dict[str, Any]:
        """The load as numbers, {"figures": those of repl.figures.live}, to be asked again
        and again: the port stays open until `rest`, or until something else is asked."""
        with self._one:
            if self._watched is None:
                device = self._open()
                device.connect()
                self._watched = device
                self._ask(LIVE_BEGIN)
            said = self._ask(LIVE).rpartition("\x02")[2].strip()
        try:
            return {"figures": json.loads(said)}
        except ValueError:
            raise ToolError(said) from None  # the board says why there are none

    def rest(self) -> dict[str, Any]:
        """The load is no longer watched."""
        with self._one:
            self._close_watched()
        return {}

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
            with contextlib.suppress(ToolError):  # the board may have gone
                device.run(LIVE_END)
            device.close()

    @contextlib.contextmanager
    def _device(self) -> Iterator[Device]:
        with self._one:
            self._close_watched()
            with self._open() as device:
                yield device

    def _open(self) -> Device:
        if self.path is None:
            raise NoRepl(
                "this board shows no second port for its REPL; name one with --repl, "
                "or edit the file with framestep rig edit"
            )
        return Device(self.path)


def _bare(text: str) -> bytes:
    """As a board can read it: without comments."""
    return rig_file.for_board(text.encode())
