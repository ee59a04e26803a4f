"""Homing on the emulated board; the edges on the motor's pins open its switch."""

import pytest

from framestep.motors.positions import HOMED, HOMING, KNOWN, LOST, NOT_FOUND, NOT_OPENED
from framestep_tools import payloads as p
from host_tests.board.chips import on_pico
from host_tests.covering import sweep
from host_tests.end_to_end.motors.home_switches import trust
from host_tests.end_to_end.session import Session

SWITCH, SPEED, BACK = 22, 3000, 150
RIG = {
    "limits": [{"low": SWITCH}],
    "motors": [
        {
            "home": {
                "limit": 1,
                "travel": 3000,
                "speed": SPEED,
                "slow_speed": 500,
                "back_off": BACK,
                "position": 1000,
            }
        }
    ],
}
RUN_ON = SPEED**2 / (2 * 4 * 20000)  # steps of the hard stop


class Rail:
    """A rail that motor 1 moves by its edges; at a step and below it opens the switch."""

    def __init__(self, session, at, bounce=(), stuck=None):
        """bounce: levels of the switch after each change, one each millisecond. stuck: a level that
        it keeps once it has it."""
        self.session = session
        self.emulator = session.board.emulator
        self.at = at
        self.bounce = bounce
        self.stuck = stuck
        self.steps = self.lowest = 0
        self.level = int(self.steps <= at)
        self.coming = [self.level]
        self._switch()

    def _switch(self):
        level = int(self.steps <= self.at)
        if level != self.level and self.level != self.stuck:
            self.level = level
            self.coming = [*self.bounce, level]
        if self.coming:
            self.emulator.set_pin(SWITCH, self.coming.pop(0))

    def run(self, ms):
        for _ in range(ms):
            self.session.run(0.001)
            for _, signal, value in sorted(self.session.board.edges()):
                if signal == "m1":
                    self.steps += value
                    self.lowest = min(self.lowest, self.steps)
            self._switch()

    def run_until_at_rest(self):
        while self.session.moving:
            self.run(20)
        self.run(20)


@pytest.fixture(scope="module")
def session(chip):
    with chip.emulated(RIG) as board:
        board.wire_switches()
        yield Session(board, reply_s=0.1)


def test_home(session):
    """While a call in C on the REPL holds the main loop up for more than a second, the motor
    reaches its switch: it makes the hard stop nevertheless, and homing continues. The REPL shows
    it."""
    repl = session.board.emulator.repl()
    repl.exec("import time")
    rail = Rail(session, -700)
    session.accept(p.Home())
    rail.run(100)
    repl.start("x = sum(range(60000))\ntime.sleep_ms(1500)")
    rail.run(500)
    assert rail.steps < -700, "it has not come to its switch"
    assert rail.lowest >= -700 - RUN_ON - 0.004 * SPEED
    rail.run_until_at_rest()
    assert repl.finish(2) == ""
    assert repl.unasked() == "framestep: motor 1 is homed\n"
    assert trust(session) == (KNOWN, HOMED)
    assert session.position(1) == 1000 + BACK
    assert abs(rail.steps - (-700 + BACK)) <= 1
    assert session.events(p.HardStop) == []


@on_pico
def test_stop(session):
    """In the fast approach; soft limits do not count, because the position is lost."""
    session.board.emulator.repl().exec(
        "import framestep.boot as b; b.controller.axes.positions.put(0, 0, 0)"
    )
    rail = Rail(session, -2000)
    session.accept(p.MotorSetLimits(1, 1, 900, 1, 5000), p.Home(b"\1"))
    rail.run(200)
    session.accept(p.MotorStop(1))
    rail.run_until_at_rest()
    assert rail.steps < -160
    assert trust(session) == (LOST, HOMING)
    session.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, 300))


def lost(session):
    """Yield the state after power-up: the position is lost, without soft limits."""
    session.board.emulator.repl().exec(
        "import framestep.boot as b; b.controller.axes.positions.put(0, 0, 0)"
    )
    session.accept(p.MotorSetLimits(1, 0, 0, 0, 0))
    session.forget()


