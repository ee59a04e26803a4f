"""Switches of both ends of an axis on one input: a rail from 0 to LENGTH, with a switch at each
end, wired in series."""

import pytest

from framestep.motors.positions import HOMED, KNOWN, LOST, NOT_OPENED
from framestep_tools import payloads as p
from host_tests.end_to_end.motors.home_switches import (
    HOME,
    Switch,
    home,
    on_rails,
    reasons,
    trust,
)

pytestmark = pytest.mark.needs("inside")

PIN = 22
LENGTH = 5000
BACK_OFF = 200
STOPS = (60, -60)  # a motor comes to rest so far behind a switch, at 2000 steps/s


class Ends(Switch):
    """Both switches: closed between 0 and LENGTH steps from where the rail begins."""

    def levels(self, steps):
        at = steps + self.at
        hit = at <= 0 or at >= LENGTH
        if hit == self.hit or not self.works:
            return self.pending.pop(0) if self.pending else []
        self.hit = hit
        self.pending = [*self.bounce, [int(hit)]]
        return self.pending.pop(0)


def rail_from(start, bounce=(), limits=None, **more):
    """Return (session, rails): a motor that begins `start` steps above its lower switch."""
    settings = {
        "limits": [{"pin": PIN, "ends": "both", **(limits or {})}],
        "motors": [{"home": {**HOME, "travel": 6000, "back_off": BACK_OFF, **more}}],
    }
    return on_rails(settings, Ends(1, PIN, start, bounce=list(bounce)))


def assign(session):
    session.accept(p.MotorSetLimits(1, 0, 0, 0, 0, 1))


def go(session, to, speed=2000):
    session.speed(1, speed, 20000).accept(p.MotorMove(1, to)).wait_idle()


@pytest.mark.parametrize("toward", ["low", "high"])
@pytest.mark.parametrize("assigned", [False, True])
@pytest.mark.parametrize(
    "start", [-150, -60, -1, 0, 1, 199, 200, 201, 2500, 4800, 4999, 5000, 5001, 5060, 5150]
)
def test_homing_from_every_start(start, assigned, toward):
    """It finds its switch, and goes no farther into an end than back_off."""
    session, rail = rail_from(start, toward=toward)
    if assigned:
        assign(session)
    lowest = highest = start
    session.accept(p.Home(b"\1"))
    while session.moving:
        session.run(0.02)
        at = start + rail.steps.get(1, 0)
        lowest, highest = min(lowest, at), max(highest, at)
    assert trust(session) == (KNOWN, HOMED)
    rest = BACK_OFF if toward == "low" else LENGTH - BACK_OFF
    assert start + rail.steps[1] == pytest.approx(rest, abs=1)
    assert session.position(1) == (150 if toward == "low" else -250)
    assert lowest >= min(start - BACK_OFF - 1, -60)
    assert highest <= max(start + BACK_OFF + 1, LENGTH + 60)
    assert reasons(session) == []


@pytest.mark.parametrize("bounce", [[[1], [0], [1], [0]], [[1, 0]] * 15])
@pytest.mark.parametrize("start", [-60, 2500, 5060])
def test_homing_with_bounce(start, bounce):
    session, rail = rail_from(start, bounce)
    assign(session)
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    assert start + rail.steps[1] == pytest.approx(BACK_OFF, abs=1)


@pytest.mark.parametrize(
    "end, reason, into, away", [(1, 1, 3000, -2000), (0, 2, -3000, 2000)], ids=["upper", "lower"]
)
def test_only_away_from_where_it_was_hit(end, reason, into, away):
    """The other end's switch stops the motor as well."""
    session, rail = rail_from(2500)
    assign(session)
    go(session, into)
    edge = LENGTH if end else 0
    at = 2500 + rail.steps[1]
    assert abs(at - edge) < 40
    assert reasons(session) == [(reason, 1)]
    code = p.Ack.ERR_HARD_UP if end else p.Ack.ERR_HARD_LOW
    session.refuse(code, p.MotorMove(1, into), p.MotorJog(1, 5000, into))
    assign(session)  # as a host does once more when it connects
    session.refuse(code, p.MotorMove(1, into)).forget()
    go(session, away)
    assert rail.steps[1] == away
    assert reasons(session) == []
    go(session, 2 * away)
    assert abs(2500 + rail.steps[1] - (LENGTH - edge)) < 40
    assert reasons(session) == [(3 - reason, 1)]


def test_it_stops_again_on_the_way_into_the_end():
    """After a short way back."""
    session, rail = rail_from(2500)
    assign(session)
    go(session, 3000)
    for _ in range(3):
        go(session, 2400)
        session.run(0.1).forget()
        go(session, 3000)
        assert reasons(session) == [(1, 1)]
        assert 0 <= 2500 + rail.steps[1] - LENGTH < 40


