"""A TCP connection with the interface of a serial port, as Client needs it, on every system."""

import select
import socket
import time
from urllib.parse import urlsplit

SCHEME = "socket://"
_CONNECT_S = 5.0
_TAKE_S = 10.0  # a peer that accepts nothing for this long is gone


def is_socket(url: str) -> bool:
    """Return whether this is a TCP address."""
    return url.startswith(SCHEME)


def host_and_port(url: str) -> tuple[str, int]:
    """Split `socket://HOST:PORT`. Raises ValueError for another address."""
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

    read() and write() raise ConnectionError once the peer has gone. write() raises TimeoutError if
    it accepts nothing.
    """

    def __init__(self, url: str, timeout: float | None = None):
        """Connect to `socket://HOST:PORT`. Raises ValueError, or OSError if nobody is there."""
        address = host_and_port(url)
        self.port = url
        self.timeout = timeout
        self.is_open = True
        self._socket = socket.create_connection(address, _CONNECT_S)
        self._socket.settimeout(_TAKE_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes that come within `timeout` seconds; None waits for all of
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
                    break  # return the bytes before the end; the next read raises
                raise ConnectionResetError(f"{self.port} has closed the connection")
            data += piece
        return bytes(data)

    def fileno(self) -> int:
        """Return the connection's file, to wait for it."""
        return self._socket.fileno()

    def write(self, data: bytes) -> int:
        """Send all bytes."""
        self._socket.sendall(data)
        return len(data)

    @property
    def in_waiting(self) -> int:
        """Number of bytes that can be read at once."""
        if not select.select([self._socket], [], [], 0)[0]:
            return 0
        return len(self._socket.recv(1 << 16, socket.MSG_PEEK))

    def close(self) -> None:
        """Close the connection. A second call does nothing."""
        self.is_open = False
        self._socket.close()
