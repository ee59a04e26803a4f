"""Ports that are busy, wrong, pulled out or noisy; a second program; Ctrl-C: each gives a sentence
and a status, and no traceback."""

import os
import random
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest
import serial

from framestep_tools import cli
from framestep_tools.client import open_port, shared_port
from framestep_tools.client.client import GREETING_ID, BrokenOff, Client, NoAnswer
from framestep_tools.client.open_port import NoPort, PortBusy
from framestep_tools.client.wire import encode
from framestep_tools.errors import (
    BROKEN_OFF,
    INTERRUPTED,
    NO_CONTROLLER,
    NO_PORT,
    PORT_BUSY,
    REFUSED,
    ToolError,
)
from framestep_tools.payloads import Hi, MotorMove, MotorStatus, MotorStopAll
from framestep_tools.simulator.boards import SimulatedBoard
from framestep_tools.simulator.serve import PtyLink
from host_tests.tools.simulator.test_serve import serving, tcp_url, until

PATIENCE_S = 100


@pytest.fixture(scope="module")
def ports():
    """Return a controller's port as a path, and as the address of a socket."""
    with serving(SimulatedBoard(), tcp="127.0.0.1:0") as server:
        yield server.announcements[0], tcp_url(server)


@pytest.fixture
def device(ports):
    return ports[0]


@pytest.fixture
def address(ports):
    return ports[1]


@pytest.fixture
def terminal():
    """Return a pseudo-terminal whose other end the test plays."""
    link = PtyLink()
    found = SimpleNamespace(
        link=link, path=link.path, got=b"", answer=lambda data: b"", ended=False
    )

    def play():
        while not found.ended:
            if data := link.read():
                found.got += data
                link.write(found.answer(data))
            time.sleep(0.002)

    thread = threading.Thread(target=play)
    thread.start()
    yield found
    found.ended = True
    thread.join()
    link.close()


def begun(*words, stdout=subprocess.PIPE, python=("-m", "framestep_tools")):
    """Start a command in its own process, with pipes for its output."""
    return subprocess.Popen(
        [sys.executable, *python, *words],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )


def positions(device, capsys):
    """Return what a second program prints while a first one has the port."""
    assert cli.app.status(["status", device]) == 0
    return capsys.readouterr()


def moving(*words):
    """Start a command that moves motors, and wait until it has the port."""
    command = begun(*words)
    until(lambda: (found := shared_port.find(words[1])) and str(command.pid) in found.who)
    return command


def until_moving(device, capsys, count=1):
    """Wait until so many motors move."""
    until(lambda: positions(device, capsys).out.count(", moving") == count)


@pytest.mark.parametrize("way", ["path", "socket"])
def test_a_second_program_goes_through_the_first(way, ports, capsys):
    device = ports[way == "socket"]
    first = moving("move", device, "1", "200000")
    until_moving(device, capsys)
    said = positions(device, capsys)
    assert f"through framestep move (process {first.pid}), which has {device}" in said.err
    assert cli.app.status(["stop", device.replace("127.0.0.1", "localhost")]) == 0
    assert re.fullmatch(r"stopped: motor 1 is at \d+\n", capsys.readouterr().out)
    out, err = first.communicate(timeout=PATIENCE_S)
    assert first.returncode == REFUSED
    assert not out
    assert "short of 200000: another program stopped it" in err
    assert len(err.splitlines()) == 1
    assert positions(device, capsys).err == "", "the port is free again"


@pytest.mark.parametrize("between", [(), ("status", "--watch", "--json")], ids=["", "a watcher"])
def test_a_stop_ends_what_is_repeated(device, between, capsys):
    """buzz and jog repeat their request, and would start again. A program between them that has the
    port changes nothing."""
    watcher = begun(*between, device, stdout=subprocess.DEVNULL) if between else None
    until(lambda: not watcher or shared_port.find(device))
    buzz = ("buzz", device, "2", "--steps", "10000", "--times", "1000")
    first = begun(*buzz) if watcher else moving(*buzz)
    try:
        until_moving(device, capsys)
        assert cli.app.status(["stop", device]) == 0, capsys.readouterr().err
        out, err = first.communicate(timeout=PATIENCE_S)
        assert first.returncode == REFUSED, err
        assert not out
        said = err.splitlines()[-1].removeprefix("framestep: ")
        assert re.fullmatch(r"motor 2 stopped at -?\d+: another program stopped it", said)
        assert ", moving" not in positions(device, capsys).out
    finally:
        for process in filter(None, (first, watcher)):
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=PATIENCE_S)


