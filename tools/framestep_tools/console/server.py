"""Serves the page, and connects one page at a time with the device.

It listens on this computer only, or on request in the local network too. It refuses foreign
requests: a Host other than this computer (DNS rebinding: a foreign name that leads here), a
WebSocket with the Origin of another page, and one without the token. The token is part of the
address that the server prints, and new each time.

A link with `take=1` takes the device from the page that has it. One with `watch=1` watches it
(watcher.py). One with `stop=1` stops everything, whichever page or program has the device, and
takes it from nobody; the server answers `{"stop": "what came of it", "bad": false}` and closes it.
"""

import asyncio
import contextlib
import hmac
import http
import json
import secrets
import socket
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from ..errors import ToolError
from . import page_files
from .device import ConsoleDevice
from .page_session import Visit
from .port_bridge import Bridge
from .watcher import Watcher

ADDRESS = "127.0.0.1"
_EVERY = "0.0.0.0"  # also reached from the local network
_ELSEWHERE = ("192.0.2.1", 9)  # an address of no network: a socket toward it sends nothing
_TURN_S = 2.0  # time for the previous page to end, when one is reloaded
_WATCH_S = 0.5  # interval at which the server asks what still moves
_LARGEST_MESSAGE = 1 << 20
_PING_S = 5.0  # a page that does not answer for this long is gone
_HEADERS = {
    "Cache-Control": "no-store",
    # xterm.js makes style sheets of its own
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; "
    "frame-ancestors 'none'; base-uri 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class ConsoleServer:
    """The server. `url` is the page's address once `start` has been called, `lan_url` the same for
    other computers of the local network."""

    def __init__(self, device: ConsoleDevice):
        self.device = device
        self.url = self.lan_url = ""
        self.offer_s = _TURN_S  # how long nobody has the device before a page that watches gets it
        self._token = secrets.token_urlsafe(24)
        self._turn = asyncio.Lock()
        self._visit: Visit | None = None  # the page that has the device
        self._coming = 0  # pages that wait for it
        self._watchers: dict[int, Watcher] = {}
        self._offering: asyncio.TimerHandle | None = None
        self._hosts: set[str] = set()
        self._server: Any = None
        self._ending: asyncio.Future[None] | None = None  # of a page's watching
        self._watch: asyncio.Task[None] | None = None

    async def start(self, port: int = 0, lan: str | None = None) -> None:
        """Listen on a port; 0 takes any free one. lan: this computer's address in the local
        network, to be reached from there too. Raises ToolError if the port is taken."""
        try:
            self._server = await serve(
                self._connected,
                _EVERY if lan else ADDRESS,
                port,
                process_request=self._answer,
                max_size=_LARGEST_MESSAGE,
                ping_interval=_PING_S,
                ping_timeout=_PING_S,
                compression=None,
            )
        except OSError as error:
            raise ToolError(
                f"cannot serve the console on port {port}: {error.strerror}; --port names another"
            ) from None
        number = self._server.sockets[0].getsockname()[1]
        hosts = [ADDRESS, "localhost", *([lan] if lan else [])]
        self._hosts = {f"{host}:{number}" for host in hosts}
        self.url = f"http://{ADDRESS}:{number}/?token={self._token}"
        self.lan_url = f"http://{lan}:{number}/?token={self._token}" if lan else ""

    async def stop(self) -> None:
        """Stop what moves, close the port and end."""
        if self._server:
            self._server.close()
            await self._server.wait_closed()
        await self._back()
        await self.device.let_go()

    # ---- the device's port

    async def _leave(self) -> None:
        """End jogs after the page has gone, and all other motion unless `keep` is set."""
        bridge = self.device.bridge
        if bridge is None:
            return
        bridge.on_bytes = lambda data: None
        bridge.on_end = lambda why: None
        bridge.on_stopped = lambda why: None
        bridge.released()
        if not self.device.keep:
            await self.device.let_go()
            return
        try:
            await bridge.stop_jogs()
        except OSError:
            await self.device.let_go()
        else:
            self._watch = asyncio.create_task(self._until_at_rest(bridge))

    async def _until_at_rest(self, bridge: Bridge) -> None:
        """Keep the port open without a page until nothing moves."""
        with contextlib.suppress(OSError):
            while await bridge.moves():
                await asyncio.sleep(_WATCH_S)
        async with self._turn:  # no page may connect while the port is being closed
            await self.device.let_go()

    async def _back(self) -> None:
        """Give the port to a page that has connected."""
        watch, self._watch = self._watch, None
        while watch and not watch.done():
            watch.cancel()
            await asyncio.wait([watch], timeout=_WATCH_S)

    # ---- requests of a browser

    async def _stop(self, page: ServerConnection) -> None:
        """Stop everything for a page that does not have the device."""
        try:
            await self.device.stop(f"{_who(page).capitalize()} has stopped the motors.")
            found = {"stop": "Stopped: all motors ramp down.", "bad": False}
        except (ToolError, OSError) as error:
            text = f"NOT STOPPED: {error}. Press the E-stop, or switch the motors' supply off."
            found = {"stop": text, "bad": True}
        with contextlib.suppress(ConnectionClosed):
            await page.send(json.dumps(found))
            await page.close()

    async def _connected(self, page: ServerConnection) -> None:
        if _asked(page, "stop"):
            await self._stop(page)
        elif _asked(page, "watch"):
            await self._watched(page)
        else:
            await self._visited(page)

    async def _visited(self, page: ServerConnection) -> None:
        """Give the device to a page, once no other one has it."""
        visit = Visit(self.device, page, _who(page), self._hand_over)
        if _asked(page, "take") and self._visit:
            await self._visit.end(f"{visit.who} has taken the device over", held=True)
        self._coming += 1
        try:
            await asyncio.wait_for(self._turn.acquire(), _TURN_S)
        except (TimeoutError, asyncio.TimeoutError):
            await visit.end(f"{self._holder or 'another page'} has the device", held=True)
            return
        finally:
            self._coming -= 1
        try:
            self._visit = visit
            self._tell_holder()
            self._tell_watchers()
            await self._back()
            await visit.run()
        finally:
            self._visit = None
            try:
                await self._leave()
            finally:
                self._turn.release()
                self._tell_watchers()
                self._offer_later()

    # ---- pages that watch

    @property
    def _holder(self) -> str | None:
        return self._visit.who if self._visit else None

    async def _watched(self, page: ServerConnection) -> None:
        watcher = Watcher(self.device, page, _who(page), self._holder)
        self._watchers[watcher.number] = watcher
        self._tell_holder()
        self._offer_later()
        try:
            await watcher.run()
        finally:
            self._watchers.pop(watcher.number, None)
            self._tell_holder()

    def _tell_watchers(self) -> None:
        """Tell the pages that watch who has the device."""
        for watcher in self._watchers.values():
            watcher.say({"holder": self._holder})

    def _tell_holder(self) -> None:
        """Tell the page that has the device which ones watch."""
        if self._visit:
            self._visit.watched_by(
                [{"number": each.number, "who": each.who} for each in self._watchers.values()]
            )

    def _hand_over(self, number: int) -> None:
        if watcher := self._watchers.get(number):
            watcher.say({"take": True})

    def _offer_later(self) -> None:
        """Let the first page that watches have a device that nobody has. The page that had it may
        be loading again, so it comes first."""
        if self._offering:
            self._offering.cancel()
        if not self._visit:
            self._offering = asyncio.get_running_loop().call_later(self.offer_s, self._offer)

    def _offer(self) -> None:
        if self._visit or self._coming or not self._watchers:
            return
        watcher = self._watchers.pop(next(iter(self._watchers)))
        self._ending = asyncio.ensure_future(watcher.end("no page has the device any more"))
        self._offer_later()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return a file of the page, or None to accept a WebSocket."""
        if not self._hosts.issuperset(hosts := request.headers.get_all("Host")) or len(hosts) != 1:
            return _refusal(
                http.HTTPStatus.FORBIDDEN, "The console answers at the addresses that it prints."
            )
        address = urlsplit(request.path)
        if address.path == "/link":
            return self._admit(request, address.query)
        name = address.path.lstrip("/") or "index.html"
        content = page_files.files().get(name)
        if content is None:
            return _refusal(http.HTTPStatus.NOT_FOUND, "There is no such page.")
        return _response(http.HTTPStatus.OK, content, page_files.TYPES[PurePosixPath(name).suffix])

    def _admit(self, request: Request, query: str) -> Response | None:
        origins = request.headers.get_all("Origin")
        given = parse_qs(query).get("token", [""])[0]
        if len(origins) != 1 or origins[0] not in {f"http://{host}" for host in self._hosts}:
            return _refusal(http.HTTPStatus.FORBIDDEN, "Only the console's own page may connect.")
        if not hmac.compare_digest(given.encode(), self._token.encode()):
            return _refusal(
                http.HTTPStatus.FORBIDDEN,
                "The address lacks its token: take the one that framestep console prints.",
            )
        return None


def lan_address() -> str:
    """Return this computer's address in the local network. Raises ToolError if it has none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_ELSEWHERE)
            address = str(probe.getsockname()[0])
        except OSError:
            address = ADDRESS
    if address.startswith("127."):
        raise ToolError("this computer is in no network: --lan needs one")
    return address


def _asked(page: ServerConnection, what: str) -> bool:
    """Return whether the address of a page's link asks for something, such as take=1."""
    return bool(page.request and parse_qs(urlsplit(page.request.path).query).get(what))


def _who(page: ServerConnection) -> str:
    """Return how other pages name this one."""
    program = page.request.headers.get("User-Agent", "") if page.request else ""
    return "a phone" if "Mobi" in program else "another page"


def _refusal(status: http.HTTPStatus, text: str) -> Response:
    return _response(status, f"{text}\n".encode(), "text/plain; charset=utf-8")


def _response(status: http.HTTPStatus, body: bytes, kind: str) -> Response:
    headers = Headers(
        {**_HEADERS, "Content-Type": kind, "Content-Length": str(len(body)), "Connection": "close"}
    )
    return Response(status.value, status.phrase, headers, body)
