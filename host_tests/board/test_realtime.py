"""Real-time operations of the firmware on the emulated board, judged from its pins."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from framestep_tools.payloads import (
    BlurMotor,
    Dmx,
    HardStop,
    MotorConfigure,
    MotorStopAll,
    Positions,
    RtEnd,
    RtGo,
    RtPositionFrame,
    RtShootFrame,
    RtShootFrame2,
)
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.realtime import (
    ACCELERATION,
    MOVE,
    VELOCITY,
    changes,
    judge_lap,
    laps_seen,
    upload,
)
from host_tests.end_to_end.session import Session, deceleration, run_request
from host_tests.end_to_end.shoot.test_shoot import assert_angles, assert_window, shoot

pytestmark = pytest.mark.repeats  # end_to_end/runs and end_to_end/shoot

FPS = 24
TRIGGERS = {0: 0b01, 3: 0b11, 5: 0b10}
START_S = 0.05  # for planning the phases after GO


def levels_sent(session, channel):
    """Return [(time, level)] of a channel in the DMX frames since the last call; a break is a gap
    of 0.1 ms or more."""
    data = session.board.emulator.uart_read(0)[0]
    found, slot, last = [], -1000, data[0][0]  # the data begin anywhere in a frame
    for ns, value in data:
        slot = 0 if ns - last > 150_000 else slot + 1
        last = ns
        if slot == channel:
            found.append((ns * 1e-9, value))
    return found


@pytest.fixture(scope="module")
def session():
    with EmulatedBoard() as board:
        session = Session(board)
        for motor in MOVE:
            session.speed(motor, VELOCITY, ACCELERATION)
            session.accept(MotorConfigure(motor, 0x03))
        board.emulator.uart_start(0)
        yield session
        assert not session.events(HardStop)


def test_eight_motors_to_a_frame(session):
    """They are planned and sent one after another, before the first runs out of segments."""
    places = {m: [0, 72 * m] for m in range(1, 9)}
    for motor in places:
        session.speed(motor, VELOCITY, ACCELERATION)
    session.upload(places)
    asked = session.now
    session.accept(RtPositionFrame(2))
    assert session.now - asked < 0.06
    session.wait_idle()
    assert session.positions == {m: 72 * m for m in places}
    upload(session, triggers=TRIGGERS, mask=0b11)


def test_shoot_frames(session):
    """Both kinds, within a step and 100 µs of the shutter's edges; by pairs and path."""
    before, _, opened, closed = shoot(
        session, RtShootFrame2(10, 400, 90, 270, [BlurMotor(2, 0, 720)]), START_S
    )
    assert closed - opened == pytest.approx(0.4, abs=3e-5)
    assert_angles(session, 2, before, opened, closed, 90, 270, 0, 720)
    middle = int(MOVE[1][9])
    assert_angles(session, 1, before, opened, closed, 90, 270, middle - 30, middle + 30)
    before, _, opened, closed = shoot(
        session, RtShootFrame(10, 0, 125, 600, [BlurMotor(1, -100, 400)]), START_S
    )
    assert closed - opened == pytest.approx(0.125, abs=3e-5)
    assert_window(session, 1, before, opened, closed, 300, 0)


# ---- a loop that is stopped in its second lap: at first softly, 50 ms later hard


SOFT = 4000  # steps/s² of motor 1, so that the second STOP_ALL finds it in motion
BLOOP_S = 0.12


@pytest.fixture(scope="module")
def stopped_loop(session):
    """A lap and a half with a bloop and a camera. Return when which request came, and all that
    was seen."""
    session.speed(1, VELOCITY, SOFT)
    session.accept(Dmx(0, 5, [33]))
    run = run_request(
        FPS, 1, 9, 500, 500, flags=0x12, bloop_outputs=0b10, bloop_channel=5, bloop_ms=120
    )
    session.ready(run)
    before = session.positions
    session.forget()
    session.board.emulator.uart_read(0)
    session.accept(RtGo())
    session.client.wait_event(Positions, 5)
    while len(laps_seen(session)) < 2 or len(laps_seen(session)[1]) < 3:
        session.run(0.02)
    session.accept(MotorStopAll())
    soft = session.now
    session.run(0.05)
    session.accept(MotorStopAll())
    hard = session.now
    session.client.wait_event(RtEnd, 5)
    session.run(0.3)
    assert not session.events(RtEnd), "RT_END came twice"
    assert not session.moving
    laps = laps_seen(session)[:2]
    positions = {m: steps[:9] for m, steps in MOVE.items()}
    begin, end = laps[0][0][0] - 1 / FPS, laps[0][-1][0]
    verdict = judge_lap(session, begin - 0.25, end + 0.25, before, positions, FPS)
    seen = SimpleNamespace(
        soft=soft,
        hard=hard,
        laps=[[frame for _, frame in lap] for lap in laps],
        first_frame=verdict.origin_ns * 1e-9,
        steps=session.steps(1),
        distance=session.positions[1] - before[1],
        lights=levels_sent(session, 5),
        signals={name: changes(session, name) for name in ("gio2", "shutter", "meter")},
    )
    session.speed(1, VELOCITY, ACCELERATION)
    return seen


def test_a_loop_begins_again_behind_its_last_frame(stopped_loop):
    """Each lap's first frame is missing among the reports (realtime.laps_seen)."""
    first, second = stopped_loop.laps
    assert first == list(range(2, 10))
    assert second[0] == 2


def test_a_second_stop_is_hard(stopped_loop):
    times, signs = stopped_loop.steps
    soft = (times > stopped_loop.soft + 0.004) & (times < stopped_loop.hard + 0.001)
    slope = np.polyfit(times[soft][1:], 1 / np.diff(times[soft]), 1)[0]
    assert slope == pytest.approx(-SOFT, rel=0.2)
    hard = deceleration(times, signs, stopped_loop.hard + 0.004)
    assert hard == pytest.approx(4 * SOFT, rel=0.1)
    assert stopped_loop.distance == signs.sum()


def test_a_bloop_switches_its_output_at_the_first_frame(stopped_loop):
    (on, _), (off, level) = stopped_loop.signals["gio2"]
    assert on == pytest.approx(stopped_loop.first_frame, abs=0.001)
    assert off == pytest.approx(stopped_loop.first_frame + BLOOP_S, abs=0.001)
    assert level == 0


def test_a_bloop_lights_its_channel_in_the_next_dmx_frame(stopped_loop):
    lights, begin = stopped_loop.lights, stopped_loop.first_frame
    (lit, dark) = [t for (_, old), (t, new) in itertools.pairwise(lights) if old != new]
    assert {level for _, level in lights} == {33, 255}
    assert lights[-1][1] == 33
    assert begin - 0.001 < lit < begin + 0.06
    assert begin + BLOOP_S - 0.001 < dark < begin + BLOOP_S + 0.06


@pytest.mark.parametrize("signal", ["shutter", "meter"])
def test_a_camera_is_started_at_go_and_stopped_at_the_stop(stopped_loop, signal):
    """By a pulse of 100 ms each, the first before the pre-roll."""
    (on, a), (off, b), (again, c), (end, d) = stopped_loop.signals[signal]
    assert (a, b, c, d) == (1, 0, 1, 0)
    assert on == pytest.approx(stopped_loop.first_frame - 0.5, abs=0.001)
    assert off - on == pytest.approx(0.1, abs=0.001)
    assert again == pytest.approx(stopped_loop.soft, abs=0.02)
    assert end - again == pytest.approx(0.1, abs=0.005)
