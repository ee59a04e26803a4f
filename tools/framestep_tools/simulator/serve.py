"""Serve a board in the foreground: its ports as pseudo-terminals and raw TCP, its edges as a CSV
file.

It prints the ports' paths, one a line, the protocol port's first, and then `ready`:

    /dev/pts/5
    tcp 127.0.0.1:7000
    repl /dev/pts/6
    ready

A client that opens the pseudo-terminal or connects opens the port (DTR), and closes it when it
disconnects. There is one client at a time: another connection is closed at once, and bytes from
another terminal are dropped.
"""

import select
import signal
import socket
import sys
import time
from typing import Protocol

from ..client.pty_port import CHUNK, PtyLink, can_make_one
from ..errors import ToolError
from ..judge.trace import TraceWriter
from .boards import Board, Channel

_HIGH_WATER = 65536  # with more bytes under way, the sender has to wait
_TRACE_FLUSH_S = 0.1
_LONGEST_CATCH_UP_NS = 100_000_000  # a pace that has fallen further behind restarts from now
_BUSY_NS = 250_000_000  # board time: positions come every 100 ms while anything moves
_CLOSED_NS = 10_000_000  # board time that a port stays closed between two clients
# Board time in which the board can read its client's last bytes, as with a serial driver; after it
# the rest is lost
_DRAIN_NS = 2_000_000_000
_WAITING_S = 0.1  # real time after its last byte in which a client counts as waiting for an answer


class AddressError(ToolError):
    """Not a valid HOST:PORT to listen on."""


def parse_address(text: str) -> tuple[str, int]:
    """Parse `127.0.0.1:7000` to host and port; port 0 takes a free one."""
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdecimal() or int(port) > 65535:
        raise AddressError(f"expected HOST:PORT such as 127.0.0.1:7000, found {text!r}")
    return host.strip("[]"), int(port)


class Link(Protocol):
    """A connection to a port for one client at a time."""

    def is_open(self, taken: bool) -> bool:
        """Return whether a client is connected. taken: another link uses the port."""

    def read(self) -> bytes:
        """Return the client's bytes, b"" for none."""

    def write(self, data: bytes) -> int:
        """Send to the client. Return the number of accepted bytes."""

    def readable(self) -> int | None:
        """Return a file descriptor that becomes readable when read() or is_open() has news, or
        None."""


class TcpLink:
    """A Link over raw TCP."""

    def __init__(self, address: str):
        host, port = parse_address(address)
        try:
            self._server = socket.create_server((host, port))
        except OSError as error:
            raise AddressError(f"cannot listen on {address}: {error.strerror or error}") from None
        self._server.setblocking(False)
        self.address = f"{host}:{self._server.getsockname()[1]}"
        self._client: socket.socket | None = None
        self._next: socket.socket | None = (
            None  # connected when the client had perhaps disconnected
        )
        self._left = False

    def is_open(self, taken: bool) -> bool:
        if self._left:  # show the end even if the next client is already waiting
            self._left = False
            return False
        if self._next:
            client = self._next
        else:
            try:
                client, _ = self._server.accept()
            except OSError:
                return self._client is not None
        if self._client and self._at_rest():
            taken = True
        self._next = None
        if taken:
            client.close()
        elif self._client:
            self._next = client
        else:
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client = client
        return self._client is not None

    def _at_rest(self) -> bool:
        """Return whether the client is connected and has sent nothing unread."""
        assert self._client
        try:
            self._client.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return True
        except OSError:
            pass
        return False

    def read(self) -> bytes:
        if self._client:
            try:
                data = self._client.recv(CHUNK)
            except BlockingIOError:
                return b""
            except OSError:
                data = b""
            if data:
                return data
            self._leave()
        return b""

    def write(self, data: bytes) -> int:
        try:
            return self._client.send(data) if self._client else 0
        except BlockingIOError:
            return 0
        except OSError:
            self._leave()
            return 0

    def readable(self) -> int | None:
        return (self._client or self._server).fileno()

    def _leave(self) -> None:
        if self._client:
            self._client.close()
            self._client = None
            self._left = True

    def close(self) -> None:
        self._leave()
        if self._next:
            self._next.close()
        self._server.close()


