"""A connection over TCP with the face of a serial port, as Client takes it. Works on every system
alike."""

import select
import socket
import time
from urllib.parse import urlsplit

SCHEME = "socket://"
_CONNECT_S = 5.0
_TAKE_S = 10.0  # one that takes nothing for so long has gone


def is_socket(url: str) -> bool:
    """Whether this names a TCP address."""
    return url.startswith(SCHEME)


def host_and_port(url: str) -> tuple[str, int]:
    """`socket://HOST:PORT` taken apart; ValueError for another address."""
    parts = urlsplit(url)
    if (
        not is_socket(url)
        or not parts.hostname
        or parts.port is None
        or parts.path not in ("", "/")
    ):
        raise ValueError(f"expected {SCHEME}HOST:PORT, found {url}")
    return parts.hostname, parts.port


class TcpPort:
    """A raw TCP connection to a board's port (`make sim`, `make emu`, a serial server).

    read() and write() raise ConnectionError once the other side has gone, write() TimeoutError if
    it takes nothing.
    """

    def __init__(self, url: str, timeout: float | None = None):
        """`socket://HOST:PORT`; ValueError for another address, OSError if nobody is there."""
        address = host_and_port(url)
        self.port = url
        self.timeout = timeout
        self.is_open = True
        self._socket = socket.create_connection(address, _CONNECT_S)
        self._socket.settimeout(_TAKE_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes: those that come within `timeout` seconds, None waits for all of
        them."""
        deadline = None if self.timeout is None else time.monotonic() + self.timeout
        data = bytearray()
        while len(data) < size:
            wait = None if deadline is None else max(0.0, deadline - time.monotonic())
            if not select.select([self._socket], [], [], wait)[0]:
                break
            piece = self._socket.recv(size - len(data))
            if not piece:
                if data:
                    break  # what came before; the next read tells
                raise ConnectionResetError(f"{self.port} has closed the connection")
            data += piece
        return bytes(data)

    def write(self, data: bytes) -> int:
        """Send all of it."""
        self._socket.sendall(data)
        return len(data)

    @property
    def in_waiting(self) -> int:
        """Bytes that can be read at once."""
        if not select.select([self._socket], [], [], 0)[0]:
            return 0
        return len(self._socket.recv(1 << 16, socket.MSG_PEEK))

    def close(self) -> None:
        """Hang up; a second time does nothing."""
        self.is_open = False
        self._socket.close()
