"""Serving a board: pseudo-terminal and TCP, one client at a time, pace, trace. The board is a small
fake."""

import contextlib
import os
import socket
import threading
import time

import pytest
import serial

from framestep_tools.client.client import Client, NoAnswer
from framestep_tools.client.open_port import open_port
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.errors import ToolError
from framestep_tools.judge.trace import Trace
from framestep_tools.payloads import DeviceInfo, Hi
from framestep_tools.simulator import serve
from framestep_tools.simulator.boards import LockstepPort
from framestep_tools.simulator.serve import (
    Pace,
    PtyLink,
    Server,
    TcpLink,
    parse_address,
    parse_speed,
)

INFO = DeviceInfo("fake", 1, 2, 3, 8, 0, 0, 0, 0, 0, 0, 2)
MS = 1_000_000
PATIENCE_S = 100  # the answer comes at once, but a busy computer may take its time


class FakeChannel:
    """Answers HI two milliseconds later; sends HI unasked when its port is opened; records opening
    and closing."""

    def __init__(self):
        self.now = 0
        self.log = []
        self.hold = False
        self._decoder = FrameDecoder()
        self._in = bytearray()
        self._out = []  # (time, bytes)

    def receive(self, data):
        self._in += data

    def pass_time(self, now):
        self.now = now
        if self._in and not self.hold:
            for frame in self._decoder.feed(bytes(self._in)):
                self._out.append((now + 2 * MS, encode(INFO.TYPE, INFO.pack(), frame.id)))
            self._in.clear()

    def transmit(self):
        ready = b"".join(data for due, data in self._out if due <= self.now)
        self._out = [(due, data) for due, data in self._out if due > self.now]
        return ready

    def open_port(self, on):
        self.log.append(on)
        if on:
            self._out.append((self.now, encode(INFO.TYPE, INFO.pack(), 0)))

    @property
    def pending(self):
        return len(self._in)


class FakeBoard:
    slice_ns = MS

    def __init__(self, repl=False):
        self.protocol = FakeChannel()
        self.repl = FakeChannel() if repl else None
        self.now_ns = 0
        self.step_every_ns = 0
        self.closed = False
        self._edges = []

    def run_until(self, ns, until_output=False):
        while self.now_ns < ns:
            if self.step_every_ns and self.now_ns % self.step_every_ns == 0:
                self._edges.append((self.now_ns + 3 * MS, "m1", 1))
                self._edges.append((self.now_ns, "dir1", 1))
            self.now_ns = min(ns, self.now_ns - self.now_ns % MS + MS)
            for channel in (self.protocol, self.repl):
                if channel:
                    channel.pass_time(self.now_ns)
            if until_output and any(due <= self.now_ns for due, _ in self.protocol._out):
                return

    def edges(self):
        edges, self._edges = self._edges, []
        return edges

    def close(self):
        self.closed = True


@contextlib.contextmanager
def serving(board, **options):
    server = Server(board, **options)

    def run():
        while not server.stopping:
            server.step()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield server
    finally:
        server.stop()
        thread.join()
        server.close()


def until(condition, seconds=PATIENCE_S):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.002)


def tcp_address(server):
    return next(line.split()[1] for line in server.announcements if line.startswith("tcp "))


def tcp_url(server):
    return f"socket://{tcp_address(server)}"


def test_client_over_the_pseudo_terminal():
    board = FakeBoard()
    with serving(board) as server:
        path = server.announcements[0]
        for _ in range(2):  # the second time, too
            with Client.open(path, PATIENCE_S) as client:
                assert client.request(Hi()) == INFO
                until(lambda: board.protocol.log[-1:] == [True])
            until(lambda: board.protocol.log[-1:] == [False])
            time.sleep(0.03)
        assert board.protocol.log == [True, False, True, False]


def test_the_terminal_is_raw_and_says_hi_when_opened():
    board = FakeBoard()
    with serving(board) as server:
        fd = os.open(server.announcements[0], os.O_RDWR | os.O_NOCTTY)
        try:
            greeting = encode(INFO.TYPE, INFO.pack(), 0)
            data = b""
            while len(data) < len(greeting):
                data += os.read(fd, 4096)
            assert data == greeting
            os.write(fd, b"\x03\x04\r\n\x11\x13")
            until(lambda: board.protocol._decoder.pending or board.protocol._decoder.skipped)
            assert board.protocol._decoder.skipped == 6  # all of it came unchanged
        finally:
            os.close(fd)


