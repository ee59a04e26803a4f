"""The protocol on a USB port of its own, on the simulated ESP32-S3: MicroPython's own USBDevice and
TinyUSB above a simulated controller, and a host that enumerates it."""

import struct
from contextlib import contextmanager

import numpy as np
import pytest

from framestep.rig import Rig, RigError
from framestep_tools import cli
from framestep_tools import payloads as p
from framestep_tools.board import file_install
from framestep_tools.board.file_install import Package, main_py
from framestep_tools.building.board_files import board_data
from framestep_tools.client import port_finder
from framestep_tools.client.client import Client
from framestep_tools.client.port_finder import PROTOCOL, PROTOCOL_PORT, REPL, Port
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.errors import PORT_BUSY
from framestep_tools.simulator.esp32_board import PROCESSOR, Esp32Board, modules
from framestep_tools.simulator.usb_host import Function, UsbError, serial_functions
from host_tests.end_to_end.session import Session, deceleration
from host_tests.esp32.conftest import Terminal

S3 = "esp32_s3_595"
QUEUE_S = 0.028


@pytest.fixture(scope="module")
def s3():
    """One board for the tests that leave it as it was: motor 1 at rest, the port open."""
    with Esp32Board({}, S3) as board:
        yield board


@pytest.fixture
def rig(s3):
    session = Session(s3, reply_s=0.02)
    session.speed(1, 20000, 100_000).accept(p.MotorResetPosition(1, 0)).forget()
    yield session
    session.port.close()


def later(board, seconds):
    board.run_until(board.now_ns + round(seconds * 1e9))


def typed(channel, board, data, seconds=0.3):
    channel.receive(data)
    later(board, seconds)
    return channel.transmit().decode(errors="replace")


def test_what_a_host_finds(s3):
    """Two serial ports with endpoints of their own, of which the second has the protocol's name."""
    device = s3.host.device
    assert [f.name for f in device.functions] == ["Board CDC", PROTOCOL_PORT]
    assert [f.interface for f in device.functions] == [0, 2]
    assert device.functions[1] == (PROTOCOL_PORT, 2, 0x83, 0x04, 0x84)
    assert device.vendor == 0x303A
    assert device.strings[1] == "MicroPython"
    assert device.strings[2] == "framestep"
    assert device.strings[3]


def test_mistakes_in_descriptors():
    """The parser refuses what a host would."""
    head = struct.pack("<BBHBBBBB", 9, 2, 9 + 9 + 7, 1, 1, 0, 0x80, 50)
    interface = bytes((9, 4, 0, 0, 2, 2, 2, 0, 0))
    endpoint = bytes((7, 5, 0x81, 3, 8, 0, 16))
    for wrong, why in (
        (head + interface, "bytes long"),
        (head + interface + endpoint, "lacks an endpoint"),
        (head + interface + b"\0\0\0\0\0\0\0", "length of 0"),
        (head + interface[:2] + b"\1" + interface[3:] + endpoint, "interface 1 comes"),
    ):
        with pytest.raises(UsbError, match=why):
            serial_functions(wrong)
    assert Function._fields[-3:] == ("notify", "out", "into")


def test_many_requests_at_once(rig):
    """More than both buffers of the board hold: the host has to wait, and each is answered."""
    rig.port.write(b"".join(encode(p.MotorStatus.TYPE, b"", 100 + i) for i in range(300)))
    later(rig.board, 0.5)
    rig.port.timeout = 0
    answers = [f.id for f in FrameDecoder().feed(rig.port.read(100_000)) if f.id]
    assert answers == [100 + i for i in range(300)]


@pytest.mark.parametrize("size", [63, 64, 65, 128])
def test_frames_without_a_short_packet(rig, size):
    """A frame that fills its packets ends no transfer, and is answered all the same. Its last byte
    may look like what marks a free place."""
    for last in (0, 0x2B):
        frame = encode(p.MotorStatus.TYPE, bytes((last,)) * (size - 12), 9)
        assert len(frame) == size
        answers = rig.bytes_for(frame)
        assert [answer.id for answer in answers if answer.id] == [9]


