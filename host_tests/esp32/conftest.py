"""MicroPython on the simulated chip of tools/micropython/esp32."""

import termios
import threading
import time
from types import TracebackType

import pytest

from framestep_tools.client.port_finder import BAUD
from framestep_tools.client.pty_port import PtyLink
from framestep_tools.simulator.esp32_board import Esp32Board
from host_tests.runtimes import Runtime


@pytest.fixture(scope="session")
def chip(tmp_path_factory) -> Runtime:
    return Runtime("esp32", tmp_path_factory.mktemp("esp32"), "stream")


_SLICE_NS = 2_000_000
_REST_S = 0.0005  # while both sides are silent: a waiting REPL needs no processor
_RATES = {getattr(termios, f"B{baud}"): baud for baud in (115200, 230400, 460800, 921600)}
_MOST = 4096  # bytes for the board at once, as its UART takes its time


class Terminal:
    """Runs a board in a thread at full speed, and passes its bytes on, at the rate that a program
    sets. `path` is the port's path.

    If the power is cut (Esp32Board.cut_power_after), the port disappears. `own`: the link to the
    protocol's own port, if the board has one on USB.
    """

    def __init__(self, board: Esp32Board):
        self.board = board
        self._link = PtyLink()
        self.path = self._link.path
        self.own = PtyLink()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._over = False
        self._unread = b""  # bytes from the board's own port

    def _run(self) -> None:
        board = self.board
        waiting = b""
        while not self._over and board.powered:
            baud = _RATES.get(termios.tcgetattr(self._link._master)[4], BAUD)
            if baud != board.baud:
                board.baud = baud
            data = self._link.read()
            for at in range(0, len(data), _MOST):
                board.receive(data[at : at + _MOST])
            board.run_until(board.now_ns + _SLICE_NS)
            own = self._pass_on_own()
            waiting += board.transmit()
            waiting = waiting[self._link.write(waiting) :] if waiting else b""
            if not data and not waiting and not own:
                time.sleep(_REST_S)
        self._link.close()
        self.own.close()

    def _pass_on_own(self) -> bool:
        """Pass on the bytes of the protocol's own port. Return whether there were any."""
        found = self.board.host.ports[1:] if self.board.host else []
        for port in found:
            port.open_port(self.own.is_open(False))
            data = self.own.read()
            port.receive(data)
            self._unread += port.transmit()
            self._unread = self._unread[self.own.write(self._unread) :] if self._unread else b""
            return bool(data or self._unread)
        self._unread = b""
        return False

    def __enter__(self) -> "Terminal":
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        where: TracebackType | None,
    ) -> None:
        self._over = True
        self._thread.join()
