"""`framestep lab conform`: what it prints and writes, a trace, Ctrl-C, a lost device."""

import json
import re

import pytest
import typer

from framestep_tools import cli
from framestep_tools.client import open_port
from framestep_tools.conform import checks, kit, trace_tail
from framestep_tools.conform.checks import edges
from framestep_tools.errors import BROKEN_OFF, DONE, FAILED, INTERRUPTED, USAGE
from framestep_tools.judge.trace import HEADER, TraceWriter
from framestep_tools.simulator.boards import LockstepPort, SimulatedBoard
from host_tests.conform.score import RIG, Hands


class Port(LockstepPort):
    """A port on a simulated board. It calls `at` once, after so many steps."""

    def __init__(self, board, at=None, after=150):
        super().__init__(board)
        self.at, self.after, self.made = at, after, 0

    def read(self, size=1):
        data = super().read(size)
        made = sum(name == "m1" for _, name, _ in self.board._edges)
        if self.at and made - self.made > self.after:
            at, self.at = self.at, None
            at()
        return data


@pytest.fixture
def board():
    found = SimulatedBoard(motors=2)
    found.run_until(50_000_000)
    return found


@pytest.fixture
def conform(board, monkeypatch, capsys):
    """Return the command on `board`, which gives its status, its output and its errors."""

    def run(*words, port=None):
        monkeypatch.setattr(open_port, "open_port", lambda url, timeout: port or Port(board))
        status = cli.app.status(["lab", "conform", "socket://x", "--yes", *words])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


def test_what_it_prints_and_writes(conform, tmp_path):
    page, before = tmp_path / "page.html", tmp_path / "before.json"
    status, out, err = conform("--subject", "framing", "--html", str(page))
    assert (status, err) == (DONE, "")
    assert out.splitlines()[-1] == (
        "65 checks: 63 passed, 0 left out, 2 reading, 0 departs, 0 fault"
    )
    assert "response codes have 2 bytes" in out
    assert "the last check byte is wrong" in page.read_text()
    status, out, _ = conform("--subject", "framing", "--json")
    found = json.loads(out)
    assert [check["verdict"] for check in found["checks"]].count("passed") == 63
    found["checks"][0]["verdict"] = "fault"
    before.write_text(json.dumps(found))
    _, out, _ = conform("--subject", "framing", "--baseline", str(before))
    assert "was fault, is passed" in out


def test_edges_are_judged_by_the_trace_of_a_board_that_runs(conform, board, tmp_path, monkeypatch):
    """`make sim --trace` writes it as time passes."""
    path = tmp_path / "trace.csv"
    writer = TraceWriter(path)

    def write(seconds):
        writer.add(board.edges())
        writer.release(board.now_ns)
        writer.flush()

    monkeypatch.setattr(trace_tail.time, "sleep", write)
    monkeypatch.setattr(checks, "every_check", lambda: edges.EDGES.checks[:3])
    status, out, err = conform("--subject", "edges", "--trace", str(path))
    assert (status, err) == (DONE, "")
    assert out == "3 checks: 3 passed, 0 left out, 0 reading, 0 departs, 0 fault\n"
    assert writer.written > 800


def test_a_trace_of_another_device_shows_faults(conform, tmp_path, monkeypatch):
    monkeypatch.setattr(checks, "every_check", lambda: edges.EDGES.checks[:1])
    path = tmp_path / "trace.csv"
    path.write_text(HEADER + "\n")
    monkeypatch.setattr(trace_tail.time, "sleep", lambda seconds: None)
    status, out, err = conform("--subject", "edges", "--trace", str(path))
    assert status == FAILED
    assert "made 0 steps" in out
    assert err == "framestep: 1 of 1 checks show a fault\n"


def test_a_file_that_is_no_trace(conform, tmp_path):
    path = tmp_path / "trace.csv"
    path.write_text("a,b\n")
    status, _, err = conform("--trace", str(path))
    assert (status, err) == (
        FAILED,
        f"framestep: {path}: expected the header 'time_ns,signal,value', found 'a,b'\n",
    )
    status, _, err = conform("--trace", str(tmp_path / "none"))
    assert status == FAILED
    assert err.startswith("framestep: cannot read ")


