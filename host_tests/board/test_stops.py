"""Requests that follow each other closely on the emulated board, where planning takes time and
ticks continue meanwhile."""

import pytest

from framestep_tools import payloads as p
from host_tests.board.conftest import on_pico
from host_tests.end_to_end.session import Session
from host_tests.selection import sweep

RIG = {"motors": [{"jerk": 0}, {"jerk": 0}, {"jerk": 100, "backlash": 24}, {"jerk": 100}]}


@pytest.fixture(scope="module")
def session(chip):
    with chip.emulated(RIG) as board:
        session = Session(board, reply_s=0.1)
        for motor in 1, 2, 3, 4:
            session.speed(motor, 5000, 20_000)
        session.accept(p.MotorConfigure(1, 1 | 0x20), p.MotorConfigure(3, 1 | 0x10))
        yield session


@on_pico
@pytest.mark.parametrize("motor", sweep([1, 3], 3))
@pytest.mark.parametrize(
    "requests", [2 * [p.MotorStopAll()], [p.MotorStopAll()], []], ids=["hard stop", "stop", "move"]
)
def test_a_move_at_once_after_a_stop(session, motor, requests):
    """The motion is 10 to 70 ms old: the plan is ready in time or waits, and no queue runs dry
    (HARD_STOP 100)."""
    for k in range(12):
        session.accept(p.MotorMove(motor, 3000 if k % 2 else -3000)).run(0.010 + 0.0052 * k)
        for request in requests:
            session.client.code(request)
        session.accept(p.MotorMove(motor, 5 * k)).wait_idle()
        assert session.events(p.HardStop) == []
        assert session.position(motor) == 5 * k


def test_a_stream_of_anything(session):
    """Jogs to and fro, stops and moves every few milliseconds, of a plain pair and of a pair with
    jerk limit and play."""
    requests = [p.MotorJog, p.MotorMove, p.MotorStop, p.MotorJog]
    for k in range(60):
        for motor in 1, 3:
            kind = requests[(k * 7 // 3 + motor) % 4]
            target = (-1) ** (k // 3) * 4000
            session.ask(
                kind(motor)
                if kind is p.MotorStop
                else kind(motor, *([6000] if kind is p.MotorJog else []), target)
            )
        session.run(0.003 * (k % 9))
    for motor in 1, 3:
        session.accept(p.MotorMove(motor, 100))
    session.wait_idle()
    assert session.events(p.HardStop) == []
    found = session.positions
    assert [found[motor] for motor in (1, 2, 3, 4)] == [100, -100, 100, found[4]]