def test_a_stop_waits_for_the_other_program_to_let_go_of_the_port(device, monkeypatch, capsys):
    opened, waited, busy = Client.open, Client.wait_idle, []

    def ended(client, *_, **__):
        monkeypatch.setattr(Client, "wait_idle", waited)
        monkeypatch.setattr(Client, "open", open_busy)
        raise BrokenOff("the program between has ended")

    def open_busy(url):
        busy.append(url)
        if len(busy) < 3:
            raise PortBusy(url, [])
        return opened(url)

    monkeypatch.setattr(Client, "wait_idle", ended)
    assert cli.app.status(["stop", device]) == 0, capsys.readouterr().err
    assert busy == [device] * 3
    assert capsys.readouterr().out == "nothing was moving\n"


def test_a_stop_that_does_not_get_through_says_so(address, capsys):
    """The program that has the socket lets no other through."""
    with Client.open(address) as other:
        other.request(MotorMove(3, 200000))
        assert cli.app.status(["stop", address]) == BROKEN_OFF
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.startswith("framestep: NOT STOPPED: ")
        assert "another program has it" in said.err
        assert "comes to rest by itself" not in said.err
        assert "E-stop" in said.err
        assert other.request(MotorStatus()).moving == [3]
        other.request(MotorStopAll())
        other.wait_idle()


def test_a_stop_of_one_motor_does_not_wait_for_the_others(address, capsys):
    first = moving("move", address, "4", "2000000")
    second = None
    try:
        until_moving(address, capsys)
        second = begun("move", address, "5", "2000000")
        until_moving(address, capsys, 2)
        assert cli.app.status(["stop", address, "4"]) == 0
        assert re.fullmatch(r"stopped: motor 4 is at \d+\n", capsys.readouterr().out)
        assert "motor 5" in positions(address, capsys).out
        assert positions(address, capsys).out.count(", moving") == 1
    finally:
        assert cli.app.status(["stop", address]) == 0
        for process in filter(None, (first, second)):
            process.communicate(timeout=PATIENCE_S)


def test_a_move_does_not_wait_for_another_programs(address, capsys):
    first = moving("move", address, "4", "2000000")
    try:
        until_moving(address, capsys)
        assert cli.app.status(["move", address, "5", "30"]) == 0
        assert cli.app.status(["buzz", address, "6", "--steps", "30", "--times", "1"]) == 0
        assert positions(address, capsys).out.count(", moving") == 1
    finally:
        assert cli.app.status(["stop", address]) == 0
        first.communicate(timeout=PATIENCE_S)


def test_a_run_goes_on_while_another_motor_is_stopped(address, tmp_path):
    file = tmp_path / "move.csv"
    file.write_text("frame,1\n" + "".join(f"{i},{i}\n" for i in range(1, 50)))
    first = begun("play", str(file), "--device", address, "--fps", "24")
    until(lambda: shared_port.find(address))
    assert cli.app.status(["stop", address, "5"]) == 0
    assert cli.app.status(["stop", address, "20"]) == REFUSED
    out, err = first.communicate(timeout=PATIENCE_S)
    assert (first.returncode, out) == (0, "frames 1 to 49 played\n"), err


def test_a_guest_is_heard_at_once():
    """A stop does not wait until the program that has the port looks for guests."""
    there, here = socket.socketpair()
    shared = shared_port.SharedPort(SimpleNamespace(), "a port of its own", "test")
    with there, here, ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(shared.wait, here, PATIENCE_S)
        guest = shared_port.enter(shared_port.find("a port of its own"), PATIENCE_S)
        assert waiting.result(PATIENCE_S / 2) == 0
        guest.close()
    shared.close()
    without_file = SimpleNamespace()
    assert shared.wait(without_file, PATIENCE_S) == shared_port.LOOK_S


def test_a_stop_without_a_device_says_so(capsys):
    assert cli.app.status(["stop", "/dev/there-is-none"]) == NO_PORT
    assert "framestep: NOT STOPPED: " in capsys.readouterr().err


def test_ctrl_c_stops_the_motors(device, capsys):
    first = moving("move", device, "1", "-200000")
    until_moving(device, capsys)
    first.send_signal(signal.SIGINT)
    out, err = first.communicate(timeout=PATIENCE_S)
    assert first.returncode == INTERRUPTED
    assert not out
    assert re.fullmatch(
        r"stopping; Ctrl-C once more stops harder\nstopped: motor 1 is at -?\d+\n", err
    )
    assert ", moving" not in positions(device, capsys).out


@pytest.mark.parametrize("after", [0.15, 0.3])
def test_ctrl_c_while_it_is_loaded(after):
    code = "import framestep_tools.__main__ as m; print('x', flush=True); m.main()"
    process = begun("--help", python=("-c", code))
    assert process.stdout.readline() == "x\n"
    time.sleep(after / 3)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=PATIENCE_S)
    assert "Traceback" not in err