def test_a_quick_return_is_seen_as_closing_and_opening():
    board = FakeBoard()
    with serving(board, tcp="127.0.0.1:0") as server:
        for _ in range(5):
            with Client.open(tcp_url(server), PATIENCE_S) as client:
                # the unasked HI may arrive before pyserial, which opens a socket, drops what came
                assert client.request(Hi()) == INFO
        until(lambda: len(board.protocol.log) == 10)
        assert board.protocol.log == [True, False] * 5


def test_a_client_that_comes_as_the_one_before_leaves_is_not_turned_away():
    """It may come after the last read of a client, and before the link looks whether that is
    there."""
    link = TcpLink("127.0.0.1:0")
    place = parse_address(link.address)
    try:
        first = socket.create_connection(place)
        until(lambda: link.is_open(False))
        first.sendall(b"last")
        first.close()
        second = socket.create_connection(place)
        second.sendall(b"first")
        assert link.is_open(False)
        until(lambda: link.read() == b"last")
        until(lambda: link.read() == b"" and not link.is_open(False))
        until(lambda: link.is_open(False))
        until(lambda: link.read() == b"first")
        second.close()
    finally:
        link.close()


def test_what_was_sent_before_leaving_arrives():
    board = FakeBoard()
    with serving(board, tcp="127.0.0.1:0") as server:
        with socket.create_connection(parse_address(tcp_address(server))) as client:
            client.sendall(b"x" * 100_000)
        until(lambda: board.protocol._decoder.skipped == 100_000)


@pytest.mark.parametrize("name", ["tcp", "terminal"])
def test_the_board_takes_what_a_client_wrote_before_it_sees_the_port_closed(name):
    """A board whose port is closed drops what has not reached it. mpremote leaves the raw REPL in
    this way."""
    board = FakeBoard()
    board.protocol.hold = True
    with serving(board, tcp="127.0.0.1:0") as server:
        url = tcp_url(server) if name == "tcp" else server.announcements[0]
        with contextlib.closing(open_port(url, PATIENCE_S)) as port:
            port.write(bytes(1000))
            until(lambda: board.protocol.pending == 1000)
        start = board.now_ns
        until(lambda: board.now_ns > start + 100 * MS)
        assert board.protocol.log == [True]
        board.protocol.hold = False
        until(lambda: board.protocol.log == [True, False])
        assert board.protocol._decoder.skipped == 1000


def test_a_board_that_takes_nothing_sees_its_port_closed():
    board = FakeBoard()
    board.protocol.hold = True
    with serving(board, tcp="127.0.0.1:0", speed=10) as server:
        with Client.open(tcp_url(server), PATIENCE_S) as client:
            client.send(Hi())
        until(lambda: board.protocol.log == [True, False])


def test_one_client_at_a_time():
    board = FakeBoard()
    with (
        serving(board, tcp="127.0.0.1:0") as server,
        Client.open(tcp_url(server), PATIENCE_S) as first,
    ):
        assert first.request(Hi()) == INFO
        with socket.create_connection(parse_address(tcp_address(server))) as second:
            second.settimeout(PATIENCE_S)
            assert second.recv(1) == b""  # closed at once
        with Client.open(server.announcements[0], timeout_s=0.2) as third, pytest.raises(NoAnswer):
            third.request(Hi())
        assert first.request(Hi()) == INFO
        assert board.protocol.log == [True]


def test_a_client_that_sends_too_much_has_to_wait():
    board = FakeBoard()
    board.protocol.hold = True
    with (
        serving(board, tcp="127.0.0.1:0") as server,
        socket.create_connection(parse_address(tcp_address(server))) as client,
    ):
        client.setblocking(False)
        sent = 0
        with contextlib.suppress(BlockingIOError):
            for _ in range(1000):
                sent += client.send(bytes(100_000))
                time.sleep(0.001)
        until(lambda: board.protocol.pending >= 65536)
        time.sleep(0.05)
        assert board.protocol.pending < 65536 + 4096
        assert sent < 50_000_000
        board.protocol.hold = False
        until(lambda: board.protocol._decoder.skipped >= sent)


def test_the_repl_has_ports_of_its_own():
    board = FakeBoard(repl=True)
    with serving(board, repl=True, repl_tcp="127.0.0.1:0") as server:
        kinds = [line.split()[0] for line in server.announcements]
        assert kinds[0].startswith("/dev/")
        assert kinds[1:] == ["repl", "repl"]
        with serial.Serial(server.announcements[1].split()[1]):
            until(lambda: board.repl.log == [True])
        assert board.protocol.log == []
    with serving(FakeBoard(repl=True)) as server:
        assert len(server.announcements) == 1


