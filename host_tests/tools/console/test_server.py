"""The server of the console, without a browser: who gets through, one page at a time, and what
stops when a page leaves."""

import asyncio
import contextlib
import errno
import functools
import http.client
import json
import re
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from urllib.parse import urlsplit

import pytest
import segno
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from framestep.protocol import messages
from framestep_tools import cli
from framestep_tools import payloads as p
from framestep_tools.board.rig_file import RigFileError
from framestep_tools.client.client import BrokenOff, Client, RequestRefused
from framestep_tools.client.open_port import open_port
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.commands.common import talking
from framestep_tools.commands.console import show_code
from framestep_tools.console import page_files
from framestep_tools.console.board_requests import BoardWork
from framestep_tools.console.device import ConsoleDevice
from framestep_tools.console.port_bridge import Bridge, Jogs
from framestep_tools.console.server import ConsoleServer, lan_address
from framestep_tools.errors import ToolError
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.served import PATIENCE_S, Console
from host_tests.tools.simulator.test_serve import serving, tcp_url, until

FAR = 2_000_000_000


class SocketPort:
    """A WebSocket of the console with the interface of a port, for Client."""

    def __init__(self, link, hello=None):
        self.link = link
        self.timeout = 1.0
        self.hello = hello or json.loads(link.recv(PATIENCE_S))
        self._bytes = bytearray()

    def read(self, size=1):
        if not self._bytes:
            with contextlib.suppress(TimeoutError):
                received = self.link.recv(self.timeout)
                if isinstance(received, bytes):
                    self._bytes += received
                elif "pages" not in json.loads(received):  # the list of pages that watch
                    raise OSError(received)
        data = bytes(self._bytes[:size])
        del self._bytes[:size]
        return data

    def write(self, data):
        self.link.send(bytes(data))

    def close(self):
        self.link.close()


class Stage:
    """A simulated board, and the console's server for it."""

    def __init__(self, serial=False):
        self._open = contextlib.ExitStack()
        simulated = SimulatedBoard({"jog_timeout_ms": 0}, 2)
        board = self._open.enter_context(serving(simulated, speed=1.0, tcp="127.0.0.1:0"))
        self.device = board.announcements[0] if serial else tcp_url(board)
        console = self._open.enter_context(contextlib.closing(Console(self.device)))
        self.call, self.server = console.call, console.server
        self.server.offer_s = PATIENCE_S  # a slow test is no page that has left
        self.parts = urlsplit(self.server.url)
        self.close = self._open.close

    @property
    def token(self):
        return self.parts.query.removeprefix("token=")

    def link(self, token=None, origin=None, host=None, headers=None):
        token = self.token if token is None else token
        return connect(
            f"ws://{host or self.parts.netloc}/link?token={token}",
            sock=socket.create_connection((self.parts.hostname, self.parts.port)),
            origin=origin or f"http://{self.parts.netloc}",
            additional_headers=headers,
            open_timeout=PATIENCE_S,
            legacy=True,
        )

    def client(self):
        """Yield the page's end, after the board has noticed that its port was closed before."""
        end = time.monotonic() + PATIENCE_S
        while True:
            client = Client(SocketPort(self.link()), PATIENCE_S)
            try:
                client.greet()
                return client
            except BrokenOff:
                client.close()
                if time.monotonic() > end:
                    raise

    def get(self, path, host=None):
        connection = http.client.HTTPConnection(self.parts.netloc, timeout=PATIENCE_S)
        connection.request("GET", path, headers={"Host": host or self.parts.netloc})
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()

    def let_jog(self, link):
        """Say that the page holds nothing, after which a jog may begin again."""
        link.send('{"released": true}')
        until(lambda: not self.server.device.bridge.stopped)


def idle_server():
    """Return a server, not yet started, of a device that nobody opens."""
    return ConsoleServer(ConsoleDevice(lambda: None, "x", BoardWork(None, "x")))


@pytest.fixture(scope="module")
def shared():
    with contextlib.closing(Stage()) as stage:
        yield stage


