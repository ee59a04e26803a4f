"""A page that watches while another one has the device.

It asks the device what it shows, over the same port: only questions get through. Reports that the
device sends unasked come to it, too. It stops everything by a link of its own (`stop=1`). Texts are
JSON: `{"device": …, "watch": true}` first; `{"holder": "a phone"}` says who has the device, null:
nobody; `{"take": true}` asks the page to take the device, as the page that has it wishes so. Before
it closes, the server sends `{"ended": "why"}`.
"""

import asyncio
import contextlib
import itertools
import json
import struct
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from framestep.protocol import messages

from ..client.wire import Frame, FrameDecoder, encode
from ..payloads import REQUESTS, Ack
from .device import ConsoleDevice

QUESTIONS = frozenset(
    kind for kind, cls in REQUESTS.items() if cls.KEEPS_PLAN and cls.REPLY is not Ack
)
_REFUSED = struct.pack("<H", Ack.ERR_GENERAL)
_MOST_ASKED = 16  # questions of a page that wait for their answers
_numbers = itertools.count(1)


class Watcher:
    """A connected page that watches. `number` and `who` name it to the page that has the device;
    holder: who that is."""

    def __init__(self, device: ConsoleDevice, page: ServerConnection, who: str, holder: str | None):
        self.number = next(_numbers)
        self.who = who
        self._device = device
        self._page = page
        self._outbox: asyncio.Queue[bytes | str] = asyncio.Queue()
        self._asked: dict[int, Frame] = {}
        hello: dict[str, Any] = {"device": device.name, "repl": False, "kept": False}
        if device.axes:
            hello["axes"] = device.axes.read()
        self.say({**hello, "watch": True, "holder": holder})

    async def run(self) -> None:
        """Serve the page until it is gone, or `end` is called."""
        sender = asyncio.create_task(self._send())
        self._device.on_reports.add(self._report)
        self._device.on_open.add(self._ask_again)
        decoder = FrameDecoder()
        try:
            with contextlib.suppress(ConnectionClosed):
                async for message in self._page:
                    if isinstance(message, str):
                        self._refuse(message)
                        continue
                    for frame in decoder.feed(message):
                        await self._ask(frame)
        finally:
            self._device.on_reports.discard(self._report)
            self._device.on_open.discard(self._ask_again)
            sender.cancel()

    def say(self, found: dict[str, Any]) -> None:
        """Send the page a text."""
        self._outbox.put_nowait(json.dumps(found))

    async def end(self, why: str) -> None:
        """Send the page the reason, and close."""
        with contextlib.suppress(ConnectionClosed):
            await self._page.send(json.dumps({"ended": why}))
        await self._page.close()

    def _refuse(self, text: str) -> None:
        """Refuse a task of the page, such as to read the rig file."""
        with contextlib.suppress(ValueError, KeyError, TypeError):
            number = int(json.loads(text)["id"])
            self.say({"id": number, "error": "another page has the device: take it over first"})

    async def _ask(self, frame: Frame) -> None:
        """Forward a question; the device answers the page, once its port is open."""
        if frame.type not in QUESTIONS:
            self._outbox.put_nowait(encode(frame.type | messages.MSG_FLAG_ACK, _REFUSED, frame.id))
            return
        if len(self._asked) == _MOST_ASKED:  # by a page that did not wait
            del self._asked[next(iter(self._asked))]
        self._asked[frame.id] = frame
        await self._forward(frame)

    async def _ask_again(self) -> None:
        """Forward what has no answer: its port was closed as another page has got the device."""
        for frame in list(self._asked.values()):
            await self._forward(frame)

    async def _forward(self, question: Frame) -> None:
        def send(frame: Frame) -> None:
            if self._asked.pop(question.id, None):
                self._outbox.put_nowait(encode(frame.type, frame.payload, question.id))

        if self._device.bridge:
            with contextlib.suppress(OSError):  # the page that has the port is told
                await self._device.bridge.ask_for(question, send)

    def _report(self, frame: Frame) -> None:
        self._outbox.put_nowait(encode(frame.type, frame.payload, 0))

    async def _send(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                await self._page.send(await self._outbox.get())
