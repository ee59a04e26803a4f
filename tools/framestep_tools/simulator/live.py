"""The simulator with a live view in the terminal, and keys that cause faults."""

import contextlib
import os
import select
import sys
import time
from collections.abc import Iterator
from typing import Any

from rich.console import Console
from rich.live import Live

from ..traffic.log import DEVICE, HOST, Recorder
from .boards import SimulatedBoard
from .faulty_line import FaultyLine
from .serve import Server
from .sim_view import View

_DRAW_S = 0.1
_KEYS = (
    "e E-stop   1-9 switch   h pull the host's cable, put it back   "
    "d damage a byte of the host's   D of the board's   q end"
)


@contextlib.contextmanager
def _single_keys(descriptor: int) -> Iterator[None]:
    """Read single keys without echo. Ctrl-C keeps its effect."""
    import termios
    import tty

    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    try:
        yield
    finally:
        termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


class LiveServer(Server):
    """A Server of a simulated board with a live view and keys."""

    def __init__(
        self,
        board: SimulatedBoard,
        speed: float | None,
        tcp: str | None,
        trace: str | None,
        console: Console | None = None,
    ):
        self._console = console or Console()
        self.line = FaultyLine(board.protocol, Recorder(self._show, lambda: board.now_ns * 1e-9))
        board.protocol = self.line
        self._simulated = board
        super().__init__(board, speed, tcp, trace)
        self.view = View(board.host_board, "framestep on " + ", ".join(self.announcements), _KEYS)
        self._live: Live | None = None
        self._drawn = 0.0

    def _show(self, entry: Any) -> None:
        self.view.add(entry)

    def run(self) -> None:
        """Run until q or Ctrl-C."""
        live = Live(console=self._console, screen=True, auto_refresh=False)
        with _single_keys(sys.stdin.fileno()), live:
            self._live = live
            super().run()

    def announce(self) -> None:
        """Do nothing: the heading of the view has the ports."""

    def step(self) -> None:
        """Run one slice, then handle keys, and draw ten times a second."""
        super().step()
        if self._live and time.monotonic() - self._drawn >= _DRAW_S:
            while select.select([sys.stdin], [], [], 0)[0]:
                keys = os.read(sys.stdin.fileno(), 64).decode(errors="replace")
                if not keys:  # the terminal is gone
                    self.stop()
                    break
                for key in keys:
                    self.press(key)
            self._drawn = time.monotonic()
            self._live.update(self.view.draw(self.line.plugged), refresh=True)

    def press(self, key: str) -> None:
        """Handle a key; unknown keys do nothing."""
        if key == "e":
            self._estop()
        elif key == "h":
            self.line.plug(not self.line.plugged)
            self.view.message = "the cable is back" if self.line.plugged else "the cable is out"
        elif key in "dD":
            who = HOST if key == "d" else DEVICE
            self.line.damage(who)
            name = "the host" if key == "d" else "the board"
            self.view.message = f"a bit of what {name} sends next will be wrong"
        elif key == "q":
            self.stop()
        elif key.isdigit() and key != "0":
            self._switch(int(key))

    def _estop(self) -> None:
        board = self.view.board
        if board.rig.estop == "none":
            self.view.message = 'the rig file has no E-stop: "estop": "nc" gives it one'
            return
        held = int(board.rig.estop == "nc")  # an open contact is pulled up
        pin = board.rig.board["estop"]
        now = board.hal.levels() >> pin & 1
        board.set_input(pin, 1 - now)
        self.view.message = f"the E-stop is {'held' if 1 - now == held else 'released'}"

    def _switch(self, number: int) -> None:
        if number > len(self.view.switches):
            self.view.message = f"there is no switch {number}: the rig file names the switches"
            return
        switch = self.view.switches[number - 1]
        pressed = not self.view.pressed(switch)
        self.view.board.set_input(switch.pin, switch.rest ^ pressed)
        self.view.message = f"{switch.name} is {'pressed' if pressed else 'released'}"