def test_the_page_and_nothing_else(shared):
    status, headers, body = shared.get("/")
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert b"framestep" in body
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert shared.get("/motors.js")[0] == 200
    for path in ("/server.py", "/../server.py", "/..%2fserver.py", "//etc/passwd", "/views"):
        assert shared.get(path)[0] == 404, path


def test_a_foreign_name_that_leads_here_is_refused(shared):
    assert shared.get("/", host="evil.example")[0] == 403
    assert shared.get("/", host=f"evil.example:{shared.parts.port}")[0] == 403
    assert shared.get("/", host=f"localhost:{shared.parts.port}")[0] == 200


@pytest.mark.parametrize(
    "wrong",
    [
        {"token": ""},
        {"token": "guessed"},
        {"token": "ü"},
        {"origin": "http://evil.example"},
        {"origin": "https://127.0.0.1"},
        {"origin": "null"},
        {"host": "evil.example"},
        {"headers": {"Host": "evil.example"}},
        {"headers": {"Origin": "http://evil.example"}},
    ],
    ids=str,
)
def test_only_the_page_itself_connects(shared, wrong):
    with pytest.raises(InvalidStatus) as error, shared.link(**wrong):
        pass
    assert error.value.response.status_code == 403


def test_each_server_has_a_token_of_its_own(shared):
    other = idle_server()
    assert other._token != shared.server._token
    assert len(other._token) >= 32


def test_bytes_go_through_and_the_second_page_is_turned_away(shared):
    with shared.client() as client:
        assert client.port.hello == {"device": shared.device, "repl": False, "kept": False}
        assert client.request(p.Hi()).motors == 2
        with shared.link() as second:
            said = text(second)
            assert "another page" in said["ended"]
            with pytest.raises(ConnectionClosed):
                second.recv(PATIENCE_S)
        client.request(p.MotorMove(1, 300))
        client.wait_idle(PATIENCE_S)
        assert client.request(p.MotorGetPosition()).steps[0] == 300


def test_a_page_takes_the_device_from_another(shared):
    with shared.client() as client:
        before = client.request(p.MotorGetPosition()).steps[0]
        client.request(p.MotorJog(1, 10_000, FAR))
        wait_far(client, 1, abs(before) + 100)
        with shared.link(token=shared.token + "&take=1") as second:
            hello = text(second)
            assert hello["device"] == shared.device
            assert "another page has taken the device over" in str(text(client.port.link))
            port = SocketPort(second, hello)
            taker = Client(port, PATIENCE_S)
            taker.wait_idle(PATIENCE_S)
            assert taker.request(p.MotorGetPosition()).steps[0] > before


def watching(stage, agent="a browser"):
    """Return the link of a page that watches, and what the server says first."""
    link = stage.link(f"{stage.token}&watch=1", headers={"User-Agent": agent})
    return link, text(link)


def text(link):
    """Return the next of the server's texts for a page."""
    while not isinstance(message := link.recv(PATIENCE_S), str):
        pass
    return json.loads(message)


def told(link, key):
    """Return the next of the server's texts with this key."""
    while key not in (said := text(link)):
        pass
    return said[key]


def test_a_page_that_watches_asks_and_moves_nothing(shared):
    with shared.client() as client:
        client.request(p.MotorJog(1, 10_000, FAR))
        link, hello = watching(shared, "Mobile")
        assert (hello["watch"], hello["holder"]) == (True, "another page")
        assert told(client.port.link, "pages")[0]["who"] == "a phone"
        for text in ("x", "[]", '{"id": 3, "do": "read_rig"}'):
            link.send(text)
        assert told(link, "error") == "another page has the device: take it over first"
        with Client(SocketPort(link, hello), PATIENCE_S) as watcher:
            assert watcher.request(p.Hi()).motors == 2
            before = watcher.request(p.MotorGetPosition()).steps[0]
            assert watcher.request(p.MotorStatus()).moving == [1]
            for request in (p.MotorMove(2, 100), p.MotorStop(1), p.MotorStopAll()):
                with pytest.raises(RequestRefused, match="ERR_GENERAL"):
                    watcher.request(request)
            watcher.wait_event(p.Positions, where=lambda each: each.steps[0] > before + 100)
            assert client.request(p.MotorStatus()).moving == [1]
        assert told(client.port.link, "pages") == []


