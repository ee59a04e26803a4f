"""The simulated board of `framestep console --demo`, in a thread of its own."""

import queue
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..client.client import Client
from ..client.tcp_port import SCHEME
from ..simulator.boards import SimulatedBoard
from ..simulator.prompt import Prompt
from ..simulator.serve import Server
from .demo import RIG, set_up

if TYPE_CHECKING:
    from typing_extensions import Self

_ANY = "127.0.0.1:0"


class DemoBoard:
    """A board with the demo's crane, set up. `url`: its port; `repl`: its prompt's."""

    def __init__(self, speed: float = 1.0) -> None:
        board = SimulatedBoard(RIG)
        board.wire_switches()
        board.repl = Prompt(board.host_board)
        self._board = board
        self._server = Server(board, speed, tcp=_ANY, repl_tcp=_ANY)
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        ports = [each.split()[-1] for each in self._server.announcements if " " in each]
        self.url, self.repl = (SCHEME + port for port in ports)
        self._thread = threading.Thread(target=self._run, name="simulated-board", daemon=True)
        self._thread.start()
        with Client.open(self.url) as client:
            client.greet()
            set_up(client)

    def press_estop(self, on: bool) -> None:
        """Press or release the E-stop, whose contact is normally closed."""
        self._calls.put(lambda: self._board.host_board.set_input("estop", int(on)))

    def close(self) -> None:
        """End the board."""
        self._server.stop()
        self._thread.join()
        self._server.close()

    def __enter__(self) -> "Self":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _run(self) -> None:
        while not self._server.stopping:
            while not self._calls.empty():
                self._calls.get()()
            self._server.step()
