"""MOVE TIME and positions of a message belong together: both are of the same time on the pins
(field note 4.6)."""

import numpy as np
import pytest

from framestep.protocol.messages import MSG_MOTOR_GET_POSITION, MSG_MOTOR_STATUS
from framestep_tools import payloads as p
from framestep_tools.client.wire import encode
from host_tests.end_to_end.realtime import rig, upload
from host_tests.end_to_end.session import run_request
from host_tests.selection import sweep

pytestmark = pytest.mark.with_reports

FRAMES = 49
LOOP, PING_PONG = 2, 1
LIVE = 0x09
PATH = {
    1: 90 * np.arange(FRAMES) + 500,
    2: np.rint(400 * np.sin(np.arange(FRAMES) * 0.2)).astype(int),
}
LATE_S = 0.006  # the longest age of a message's contents


class Pins:
    """The position of each motor at any time, by its edges."""

    def __init__(self, session):
        self.session = session
        self.origin = session.positions

    def __call__(self, motor, time):
        times, signs = self.session.steps(motor)
        return self.origin[motor] + int(signs[times <= time].sum())


def loaded(**settings):
    session = rig(**settings)
    upload(session, PATH, frames=FRAMES)
    return session


def watch(session, seconds, ask):
    """Return [(time, Positions)] of that time; with `ask` including answers to GET_POSITION."""
    begun = session.now
    end = begun + seconds
    replies = []
    while session.now < end:
        session.run(0.007)
        if ask:
            message = session.ask(p.MotorGetPosition())
            replies.append((session.now, message))
    events = [pair for pair in session.events(p.Positions) if pair[0] > begun]
    return sorted(events + replies, key=lambda pair: pair[0])


def assert_of_one_moment(session, pins, messages, motors=(1, 2)):
    """Assert that shortly before each message there is a time at which the pins of all motors had
    its positions, to a step."""
    edges = {motor: session.steps(motor) for motor in motors}

    def at(motor, moments):
        times, signs = edges[motor]
        sums = np.concatenate(([0], np.cumsum(signs)))
        return pins.origin[motor] + sums[np.searchsorted(times, moments, side="right")]

    for time, message in messages:
        moments = np.arange(time - LATE_S, time, 0.0001)
        off = np.max(
            [np.abs(at(motor, moments) - message.steps[motor - 1]) for motor in motors], axis=0
        )
        assert off.min() <= 1, (time, message)


@pytest.mark.parametrize("fps", [24, 60])
@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("ask", [False, True])
def test_in_a_run(fps, way, ask):
    session = loaded(report_ms=20)
    first, last = (1, FRAMES) if way > 0 else (FRAMES, 1)
    session.ready(run_request(fps, first, last, 400, 400)).forget()
    pins = Pins(session)
    session.accept(p.RtGo())
    messages = watch(session, 0.4 + FRAMES / fps + 0.5, ask)
    assert_of_one_moment(session, pins, messages)
    # Every frame is reported exactly
    reported = [(time, m) for time, m in messages if m.move_time % 1000 == 0]
    for index in range(FRAMES)[1:]:
        exact = [m for _, m in reported if m.move_time == (index + 1) * 1000]
        at_it = [m.steps[:2] == (PATH[1][index], PATH[2][index]) for m in exact]
        assert any(at_it)
        assert all(at_it) or index == FRAMES - 1  # it stays MOVE TIME in the post-roll
    # between frames MOVE TIME is the play head: motor 1 has a constant speed
    parts = [m for _, m in messages if m.move_time % 1000]
    # each frame has its report, which comes before the next periodic one is due
    assert len(parts) > 30 or (fps == 60 and not ask)
    for m in parts:
        assert m.steps[0] == pytest.approx(PATH[1][0] + 90 * (m.move_time / 1000 - 1), abs=1.6)
    unasked = [m.move_time * way for _, m in session.events(p.Positions)]
    assert unasked == sorted(unasked)
    begin = [m.move_time for time, m in messages if time < messages[0][0] + 0.3]
    assert set(begin) == {first * 1000}
    assert unasked[-1] == last * 1000 * way


