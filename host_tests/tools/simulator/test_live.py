"""The simulator's live view: what it shows, what its keys do. In virtual time, and once in a
terminal."""

import contextlib
import io
import os
import re
import select
import subprocess
import sys
import termios
import time

import pytest
from rich.console import Console

from framestep_tools import payloads as p
from framestep_tools.building.board_files import ROOT
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.simulator.boards import SimulatedBoard
from framestep_tools.simulator.faulty_line import FaultyLine
from framestep_tools.simulator.live import LiveServer
from framestep_tools.traffic.log import CLOSE, DEVICE, HOST, OPEN, Recorder

RIG = {
    "estop": "nc",
    "limits": [{"high": 22, "low": 26, "contact": "nc"}],
    "inputs": [{"pin": 27}],
    "outputs": [{"pin": 28}],
}
PATIENCE_S = 100


class Bench:
    """A live simulator without a terminal, and a host on its line."""

    def __init__(self, rig):
        board = SimulatedBoard(rig, 2)
        board.wire_switches()
        self.server = LiveServer(board, None, None, None, Console(file=io.StringIO()))
        self.board, self.line = board, self.server.line
        self.decoder = FrameDecoder()
        self.line.open_port(True)
        self.run(0.05)

    def run(self, seconds):
        """Run, and return what the board sends."""
        frames = []
        for _ in range(round(seconds * 1000)):
            self.board.run_until(self.board.now_ns + 1_000_000)
            frames += self.decoder.feed(self.line.transmit())
        return frames

    def ask(self, request, seconds=0.02):
        self.line.receive(encode(request.TYPE, request.pack(), 9))
        return [frame for frame in self.run(seconds) if frame.id == 9]

    def picture(self):
        console = Console(file=io.StringIO(), width=120, height=60)
        console.print(self.server.view.draw(self.line.plugged))
        return console.file.getvalue()


@pytest.fixture
def bench():
    found = Bench(RIG)
    with contextlib.closing(found.server):
        yield found


def test_positions_and_velocities_are_shown(bench):
    bench.ask(p.MotorSetSpeed(2, 5000, 50000))
    bench.picture()
    bench.ask(p.MotorMove(2, -20000), 0.5)
    bench.picture()
    bench.run(0.2)
    text = bench.picture()
    row = next(line for line in text.splitlines() if re.match(r" *2 +-", line))
    assert -20000 < int(row.split()[1]) < -2000
    assert int(row.split()[2]) == pytest.approx(-5000, abs=2)
    assert "motors move" in text
    assert "MOTOR_MOVE            motor=2  position=-20000" in text  # the traffic


def test_lights_and_outputs_are_shown(bench):
    assert re.search(r"output 1 +off", bench.picture())
    bench.ask(p.GioOut(1))
    bench.ask(p.Dmx(0, 7, (99,)))
    text = bench.picture()
    assert re.search(r"output 1 +on", text)
    assert re.search(r" 7 +99", text)


def test_the_estop_key_stops_what_moves_and_a_second_one_frees_it(bench):
    bench.ask(p.MotorMove(1, 20000), 0.2)
    bench.server.press("e")
    reported = bench.run(0.5)
    assert p.HardStop.TYPE in [frame.type for frame in reported]
    text = bench.picture()
    assert "the E-stop is held" in text
    assert re.search(r"E-stop \(e\) +held", text)
    bench.server.press("e")
    bench.run(0.2)
    assert re.search(r"E-stop \(e\) +released", bench.picture())


def test_digits_press_switches_and_inputs(bench):
    assert [switch.name for switch in bench.server.view.switches] == [
        "limit set 1 upper",
        "limit set 1 lower",
        "input 1",
    ]
    bench.ask(p.MotorSetLimits(1, 0, 0, 0, 0, 1))
    bench.ask(p.MotorMove(1, 20000), 0.2)
    bench.server.press("1")
    reported = [frame for frame in bench.run(0.5) if frame.type == p.HardStop.TYPE]
    assert [p.HardStop.unpack(frame.payload) for frame in reported] == [p.HardStop(1, 1)]
    before = p.InputLevels.unpack(bench.ask(p.GioIn())[0].payload).levels
    bench.server.press("3")
    bench.run(0.1)
    after = p.InputLevels.unpack(bench.ask(p.GioIn())[0].payload).levels
    assert after == before ^ 1
    assert "input 1 is pressed" in bench.picture()
    bench.server.press("4")
    assert "there is no switch 4" in bench.picture()