def test_the_port_closes_while_a_motor_moves(rig):
    """It ramps down at once, as the host is lost; a new host finds the board at rest."""
    rig.accept(p.MotorMove(1, 30_000)).run(0.4).leave()
    left = rig.now
    rig.board.run_until(rig.board.now_ns + 600_000_000)
    times, ways = rig.steps(1)
    assert times[-1] < left + QUEUE_S + 0.2 + 0.01
    slower = left + QUEUE_S
    assert deceleration(times, ways, slower) == pytest.approx(100_000, rel=0.15)
    rig.come_back()
    assert rig.moving == []
    assert rig.position(1) == ways.sum()


def test_a_host_that_starts_again(rig):
    """Its reset of the bus ends the session; a moving motor ramps down. It finds the
    board again."""
    rig.accept(p.MotorMove(1, 30_000)).run(0.4)
    rig.board.host.reset_and_enumerate()
    later(rig.board, 0.5)
    times, ways = rig.steps(1)
    assert 0 < ways.sum() < 30_000
    assert np.diff(times)[-1] > 5 * np.diff(times).min(), "a ramp"
    rig.board.protocol = rig.board.host.ports[1]
    again = Session(rig.board)
    assert again.ask(p.Hi()).motors == 8
    assert again.position(1) == ways.sum()
    again.port.close()


def test_the_cable_is_pulled(rig):
    """The chip does not notice: the motor ramps down when nothing has been read for 3 s."""
    rig.speed(1, 1000, 100_000).accept(p.MotorMove(1, 30_000)).run(0.4)
    rig.board.host.plug(False)
    pulled = rig.now
    later(rig.board, 4)
    times, ways = rig.steps(1)
    assert pulled + 2.9 < times[-1] < pulled + 3.3
    rig.board.host.plug(True)
    later(rig.board, 0.5)
    rig.board.protocol = rig.board.host.ports[1]
    again = Session(rig.board)
    assert again.position(1) == ways.sum()
    again.port.close()


def test_a_host_that_does_not_read(rig):
    """Its port is open, and nothing takes what is sent: nothing is lost, and all comes later."""
    host, into = rig.board.host, rig.port.channel.function.into & 15
    host.wire.usb("l", "BB", into, 0)
    rig.port.write(b"".join(encode(p.MotorStatus.TYPE, b"", 100 + i) for i in range(10)))
    later(rig.board, 0.5)
    host.wire.usb("l", "BB", into, 1)
    later(rig.board, 0.1)
    rig.port.timeout = 0
    answers = [f.id for f in FrameDecoder().feed(rig.port.read(100_000)) if f.id]
    assert answers == [100 + i for i in range(10)]


def test_the_repl():
    """Ctrl-C on the REPL's port, USB or UART, lands the motors and gives the REPL; other bytes do
    nothing. After a soft reset the board comes back with both ports."""
    with Esp32Board({}, S3) as board:
        session = Session(board)
        session.speed(1, 20000, 100_000).accept(p.MotorMove(1, 30_000)).run(0.4)
        terminal = board.host.ports[0]
        terminal.open_port(True)
        assert typed(terminal, board, b"print(1)\r\n\x04\x01") == ""
        assert session.moving == [1]
        said = typed(terminal, board, b"\r\x03", 1)
        assert "KeyboardInterrupt" in said
        assert said.endswith(">>> ")
        times, _ = session.steps(1)
        assert np.diff(times)[-1] > 5 * np.diff(times).min(), "a ramp"
        assert typed(terminal, board, b"6*7\r\n").endswith("42\r\n>>> ")
        assert typed(board.repl, board, b"6*9\r\n").endswith("54\r\n>>> ")
        assert not session.bytes_for(encode(p.MotorStatus.TYPE, b"", 1))

        typed(board.repl, board, b"\x04", 0.02)
        later(board, 1)
        assert terminal not in board.host.ports
        assert [port.function.name for port in board.host.ports] == ["Board CDC", PROTOCOL_PORT]
        board.protocol = board.host.ports[1]
        assert Session(board).ask(p.Hi()).motors == 8