def test_a_question_of_a_page_that_watches_waits_for_the_port():
    """It may come while one page closes the port and another one opens it."""
    # a stage of its own: once a page has left, the device is offered to the one that watches
    with contextlib.closing(Stage()) as stage:
        link, _ = watching(stage)
        link.send(encode(p.MotorStatus.TYPE, b"", 7))
        link.send('{"id": 3, "do": "read_rig"}')
        assert told(link, "error")  # so the question has been read
        with stage.client():
            decoder = FrameDecoder()
            answered = False
            while not answered:
                message = link.recv(PATIENCE_S)
                if isinstance(message, bytes):
                    answered = any(frame.id == 7 for frame in decoder.feed(message))
        link.close()


def test_a_page_hands_the_device_over_and_watchers_are_told(shared):
    with shared.client() as client:
        number = None
        link, _ = watching(shared)
        other, _ = watching(shared)
        while number is None:
            pages = told(client.port.link, "pages")
            number = pages[0]["number"] if len(pages) == 2 else None
        client.port.link.send(json.dumps({"hand_over": number}))
        assert told(link, "take")
        with shared.link(f"{shared.token}&take=1", headers={"User-Agent": "Mobile"}) as taker:
            assert "has taken the device over" in told(client.port.link, "ended")
            assert told(taker, "device")
            while told(other, "holder") != "a phone":
                pass
        link.close()
        other.close()


def test_who_watches_gets_a_device_that_nobody_has(shared, monkeypatch):
    with monkeypatch.context() as offers:
        offers.setattr(shared.server, "offer_s", 0.2)
        with shared.client():
            link, _ = watching(shared)
        assert told(link, "ended") == "no page has the device any more"
    other, _ = watching(shared)
    with shared.client():  # as the page does then
        while told(other, "holder") is None:
            pass
    link.close()
    other.close()


def test_an_earlier_wait_offers_nothing(shared, monkeypatch):
    """A page that is loaded again and again is given the whole time each time."""
    link, _ = watching(shared)

    async def wait_twice():
        for seconds in (0.05, PATIENCE_S):
            monkeypatch.setattr(shared.server, "offer_s", seconds)
            shared.server._offer_later()
        await asyncio.sleep(0.2)

    shared.call(wait_twice())
    with pytest.raises(TimeoutError):
        while True:
            assert "ended" not in str(link.recv(0.5))
    link.close()


def test_in_the_local_network_the_same_rules_hold(shared):
    """Another address of this computer plays another computer."""
    device = ConsoleDevice(lambda: open_port(shared.device, 1.0), "x", BoardWork(None, "x"))
    served = ConsoleServer(device)
    shared.call(served.start(0, "127.0.0.2"))
    try:
        here, there = urlsplit(served.url), urlsplit(served.lan_url)
        assert (here.hostname, there.hostname) == ("127.0.0.1", "127.0.0.2")
        assert here.query == there.query
        for place in (here, there):
            page = http.client.HTTPConnection(place.hostname, place.port, timeout=PATIENCE_S)
            page.request("GET", "/")
            assert page.getresponse().status == 200
        page = http.client.HTTPConnection("127.0.0.3", there.port, timeout=PATIENCE_S)
        page.request("GET", "/")
        assert page.getresponse().status == 403
        for token, origin, status in (
            ("guessed", f"http://{there.netloc}", 403),
            (there.query.removeprefix("token="), "http://evil.example", 403),
        ):
            with pytest.raises(InvalidStatus) as error:
                connect(f"ws://{there.netloc}/link?token={token}", origin=origin, legacy=True)
            assert error.value.response.status_code == status
        with connect(
            f"ws://{there.netloc}/link?{there.query}", origin=f"http://{there.netloc}", legacy=True
        ) as link:
            assert text(link)["device"] == "x"
    finally:
        shared.call(served.stop())


