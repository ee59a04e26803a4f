"""Record the session in docs/use/repl.md: somebody at the friendly prompt of an emulated Pico,
while a host sends requests.

python -m framestep_tools.documents.repl_session          record it again, with the built image
"""

from collections.abc import Iterator

from ..building.board_files import ROOT, board_data
from ..client.client import Client
from ..payloads import MotorMove, MotorSetLimits, MotorSetSpeed
from ..simulator.boards import EmulatedBoard, LockstepPort

PAGE = ROOT / "docs/use/repl.md"
BEGIN = "<!-- session: recorded by python -m framestep_tools.documents.repl_session -->\n"
END = "<!-- end of the session -->"
RIG = {"name": "my slider", "motor_count": 2, "estop": "nc", "motors": [{"type": "tmc2209"}]}
_PROMPT = b">>> "
_CTRL_B = "\x02"


class Terminal:
    """Somebody who types at the friendly prompt."""

    def __init__(self, board: EmulatedBoard):
        self._board = board
        self._serial = board.emulator.serial(0)
        self._serial.timeout = 30

    def wait(self, seconds: float) -> None:
        self._board.run_until(self._board.emulator.ns + round(seconds * 1e9))

    def read(self, until: bytes = _PROMPT) -> str:
        """Return what the board prints up to this, as a terminal shows it."""
        data = self._serial.read_until(until)
        assert data.endswith(until), data
        lines = data.decode().replace("\r\n", "\n").split("\n")
        # text after \r is written over the line that is there
        return "\n".join(line.rsplit("\r", 1)[-1].rstrip() for line in lines)

    def type(self, text: str, until: bytes = _PROMPT) -> str:
        """Type this. Return what is shown from then on, without the prompt at its end."""
        self._serial.write(text.encode())
        return self.read(until).removesuffix(_PROMPT.decode().strip())

    def call(self, command: str) -> str:
        """Type a command. Return it behind its prompt, and what it prints."""
        return _PROMPT.decode() + self.type(command + "\r")


def session() -> Iterator[tuple[str, str]]:
    """Yield (text, what the terminal shows after it)."""
    with EmulatedBoard(RIG, trace=False) as board:
        board.wire_switches()
        estop = board_data("pico")["estop"]
        terminal = Terminal(board)
        host = Client(LockstepPort(board))
        host.greet()
        terminal.read()
        yield "Ctrl-B shows what the board prints at its start:", terminal.type(_CTRL_B)
        yield "", terminal.call("import framestep.repl")
        yield "", terminal.call("rig()")
        yield "", terminal.call("trace()")
        for request in MotorSetSpeed(1, 5000, 20_000), MotorSetLimits(1, 1, 0, 1, 6400):
            host.request(request)
        host.code(MotorMove(1, 7000))
        yield (
            "Now Dragonframe sends a few requests, and a motor does not move:",
            terminal.call("why()"),
        )
        yield "", terminal.call("trace()")
        yield "", terminal.call("move(1, 6400)")
        terminal._serial.write(b"watch()\r")
        terminal.wait(0.8)
        yield "A key ends `watch()`:", _PROMPT.decode() + terminal.type(" ")
        terminal.call("move(1, 0)")
        terminal.wait(0.2)
        board.emulator.set_pin(estop, 1)
        terminal.wait(1)
        text = "Somebody presses the E-stop while motor 1 moves:"
        yield text, _PROMPT.decode() + terminal.type("why()\r").lstrip("\n")
        host.close()


def block() -> str:
    """Return the session as Markdown."""
    parts = []
    for text, shown in session():
        if text:
            parts.append(f"\n{text}\n\n" if parts else f"{text}\n\n")
        parts += [f"    {line}".rstrip() + "\n" for line in shown.strip("\n").split("\n")]
    return "".join(parts) + "\n"


def updated(text: str) -> str:
    """Return the page's text with a new session in it."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + "\n" + block() + END + rest.split(END, 1)[1]


if __name__ == "__main__":
    PAGE.write_text(updated(PAGE.read_text()))