def test_trace_is_written_while_it_happens(tmp_path):
    board = FakeBoard()
    board.step_every_ns = 10 * MS
    path = tmp_path / "trace.csv"
    with serving(board, trace=str(path)):
        until(lambda: path.read_text().count("m1") > 5)
    trace = Trace.read(path)
    assert board.closed
    assert set(trace.signals) == {"m1", "dir1"}
    rows = [int(row.split(",")[0]) for row in path.read_text().splitlines()[1:]]
    assert rows == sorted(rows)


def pace(board):
    """Return the board's seconds in a second of the wall clock, over 0.4 s."""
    began, virtual = time.monotonic(), board.now_ns
    time.sleep(0.4)
    return (board.now_ns - virtual) * 1e-9 / (time.monotonic() - began)


def keeps_real_time(board):
    """Whether it does so as soon as a busy computer allows. It may fall behind, and catch up a
    tenth of a second, but not be ahead."""
    until(lambda: kept_pace(board) > 0.8)
    return True


def kept_pace(board):
    found = pace(board)
    assert found < 1.3
    return found


def test_real_time_is_kept():
    board = FakeBoard()
    with serving(board):
        assert keeps_real_time(board)


def test_full_speed_only_while_there_is_something_to_do():
    board = FakeBoard()
    with serving(board, speed=None, tcp="127.0.0.1:0") as server:
        assert keeps_real_time(board)  # without a client
        with Client.open(tcp_url(server), PATIENCE_S) as client:
            board.step_every_ns = 10 * MS
            client.request(Hi())
            until(lambda: pace(board) > 3)
            board.step_every_ns = 0
            until(lambda: pace(board) < 1.3)
            assert keeps_real_time(board)


def test_pace_does_not_make_up_for_a_long_pause(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(serve.time, "monotonic", lambda: now[0])
    pace = Pace(2.0, 0)
    now[0] += 0.001
    assert pace.target(0, MS, False) == 2 * MS
    now[0] += 5.0
    first = pace.target(2 * MS, MS, False)
    assert first == 3 * MS
    assert pace.target(first, MS, False) == first  # and then the pace starts from there
    assert pace.lost_ns == pytest.approx(10_000 * MS - MS, abs=1000)


@pytest.mark.parametrize(
    ("speed", "lost_ns", "said"),
    [
        (0.5, 0, ""),
        (None, 3 * 10**9, ""),
        (0.5, 3_210_000_000,
         "this computer did not keep up with --speed 0.5: the board's time lost 3.2 s, "
         "so clients measured wrong times\n"),
    ],
)  # fmt: skip
def test_time_that_was_lost_is_reported(speed, lost_ns, said, capsys):
    with contextlib.closing(Server(FakeBoard(), speed)) as server:
        server.pace.lost_ns = lost_ns
        server.report_lost_time()
        assert capsys.readouterr().err == said


@pytest.mark.parametrize(
    "text", ["7000", "localhost", ":7000", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:70000"]
)
def test_addresses_that_are_none(text):
    with pytest.raises(ToolError, match="expected HOST:PORT"):
        parse_address(text)


def test_an_address_in_use_is_said():
    with (
        contextlib.closing(TcpLink("127.0.0.1:0")) as taken,
        pytest.raises(ToolError, match="cannot listen on"),
    ):
        TcpLink(taken.address)


def test_speeds():
    assert parse_speed("max") is None
    assert parse_speed("0.5") == 0.5
    for text in ("", "fast", "0", "-1", "inf", "nan"):
        with pytest.raises(ToolError, match="expected max or a positive number"):
            parse_speed(text)


def test_pseudo_terminal_knows_whether_it_is_open():
    with contextlib.closing(PtyLink()) as link:
        assert not link.is_open(False)
        fd = os.open(link.path, os.O_RDWR | os.O_NOCTTY)
        assert link.is_open(False)
        os.write(fd, b"last words")
        os.close(fd)
        assert not link.is_open(False)
        assert link.read() == b"last words"
        assert link.read() == b""


# ---- the port in lockstep


def test_time_passes_in_reads_only():
    board = FakeBoard()
    client = Client(LockstepPort(board))
    assert board.now_ns == 0
    assert client.request(Hi()) == INFO
    assert 2 * MS <= board.now_ns <= 5 * MS
    before = board.now_ns
    with pytest.raises(NoAnswer):
        board.protocol.hold = True
        client.request(Hi(), timeout_s=0.25)
    assert board.now_ns - before == 250 * MS
    for _ in range(50):  # rounding of seconds to nanoseconds must not prevent a wait from ending
        client.pump(0.1)
    assert board.now_ns - before == pytest.approx(5250 * MS, abs=MS)
    client.close()
    assert board.protocol.log == [True, False]