def test_the_address_for_a_phone_is_printed_with_a_code(capsys):
    url = "http://192.168.1.20:7878/?token=" + "x" * 32
    show_code(url)
    *code, address, warning = capsys.readouterr().out.splitlines()
    assert address == url
    assert "not encrypted" in warning
    size = segno.make(url, micro=False).symbol_size()[0]
    assert {len(line) for line in code} == {size}
    assert len(code) == (size + 1) // 2


def test_a_computer_without_a_network_says_so(monkeypatch):
    def unreachable(probe, address):
        raise OSError("Network is unreachable")

    probe = type("Probe", (socket.socket,), {"connect": unreachable})
    monkeypatch.setattr(socket, "socket", probe)
    with pytest.raises(ToolError, match="this computer is in no network"):
        lan_address()


def test_without_lan_nothing_else_reaches_the_server(shared):
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", shared.parts.port), PATIENCE_S)


@pytest.mark.parametrize("sent", ["x", "[]", '"x"', '{"do": "stop", "id": 1}', '{"do": "load"}'])
def test_texts_that_mean_nothing(shared, sent):
    with shared.link() as page:
        text(page)
        page.send(sent)
        assert "does not know" in text(page)["error"]


def test_what_needs_the_repl_says_that_there_is_none(shared):
    with shared.link() as page:
        text(page)
        page.send('{"do": "read_rig", "id": 7}')
        said = text(page)
        assert said["id"] == 7
        assert "no second port" in said["error"]


def wait_far(client, motor, steps):
    while abs(client.request(p.MotorGetPosition()).steps[motor - 1]) < steps:
        client.pump(0.02)


def test_a_page_that_goes_ends_its_jog_and_its_move(shared):
    with shared.client() as client:
        client.request(p.MotorJog(1, 10_000, FAR))
        client.request(p.MotorMove(2, 1_000_000))
        wait_far(client, 2, 500)
    with shared.client() as client:  # it comes after the port is closed
        client.wait_idle(PATIENCE_S)
        assert 500 <= client.request(p.MotorGetPosition()).steps[1] < 1_000_000


def test_a_move_goes_on_where_the_page_has_said_so_and_a_jog_does_not(shared):
    with shared.client() as client:
        target = client.request(p.MotorGetPosition()).steps[1] + 9000
        client.port.link.send('{"keep": true}')
        client.request(p.MotorJog(1, 10_000, FAR))
        client.request(p.MotorMove(2, target))
        client.pump(0.05)
    with shared.client() as client:
        assert client.port.hello["kept"]
        while 1 in client.request(p.MotorStatus()).moving:
            client.pump(0.02)
        client.wait_idle(PATIENCE_S)
        assert client.request(p.MotorGetPosition()).steps[1] == target


def test_the_port_is_let_go_when_what_went_on_has_come_to_rest(shared):
    with shared.client() as client:
        before = client.request(p.MotorGetPosition()).steps[1]
        client.port.link.send('{"keep": true}')
        client.request(p.MotorMove(2, before - 700))
    until(lambda: not shared.server.device.bridge)
    with shared.client() as client:
        assert not client.port.hello["kept"]
        assert client.request(p.MotorGetPosition()).steps[1] == before - 700


@pytest.fixture
def gone(shared, monkeypatch):
    """Return the stage with a device that is no longer there."""
    nowhere = "socket://127.0.0.1:1"
    monkeypatch.setattr(shared.server.device, "_open_port", lambda: open_port(nowhere, 1.0))
    return shared


def test_a_device_that_is_not_there_is_reported(gone):
    with gone.link() as page:
        assert "cannot open socket://127.0.0.1:1" in text(page)["ended"]


def test_a_port_that_is_taken(shared):
    with pytest.raises(ToolError, match="cannot serve the console on port"):
        shared.call(idle_server().start(shared.parts.port))


# ---- another program besides the page


@pytest.fixture(params=[True, False], ids=["terminal", "socket"])
def stage(request):
    with contextlib.closing(Stage(serial=request.param)) as stage:
        yield stage


