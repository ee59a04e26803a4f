"""A hand wheel at the board, on the host simulation."""

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end.session import run_request, simulated

pytestmark = pytest.mark.needs("boards")

A, B, ENABLE, AXIS, STEP = 22, 26, 27, 28, 0
PENDANT = {"a": A, "b": B, "enable": ENABLE, "axis": AXIS, "step": STEP}
ORDER = ((0, 0), (1, 0), (1, 1), (0, 1))  # A, B for each quarter of a click, upward


class Hand:
    """Turns the wheel and presses the buttons."""

    def __init__(self, session):
        self.session = session
        self.board = session.board._board
        self.at = 0
        self._show()

    def _show(self):
        for pin, level in zip((A, B), ORDER[self.at & 3], strict=True):
            if (self.board.hal.levels() >> self.board.hal._place(pin)) & 1 != level:
                self.board.set_input(pin, level)

    def quarter(self, up=1):
        self.at += up
        self._show()

    def turn(self, clicks, per_s=100.0, after_s=0.6):
        """Turn by so many clicks at a steady rate, then hold still."""
        for _ in range(4 * abs(clicks)):
            self.quarter(1 if clicks > 0 else -1)
            self.session.run(0.25 / per_s)
        self.session.run(after_s)

    def hold(self, on=True):
        self.board.set_input(ENABLE, int(not on))
        self.session.run(0.05)

    def press(self, pin):
        for level in (0, 1):
            self.board.set_input(pin, level)
            self.session.run(0.05)


def rig(held=True, settings=None, **pendant):
    session = simulated({"pendant": {**PENDANT, **pendant}, "dmx": False, **(settings or {})})
    hand = Hand(session)
    session.run(0.05)
    if held:
        hand.hold()
    session.forget()
    return session, hand


@pytest.mark.parametrize("clicks", [1, -1, 3, -40])
@pytest.mark.parametrize("click", [1, 16])
def test_clicks(clicks, click):
    session, hand = rig(click=click)
    hand.turn(clicks)
    assert session.position(1) == clicks * click
    assert session.events(p.Positions), "positions are reported as for a jog"
    assert abs(session.steps(1)[1].sum()) == abs(clicks * click)


def test_back_and_forth():
    session, hand = rig()
    hand.turn(30, per_s=400, after_s=0)
    hand.turn(-50, per_s=300, after_s=0)
    hand.turn(21, per_s=1000)
    assert session.position(1) == 1


def test_a_fast_wheel_for_long():
    """Ten turns a second of a wheel with 100 clicks, at x1: no count is lost."""
    session, hand = rig()
    hand.turn(6000, per_s=1000)
    hand.turn(-2000, per_s=1000)
    assert session.position(1) == 4000


def test_only_while_the_button_is_held():
    session, hand = rig(held=False)
    hand.turn(5)
    assert session.position(1) == 0
    hand.hold()
    session.run(0.5)
    assert session.position(1) == 0, "clicks from before do not count"
    hand.turn(5)
    assert session.position(1) == 5
    session.speed(1, 200, 2000)
    hand.press(STEP)
    hand.turn(30, after_s=0.02)
    assert session.moving == [1]
    hand.hold(False)
    session.run(0.3)
    assert not session.moving


def test_axis_and_step_buttons():
    """The axis button goes on to the next motor, the step button to x10, x100 and x1."""
    session, hand = rig(motors=3)
    for motor in (1, 2, 3, 1):
        before = session.position(motor)
        hand.turn(2)
        assert session.position(motor) == before + 2
        hand.press(AXIS)
    hand.press(AXIS)
    hand.press(AXIS)
    before = session.position(1)
    for factor in (10, 100, 1):
        hand.press(STEP)
        hand.turn(1)
        assert session.position(1) - before == factor
        before = session.position(1)


