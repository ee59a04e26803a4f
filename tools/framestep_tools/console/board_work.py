"""What the page asks of the board's other port, the REPL: its rig file, and what a tick costs.

Everything goes through framestep_tools.device, which resets nothing while motors move. The methods
of BoardWork block; ToolError says what is wrong.
"""

from typing import Any

from .. import rig_file
from ..device import RIG_FILE, Device, Moving
from ..errors import ToolError
from ..restart import greeting, hello

_LOAD = """
import framestep.repl
print("\\x02")
framestep.repl.timing()
"""


class NoRepl(ToolError):
    """The board shows no port for its REPL."""


class BoardWork:
    """The REPL of the board that has the protocol's port `protocol`; `path` is None where there is
    no REPL port."""

    def __init__(self, path: str | None, protocol: str):
        self.path = path
        self.protocol = protocol

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
            "text": f"right for {board['name']}: {found.name.decode()!r}, "
            f"{len(found.motors)} motors set"
        }

    def write_rig(self, text: str) -> dict[str, Any]:
        """Put a rig file onto the board and restart it. Nothing is changed where the file has a
        mistake, or while motors move. The protocol's port must be closed meanwhile."""
        content = _bare(text)
        with self._device() as device:
            board = device.board()
            found = rig_file.check(rig_file.parse(content, "rig.json"), board, "rig.json")
            device.halt()
            device.replace(RIG_FILE, content)
            device.restart()
            path = device.path
        return {"text": greeting(*hello(path, self.protocol, found.ports))}

    def see_that_all_stands(self) -> None:
        """Moving where motors move or are about to: then the port must stay open."""
        with self._device() as device:
            if device.state.moving:
                raise Moving("motors move, or a run is prepared; nothing has been changed")

    def load(self) -> dict[str, Any]:
        """What `timing()` prints on the REPL: the interrupt's share, its lateness, the queues."""
        with self._device() as device:
            said = device.run(_LOAD).rpartition("\x02")[2]
        return {"lines": [line.strip() for line in said.splitlines() if line.strip()]}

    def _device(self) -> Device:
        if self.path is None:
            raise NoRepl(
                "this board shows no second port for its REPL; name one with --repl, "
                "or edit the file with framestep rig edit"
            )
        return Device(self.path)


def _bare(text: str) -> bytes:
    """As a board can read it: without comments."""
    return rig_file.for_board(text.encode())