def test_a_pulled_cable_is_a_lost_host_until_it_is_put_back(bench):
    bench.ask(p.MotorMove(1, 200000), 0.3)
    bench.server.press("h")
    assert bench.ask(p.Hi()) == []
    bench.run(3)
    assert not bench.board.host_board.moving()
    assert "the cable is out" in bench.picture()
    bench.server.press("h")
    reported = bench.run(0.1)
    assert p.DeviceInfo.TYPE in [frame.type for frame in reported]
    assert len(bench.ask(p.Hi())) == 1


def test_a_damaged_byte_of_the_host_is_refused_once(bench):
    bench.server.press("d")
    answers = bench.ask(p.MotorResetPosition(1, 5), 0.1)
    assert answers == [] or p.Ack.unpack(answers[0].payload) == p.Ack.ERR_CHECKSUM
    bench.run(2)  # a damaged length may make the board wait for more
    (answer,) = bench.ask(p.MotorResetPosition(1, 5))
    assert p.Ack.unpack(answer.payload) == p.Ack.OK


def test_a_damaged_byte_of_the_board_reaches_the_host(bench):
    bench.server.press("D")
    assert bench.ask(p.MotorStatus()) == []
    assert bench.decoder.skipped + bench.decoder.pending > 0
    assert "a bit of what the board sends" in bench.picture()


def test_without_an_estop_the_key_says_how_to_have_one():
    bench = Bench({})
    with contextlib.closing(bench.server):
        bench.server.press("e")
        assert "the rig file has no E-stop" in bench.picture()


def test_q_ends_it(bench):
    bench.server.press("x")
    assert not bench.server.stopping
    bench.server.press("q")
    assert bench.server.stopping


def test_what_a_line_loses_is_not_recorded():
    class End:
        pending = 0

        def __init__(self):
            self.got, self.calls = b"", []

        def receive(self, data):
            self.got += data

        def transmit(self):
            return b"answer"

        def open_port(self, on):
            self.calls.append(on)

    end, entries = End(), []
    line = FaultyLine(end, Recorder(entries.append, iter(range(99)).__next__))
    line.plug(False)
    line.open_port(True)
    line.receive(b"lost")
    assert (line.transmit(), end.got, end.calls, entries) == (b"", b"", [], [])
    line.plug(True)
    line.damage(HOST)
    line.receive(b"\0\0\0\0")
    assert end.got == b"\0\0\x10\0"
    assert line.transmit() == b"answer"
    line.open_port(False)
    assert end.calls == [True, False]
    assert [entry.who for entry in entries] == [OPEN, HOST, DEVICE, CLOSE]


@contextlib.contextmanager
def terminal(*args):
    """Start the simulator in a terminal of 120 columns; return (the terminal's two ends, its
    settings before, the process)."""
    master, slave = os.openpty()
    before = termios.tcgetattr(slave)
    termios.tcsetwinsize(slave, (60, 120))
    process = subprocess.Popen(
        [sys.executable, "-m", "framestep_tools", "sim", *args],
        stdin=slave, stdout=slave, stderr=slave, cwd=ROOT,
        env={**os.environ, "TERM": "xterm"},
    )  # fmt: skip
    try:
        yield master, slave, before, process
    finally:
        process.kill()
        process.wait()
        os.close(slave)
        os.close(master)


def seen(master, text):
    """Read the output until that text is on the screen."""
    found, end = "", time.monotonic() + PATIENCE_S
    while text not in found:
        assert time.monotonic() < end, found[-2000:]
        if select.select([master], [], [], 1)[0]:
            found += os.read(master, 65536).decode(errors="replace")
    return found


def test_in_a_terminal(tmp_path):
    rig = tmp_path / "rig.json"
    rig.write_text('{"estop": "nc"}')
    with terminal("--rig", str(rig), "--tcp", "127.0.0.1:0") as (
        master,
        slave,
        before,
        process,
    ):
        text = seen(master, "no host is connected")
        assert "framestep on /dev/" in text
        assert "127.0.0.1:" in text
        os.write(master, b"e")
        seen(master, "the E-stop is held")
        os.write(master, b"q")
        end = time.monotonic() + PATIENCE_S
        while process.poll() is None and time.monotonic() < end:
            if select.select([master], [], [], 0.1)[0]:
                os.read(master, 65536)
        assert process.returncode == 0
        assert termios.tcgetattr(slave) == before


def test_plain_where_that_is_asked_for():
    with terminal("--plain") as (master, *_):
        assert "\x1b" not in seen(master, "ready")