class Exchange:
    """Carries bytes between a board's port and the link that has a client."""

    def __init__(self, channel: Channel, links: list[PtyLink | TcpLink]):
        self.channel, self.links = channel, links
        self.active: PtyLink | TcpLink | None = None
        self._to_client = bytearray()
        self._drained_ns: int | None = (
            None  # after the client has disconnected: latest time to close its port
        )
        self._free_ns = 0

    def from_client(self, now_ns: int) -> int:
        """Read the client's bytes, and notice it come or go. Return the number of bytes."""
        taken = 0
        if self.active:
            # Read first: bytes before a disconnection still count.
            while self.channel.pending < _HIGH_WATER and (data := self.active.read()):
                self.channel.receive(data)
                taken += len(data)
            if not self.active.is_open(False):
                self.active = None
                self._drained_ns = now_ns + _DRAIN_NS
        if self._drained_ns is not None and (
            not self.channel.pending or now_ns >= self._drained_ns
        ):
            self._drained_ns = None
            self._free_ns = now_ns + _CLOSED_NS
            self.channel.open_port(False)
        for link in self.links:
            if link is self.active:
                continue
            if self._drained_ns is not None or now_ns < self._free_ns:
                break  # the board must see that its port was closed
            if link.is_open(self.active is not None):
                if self.active:
                    link.read()  # dropped: another client has the port
                else:
                    self.active = link
                    self._to_client.clear()
                    self.channel.transmit()
                    self.channel.open_port(True)
        return taken

    def to_client(self) -> int:
        """Forward the board's bytes. Return their number."""
        sent = 0
        if len(self._to_client) < _HIGH_WATER:
            data = self.channel.transmit()
            sent = len(data)
            self._to_client += data
        if self.active is None:
            self._to_client.clear()
        elif self._to_client:
            del self._to_client[: self.active.write(bytes(self._to_client))]
        return sent

    def readable(self) -> list[int]:
        """Return the file descriptors to wait for."""
        if self.active and self.channel.pending >= _HIGH_WATER:
            return []
        return [fd for link in self.links if (fd := link.readable()) is not None]

    def close(self) -> None:
        for link in self.links:
            link.close()


class Pace:
    """Limits a board's time: `speed` times as fast as the clock, or unlimited while there is
    work."""

    def __init__(self, speed: float | None, now_ns: int):
        self.speed = speed  # None: as fast as possible
        self.lost_ns = 0  # the board's time that was never caught up
        self._start(now_ns)

    def _start(self, now_ns: int) -> None:
        self._real, self._virtual = time.monotonic(), now_ns

    def target(self, now_ns: int, slice_ns: int, work: bool) -> int:
        """Return the time until which the board may run in the next slice; `now_ns` if it has to
        wait."""
        if self.speed is None and work:
            self._start(now_ns + slice_ns)
            return now_ns + slice_ns
        allowed = self._virtual + int((time.monotonic() - self._real) * (self.speed or 1.0) * 1e9)
        if allowed - now_ns > _LONGEST_CATCH_UP_NS * max(1.0, self.speed or 1.0):
            self.lost_ns += allowed - now_ns - slice_ns
            self._start(now_ns + slice_ns)
            return now_ns + slice_ns
        longest = max(slice_ns, int(slice_ns * (self.speed or 1.0)))
        return max(now_ns, min(allowed, now_ns + longest))


def parse_speed(text: str) -> float | None:
    """Parse `max` (None) or a positive factor of real time. Raises ToolError."""
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0 < speed < float("inf"):
        raise ToolError(
            f"--speed: expected max or a positive number such as 1 or 0.5, found {text!r}"
        )
    return speed


