"""The prompt of a simulated board: the commands of framestep.repl, and nothing else.

A page that shows it must not be able to run Python on this computer.
"""

import ast
import contextlib
import io
from typing import Any

from framestep import boot, repl
from framestep.hal.host_board import HostBoard


def help() -> None:
    """Print the commands with a line each. (Help about anything else stays away.)"""
    repl.help()


COMMANDS = (
    *(repl.status, repl.why, repl.move, repl.home, repl.stop, repl.io, repl.timing, repl.rig),
    help,
)
KNOWN = "status() why() move(1, 200) home(1) stop() io() timing() rig() help()"
PROMPT = ">>> "
_HELP = f"the prompt of the simulated board knows {KNOWN}"
_BY_NAME = {command.__name__: command for command in COMMANDS}
_INTERRUPT, _ERASE, _ENTER, _ESCAPE = "\x03", "\b\x7f", "\r\n", "\x1b"
_LONGEST = 200  # characters of a line


class Prompt:
    """A Channel: a line editor without cursor keys. A command runs between two passes, as the port
    is served then."""

    pending = 0

    def __init__(self, board: HostBoard):
        self._board = board
        self._line = ""
        self._said = bytearray()

    def receive(self, data: bytes) -> None:
        for letter in data.decode(errors="ignore"):
            if letter == _ESCAPE:
                return  # a cursor key
            if letter in _ENTER:
                line, self._line = self._line, ""
                self._say("\r\n" + self._answer(line.strip()) + PROMPT)
            elif letter == _INTERRUPT:
                self._line = ""
                self._say("\r\n" + PROMPT)
            elif letter in _ERASE:
                if self._line:
                    self._line = self._line[:-1]
                    self._say("\b \b")
            elif letter.isprintable() and len(self._line) < _LONGEST:
                self._line += letter
                self._say(letter)

    def transmit(self) -> bytes:
        said = bytes(self._said)
        self._said.clear()
        return said

    def open_port(self, on: bool) -> None:
        self._line = ""

    def _say(self, text: str) -> None:
        self._said += text.encode()

    def _answer(self, line: str) -> str:
        if not line:
            return ""
        found = _call(line)
        if found is None:
            return _HELP + "\r\n"
        command, arguments = found
        board: Any = self._board
        boot.hal, boot.controller, boot.runner = board.hal, board.controller, board
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            try:
                command(*arguments)
            except Exception as error:  # wrong arguments: the last line of a board's traceback
                print(f"{type(error).__name__}: {error}")
        return said.getvalue().replace("\n", "\r\n")


def _call(line: str):
    """Return (command, arguments) of a line such as `move(1, 200)`, or None."""
    try:
        found = ast.parse(line, mode="eval").body
        if (
            not isinstance(found, ast.Call)
            or not isinstance(found.func, ast.Name)
            or found.keywords
        ):
            return None
        return _BY_NAME[found.func.id], [ast.literal_eval(each) for each in found.args]
    except (SyntaxError, ValueError, KeyError, TypeError, MemoryError, RecursionError):
        return None
