"""Real-time operations of the firmware on the emulated board, judged from its pins."""

import itertools

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


def test_loop_bloop_video_and_two_stops(session):
    """A lap and a half; bloop by pin and channel; a camera started and stopped; a hard stop after
    a soft one."""
    session.speed(1, VELOCITY, 4000)  # to leave time for the second STOP_ALL
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
    stopped = session.now
    session.run(0.05)
    session.accept(MotorStopAll())
    again = session.now
    session.client.wait_event(RtEnd, 5)
    session.run(0.3)
    assert not session.events(RtEnd)
    assert not session.moving
    # both laps meet their frames
    first, second = laps_seen(session)[:2]
    assert [frame for _, frame in first] == list(range(2, 10))
    assert second[0][1] == 2
    begin = first[0][0] - 1 / FPS
    positions = {m: steps[:9] for m, steps in MOVE.items()}
    verdict = judge_lap(session, begin - 0.25, first[-1][0] + 0.25, before, positions, FPS)
    starts = verdict.origin_ns * 1e-9
    # both ramps of the stop
    times, signs = session.steps(1)
    soft = (times > stopped + 0.004) & (times < again + 0.001)
    slope = np.polyfit(times[soft][1:], 1 / np.diff(times[soft]), 1)[0]
    assert slope == pytest.approx(-4000, rel=0.2)
    assert deceleration(times, signs, again + 0.004) == pytest.approx(4 * 4000, rel=0.1)
    assert session.positions[1] == before[1] + signs.sum()
    # bloop
    (on, _), (off, level) = changes(session, "gio2")
    assert (on, off, level) == (
        pytest.approx(starts, abs=0.001),
        pytest.approx(starts + 0.12, abs=0.001),
        0,
    )
    lights = levels_sent(session, 5)
    (lit, dark) = [t for (_, old), (t, new) in itertools.pairwise(lights) if old != new]
    assert {level for _, level in lights} == {33, 255}
    assert lights[-1][1] == 33
    assert starts - 0.001 < lit < starts + 0.06
    assert starts + 0.12 - 0.001 < dark < starts + 0.18
    # a pulse of 100 ms of both lines at GO, before the pre-roll, and another after the stop
    for signal in ("shutter", "meter"):
        pulses = changes(session, signal)
        assert [v for _, v in pulses] == [1, 0, 1, 0]
        assert pulses[0][0] == pytest.approx(starts - 0.5, abs=0.001)
        assert pulses[1][0] - pulses[0][0] == pytest.approx(0.1, abs=0.001)
        assert pulses[2][0] == pytest.approx(stopped, abs=0.02)
        assert pulses[3][0] - pulses[2][0] == pytest.approx(0.1, abs=0.005)
    session.speed(1, VELOCITY, ACCELERATION)
