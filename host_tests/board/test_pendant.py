"""A hand wheel on the emulated board: its edges interrupt a board that moves motors and talks to a
host."""

import pytest

from framestep_tools import payloads as p
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.session import Session

A, B, ENABLE = 22, 26, 27
RIG = {"pendant": {"a": A, "b": B, "enable": ENABLE}}
ORDER = ((0, 0), (1, 0), (1, 1), (0, 1))


@pytest.fixture(scope="module")
def session():
    with EmulatedBoard(RIG) as board:
        yield Session(board, reply_s=0.1)


class Hand:
    def __init__(self, session):
        self.session = session
        self.emulator = session.board.emulator
        self.at = 0
        for pin, level in ((A, 0), (B, 0), (ENABLE, 0)):
            self.emulator.set_pin(pin, level)
        session.run(0.1)

    def turn(self, clicks, quarter_us):
        """Turn upward, with so long between the edges."""
        begun = self.session.board.now_ns
        for i in range(4 * clicks):
            self.at += 1
            pin = A if self.at & 1 else B
            self.emulator.set_pin(pin, ORDER[self.at & 3][(A, B).index(pin)])
            self.session.board.run_until(begun + (i + 1) * quarter_us * 1000)


@pytest.mark.parametrize("quarter_us", [pytest.param(1000, marks=pytest.mark.repeats), 250])
def test_no_click_is_lost_beside_motors_and_a_host(session, quarter_us):
    """1000 clicks a second: ten turns of a wheel with 100."""
    hand = Hand(session)
    before = session.position(1)
    for motor in (2, 3, 4):
        session.speed(motor, 20_000, 100_000)
        session.accept(p.MotorMove(motor, session.position(motor) + 12_000))
    for _ in range(10):
        hand.turn(30, quarter_us)
        session.ask(p.MotorStatus())
    session.wait_idle().run(0.3)
    assert session.position(1) - before == 300