def test_somebody_presses_switches_when_asked(monkeypatch, capsys):
    """They do as the sentences say, within half a second."""
    board = SimulatedBoard(RIG, 2)
    switches = Hands(board.host_board.rig, board.host_board.set_input)
    board.run_until(50_000_000)
    port, said = Port(board, after=10), []

    def say(text, **_):
        said.append(text)
        what = re.search(r"(input|upper limit|lower limit) 1|E-stop", text)[0]
        if text.startswith("Motor 1"):
            port.made = sum(name == "m1" for _, name, _ in board._edges)
            port.at = lambda: switches.press(what, True)
        else:
            switches.press(what, text.startswith("Press"))

    monkeypatch.setattr(typer, "prompt", say)
    monkeypatch.setattr(typer, "confirm", lambda text, **_: True)
    monkeypatch.setattr(open_port, "open_port", lambda url, timeout: port)
    status = cli.app.status(
        ["lab", "conform", "socket://x", "--yes", "--hands", "--subject", "inputs"]
    )
    out, err = capsys.readouterr()
    assert (status, err) == (DONE, "")
    assert out == "24 checks: 24 passed, 0 left out, 0 reading, 0 departs, 0 fault\n"
    assert "Let go of the E-stop; then Enter" in said
    assert not any(text.startswith("Press the lower limit") for text in said)  # it was, under way


def test_a_row_that_is_being_written_is_left_out(tmp_path, monkeypatch):
    path = tmp_path / "trace.csv"
    path.write_text(HEADER + "\n1,m1,1\n25,m")
    monkeypatch.setattr(trace_tail.time, "sleep", lambda seconds: None)
    tail = trace_tail.TraceTail(path)
    assert tail.take() == []
    with path.open("a") as file:
        file.write("1,1\n30,m1,-1\n28,m2,1\n4")
    assert tail.take() == [(28, "m2", 1), (30, "m1", -1)]
    with path.open("a") as file:
        file.write("0,m2,1\n")
    assert tail.take() == [(40, "m2", 1)]
    tail.close()


def test_an_unknown_subject(conform):
    status, _, err = conform("--subject", "weather")
    assert status == USAGE
    assert "weather is none of arms, couples, edges, framing" in err


def test_ctrl_c_brings_the_motors_to_rest(conform, board, monkeypatch):
    def interrupt():
        raise KeyboardInterrupt

    port = Port(board, interrupt)
    port.close = lambda: None  # a lost host would stop the motors, too
    far = kit.Check("motors", "a long move", "MSG_MOTOR_MOVE", lambda bench: bench.go(1, 900))
    monkeypatch.setattr(checks, "every_check", lambda: [far])
    status, _, _ = conform(port=port)
    assert status == INTERRUPTED
    assert board.host_board.moving()
    board.run_until(board.now_ns + 300_000_000)
    assert not board.host_board.moving()
    assert 150 < board.host_board.steps(0) < 400


def test_a_connection_that_is_lost_is_one_sentence(conform, board):
    def pull():
        raise OSError("the other side has gone")

    status, out, err = conform("--subject", "motors", port=Port(board, pull))
    assert (status, out) == (BROKEN_OFF, "")
    assert err == ("framestep: the connection to socket://x broke off: the other side has gone\n")


def test_a_device_that_says_nothing_any_more_ends_the_checks(conform, board, monkeypatch):
    port = Port(board)

    def silent():
        monkeypatch.setattr(board, "transmit", lambda: b"")
        monkeypatch.setattr(
            board, "run_until", lambda ns, until_output=False: SimulatedBoard.run_until(board, ns)
        )

    port.at = silent
    status, _, err = conform("--subject", "motors", port=port)
    assert status == FAILED
    assert err.startswith("framestep: socket://x cannot be checked after ")
    assert err.endswith(" checks: it no longer answers, not even HI\n")


@pytest.mark.parametrize("speed", ["0", "-1", "1000", "nan"])
def test_a_speed_that_no_device_has(conform, speed):
    status, _, err = conform("--speed", speed)
    assert status == USAGE
    assert "--speed" in err


def test_a_device_that_runs_at_a_tenth_of_real_time(conform, board, monkeypatch):
    """By the computer's clock, which runs ten times as fast as the device's."""

    class Slow:
        def __init__(self):
            self.port = Port(board)
            self.timeout = 1.0

        def read(self, size=1):
            self.port.timeout = None if self.timeout is None else self.timeout / 10
            return self.port.read(size)

        def write(self, data):
            return self.port.write(data)

        def close(self):
            self.port.close()

    monkeypatch.setattr("framestep_tools.conform.pace.time.monotonic", lambda: board.now_ns * 1e-8)
    names = {"24 frames/s forward: frames come at their times"}
    chosen = [one for one in checks.every_check() if one.name in names]
    monkeypatch.setattr(checks, "every_check", lambda: chosen)
    status, out, err = conform("--speed", "0.1", port=Slow())
    assert (status, err) == (DONE, "")
    assert out == "1 checks: 1 passed, 0 left out, 0 reading, 0 departs, 0 fault\n"
