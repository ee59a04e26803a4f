"""The device of a console: what its pages take turns with."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any

from ..client import shared_port
from ..client.client import Client
from ..client.wire import Frame
from ..errors import ToolError
from ..payloads import MotorStopAll
from .axes_text import AxesText
from .board_requests import BoardWork
from .demo import keyframes
from .port_bridge import Bridge

if TYPE_CHECKING:
    from .demo_board import DemoBoard

_ENTER_S = 1.0
SILENCE_S = 1.5  # a jog ends if its page sends nothing for this long


class ConsoleDevice:
    """A device, its port while that is open, and its settings for all pages.

    open_port: returns a port for Client, or raises ToolError; name: the device's name on the page;
    work: the board's REPL; axes: the motors' names and units (None: the page keeps them).
    """

    def __init__(
        self,
        open_port: Callable[[], Any],
        name: str,
        work: BoardWork,
        axes: AxesText | None = None,
    ):
        self.name = name
        self.work = work
        self.axes = axes
        self.keep = False  # all motion but jogs goes on without the page
        self.silence_s = SILENCE_S
        self.example: str | None = None  # keyframes for a page without any
        self.press_estop: Callable[[bool], None] | None = None  # of a simulated board
        self.bridge: Bridge | None = None  # the open port
        self.on_reports: set[Callable[[Frame], None]] = set()  # what gets the unasked messages
        self.on_open: set[Callable[[], Awaitable[None]]] = set()  # awaited once a port is open
        self._open_port = open_port

    def simulate(self, board: "DemoBoard") -> None:
        """Offer the pages of this device what only a simulated board has: an example, the E-stop,
        a prompt."""
        self.work = BoardWork(board.repl, board.url, prompt_only=True)
        self.example = keyframes()
        self.press_estop = board.press_estop

    async def attach(self) -> Bridge:
        """Return the device's port, and open it if necessary. Raises ToolError."""
        if self.bridge is None:
            self.bridge = Bridge(await asyncio.to_thread(self._open_port), self.name)
            self.bridge.on_report = self._report
            for told in list(self.on_open):
                await told()
        return self.bridge

    def _report(self, frame: Frame) -> None:
        for take in self.on_reports:
            take(frame)

    async def let_go(self) -> None:
        """Stop everything and close the port."""
        self.keep = False
        if self.bridge:
            await self.bridge.close()
            self.bridge = None

    async def stop(self, why: str) -> None:
        """Stop everything for a page that does not have the device, and leave it to who has it: the
        page that gets the reason, or another program. Raises ToolError, OSError."""
        if self.bridge is None:
            try:
                await asyncio.to_thread(self._stop_without_a_page)
                return
            except (ToolError, OSError):
                if self.bridge is None:  # else a page has got the port meanwhile
                    raise
        await self.bridge.stop_all(why)

    def _stop_without_a_page(self) -> None:
        """Like `framestep stop`: through the program that has the port, if there is one."""
        found = shared_port.find(self.name)
        port = shared_port.enter(found, _ENTER_S) if found else None
        with Client(port or self._open_port(), _ENTER_S) as client:
            client.request(MotorStopAll())