def test_one_port():
    """With "ports": 1 the protocol is on the REPL's UART, at the rate that the rig file sets."""
    with Esp32Board({"ports": 1, "uart_baud": 460800}, S3, baud=460800) as board:
        assert Session(board, reply_s=0.06).ask(p.Hi()).motors == 8
        assert [port.function.name for port in board.host.ports] == ["Board CDC"]


def test_a_rate_for_usb():
    with pytest.raises(RigError, match="uart_baud: found 460800, but this board's port is USB"):
        Rig({"uart_baud": 460800}, board_data(S3))
    assert Rig({"uart_baud": 460800, "ports": 1}, board_data(S3)).ports == 1


@pytest.fixture
def shell(monkeypatch, capsys):
    """Return shell(board): a context with a function that runs a command, with the board's two
    ports on USB, and gives its status and output. The board ends with it."""
    found = Package(S3, modules(S3), main_py(), "ESP32", PROCESSOR)
    monkeypatch.setattr(file_install, "package", lambda board: found)
    monkeypatch.setattr(file_install, "OWN_PORT_FROM", (1, 26))  # the simulated one has this USB

    @contextmanager
    def make(board):
        with board, Terminal(board) as terminal:

            def listed(records=None):
                ports = [Port(terminal.path, REPL, "s3", "", "", 0, True)]
                if len(board.host.ports) == 2:
                    ports.append(Port(terminal.own.path, PROTOCOL, "s3", "", "", 2, True))
                return ports

            def run(*words):
                status = cli.app.status(list(words))
                return status, "".join(capsys.readouterr())

            monkeypatch.setattr(port_finder, "listed", listed)
            yield run

    return make


@pytest.mark.repeats
def test_from_an_erased_flash_to_the_first_move(shell, tmp_path, monkeypatch):
    """The commands find each port."""
    with shell(Esp32Board({}, S3, files={})) as run:
        repl = port_finder.repl_port
        monkeypatch.setattr(port_finder, "esp32_port", repl)
        status, said = run("install", "--board", S3)
        assert status == 0, said
        assert "firmware 0.1.0: 8 motors" in said
        assert run("move", "2", "300")[0] == 0
        assert "motor 2: 300" in run("status")[1]
        (tmp_path / "rig.json").write_text('{"name": "turntable", "motor_count": 2}')
        monkeypatch.setenv("EDITOR", f"cp {tmp_path}/rig.json")
        status, said = run("rig", "edit")
        assert status == 0, said
        assert "turntable on" in said
        assert "firmware 0.1.0: 2 motors" in said
        status, said = run("flash")
        assert status == 0, said
        assert f"all of framestep ({len(modules(S3))} modules)" in said


def test_a_command_for_the_repl_while_another_program_moves_motors(shell):
    """Getting to the REPL would end framestep, so the command changes nothing."""
    with shell(Esp32Board({}, S3)) as run:
        with Client.open(port_finder.protocol_port()) as client:
            client.request(p.MotorMove(1, 30_000))
            status, said = run("flash")
            assert status == PORT_BUSY, said
            assert "getting to the REPL would end framestep under the program that uses it" in said
            assert client.request(p.MotorStatus()).moving == [1]
        assert run("status")[0] == 0


def test_an_older_micropython(shell, monkeypatch):
    """Its USB cannot have the port, so nothing is copied."""
    monkeypatch.setattr(file_install, "OWN_PORT_FROM", (99, 0))
    board = Esp32Board({}, S3, files={"/boot.py": b""})
    with shell(board) as run:
        monkeypatch.setattr(port_finder, "esp32_port", lambda: port_finder.repl_port())
        status, said = run("install", "--board", S3)
        assert status == 1
        assert "put 99.0 or newer on the board" in said
        assert '"ports": 1 into its rig file' in said
        assert board.files().keys() == {"/boot.py"}
