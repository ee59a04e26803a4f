"""The kit on the computer's clock: a device at another speed, a computer with hold-ups."""

import itertools
import threading

import pytest

from framestep_tools.conform import kit, report
from framestep_tools.conform.bench import Bench
from framestep_tools.conform.checks import every_check
from framestep_tools.conform.link import Failed, Link
from framestep_tools.conform.pace import HELD_UP_S, HoldUps, PacedPort
from framestep_tools.simulator.boards import LockstepPort, SimulatedBoard
from host_tests.conform import motion_faults
from host_tests.conform.faults import Behaviour, FaultProxy


class Held:
    """A computer that is late by these times, one for each measurement."""

    def __init__(self, *late_s):
        self.late_s = itertools.cycle(late_s)

    def take(self):
        return next(self.late_s)


@pytest.fixture
def bench():
    """Return bench(hold_ups, behaviour): a bench on a simulated board of one motor."""
    boards = []

    def make(hold_ups, behaviour=None):
        boards.append(board := SimulatedBoard(motors=1))
        link = Link(FaultProxy(LockstepPort(board), behaviour or Behaviour()))
        link.pump(0.3)
        return Bench(link, hold_ups=hold_ups)

    yield make
    for board in boards:
        board.close()


def check(fails, subject="runs", level=kit.MUST):
    """Return a check that fails in its first tries."""
    left = [True] * fails

    def run(bench):
        if left:
            left.pop()
            raise Failed("frame 3 is +80 ms from its time")

    return kit.Check(subject, "a frame", "MSG_RT_GO", run, level)


# for each try, the hold-up measured before it, which does not count, and the one in it
CALM, BUSY = (0.5, HELD_UP_S / 2), (0.0, 0.08)


@pytest.mark.parametrize(
    ("fails", "subject", "late", "verdict", "text"),
    [
        (0, "runs", BUSY, kit.PASSED, ""),
        (1, "runs", CALM, kit.READING, "only try 2 passed; before: frame 3 is +80 ms"),
        (2, "runs", BUSY, kit.READING, "only try 3 passed; before: frame 3 is +80 ms"),
        (3, "runs", CALM, kit.FAULT, "frame 3 is +80 ms"),
        (3, "runs", BUSY + BUSY + CALM, kit.FAULT, "frame 3 is +80 ms"),
        (3, "runs", BUSY, kit.NOT_JUDGED, "this computer was held up for 80 ms; frame 3 is +80"),
        (3, "framing", BUSY, kit.FAULT, "frame 3 is +80 ms"),
    ],
)
def test_what_becomes_of_a_check_that_fails(bench, fails, subject, late, verdict, text):
    found = bench(Held(*late))
    (result,) = kit.run(found, [check(fails, subject)])
    assert result.verdict == verdict
    assert result.text.startswith(text)


def test_in_lockstep_there_is_one_try(bench):
    first, second = kit.run(bench(None), [check(1), check(1, level=kit.SHOULD)])
    assert (first.verdict, second.verdict) == (kit.FAULT, kit.DEPARTS)


def test_what_was_not_judged_is_counted():
    one = kit.Result(check(0), kit.NOT_JUDGED)
    assert report.counts([one]) == (
        "0 passed, 0 left out, 0 reading, 1 not judged, 0 departs, 0 fault"
    )


@pytest.mark.parametrize("name", ["reports come 0.2 s late", "no pre-roll"])
def test_each_try_finds_a_fault_that_is_there(bench, name):
    """Each try repeats the play that several checks judge."""
    (fault,) = [fault for fault in motion_faults.FAULTS if fault.name == name]
    found = bench(Held(*CALM), fault.behave())
    checks = [one for one in every_check() if one.subject == "runs"]
    assert any(
        result.verdict in (kit.FAULT, kit.DEPARTS) for result in kit.results_of(found, checks)
    )


def test_hold_ups_are_in_the_time_of_the_device():
    now = itertools.accumulate((0, 0.005, 1, 0.085, 1, 0.015))
    hold_ups = HoldUps(0.25, lambda: next(now), lambda seconds: None)
    for _ in range(3):
        hold_ups.look()
    assert hold_ups.take() == pytest.approx(0.25 * 0.08)
    assert hold_ups.take() == 0


def test_hold_ups_are_measured_until_it_is_asked_to_stop():
    looked, going_on = threading.Event(), threading.Event()

    def sleep(seconds):
        looked.set()
        going_on.wait()

    hold_ups = HoldUps(sleep=sleep).start()
    looked.wait()
    going_on.set()
    hold_ups.stop()
    looked.clear()
    assert hold_ups.take() >= 0
    assert not looked.is_set()


def test_a_port_at_another_speed(monkeypatch):
    class Port:
        timeout = None

        def read(self, size):
            return f"{self.timeout:g} {size}".encode()

        def write(self, data):
            return data

    monkeypatch.setattr("time.monotonic", lambda: 100.0)
    port = PacedPort(Port(), 0.25)
    assert port.clock() == 25
    port.timeout = 0.5
    assert port.read(7) == b"2 7"
    assert port.write(b"x") == b"x"