class Server:
    """Runs a board until `stop` is called or SIGINT or SIGTERM comes."""

    def __init__(
        self,
        board: Board,
        speed: float | None = 1.0,
        tcp: str | None = None,
        trace: str | None = None,
        repl: bool = False,
        repl_tcp: str | None = None,
    ):
        self.board = board
        self.pace = Pace(speed, board.now_ns)
        self.stopping = False
        self.announcements: list[str] = []
        self.exchanges = [Exchange(board.protocol, self._links("tcp", tcp, pty=""))]
        if board.repl and (repl or repl_tcp):
            self.exchanges.append(
                Exchange(board.repl, self._links("repl", repl_tcp, pty="repl " if repl else None))
            )
        self.trace = TraceWriter(trace) if trace else None
        self._last_flush = time.monotonic()
        self._last_byte = -_WAITING_S
        self._last_work_ns = -_BUSY_NS

    def _links(self, name: str, tcp: str | None, pty: str | None) -> list[PtyLink | TcpLink]:
        links: list[PtyLink | TcpLink] = []
        if pty is not None and (can_make_one() or not tcp):
            links.append(link := PtyLink())
            self.announcements.append(f"{pty}{link.path}")
        if tcp:
            links.append(served := TcpLink(tcp))
            self.announcements.append(f"{name} {served.address}")
        return links

    def stop(self, *_: object) -> None:
        """End `run` after the present slice; safe in a signal handler."""
        self.stopping = True

    def run(self) -> None:
        """Announce the ports and serve them."""
        before = {
            number: signal.signal(number, self.stop) for number in (signal.SIGINT, signal.SIGTERM)
        }
        try:
            self.announce()
            while not self.stopping:
                self.step()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
            self.close()

    def report_lost_time(self) -> None:
        """Report on standard error if the computer did not keep up with the speed."""
        if self.pace.speed is not None and self.pace.lost_ns:
            print(
                f"this computer did not keep up with --speed {self.pace.speed:g}: the board's "
                f"time lost {self.pace.lost_ns * 1e-9:.1f} s, so clients measured wrong times",
                file=sys.stderr,
            )

    def announce(self) -> None:
        """Print the ports' paths, then `ready`."""
        print(*self.announcements, "ready", sep="\n", flush=True)

    def step(self) -> None:
        """Run one slice: bytes in, time passes, bytes and edges out. Then wait briefly if there is
        nothing to do."""
        board = self.board
        if sum([exchange.from_client(board.now_ns) for exchange in self.exchanges]):
            self._last_byte = time.monotonic()
        client = any(exchange.active for exchange in self.exchanges)
        work = client and (
            time.monotonic() - self._last_byte < _WAITING_S
            or board.now_ns - self._last_work_ns < _BUSY_NS
            or any(exchange.channel.pending for exchange in self.exchanges)
        )
        target = self.pace.target(board.now_ns, board.slice_ns, work)
        # a whole slice, as there may be more to catch up with
        behind = target - board.now_ns >= board.slice_ns
        if target > board.now_ns:
            board.run_until(target)
        sent = sum([exchange.to_client() for exchange in self.exchanges])
        if edges := board.edges():
            sent += 1
            if self.trace:
                self.trace.add(edges)
        if sent:
            self._last_work_ns = board.now_ns
        if self.trace:
            self.trace.release(board.now_ns)
            if time.monotonic() - self._last_flush >= _TRACE_FLUSH_S:
                self.trace.flush()
                self._last_flush = time.monotonic()
        if not (work and self.pace.speed is None):
            descriptors = [fd for exchange in self.exchanges for fd in exchange.readable()]
            select.select(descriptors, [], [], 0 if behind else board.slice_ns * 1e-9)

    def close(self) -> None:
        """Close the ports and the trace, then the board."""
        for exchange in self.exchanges:
            exchange.close()
        if self.trace:
            self.trace.close()
        self.board.close()
