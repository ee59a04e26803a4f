"""The trial finds its faults: each one is put back into the firmware, and a session reveals it.

The first ones were found by an earlier fuzzer; their scripts are kept. (What could follow a hard
stop was repaired in several places at once, and no single change brings it back: for it there is
only scripts/move-after-a-hard-stop-with-jerk.txt.) Then follows, for each of the trial's rules, a
fault that breaks only this rule.
"""

from pathlib import Path

import pytest

from framestep.controller import Controller
from framestep.hal.host import HostPort, PulseModel
from framestep.interlock import Interlock
from framestep.io.requests import Io
from framestep.motors import bounds
from framestep.motors.axis import Axis
from framestep.motors.requests import Motors
from framestep.moves.operation_runner import OperationRunner
from framestep.moves.requests import Moves
from framestep.moves.upload.store import UploadStore
from framestep.protocol import messages as m
from framestep.reports import Reports
from framestep.stops import Stops
from framestep.virtual_axes import move
from framestep.virtual_axes.lookahead import LookAhead
from framestep.virtual_axes.registers import MAX_A
from host_tests.script import parse

from . import fuzz
from .findings import Finding
from .sessions import (
    SESSIONS,
    Host,
    coupled,
    jogs_beside,
    limited,
    moves,
    outputs_on,
    prepared_in_motion,
    pressed,
    run,
    slow,
    stopped,
    stopped_alone,
)
from .trial import Trial

SCRIPTS = Path(__file__).parent / "scripts"


@pytest.mark.parametrize("session", SESSIONS)
def test_nothing_is_found_where_nothing_is_wrong(session):
    host = Host({"motor_count": 2, "estop": "no", "motors": [{"jerk": 200}]})
    session(host)
    assert host.trial.counts["0x10"] > 1
    if session in (run, slow):
        assert host.trial.counts["runs judged"] == 1


# ---- faults of the past ----------------------------------------------------------------------


def ends_without_play(monkeypatch):
    """A jog to the end of the range ignores the play: its sum leaves the word."""
    monkeypatch.setattr(bounds, "clamp", lambda axis, target, i: None)
    monkeypatch.setattr(bounds, "beyond", lambda axis, target, i: 0)


def limit_forgotten(monkeypatch):
    """The stop of a virtual jog no longer knows the limits ahead."""
    load_limits, place_knot = LookAhead.load_limits, move.place_knot
    now = {"stopping": False}

    def forgetful(self):
        known = load_limits(self)
        if now["stopping"]:
            self.r[MAX_A] = self.r[MAX_A] >> 3
        return known

    def noted(r, survey, ahead, stopping):
        now["stopping"] = stopping
        return place_knot(r, survey, ahead, stopping)

    monkeypatch.setattr(LookAhead, "load_limits", forgetful)
    monkeypatch.setattr(move, "place_knot", noted)


def play_in_the_ramp(monkeypatch):
    """The play is taken up within the first phase of a run, at any speed."""
    move_to, rests_on = Axis.move_to, Axis.rests_on
    monkeypatch.setattr(
        Axis,
        "move_to",
        lambda self, hal, target, i, speed=10000, way=0: move_to(self, hal, target, i, speed),
    )
    monkeypatch.setattr(Axis, "rests_on", lambda self, source, i, way=0: rests_on(self, source, i))


@pytest.mark.parametrize(
    "fault, script",
    [
        (ends_without_play, "jog-to-the-end-of-the-range-with-backlash"),
        (limit_forgotten, "virtual-jog-stopped-before-a-soft-limit"),
        (play_in_the_ramp, "backlash-with-no-pre-roll"),
    ],
)
def test_faults_that_were_there_are_found(fault, script, monkeypatch):
    with (SCRIPTS / (script + ".txt")).open() as file:
        session = parse(file)
    fault(monkeypatch)
    with pytest.raises(Finding):
        fuzz.replay(session)


# ---- each rule -----------------------------------------------------------------------------------


def replaced(owner, name, by):
    """Return a fault: a method is another one."""
    return lambda monkeypatch: monkeypatch.setattr(owner, name, by)


def scaled(name, factor):
    """Return a fault: a motor's own speed or acceleration is applied as another one."""
    apply = Axis._apply

    def wrong(self):
        before = getattr(self, name)
        setattr(self, name, int(before * factor))
        apply(self)
        setattr(self, name, before)

    return replaced(Axis, "_apply", wrong)


def reported(steps, moving_only):
    """Return a fault: the first motor's position is reported so many steps ahead."""
    tell = OperationRunner.sample_move_time

    def wrong(self, frame):
        time = tell(self, frame)
        if self.axes.moving_bits() or not moving_only:
            self.axes.reported[0] += steps
        return time

    return replaced(OperationRunner, "sample_move_time", wrong)


def handled(kind, changed):
    """Return a fault: changed(handler) answers a type."""
    original = Controller.__init__

    def init(self, *args):
        original(self, *args)
        self.handlers[kind] = changed(self.handlers[kind])

    return replaced(Controller, "__init__", init)


def with_jerk_ignored(monkeypatch):
    monkeypatch.setattr(Axis, "set_jerk", lambda self, jerk: None)


def harder_stop(monkeypatch):
    stop = Axis.stop
    monkeypatch.setattr(
        Axis, "stop", lambda self, hal, factor=1, smooth=False: stop(self, hal, 2, False)
    )