def test_it_stops_when_the_wheel_stops():
    """The motor is slower than the wheel: clicks that it cannot follow are dropped, and it stops
    on a whole click."""
    session, hand = rig(click=16)
    session.speed(1, 1000, 10000)
    hand.turn(300, per_s=500, after_s=0)
    assert session.moving == [1]
    stopped = session.now
    session.wait_idle()
    assert session.steps(1)[0][-1] - stopped < 0.4
    assert session.position(1) % 16 == 0
    assert 600 < session.position(1) < 1200


@pytest.mark.parametrize("at", [(A, 0), (B, 1)])
def test_a_noisy_wire_moves_nothing(at):
    """An edge without its partner counts nothing, however often it comes."""
    session, hand = rig()
    pin, which = at
    level = ORDER[0][which]
    for _ in range(500):
        session.input(pin, 1 - level).run(0.001).input(pin, level).run(0.001)
    session.run(0.3)
    assert not session.moving
    assert len(session.steps(1)[0]) == 0
    hand.turn(3)
    assert session.position(1) == 3


def test_contacts_that_bounce():
    session, hand = rig()
    for _ in range(4 * 20):
        for way in (1, -1, 1, -1, 1):
            hand.quarter(way)
            session.run(0.001)
    session.run(0.5)
    assert session.position(1) == 20


def test_less_than_a_click_moves_nothing():
    session, hand = rig()
    for _ in range(3):
        hand.quarter()
        session.run(0.05)
    session.run(0.3)
    assert not len(session.steps(1)[0])
    hand.quarter()
    session.run(0.3)
    assert session.position(1) == 1


def test_limits():
    session, hand = rig(settings={"limits": [{"high": 1}]})
    session.board.wire_switches()
    session.run(0.1).accept(p.MotorSetLimits(1, 1, -4, 1, 30))
    hand.turn(50)
    assert session.position(1) == 30
    hand.turn(-50)
    assert session.position(1) == -4
    session.accept(p.MotorSetLimits(1, 0, 0, 0, 0, 1)).input(1, 1).run(0.05)
    hand.turn(5)
    assert session.position(1) == -4, "it is at its limit switch"
    hand.turn(-5)
    assert session.position(1) == -9


def nothing(session, hand):
    before = dict(session.positions)
    hand.turn(20)
    assert session.positions == before


def test_nothing_while_an_operation_is_prepared_or_runs():
    session, hand = rig()
    session.upload({2: np.arange(0, 240, 10)})
    session.ready(run_request(24, 1, 24, 500, 500))
    nothing(session, hand)
    session.accept(p.RtGo())
    hand.turn(40, per_s=50, after_s=0)
    session.until(p.RtEnd, 10).wait_idle().run(0.5)
    assert session.position(1) == 0
    hand.turn(4)
    assert session.position(1) == 4


def test_nothing_while_something_else_moves_it():
    session, hand = rig()
    session.accept(p.MotorMove(1, 3000))
    hand.turn(20)
    session.wait_idle()
    assert session.position(1) == 3000
    session.accept(p.MotorMove(2, 3000))
    hand.turn(4)
    assert session.position(1) == 3004


def test_estop_and_a_disabled_motor():
    session, hand = rig(settings={"estop": "nc"})
    session.input("estop", 0).run(0.05)
    hand.turn(50, after_s=0)
    session.input("estop", 1).wait_idle()
    nothing(session, hand)
    session.input("estop", 0).run(0.1).accept(p.MotorConfigure(1, 0))
    nothing(session, hand)


def test_without_a_host():
    session, hand = rig()
    session.leave().run(0.3)
    hand.turn(25)
    assert session.steps(1)[1].sum() == 25


def test_a_host_takes_over():
    """A MOVE while the wheel's motion is under way goes where the host says."""
    session, hand = rig()
    session.speed(1, 500, 5000)
    hand.turn(30, per_s=400, after_s=0)
    assert session.moving == [1]
    session.accept(p.MotorMove(1, -200))
    hand.turn(30, per_s=400, after_s=0)
    session.wait_idle()
    assert session.position(1) == -200
