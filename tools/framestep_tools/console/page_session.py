"""One page's connection: the messages on its WebSocket.

Binary messages are bytes of the protocol, in both directions. Texts are JSON. The page asks
`{"id": 1, "do": "read_rig"}` and gets `{"id": 1, "result": {…}}` or `{"id": 1, "error": "…"}`.
`{"keep": true}` lets all motion but jogs go on without the page. The server first sends
`{"device": …}`. It sends `{"stopped": "why"}` when another program or page has stopped motors; the
page answers `{"released": true}` once it holds no jog. The pages that watch are
`{"pages": [{"number": 1, "who": "a phone"}]}`; the page sends `{"hand_over": 1}` to let one take
the device. After the task `terminal` the server sends the REPL's output, `{"repl": "…"}`, and
`{"repl_ended": "why"}`; the page sends `{"typed": "…"}`.
Before it closes, the server sends `{"ended": "why"}`, with `"held": true` if another page has the
device.
"""

import asyncio
import contextlib
import json
from collections.abc import Callable
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from ..errors import ToolError
from .device import ConsoleDevice
from .move_requests import MoveWork

_LOOK_S = 0.1
_OF_MOVES = ("check_move", "export_move", "read_move")
_WITH_TEXT = ("check_rig", "write_rig", "write_axes", "estop", *_OF_MOVES)
_TASKS = ("read_rig", "load", "live", "rest", "terminal", "close_terminal", *_WITH_TEXT)


class Visit:
    """A connected page. who: how other pages name it; on_hand_over: called with the number of the
    page that is to take the device."""

    def __init__(
        self,
        device: ConsoleDevice,
        page: ServerConnection,
        who: str = "another page",
        on_hand_over: Callable[[int], None] = lambda number: None,
    ):
        self.who = who
        self._device = device
        self._page = page
        self._on_hand_over = on_hand_over
        self._greeted = False
        self._pages: list[dict[str, Any]] = []
        self._outbox: asyncio.Queue[bytes] = asyncio.Queue()
        self._tasks: set[asyncio.Task[None]] = set()
        self._typing = asyncio.Lock()  # keeps the order of what is typed
        self._heard_s = 0.0  # time of the page's last message

    async def run(self) -> None:
        """Serve the page until it or the device is gone."""
        sender = asyncio.create_task(self._send())
        dead_man = asyncio.create_task(self._watch_the_page())
        try:
            await self._attach()
            device = self._device
            hello: dict[str, Any] = {
                "device": device.name,
                "repl": device.work.runs_scripts,
                "kept": device.keep,
            }
            if device.press_estop:
                hello |= {"simulated": True, "terminal": True}
            if device.axes:
                hello["axes"] = device.axes.read()
            if device.example:
                hello["example"] = device.example
            await self._say(hello)
            self._greeted = True
            if self._pages:
                await self._say({"pages": self._pages})
            await self._listen()
        except ToolError as error:
            await self.end(str(error))
        finally:
            if self._tasks:  # lets the board finish its tasks
                await asyncio.wait(self._tasks)
            with contextlib.suppress(ToolError):
                await asyncio.to_thread(self._device.work.rest)
            await asyncio.to_thread(self._device.work.close_terminal)
            sender.cancel()
            dead_man.cancel()

    def watched_by(self, pages: list[dict[str, Any]]) -> None:
        """Tell the page which ones watch: [{"number": 1, "who": "a phone"}]."""
        self._pages = pages
        if self._greeted:
            self._start(self._say({"pages": pages}))

    async def end(self, why: str, held: bool = False) -> None:
        """Send the page the reason, and close. held: another page has the device."""
        await self._say({"ended": why, "held": True} if held else {"ended": why})
        await self._page.close()

    async def _attach(self) -> None:
        bridge = await self._device.attach()
        bridge.on_bytes = self._outbox.put_nowait
        bridge.on_end = lambda why: self._start(self.end(why))
        bridge.on_stopped = lambda why: self._start(self._say({"stopped": why}))

    async def _listen(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            async for message in self._page:
                self._heard_s = asyncio.get_running_loop().time()
                if isinstance(message, str):
                    self._start(self._handle(message))
                elif self._device.bridge:
                    try:
                        await self._device.bridge.send(message)
                    except OSError as error:
                        await self.end(f"the connection to {self._device.name} broke off: {error}")

    async def _send(self) -> None:
        """Send the device's bytes to the page, in their order."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                await self._page.send(await self._outbox.get())

    async def _watch_the_page(self) -> None:
        """End the jogs of a page whose script hangs, as it cannot release them.

        While anything moves, a healthy page sends several requests a second.
        """
        loop = asyncio.get_running_loop()
        while True:
            await asyncio.sleep(_LOOK_S)
            bridge = self._device.bridge
            silent_s = loop.time() - self._heard_s
            if bridge and bridge.jogging and silent_s > self._device.silence_s:
                with contextlib.suppress(OSError):  # another task reports a lost port
                    await bridge.let_go("The page was silent, so its jog has been stopped.")

    def _start(self, work: Any) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _say(self, found: dict[str, Any]) -> None:
        with contextlib.suppress(ConnectionClosed):
            await self._page.send(json.dumps(found))

    # ---- the page's other requests

    async def _handle(self, text: str) -> None:
        try:
            said = json.loads(text)
            if isinstance(said.get("keep"), bool):
                self._device.keep = said["keep"]
                return
            if said.get("released") is True:
                if self._device.bridge:
                    self._device.bridge.released()
                return
            if isinstance(said.get("hand_over"), int):
                self._on_hand_over(said["hand_over"])
                return
            if isinstance(said.get("typed"), str):
                async with self._typing:
                    await asyncio.to_thread(self._device.work.type, said["typed"])
                return
            if said["do"] not in _TASKS:
                raise ValueError(f"there is no task {said['do']!r}")
            number = int(said["id"])
            arguments = [str(said["text"])] if said["do"] in _WITH_TEXT else []
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            await self._say({"error": f"the page has sent what the server does not know: {error}"})
            return
        try:
            await self._say({"id": number, "result": await self._do(said["do"], arguments)})
        except ToolError as error:
            await self._say({"id": number, "error": str(error)})

    def _open_terminal(self, loop: asyncio.AbstractEventLoop) -> None:
        def say(found: dict[str, Any]) -> None:
            asyncio.run_coroutine_threadsafe(self._say(found), loop).result()

        self._device.work.open_terminal(
            lambda text: say({"repl": text}), lambda why: say({"repl_ended": why})
        )

    async def _do(self, task: str, arguments: list[str]) -> Any:
        if task == "write_axes":
            if not self._device.axes:
                raise ToolError("this server keeps no axes.toml")
            return await asyncio.to_thread(self._device.axes.write, *arguments)
        if task == "estop":
            if not self._device.press_estop:
                raise ToolError("only a simulated board's E-stop can be pressed on the page")
            self._device.press_estop(arguments[0] == "pressed")
            return {}
        if task in _OF_MOVES:
            return await asyncio.to_thread(getattr(MoveWork(self._device.axes), task), *arguments)
        if task == "terminal":
            await asyncio.to_thread(self._open_terminal, asyncio.get_running_loop())
            return {}
        work = getattr(self._device.work, task)
        if task != "write_rig":
            return await asyncio.to_thread(work, *arguments)
        await asyncio.to_thread(self._device.work.check_at_rest)
        await self._device.let_go()  # the board restarts, and so do its ports
        try:
            return await asyncio.to_thread(work, *arguments)
        finally:
            await self._attach()