def test_a_port_that_another_program_has(device, capsys):
    other = subprocess.Popen(
        ["sh", "-c", f"exec 3<>{device}; echo; exec sleep 100"], stdout=subprocess.PIPE
    )
    try:
        other.stdout.readline()
        until(lambda: cli.app.status(["status", device]) == PORT_BUSY)
        said = capsys.readouterr().err.splitlines()[-1]
        assert f"sleep (process {other.pid}) has {device} open: end it there first" in said
    finally:
        other.kill()
        other.wait()
        other.stdout.close()


def test_a_port_is_opened_for_one_alone(device):
    with Client.open(device) as client:
        client.greet()
        with pytest.raises(PortBusy):
            Client.open(device)
        assert client.request(MotorStatus()).idle
    with Client.open(device) as client:
        client.greet()


def test_a_port_at_another_rate(device):
    port = open_port.open_port(f"{device}@460800", 0.1)
    assert (port.port, port.baudrate) == (device, 460800)
    open_port.close_port(port)
    with pytest.raises(NoPort, match=r"cannot open /dev/nobody: .*No such file"):
        open_port.open_port("/dev/nobody@460800", 0.1)


def test_a_pulled_cable(terminal):
    client = Client.open(terminal.path)
    terminal.ended = True
    time.sleep(0.01)
    os.close(terminal.link._master)
    with pytest.raises(
        BrokenOff,
        match=f"{terminal.path} broke off: the cable was pulled, .*comes to rest by itself",
    ):
        client.request(Hi())
    client.close()
    terminal.link.close = lambda: None
    assert BrokenOff.status == BROKEN_OFF


def test_a_repl_is_left_as_it_was(terminal, capsys):
    terminal.answer = lambda data: data.replace(b"\x01", b"\x1b[8D").replace(b"\0", b"")
    assert cli.app.status(["status", terminal.path]) == NO_CONTROLLER
    assert "is a REPL, not the protocol's port" in capsys.readouterr().err
    until(lambda: terminal.got.endswith(b"\x03"))
    greeting = encode(Hi.TYPE, b"", GREETING_ID)
    assert terminal.got == greeting + b"\x03"
    # Ctrl-A on a line that is not empty moves the cursor; a REPL skips zeros
    assert greeting[:6].isalpha() or greeting[:6] == b"DF    "
    assert not set(greeting) & set(range(2, 32))
    assert greeting.index(1) > 0


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (lambda data: b"T=21.5\r\n" * 3, "sends 24 bytes that are not this protocol"),
        (lambda data: b"DF" * 300, "sends 600 bytes that are not this protocol"),
        (lambda data: data, "sends back what it gets: it is not the protocol's port"),
    ],
    ids=["another program", "the begin of a frame for ever", "an echo"],
)
def test_a_port_of_something_else(answer, said, terminal, capsys):
    terminal.answer = answer
    assert cli.app.status(["status", terminal.path]) == NO_CONTROLLER
    assert said in capsys.readouterr().err
    assert not terminal.got.endswith(b"\x03"), "nothing is broken into"


def test_silence(terminal):
    with Client.open(terminal.path, timeout_s=0.05) as client, pytest.raises(NoAnswer):
        client.greet()


class Noise:
    """A port that answers each request with the same data."""

    timeout = None

    def __init__(self, replies):
        self.replies, self.waiting = replies, b""

    def write(self, data):
        self.waiting += self.replies.pop(0) if self.replies else b""

    def read(self, size):
        data, self.waiting = self.waiting[:size], self.waiting[size:]
        return data

    def close(self):
        pass


def test_whatever_comes_ends_in_a_sentence():
    rng = random.Random(5)
    for seed in range(200):
        kind = rng.choice([Hi.TYPE, 0x8001, MotorStatus.TYPE, 0x7777])
        frame = encode(kind, rng.randbytes(rng.randrange(60)), rng.choice([0, GREETING_ID]))
        client = Client(Noise([rng.randbytes(seed % 7) + frame]), timeout_s=0.0)
        try:
            client.greet()
        except ToolError as error:
            assert "\n" not in str(error)
            assert error.status in (NO_CONTROLLER, REFUSED)


@pytest.mark.parametrize(
    ("why", "kind", "status", "words"),
    [
        ("PermissionError(13, 'Access is denied.', None, 5)", PortBusy, PORT_BUSY, "has COM5 open"),
        ("FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)",
         NoPort, NO_PORT, "No such file or directory; framestep ports lists"),
    ],
)  # fmt: skip
def test_what_windows_says(why, kind, status, words):
    said = serial.SerialException(f"could not open port 'COM5': {why}")
    found = open_port._why("COM5", said)
    assert type(found) is kind
    assert words in str(found)
    assert found.status == status


def test_who_has_a_port_on_a_mac(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    said = f"p4711\ncscreen\nf5\np{os.getpid()}\ncpython\n"
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: SimpleNamespace(stdout=said))
    assert open_port.holders("/dev/cu.usbmodem2023") == ["screen (process 4711)"]
