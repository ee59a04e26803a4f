"""A second program's way to a device through the program that has its port: `framestep stop` while
`framestep play` plays.

The first program listens on this computer only. It writes its address and a secret into a file
that only its user can read. The second program sends the secret and then frames. The first one
forwards them to the device under its own IDs, and returns the answers under the original IDs.
Unasked messages of the device go to both. A request to stop motors also goes to both, with ID 0: a
program that repeats a jog must know of it.
"""

import contextlib
import hashlib
import json
import os
import secrets
import select
import socket
import tempfile
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from ..payloads import REQUESTS, MotorStop
from .port_finder import split_rate
from .tcp_port import SCHEME, TcpPort, host_and_port, is_socket
from .wire import Frame, FrameDecoder, encode

STOPS = frozenset(kind for kind, cls in REQUESTS.items() if cls.STOPS)
ALL_MOTORS = -1  # as bits
# Interval at which the first program looks for guests where it cannot wait for them and its port
LOOK_S = 0.05
_SECRET_BYTES = 32


def _same_name(path: str) -> str:
    """Return one name for all spellings of a port: follow links, resolve hosts to IP addresses."""
    if not is_socket(path):
        return os.path.realpath(split_rate(path)[0])
    try:
        host, port = host_and_port(path)
        return f"{SCHEME}{socket.gethostbyname(host)}:{port}"
    except (OSError, ValueError):  # opening it will report the mistake
        return path


def _place(path: str) -> Path:
    """Return the path of a port's file."""
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    name = hashlib.sha256(_same_name(path).encode()).hexdigest()[:16]
    return Path(tempfile.gettempdir(), f"framestep-{user}", f"{name}.json")


class Found(NamedTuple):
    """A program that has a port and shares it."""

    port: int
    secret: str
    who: str


def find(path: str) -> Found | None:
    """Return the program that has this port and shares it, or None."""
    try:
        file = _place(path)
        if hasattr(os, "getuid") and file.stat().st_uid != os.getuid():
            return None
        return Found(**json.loads(file.read_text()))
    except (OSError, ValueError, TypeError):
        return None


def enter(found: Found, timeout: float) -> TcpPort | None:
    """Return a port through this program to its device, or None if the program has ended."""
    try:
        port = TcpPort(f"{SCHEME}127.0.0.1:{found.port}", timeout)
        port.write(found.secret.encode())
        return port
    except OSError:
        return None


def stopped_by(frame: Frame) -> int:
    """Return the bits of the motors that a request stops; 0 if it stops none."""
    if frame.type == MotorStop.TYPE and frame.payload:
        return 1 << frame.payload[0]
    return ALL_MOTORS if frame.type in STOPS else 0


class _Guest:
    def __init__(self, connection: socket.socket):
        connection.setblocking(False)
        self.connection = connection
        self.secret = b""
        self.decoder = FrameDecoder()

    def send(self, frame: Frame, id: int) -> None:
        with contextlib.suppress(OSError):  # a guest that does not read gets nothing
            self.connection.send(encode(frame.type, frame.payload, id))


class Host(Protocol):
    """The owner of the port: a Client, or the console's Bridge."""

    stopped: int  # bits of the motors that guests stop, bit 1 for motor 1

    def forward(self, kind: int, payload: bytes) -> int:
        """Send a guest's message. Return the ID of its answer, for SharedPort.answer."""


class SharedPort:
    """The sharing of a host's port with guests. The host calls `wait` before it reads, `look`,
    `answer` and `pass_on`."""

    def __init__(self, client: Host, path: str, who: str):
        self._client = client
        self._secret = secrets.token_hex(_SECRET_BYTES // 2)
        self._guests: list[_Guest] = []
        self._asked: dict[int, tuple[_Guest, int]] = {}
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        self._file = _place(path)
        self._file.parent.mkdir(mode=0o700, exist_ok=True)
        said = json.dumps(
            {"port": self._server.getsockname()[1], "secret": self._secret, "who": who}
        )
        with contextlib.suppress(OSError):
            self._file.unlink()
        with open(os.open(self._file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
            file.write(said)

    @property
    def used(self) -> bool:
        """Whether there are guests."""
        return bool(self._guests)

    def close(self) -> None:
        """End the sharing."""
        with contextlib.suppress(OSError):
            self._file.unlink()
        for each in (self._server, *(guest.connection for guest in self._guests)):
            each.close()

    def wait(self, port: Any, seconds: float) -> float:
        """Wait until the port or a guest has something to read, at most `seconds`. Return the time
        for which the host may wait at its port after that."""
        files = [self._server, *(guest.connection for guest in self._guests)]
        try:
            select.select([port.fileno(), *files], [], [], seconds)
        except (AttributeError, OSError, ValueError):  # no file, as on Windows, or a closed one
            return min(seconds, LOOK_S)
        return 0.0

    def look(self) -> None:
        """Accept new guests, and forward their messages."""
        with contextlib.suppress(OSError):
            while True:
                self._guests.append(_Guest(self._server.accept()[0]))
        for guest in list(self._guests):
            try:
                data = guest.connection.recv(4096)
            except BlockingIOError:
                continue
            except OSError:
                data = b""
            if not data or not self._hear(guest, data):
                guest.connection.close()
                self._guests.remove(guest)

    def _hear(self, guest: _Guest, data: bytes) -> bool:
        """Forward a guest's messages. Return False if the guest has to go."""
        missing = _SECRET_BYTES - len(guest.secret)
        guest.secret += data[:missing]
        if not self._secret.encode().startswith(guest.secret):
            return False
        for frame in guest.decoder.feed(data[missing:]) if missing < len(data) else []:
            if frame.type in STOPS:
                self._client.stopped |= stopped_by(frame)
                self.pass_on(frame, guest)
            self._asked[self._client.forward(frame.type, frame.payload)] = guest, frame.id
        return True

    def answer(self, frame: Frame) -> bool:
        """Forward an answer to its guest. Return False if it answers no guest's request."""
        guest, id = self._asked.pop(frame.id, (None, 0))
        if guest:
            guest.send(frame, id)
        return guest is not None

    def pass_on(self, frame: Frame, but: _Guest | None = None) -> None:
        """Forward an unasked message or a stop to all guests, except one."""
        for guest in self._guests:
            if guest is not but and len(guest.secret) == _SECRET_BYTES:
                guest.send(frame, 0)