@pytest.mark.parametrize("flags", [LOOP, PING_PONG])
def test_in_a_loop(flags):
    session = loaded(report_ms=20)
    session.ready(run_request(24, 1, 20, 200, 200, flags=flags)).forget()
    pins = Pins(session)
    session.accept(p.RtGo())
    messages = watch(session, 6, True)
    assert_of_one_moment(session, pins, messages)
    assert all(1000 <= m.move_time <= 20000 for _, m in messages)
    assert sum(m.move_time == 20000 and m.steps[0] == PATH[1][19] for _, m in messages) >= 2


@pytest.mark.parametrize("fps", [0.5, 6, 24])
def test_in_jog_all(fps):
    session = loaded(report_ms=20)
    session.accept(p.RtPositionFrame(10)).wait_idle().forget()
    pins = Pins(session)
    messages = []
    for frame in (30, 12):
        session.accept(p.RtJogAll(round(fps * 1000), frame))
        messages += watch(session, 2.5, True)
        session.accept(p.MotorStop(1))
        messages += watch(session, 2.5, True)
    assert_of_one_moment(session, pins, messages)
    parts = [m for _, m in messages if m.move_time % 1000]
    assert len(parts) > 50
    for m in parts:
        assert m.steps[0] == pytest.approx(PATH[1][0] + 90 * (m.move_time / 1000 - 1), abs=3)
    assert session.ask_positions().move_time == 1000 + (session.position(1) - 500) // 90 * 1000


def test_position_frame_sets_it_on_arrival():
    session = loaded()
    session.accept(p.RtPositionFrame(7)).wait_idle()
    assert session.ask_positions().move_time == 7000
    session.accept(p.RtPositionFrame(40)).run(0.05)
    assert session.ask_positions().move_time == 7000
    session.forget().wait_idle()
    assert session.events(p.Positions)[-1][1].move_time == 40_000
    session.accept(p.RtPositionFrame(3)).run(0.05)
    session.accept(p.MotorStopAll()).wait_idle()
    assert session.ask_positions().move_time == 40_000  # it has not arrived there
    session.accept(p.RtPositionFrame(3)).wait_idle()
    assert session.ask_positions().move_time == 3000


def test_moves_and_a_live_motor_beside_a_run():
    """One time for all motors, those of the run and others."""
    session = loaded(report_ms=20)
    session.accept(p.MotorConfigure(3, LIVE))
    session.speed(3, 9000, 60_000).ready(run_request(24, 1, FRAMES, 300, 300)).forget()
    pins = Pins(session)
    session.accept(p.RtGo())
    messages = []
    for target in (3000, -2000, 4000, 0):
        session.accept(p.MotorMove(3, target))
        messages += watch(session, 0.6, True)
    assert_of_one_moment(session, pins, [m for m in messages if m[1].move_time % 1000], (1, 2, 3))
    session.until(p.RtEnd, 20).wait_idle()
    for motor in (1, 2, 3):
        assert session.position(motor) == pins(motor, session.now)


def tick(board):
    """Play a millisecond without a pass of the main loop."""
    board.hal.now_ns = board.next_tick
    board.hal.tick()
    board.next_tick += 1_000_000