def rests_too_soon(self):
    self.writer.begin(m.MSG_MOTOR_STATUS, self.reader)
    self.writer.u32(0)
    self.writer.u8(0)
    self.writer.end()
    return 0


def steps_off(steps):
    positions = UploadStore.positions

    def wrong(self, motor, index, count, to, at):
        positions(self, motor, index, count, to, at)
        if count in (5, 17) and index <= 10 < index + count:  # the windows of a path
            to[at + 10 - index] += steps

    return replaced(UploadStore, "positions", wrong)


def ends_twice(monkeypatch):
    end = OperationRunner._end

    def wrong(self):
        end(self)
        self.axes.hal.port.twice = True

    send = Reports.send

    def again(self, now, listened):
        send(self, now, listened)
        port = self.operations.axes.hal.port
        if getattr(port, "twice", False) and not self.end:
            port.twice = False
            self.end = True

    monkeypatch.setattr(OperationRunner, "_end", wrong)
    monkeypatch.setattr(Reports, "send", again)


def never_ends(monkeypatch):
    monkeypatch.setattr(
        Reports, "end", property(lambda self: False, lambda self, value: None), raising=False
    )


def false_fault(monkeypatch):
    stop_all = Stops.stop_all

    def wrong(self):
        self.reports.hard_stop = m.HARD_STOP_FAULT
        return stop_all(self)

    monkeypatch.setattr(Stops, "stop_all", wrong)


def couple_apart(monkeypatch):
    """The coupled motor loses the first step of each motion."""
    put = PulseModel.__setitem__
    first = {}

    def wrong(self, index, command):
        pulses = command >> 1 & 0x1FF
        second = self.on_step.__closure__[0].cell_contents.__self__ is first.get("edges")
        if pulses and second and not first.get("done"):
            first["done"] = True
            command -= 2
        put(self, index, command)

    original = Host.__init__

    def init(self, *args, **more):
        original(self, *args, **more)
        first["edges"] = self.trial.motors[1].edges

    monkeypatch.setattr(Host, "__init__", init)
    monkeypatch.setattr(PulseModel, "__setitem__", wrong)


def noise(monkeypatch):
    send = HostPort.send

    def wrong(self, writer):
        send(self, writer)
        if self.outgoing:
            self.outgoing += b"debug"

    monkeypatch.setattr(HostPort, "send", wrong)


def jogs_forgotten(monkeypatch):
    original = Interlock.prepare

    def wrong(self, bits):
        self.jogging = 0
        original(self, bits)

    monkeypatch.setattr(Interlock, "prepare", wrong)


def falls_short(monkeypatch):
    original = bounds.clamp

    def wrong(axis, target, i):
        target[i] -= 1
        original(axis, target, i)

    monkeypatch.setattr(bounds, "clamp", wrong)


def breaks_off(self):
    raise IndexError("by a fault")


# a fault, a session, what is found
RULES = (
    (falls_short, moves, "goal"),
    (scaled("own_velocity", 1.1), moves, "velocity"),
    (scaled("own_acceleration", 1.25), moves, "acceleration"),
    (with_jerk_ignored, moves, "jerk"),
    (harder_stop, stopped, "acceleration"),
    (replaced(bounds, "clamp", lambda axis, target, i: None), limited, "limits|acceleration"),
    (reported(1, False), moves, "positions"),
    (reported(30, True), moves, "pins"),  # of the queue, not of the pins
    (replaced(Controller, "_status", rests_too_soon), moves, "goal|quiet"),
    (replaced(Axis, "stop", lambda *_, **more: None), stopped, "quiet|no-rest"),
    (steps_off(3), run, "frames|acceleration|velocity"),
    (steps_off(-1), slow, "frames"),
    (ends_twice, run, "rt-end"),
    (never_ends, run, "rt-end"),
    (false_fault, stopped, "fault"),
    (handled(m.MSG_HI, lambda hi: lambda: 0), pressed, "unanswered"),
    (handled(m.MSG_MOTOR_STATUS, lambda status: lambda: status() or status()), moves, "answers"),
    (replaced(Io, "safe", lambda self: None), outputs_on, "outputs"),
    (replaced(Interlock, "may_move", lambda self, motor: m.OK), pressed, "estop"),
    (couple_apart, coupled, "coupled"),
    (noise, moves, "bytes"),
    (replaced(Motors, "end_jogs", breaks_off), limited, "exception"),
    (replaced(Motors, "_stop", lambda self: m.OK), stopped_alone, "stop"),
    (jogs_forgotten, jogs_beside, "jog"),
    (replaced(Moves, "may_begin", lambda self: m.OK), prepared_in_motion, "taken"),
)


@pytest.mark.parametrize("fault, session, kind", RULES)
def test_each_rule(fault, session, kind, monkeypatch):
    fault(monkeypatch)
    with pytest.raises(Finding, match=f"^({kind})"):
        conduct(fault, session, Trial)


def conduct(fault, session, make):
    """Play a session on two motors. make: see Host."""
    jerk = 5 if fault is with_jerk_ignored else 0
    host = Host({"motor_count": 2, "estop": "no", "motors": [{"jerk": jerk}]}, make=make)
    session(host)
    host.wait(500)
    host.rest()