def test_framestep_stop_stops_what_a_page_jogs(stage, capsys):
    def jog(motor, number):
        page.send(encode(p.MotorJog.TYPE, p.MotorJog(motor, 10_000, FAR).pack(), number))

    with stage.link() as page:
        assert "device" in text(page)
        jog(1, 1)
        assert cli.app.status(["stop", "--device", stage.device]) == 0
        assert re.fullmatch(
            r"stopped: motor 1 is at -?\d+\n|nothing was moving\n", capsys.readouterr().out
        )
        assert text(page) == {"stopped": "Another program has stopped the motors."}
        jog(2, 2)  # like a page that does not know of it yet
        answers = []
        decoder = FrameDecoder()
        while not answers:
            data = page.recv(PATIENCE_S)
            answers = [frame for frame in decoder.feed(data) if frame.id == 2]
        assert int.from_bytes(answers[0].payload, "little") == p.Ack.ERR_GENERAL
        stage.let_jog(page)
        jog(2, 3)
        with talking(stage.device) as other:  # while it moves, another program gets its own answers
            while 2 not in other.request(p.MotorStatus()).moving:
                other.pump(0.01)
            assert 1 not in other.request(p.MotorStatus()).moving
    with stage.client() as client:  # the next page has the port, and the jog has ended
        client.wait_idle(PATIENCE_S)


def stopped_by(stage):
    """Return what the server says to a page that stops without the device."""
    with stage.link(f"{stage.token}&stop=1") as other:
        return text(other)


def test_another_page_stops_without_taking_the_device(stage):
    with stage.client() as client:
        page = client.port.link
        client.request(p.MotorJog(1, 10_000, FAR))
        client.request(p.MotorMove(2, 1_000_000))
        page.send('{"keep": true}')
        assert stopped_by(stage) == {"stop": "Stopped: all motors ramp down.", "bad": False}
        assert text(page) == {"stopped": "Another page has stopped the motors."}
        client.wait_idle(PATIENCE_S)  # this page still has the device
        with pytest.raises(RequestRefused, match="ERR_GENERAL"):
            client.request(p.MotorJog(1, 10_000, FAR))  # as if it did not know yet
        stage.let_jog(page)
        client.request(p.MotorJog(1, 10_000, FAR))
        assert client.request(p.MotorStatus()).moving == [1]


def test_a_page_stops_what_goes_on_without_a_page(stage):
    with stage.client() as client:
        client.port.link.send('{"keep": true}')
        client.request(p.MotorMove(2, client.request(p.MotorGetPosition()).steps[1] + 1_000_000))
    assert stopped_by(stage) == {"stop": "Stopped: all motors ramp down.", "bad": False}
    until(lambda: not stage.server.device.bridge)  # then nothing moves


def test_a_page_stops_what_another_program_moves():
    with contextlib.closing(Stage(serial=True)) as stage, talking(stage.device) as other:
        other.request(p.MotorMove(1, 1_000_000))
        with ThreadPoolExecutor(1) as pool:
            said = pool.submit(stopped_by, stage)
            other.wait_idle(PATIENCE_S)
            assert not said.result(PATIENCE_S)["bad"]
        assert other.stopped


def test_a_stop_that_nothing_acknowledges_says_so(gone):
    found = stopped_by(gone)
    assert found["bad"]
    assert re.fullmatch(
        r"NOT STOPPED: cannot open socket://127\.0\.0\.1:1: .*\. Press the E-stop, or .*",
        found["stop"],
    )
    with pytest.raises(InvalidStatus), gone.link("guessed&stop=1"):
        pass


@pytest.mark.parametrize("by", ["the page that has the device", "another page"])
def test_another_program_knows_of_a_stop(by):
    """It would repeat its jog."""
    with (
        contextlib.closing(Stage(serial=True)) as stage,
        stage.client() as client,
        talking(stage.device) as other,
    ):
        other.request(p.MotorJog(1, 10_000, FAR))
        if by == "another page":
            stopped_by(stage)
        else:
            client.request(p.MotorStopAll())
        until(lambda: other.pump(0.02) or other.stopped)