def test_a_noisy_switch_does_not_count_as_the_other_end():
    """It closes and opens once more on the way back: that is still the upper end."""
    session, rail = rail_from(2500)
    assign(session)
    go(session, 3000)
    session.accept(p.MotorMove(1, 2300))
    while 2500 + rail.steps[1] > LENGTH - 100:
        session.run(0.001)
    rail.hal.set_level(PIN, 1)
    session.run(0.05)
    rail.hal.set_level(PIN, 0)
    session.wait_idle().run(0.1)
    assert rail.steps[1] == 2300
    assert reasons(session) == [(1, 1)]
    go(session, 3000)
    assert reasons(session) == [(1, 1)] * 2


@pytest.mark.provokes("acceleration")  # pressed long before
def test_a_switch_that_stays_pressed_stops_the_way_back():
    """Its wire has broken: there would be no switch at the other end."""
    session, rail = rail_from(2500)
    assign(session)
    go(session, 3000)
    rail.switches[0].works = False
    at = rail.steps[1]
    session.forget()
    go(session, -2000)
    assert reasons(session) == [(2, 1)]
    assert 2 * BACK_OFF <= at - rail.steps[1] < 2 * BACK_OFF + 60
    session.refuse(p.Ack.ERR_HARD_LOW, p.MotorMove(1, 0))
    session.refuse(p.Ack.ERR_HARD_UP, p.MotorMove(1, 3000))


@pytest.mark.parametrize("start", [-20, 5020])
def test_pressed_at_the_start(start):
    """Nobody knows which end it is: neither direction is allowed, until homing finds out."""
    session, rail = rail_from(start)
    assign(session)
    session.refuse(p.Ack.ERR_HARD_UP, p.MotorMove(1, 500))
    session.refuse(p.Ack.ERR_HARD_LOW, p.MotorMove(1, -500))
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    go(session, 2000)
    assert start + rail.steps[1] == pytest.approx(2050, abs=1)


@pytest.mark.provokes("acceleration")  # broken long before
def test_homing_with_a_broken_wire():
    """It reads as pressed: homing tries both directions, neither for long."""
    session, rail = rail_from(2500)
    rail.switches[0].works = False
    rail.hal.set_level(PIN, 1)
    session.run(0.1)
    seen = [0]
    session.accept(p.Home(b"\1"))
    while session.moving:
        session.run(0.02)
        seen.append(rail.steps.get(1, 0))
    assert trust(session) == (LOST, NOT_OPENED)
    assert max(seen) <= BACK_OFF
    assert min(seen) > -2 * BACK_OFF - 60


def test_position_set_on_the_switch():
    """The new number does not make the switch another end's."""
    session, rail = rail_from(2500)
    assign(session)
    go(session, 3000)
    session.accept(p.MotorResetPosition(1, -100000)).forget()
    session.refuse(p.Ack.ERR_HARD_UP, p.MotorMove(1, -99000))
    at = rail.steps[1]
    go(session, -101000)
    assert rail.steps[1] == at - 1000
    assert reasons(session) == []


def test_pushed_by_hand_to_the_other_end():
    """The switch opens and is pressed again at rest: nobody knows which end it is any more, and
    homing does not drive into the end."""
    session, rail = rail_from(2500)
    assign(session)
    go(session, 3000)
    at = rail.steps[1]
    switch = rail.switches[0]
    switch.at = 2500 - at  # in the middle
    session.run(0.5)
    switch.at = -20 - at  # on the lower switch
    session.run(0.5).refuse(p.Ack.ERR_HARD_LOW, p.MotorMove(1, 0))
    session.refuse(p.Ack.ERR_HARD_UP, p.MotorMove(1, 3000))
    lowest = rail.steps[1]
    session.accept(p.Home(b"\1"))
    while session.moving:
        session.run(0.02)
        lowest = min(lowest, rail.steps[1])
    assert trust(session) == (KNOWN, HOMED)
    assert lowest + switch.at > -60


def test_a_motor_without_home():
    session, rail = on_rails({"limits": [{"pin": PIN}]}, Ends(1, PIN, 2500))
    assign(session)
    go(session, -3000)
    assert reasons(session) == [(2, 1)]
    go(session, 0)
    assert rail.steps[1] == 0


def test_stop_while_it_tries_an_end():
    """It stays at rest, and the switch counts for both ends again."""
    session, rail = rail_from(5020)
    assign(session)
    session.accept(p.Home(b"\1")).run(0.5)
    session.accept(p.MotorStopAll()).wait_idle()
    at = rail.steps[1]
    assert 0 < at < BACK_OFF
    session.run(0.5)
    assert rail.steps[1] == at
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