@on_pico
@pytest.mark.parametrize(
    "bounce", sweep([(0, 1, 0), (1, 0, 1, 1, 0, 1, 0, 0, 1)], (1, 0, 1, 1, 0, 1, 0, 0, 1))
)
def test_bounce(session, bounce):
    """The first contact of the slow approach counts, and contacts after the switch has opened do
    not end homing."""
    lost(session)
    rail = Rail(session, -400, bounce)
    session.accept(p.Home())
    rail.run_until_at_rest()
    assert trust(session) == (KNOWN, HOMED)
    assert session.position(1) == 1000 + BACK
    # the switch may be found as many milliseconds late as it bounces
    assert -len(bounce) <= rail.steps - (-400 + BACK) <= 1
    assert session.events(p.HardStop) == []


@on_pico
@pytest.mark.parametrize(
    ("at", "stuck", "reason", "low", "high"),
    [
        pytest.param(-400, 0, NOT_FOUND, -3000, -3000, id="stuck closed"),
        pytest.param(-400, 1, NOT_OPENED, -400 - RUN_ON - 12, -400 + BACK + 12, id="stuck open"),
        pytest.param(5000, 1, NOT_OPENED, 0, BACK, id="cable broken"),
    ],
)
def test_switch_that_does_not_work(session, at, stuck, reason, low, high):
    """The motor goes no further than its travel or its back-off; its position is lost."""
    lost(session)
    rail = Rail(session, at, stuck=stuck)
    session.accept(p.Home())
    rail.run_until_at_rest()
    assert trust(session) == (LOST, reason)
    assert low <= rail.lowest <= rail.steps <= high
    rail.stuck, rail.at = None, -10_000
    rail.run(50)
    session.forget()


@on_pico
def test_a_gantry(chip):
    """Two coupled motors; their switches are 70 steps apart."""
    second, at = 26, {1: -700, 2: -630}
    first = RIG["motors"][0]["home"]
    rig = {
        "limits": [{"low": SWITCH}, {"low": second}],
        "motors": [
            {"home": {**first, "square_within": 100, "square": 10}},
            {"home": {**first, "limit": 2}},
        ],
    }
    with chip.emulated(rig) as board:
        board.wire_switches()
        session = Session(board, reply_s=0.1)
        session.accept(p.MotorConfigure(1, 0x11), p.Home(b"\1"))
        steps, apart = {1: 0, 2: 0}, 0
        while session.moving:
            for _ in range(20):
                session.run(0.001)
                for _, signal, value in sorted(session.board.edges()):
                    if signal in ("m1", "m2"):
                        steps[int(signal[1])] += value
                apart = max(apart, abs(steps[1] - steps[2]))
                for motor, pin in ((1, SWITCH), (2, second)):
                    board.emulator.set_pin(pin, int(steps[motor] <= at[motor]))
        assert trust(session, 1) == trust(session, 2) == (KNOWN, HOMED)
        assert steps[1] == pytest.approx(at[1] + BACK, abs=1)
        assert steps[2] == pytest.approx(at[2] + BACK + 10, abs=1)
        assert apart < 70 + RUN_ON + 20


class BothEnds(Rail):
    """A rail of 2000 steps with a switch at each end, in series on one input. at: the step of the
    motor's first position, from the lower end."""

    def _switch(self):
        level = int(not 0 < self.at + self.steps < 2000)
        if level != self.level:
            self.level = level
            self.coming = [*self.bounce, level]
        if self.coming:
            self.emulator.set_pin(SWITCH, self.coming.pop(0))


@on_pico
def test_both_switches_on_one_input(chip):
    """Homing begins on the upper one; then each end stops the motor."""
    with chip.emulated({**RIG, "limits": [{"pin": SWITCH, "ends": "both"}]}) as board:
        board.wire_switches()
        session = Session(board, reply_s=0.1)
        rail = BothEnds(session, 2010, bounce=(0, 1, 0, 1))
        rail.run(50)
        session.accept(p.MotorSetLimits(1, 0, 0, 0, 0, 1), p.Home(b"\1"))
        rail.run_until_at_rest()
        assert trust(session) == (KNOWN, HOMED)
        assert 2010 + rail.steps == pytest.approx(BACK, abs=1)
        assert 2010 + rail.lowest > -RUN_ON - 4 * SPEED / 1000  # after 4 ms of bounce
        session.forget()
        for target, code in ((4000, p.Ack.ERR_HARD_UP), (-4000, p.Ack.ERR_HARD_LOW)):
            session.accept(p.MotorMove(1, target))
            rail.run_until_at_rest()
            session.refuse(code, p.MotorMove(1, target))
        assert [(event.reason, event.motor) for _, event in session.events(p.HardStop)] == [
            (1, 1),
            (2, 1),
        ]