@pytest.mark.parametrize("request_", [p.MotorJog(1, 10_000, FAR), p.VirtJogOnLine(1, 100)], ids=str)
def test_a_page_that_hangs_lets_go(shared, monkeypatch, request_):
    """Its script sends nothing any more, but its link exists. Until it says that it holds nothing,
    no jog begins."""
    monkeypatch.setattr(shared.server.device, "silence_s", 0.3)
    with shared.client() as client:
        link = client.port.link
        link.send(encode(request_.TYPE, request_.pack(), 1))
        said = {"stopped": "The page was silent, so its jog has been stopped."}
        assert text(link) == said
        client.wait_idle(PATIENCE_S)
        with pytest.raises(RequestRefused, match="ERR_GENERAL"):
            client.request(p.MotorJog(1, 10_000, FAR))
        shared.let_jog(link)
        shared.server.device.silence_s = PATIENCE_S
        client.request(p.MotorJog(2, 10_000, FAR))
        assert client.request(p.MotorStatus()).moving == [2]
        client.request(p.MotorStop(2))
        client.wait_idle(PATIENCE_S)


# ---- a page that returns while the server waits for a move to end


def in_a_loop(test):
    """Run a test in its own thread: the browser's tests have a loop in this one."""

    @functools.wraps(test)
    def run():
        with ThreadPoolExecutor(1) as pool:
            pool.submit(asyncio.run, test()).result(PATIENCE_S)

    del run.__wrapped__  # or pytest would take it for the coroutine
    return run


class SilentPort:
    """A port of a device that only the test answers for."""

    timeout = 0.01
    in_waiting = 0

    def __init__(self):
        self.sent = asyncio.Event()
        self.loop = asyncio.get_running_loop()

    def read(self, size):
        time.sleep(self.timeout)
        return b""

    def write(self, data):
        self.loop.call_soon_threadsafe(self.sent.set)

    def close(self):
        pass


def answer(number):
    """Return a device's answer, while its motor 1 moves, to the bridge's request of this number."""
    return encode(p.Status.TYPE, p.Status(1, 0).pack(), 0xF000_0000 + number)


@in_a_loop
async def test_a_cancellation_together_with_the_answer_is_not_lost():
    port = SilentPort()
    bridge = Bridge(port, "x")
    asked = asyncio.create_task(bridge.moves())
    await asyncio.wait_for(port.sent.wait(), PATIENCE_S)
    await asyncio.sleep(0.05)  # the writer's thread is back, and the bridge waits
    bridge.on_bytes(answer(1))
    asked.cancel()
    await asyncio.wait([asked], timeout=PATIENCE_S)
    assert asked.cancelled()
    await bridge.close()


@in_a_loop
async def test_a_stop_and_the_question_what_moves_do_not_take_each_others_answers():
    """Both wait for the port at the same time."""

    class Board(SilentPort):
        """Its motor 1 moves, and it answers everything after a while."""

        def __init__(self):
            super().__init__()
            self.decoder, self.answers = FrameDecoder(), b""

        def write(self, data):
            time.sleep(0.05)
            for frame in self.decoder.feed(data):
                if frame.type == p.MotorStatus.TYPE:
                    self.answers += encode(p.Status.TYPE, p.Status(1, 0).pack(), frame.id)
                else:
                    ok = messages.OK.to_bytes(2, "little")
                    self.answers += encode(frame.type | messages.MSG_FLAG_ACK, ok, frame.id)

        def read(self, size):
            data, self.answers = self.answers, b""
            return data or super().read(size)

    bridge = Bridge(Board(), "x")
    moves, stopped = await asyncio.gather(bridge.moves(), bridge.stop_all("why"))
    assert moves
    assert stopped is None
    await bridge.close()


@in_a_loop
async def test_what_a_page_sends_after_the_port_was_closed_is_dropped():
    """It may not know yet that something else needs the port."""

    def closed(data):
        raise OSError(errno.EBADF, "Bad file descriptor")

    port = SilentPort()
    bridge = Bridge(port, "x")
    await bridge.close()
    port.write = closed
    await bridge.send(encode(p.MotorStatus.TYPE, b"", 1))