@pytest.mark.needs("inside")
@pytest.mark.inside
@pytest.mark.parametrize("away", sweep([*range(2, 19), 30, 50], 2, 10, 18, 50))
def test_at_rest_after_an_absence(away):
    """The main loop is away when the last motor stops: as soon as STATUS reports no motion,
    positions are those at rest, and so are the last report's."""
    for back in range(1, 8):  # ms from the last step to the next pass
        session = rig()
        session.speed(1, 20_000, 400_000).speed(2, 20_000, 300_000)
        session.accept(p.MotorMove(2, 500), p.MotorMove(1, 1000))
        board = session.board._board
        while board.steps(0) < 1000:
            session.run(0.001)
        ended = board.hal.now_ns
        session = rig()
        session.speed(1, 20_000, 400_000).speed(2, 20_000, 300_000).forget()
        session.accept(p.MotorMove(2, 500), p.MotorMove(1, 1000))
        board = session.board._board
        session.run((ended - board.hal.now_ns) * 1e-9 + (back - away) * 1e-3)
        for _ in range(away):
            tick(board)
        both = encode(MSG_MOTOR_STATUS, b"", 5) + encode(MSG_MOTOR_GET_POSITION, b"", 5)
        frames = [f for _ in range(300) for f in session.bytes_for(both, 0.001)]
        reported = [f for f in frames if f.type == MSG_MOTOR_GET_POSITION]
        statuses = [f for f in frames if f.type == MSG_MOTOR_STATUS]
        for frame, status in zip([f for f in reported if f.id == 5], statuses, strict=True):
            steps = p.Positions.unpack(frame.payload).steps[:2]
            moving = p.Status.unpack(status.payload).moving
            assert moving or steps == (1000, 500), (back, steps)
        unasked = [event for _, event in session.events(p.Positions)]
        unasked += [p.Positions.unpack(f.payload) for f in reported if f.id == 0]
        assert unasked[-1].steps[:2] == (1000, 500), back


@pytest.mark.needs("inside")
@pytest.mark.inside
@pytest.mark.parametrize("request_", [p.MotorGetPosition(), p.MotorStatus()])
def test_in_a_burst_of_requests(request_):
    """Each answer has its own time, although one pass answers all."""
    session = rig()
    session.speed(1, 20_000, 400_000).speed(2, 17_000, 300_000)
    session.accept(p.MotorMove(1, 30_000), p.MotorMove(2, -30_000)).run(0.012)
    pins = Pins(session)
    pins.origin = {1: 0, 2: 0}
    board = session.board._board
    handle = board.controller._handle
    answered = []

    def slowly(reader):
        if reader.type == MSG_MOTOR_GET_POSITION:
            answered.append(session.now)
        code = handle(reader)
        for _ in range(3):
            tick(board)
        return code

    board.controller._handle = slowly
    ask = encode(MSG_MOTOR_GET_POSITION, b"", 5)
    other = encode(request_.TYPE, b"", 6)
    frames = session.bytes_for((other * 3 + ask) * 4 + ask * 3)
    board.controller._handle = handle
    reported = [p.Positions.unpack(f.payload) for f in frames if f.id and len(f.payload) > 5]
    session.run(0.1)
    messages = list(zip(answered, reported, strict=True))
    assert len(messages) >= 7
    assert_of_one_moment(session, pins, messages)


def test_a_position_that_is_reset_while_others_move():
    session = rig()
    session.accept(p.MotorMove(1, 5000))
    session.run(0.1).accept(p.MotorResetPosition(2, 777))
    for _ in range(10):
        assert session.position(2) == 777
        session.run(0.003)


def test_a_position_that_is_reset_beside_a_run():
    """Field note 4.5: the motor is at rest and has no part in the run, which continues as
    uploaded."""
    session = loaded()
    session.accept(p.MotorConfigure(3, LIVE))
    session.ready(run_request(24, 1, FRAMES, 300, 300)).forget()
    session.accept(p.RtGo()).run(0.5)
    session.accept(p.MotorResetPosition(3, 777))
    assert session.position(3) == 777
    session.refuse(p.Ack.ERR_MOVING, p.MotorResetPosition(1, 0), p.MotorResetPosition(2, 0))
    session.accept(p.MotorMove(3, 1777))
    session.run(0.02).refuse(p.Ack.ERR_MOVING, p.MotorResetPosition(3, 0))
    session.until(p.RtEnd, 20).wait_idle()
    assert session.made(3) == 1000
    assert [session.position(motor) for motor in (1, 2, 3)] == [PATH[1][-1], PATH[2][-1], 1777]