@in_a_loop
async def test_a_page_gets_the_port_however_often_the_watch_has_to_be_reported():
    async def deaf(times):
        while times:
            try:
                await asyncio.sleep(PATIENCE_S)
            except asyncio.CancelledError:
                times -= 1

    server = idle_server()
    server._watch = watch = asyncio.create_task(deaf(2))
    await asyncio.sleep(0)
    await asyncio.wait_for(server._back(), PATIENCE_S)
    assert watch.done()
    assert server._watch is None


# ---- its parts


def test_jogs_that_have_begun_and_not_ended():
    jogs = Jogs()
    for request in (
        p.MotorJog(1, 100, FAR), p.MotorJog(2, 100, FAR), p.MotorStop(1), p.VirtJog(5, 100, 0),
        p.VirtJogOnLine(messages.LINE_X, 100), p.VirtJogOnLine(messages.LINE_Z, 100),
        p.VirtStop(messages.VIRT_MOTOR_TRACK),
    ):  # fmt: skip
        jogs.note(encode(request.TYPE, request.pack(), 1))
    assert jogs.stops() == [p.MotorStop(2), p.VirtStop(5), p.VirtStop(messages.VIRT_MOTOR_EW)]
    assert jogs.stops() == []
    jogs.note(encode(p.RtJogAll.TYPE, p.RtJogAll(24_000, 5).pack(), 1))
    assert jogs.stops() == [p.MotorStopAll()]
    for request in (p.MotorJog(3, 1, 0), p.RtJogAll(24_000, 5), p.MotorStopAll()):
        jogs.note(encode(request.TYPE, request.pack(), 1))
    assert jogs.stops() == []


@pytest.mark.parametrize(
    "kind", [cls for cls in p.REQUESTS.values() if cls.JOGS], ids=lambda cls: cls.__name__
)
def test_the_stop_of_each_jog_ends_it(kind):
    """Whatever follows the fields that are known."""
    jogs = Jogs()
    request = kind(*range(1, 1 + len(fields(kind))))
    jogs.note(encode(kind.TYPE, request.pack() + b"\0\0", 1))
    assert jogs.stops() == [request.stop()]
    jogs.note(encode(kind.TYPE, request.pack(), 1))
    stop = request.stop()
    assert type(stop).STOPS
    jogs.note(encode(stop.TYPE, stop.pack() + b"\0", 2))
    assert not jogs
    jogs.note(encode(kind.TYPE, request.pack()[:-1], 3))  # too short: the device refuses it
    assert not jogs


def test_numbers_and_texts_of_the_page_are_those_of_the_firmware():
    script = page_files.protocol_js()
    lines = {}
    for part in script.split("export const ")[1:]:
        name, _, value = part.partition(" = ")
        lines[name] = json.loads(value.rstrip().rstrip(";"))
    numbers = {name: v for name, v in vars(messages).items() if name.startswith(("MSG_", "ERR_"))}
    assert lines["M"] | numbers == lines["M"]
    types = {each["type"] for each in lines["REQUESTS"].values()}
    assert set(messages.SIZES) <= types
    assert lines["SECTION_POSITIONS"] * 4 + 5 <= messages.LARGEST_PAYLOAD


def test_a_page_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ToolError, match="cannot write the page"):
        page_files.save(tmp_path / "file")


def test_a_rig_file_with_comments_and_a_mistake(monkeypatch):
    class Board:
        """A board whose REPL only answers for its name."""

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def board(self):
            from framestep_tools.building.board_files import board_data

            return board_data("pico")

    work = BoardWork("/dev/none", "x")
    monkeypatch.setattr(work, "_device", Board)
    assert (
        "valid for Raspberry Pi Pico: 'slider'" in work.check_rig('{"name": "slider"} // x')["text"]
    )
    with pytest.raises(RigFileError, match="motor_count"):
        work.check_rig('{"motor_count": 99}')
