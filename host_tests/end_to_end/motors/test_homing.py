"""Homing on the host simulation, with switches that follow the motors (field note 4.9)."""

import numpy as np
import pytest

from framestep import boot, repl
from framestep.motors.positions import HELD, HOMED, HOMING, KNOWN, LOST, NOT_FOUND, NOT_OPENED
from framestep.rig.settings import RigError
from framestep_tools import payloads as p
from framestep_tools.client.wire import encode
from framestep_tools.errors import REFUSED
from host_tests.end_to_end.motors.home_switches import (
    HIGH,
    LOW,
    LOW_2,
    Switch,
    home,
    rails,
    reasons,
    trust,
)
from host_tests.end_to_end.session import assert_within, simulated

pytestmark = pytest.mark.needs("inside")

FREE = 150  # HOME's position of the switch, -50, and back_off, 200
CHATTER = [[1, 0, 1], [0, 1, 0, 1, 0], [1, 0], [1, 0, 1, 0]]


@pytest.mark.parametrize("toward, pin, at", [("low", LOW, -1700), ("high", HIGH, 1700)])
def test_position_is_counted_from_the_switch(toward, pin, at):
    upward = toward == "high"
    session, rail = rails(Switch(1, pin, at, upward), toward=toward)
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    away = -1 if upward else 1
    # by the rig file the switch is at -50, and the motor is 200 steps off it
    assert session.position(1) == -50 + 200 * away
    assert abs(rail.steps[1] - (at + 200 * away)) <= 1
    assert reasons(session) == []


def test_run_on_behind_the_switch_does_not_count():
    """The position counts from where the switch was found, not from where the motor rests."""
    session, rail = rails(Switch(1, LOW, -1700), slow_speed=2000)
    home(session, 1)
    assert session.steps(1)[1].cumsum().min() < -1700 - 20  # 25 steps by the hard stop
    assert session.position(1) - rail.steps[1] == pytest.approx(-50 + 1700, abs=3)


@pytest.mark.parametrize("speed, factor, least", [(2000, 4, 30), (4000, 1, 409), (4000, 16, 34)])
def test_the_least_back_off_is_more_than_the_run_on(speed, factor, least):
    """The rig file refuses less; with that much the motor homes."""
    rig = {"hard_stop_factor": factor}
    session, rail = rails(Switch(1, LOW, -1700), rig=rig, speed=speed, back_off=least)
    home(session, 1)
    run_on = -1700 - session.steps(1)[1].cumsum().min()
    assert least - speed / 500 - 2 < run_on < least
    assert rail.steps[1] == pytest.approx(-1700 + least, abs=1)
    with pytest.raises(RigError, match=f"back_off: found {least - 1}, allowed is {least} at least"):
        rails(rig=rig, speed=speed, back_off=least - 1)


def test_speeds():
    """Fast toward the switch and off it, slowly the second time, by the motor's acceleration and,
    at the switch, the hard stop."""
    session, _ = rails(Switch(1, LOW, -1700))
    home(session)
    times, signs = session.steps(1)
    assert_within(times, signs, 2000, 4 * 20000)
    turns = [i for i in range(1, len(signs)) if signs[i] != signs[i - 1]]
    assert len(turns) == 3  # toward, off, toward, off
    slow = times[turns[1] : turns[2]]
    assert len(slow) > 150
    assert np.diff(slow).min() > 0.9 / 200


def test_slower_than_a_motor_is_set_to():
    session, _ = rails(Switch(1, LOW, -300))
    session.speed(1, 500, 20000)
    home(session)
    times, signs = session.steps(1)
    assert_within(times, signs, 500, 4 * 20000)
    assert trust(session) == (KNOWN, HOMED)
    # and later motions have their own speed again: the slowest jog, a move
    session.forget().accept(p.MotorJog(1, 1, 3000)).run(0.4)
    session.accept(p.MotorStop(1)).wait_idle()
    assert 0 < len(session.steps(1)[0]) < 10
    session.speed(1, 5000, 20000).forget().accept(p.MotorMove(1, 3000)).wait_idle()
    times, _ = session.steps(1)
    assert np.diff(times).min() < 1.1 / 5000


@pytest.mark.parametrize("bounce", [CHATTER, [[1], [0], [1], [0]], [[1, 0]] * 15])
def test_bounce(bounce):
    session, rail = rails(Switch(1, LOW, -1700, bounce=bounce))
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    # the first contact counts
    assert session.position(1) == FREE
    assert abs(rail.steps[1] - (-1700 + 200)) <= 1


def test_it_stands_on_the_switch():
    session, rail = rails(Switch(1, LOW, 80))
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    assert abs(rail.steps[1] - (80 + 200)) <= 1
    assert session.position(1) == FREE


def test_switch_stays_closed():
    """It never opens again: the motor goes no further than its back-off, and its position is
    lost."""
    session, rail = rails(Switch(1, LOW, -1700))
    session.accept(p.Home(b"\1"))
    while not rail.switches[0].hit:
        session.run(0.01)
    rail.switches[0].works = False
    session.wait_idle()
    assert trust(session) == (LOST, NOT_OPENED)
    assert abs(rail.steps[1] - (-1700 + 200)) <= 4


def test_cable_of_a_closed_switch_is_broken():
    """It reads as an active switch: the motor backs off, no more."""
    session, rail = rails(Switch(1, LOW, -1700, works=False))
    session.input(LOW, 1).run(0.05)
    home(session, 1)
    assert trust(session) == (LOST, NOT_OPENED)
    assert rail.steps[1] == 200


def test_switch_is_not_found():
    """The switch is stuck, or an open contact has a broken cable: the motor stops after its
    travel."""
    session, rail = rails(Switch(1, LOW, -1700, works=False), travel=2500)
    session.accept(p.MotorResetPosition(1, 4000))
    home(session, 1)
    assert rail.steps[1] == -2500
    assert trust(session) == (LOST, NOT_FOUND)
    # and motors may move as before
    session.accept(p.MotorMove(1, 3000)).wait_idle()
    assert session.position(1) == 3000


def test_switch_is_not_found_again():
    session, rail = rails(Switch(1, LOW, -1700))
    session.accept(p.Home(b"\1"))
    while rail.steps.get(1, 0) > -1650 or not rail.switches[0].hit:
        session.run(0.01)
    rail.switches[0].at = -9000
    session.wait_idle()
    assert trust(session) == (LOST, NOT_FOUND)
    assert rail.steps[1] > -1700 - 300


def test_disturbance_on_the_slow_approach():
    """A spike is no switch: the position does not follow from it."""
    session, rail = rails(Switch(1, LOW, -1700))
    session.accept(p.Home(b"\1")).run(2.0)  # past the fast approach and off the switch
    assert rail.steps[1] == pytest.approx(-1600, abs=80)
    rail.hal.set_level(LOW, 1)
    rail.hal.set_level(LOW, 0)
    session.wait_idle()
    assert trust(session) == (LOST, NOT_FOUND)


def test_soft_limits_count_where_the_position_is_known():
    session, rail = rails(Switch(1, LOW, -1700, works=False), position=-500)
    session.accept(p.MotorResetPosition(1, 0), p.MotorSetLimits(1, 1, -800, 1, 3000))
    home(session, 1)
    assert rail.steps[1] == -800
    assert trust(session) == (LOST, NOT_FOUND)


def test_a_switch_past_a_soft_limit_is_refused():
    session, rail = rails(Switch(1, LOW, -1700))
    session.accept(p.MotorResetPosition(1, 0), p.MotorSetLimits(1, 1, -49, 1, 3000))
    session.refuse(p.Ack.ERR_SOFT_LOW, p.Home(b"\1"), p.Home())
    session.accept(p.MotorSetLimits(1, 0, 0, 1, -51), p.MotorResetPosition(1, -2000))
    session.refuse(p.Ack.ERR_SOFT_UP, p.Home(b"\1")).run(0.2)
    assert rail.steps == {}


def test_soft_limits_do_not_count_where_the_position_is_lost():
    """Afterwards they count again."""
    session, rail = rails(Switch(1, LOW, -1700))
    session.accept(p.MotorSetLimits(1, 1, -100, 1, 3000))
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    assert abs(rail.steps[1] - (-1700 + 200)) <= 1
    session.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, -101))
    session.refuse(p.Ack.ERR_SOFT_UP, p.MotorMove(1, 3001))
    session.accept(p.MotorMove(1, 3000))


def test_soft_limits_after_it_was_stopped():
    session, rail = rails(Switch(1, LOW, -1700))
    session.accept(p.MotorSetLimits(1, 1, -100, 1, 3000), p.Home(b"\1")).run(0.5)
    session.accept(p.MotorStop(1)).wait_idle()
    assert rail.steps[1] < -100
    session.refuse(p.Ack.ERR_SOFT_LOW, p.MotorMove(1, -5000))


THREE = {
    "motors": [
        {"home": {"limit": 1, "travel": 3000, "order": 2}},
        {},
        {"home": {"limit": 2, "travel": 3000, "order": 1}},
    ]
}


def test_order():
    session, rail = rails(Switch(1, LOW, -300), Switch(3, LOW_2, -200), rig=THREE)
    assert session.moving == []
    session.accept(p.Home())
    assert session.moving == [1, 3]
    seen = []
    while session.moving:
        if session.moving not in seen:
            seen.append(session.moving)
        session.run(0.02)
    assert seen == [[1, 3], [1]]
    first, second = session.steps(3)[0], session.steps(1)[0]
    assert first[-1] < second[0]
    assert trust(session, 1) == trust(session, 3) == (KNOWN, HOMED)
    assert trust(session, 2)[0] == LOST
    assert rail.steps[1] == pytest.approx(-100, abs=1)
    assert rail.steps[3] == pytest.approx(0, abs=1)


def test_one_that_fails_ends_the_others():
    session, rail = rails(Switch(1, LOW, -300), rig=THREE)
    home(session, 1, 3)
    assert trust(session, 3) == (LOST, NOT_FOUND)
    assert trust(session, 1) == (LOST, HOMING)
    assert rail.steps == {3: -3000}


def test_refused():
    session, rail = rails(Switch(1, LOW, -1700), rig={"estop": "nc"})
    session.input("estop", 0)
    session.run(0.1).refuse(p.Ack.ERR_RANGE, p.Home(b"\2"), p.Home(b"\0"), p.Home(b"\1\x09"))
    session.accept(p.MotorConfigure(1, 0))
    session.refuse(p.Ack.ERR_GENERAL, p.Home(), p.Home(b"\1"))
    session.accept(p.MotorConfigure(1, 1), p.MotorMove(1, 400))
    session.refuse(p.Ack.ERR_MOVING, p.Home(b"\1")).wait_idle()
    session.upload({2: [0, 10, 20]})
    session.accept(p.RtRunMove(24000, 1, 3, 500, 500))
    session.refuse(p.Ack.ERR_MOVING, p.Home(b"\1"))
    session.accept(p.MotorStopAll()).wait_idle().input("estop", 1)
    session.run(0.1).refuse(p.Ack.ERR_GENERAL, p.Home(b"\1"))
    assert trust(session)[1] != HOMING
    assert rail.steps[1] == 400


def test_a_rig_without_home_does_not_know_it():
    session = simulated()
    session.refuse(p.Ack.ERR_UNSUPPORTED, p.Home())


def test_what_is_refused_meanwhile():
    session, _ = rails(Switch(1, LOW, -1700))
    session.upload({2: [0, 10, 20]})
    session.accept(p.Home(b"\1"))
    for _ in range(40):  # in motion and in the pauses between
        assert 1 in session.moving
        session.refuse(
            p.Ack.ERR_MOVING, p.Home(b"\1"), p.MotorMove(1, 5), p.MotorJog(1, 5000, 5),
            p.MotorResetPosition(1, 5), p.MotorConfigure(1, 0), p.MotorConfigure(1, 3),
            p.MotorSetLimits(1, 0, 0, 0, 0), p.RtPositionFrame(2),
            p.RtRunMove(24000, 1, 3, 500, 500), p.RtShootFrame(2, 1, 100, 500),
            p.RtJogAll(24000, 3),
        )  # fmt: skip
        session.accept(p.MotorMove(3, 100), p.MotorSetLimits(4, 0, 0, 0, 0)).run(0.03)
    session.wait_idle()
    assert trust(session) == (KNOWN, HOMED)
    session.accept(p.MotorMove(1, 5), p.RtPositionFrame(2))


STOPS = {
    "STOP": lambda session: session.accept(p.MotorStop(1)),
    "STOP_ALL": lambda session: session.accept(p.MotorStopAll()),
    "E-stop": lambda session: session.input("estop", 1),
    # shorter than the motor's rest between two approaches
    "short E-stop": lambda session: session.input("estop", 1).run(0.03).input("estop", 0),
    "lost host": lambda session: session.leave().run(0.5).come_back(),
    # another one at the same end, assigned to the motor by SET_LIMITS
    "limit switch": lambda session: session.input(LOW_2, 1),
}
HARD = {"E-stop": [(0, None)], "short E-stop": [(0, None)], "limit switch": [(2, 1)]}


@pytest.mark.parametrize("after, known", [(0.3, True), (0.98, False), (1.1, True), (1.3, False)])
@pytest.mark.parametrize("stop", STOPS)
def test_stopped(stop, after, known):
    """In any phase, and between two of them, the motor comes to rest and stays there."""
    session, rail = rails(Switch(1, LOW, -1700), rig={"estop": "nc"})
    session.input("estop", 0).run(0.1).accept(p.MotorSetLimits(1, 0, 0, 0, 0, 2))
    if known:
        session.accept(p.MotorResetPosition(1, 4000))
    session.forget().accept(p.Home(b"\1")).run(after)
    assert session.moving == [1]
    STOPS[stop](session)
    session.run(0.6)
    if stop == "limit switch" and session.moving:
        session.wait_idle()  # it was backing off, and met the switch on the next approach
        session.run(0.3)
    assert session.moving == []
    before = dict(rail.steps)
    session.run(1.0)
    assert rail.steps == before
    assert trust(session) == (HELD if known else LOST, HOMING)
    assert reasons(session) == HARD.get(stop, [])


def test_what_comes_in_one_packet_with_a_stop():
    """Soft limits count at once, and another motor's homing does not change the first motor's
    state."""
    session, _ = rails(Switch(1, LOW, -1700), Switch(3, LOW_2, -200), rig=THREE)
    session.accept(p.MotorSetLimits(1, 1, -500, 1, 500), p.Home(b"\1")).run(0.3)
    requests = (p.MotorStop(1), p.MotorMove(1, -900), p.Home(b"\1"), p.Home(b"\3"))
    data = b"".join(encode(r.TYPE, r.pack(), 50 + i) for i, r in enumerate(requests))
    answers = {f.id: p.Ack.unpack(f.payload) for f in session.bytes_for(data)}
    ack = p.Ack
    assert answers == {50: ack.OK, 51: ack.ERR_SOFT_LOW, 52: ack.ERR_MOVING, 53: ack.ERR_MOVING}
    session.wait_idle()
    home(session, 3)
    assert trust(session, 3) == (KNOWN, HOMED)
    session.refuse(ack.ERR_SOFT_LOW, p.MotorMove(1, -900))


def test_switch_on_the_way_to_rest():
    """After a STOP the switch is a limit until the motor rests; then the setting of SET_LIMITS
    counts."""
    session, rail = rails(Switch(1, LOW, -700))
    session.accept(p.Home(b"\1"))
    while rail.steps.get(1, 0) > -650:
        session.run(0.001)
    session.accept(p.MotorStop(1)).wait_idle()
    assert rail.steps[1] < -700
    assert rail.steps[1] > -700 - 2000**2 / (2 * 4 * 20000) - 8
    session.accept(p.MotorMove(1, 0)).wait_idle().forget()
    session.accept(p.MotorMove(1, -750)).wait_idle()
    assert reasons(session) == []
    assert rail.steps[1] == -750


def test_limits_set_on_the_way_to_rest():
    session, _ = rails(Switch(1, LOW, -700))
    session.accept(p.Home(b"\1")).run(0.2)
    session.accept(p.MotorStop(1), p.MotorSetLimits(1, 0, 0, 0, 0, 1)).wait_idle()
    session.accept(p.MotorMove(1, -750)).wait_idle()
    assert reasons(session) == [(2, 1)]


def test_stop_of_another_motor_ends_nothing():
    session, _ = rails(Switch(1, LOW, -1700))
    session.accept(p.Home(b"\1"), p.MotorMove(2, 1000)).run(0.1)
    session.accept(p.MotorStop(2)).wait_idle()
    assert trust(session) == (KNOWN, HOMED)


def test_limit_of_another_motor():
    """It stops that motor, and homing continues."""
    session, _ = rails(Switch(1, LOW, -1700), Switch(2, LOW_2, -500))
    session.accept(p.MotorSetLimits(2, 0, 0, 0, 0, 2), p.Home(b"\1"), p.MotorMove(2, -4000))
    session.run(0.5)
    assert reasons(session) == [(2, 2)]
    assert session.moving == [1]
    session.wait_idle()
    assert trust(session) == (KNOWN, HOMED)


def test_limit_switch_that_is_the_home_switch():
    """Homing does not report it as a stop; in a move it is one, before and after homing."""
    session, _ = rails(Switch(1, LOW, -1700))
    session.accept(p.MotorSetLimits(1, 0, 0, 0, 0, 1))
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    assert reasons(session) == []
    session.accept(p.MotorMove(1, -3000)).wait_idle()
    assert reasons(session) == [(2, 1)]


def test_home_switch_is_no_limit_afterwards():
    """SET_LIMITS has not assigned it to the motor."""
    session, _ = rails(Switch(1, LOW, -1700))
    home(session, 1)
    session.accept(p.MotorMove(1, -400)).wait_idle()
    assert session.position(1) == -400
    assert reasons(session) == []


def test_coupled_motors():
    """Both move; the leader's position is set."""
    session, rail = rails(Switch(1, LOW, -600))
    session.accept(p.MotorConfigure(1, 0x11))
    session.refuse(p.Ack.ERR_RANGE, p.Home(b"\2"))
    home(session, 1)
    assert rail.steps[1] == rail.steps[2] == pytest.approx(-400, abs=1)
    assert trust(session) == (KNOWN, HOMED)
    assert session.position(1) == FREE
    session.accept(p.MotorMove(1, FREE + 100)).wait_idle()
    assert rail.steps[1] == rail.steps[2] == pytest.approx(-300, abs=1)


def test_backlash_and_jerk():
    rig = {"motors": [{"backlash": 40, "jerk": 400, "home": {"limit": 1, "travel": 5000}}]}
    session, rail = rails(Switch(1, LOW, -600), rig=rig)
    home(session)
    assert trust(session) == (KNOWN, HOMED)
    assert session.position(1) == 200
    # on the way back it takes up the play
    assert rail.steps[1] == pytest.approx(-600 + 200 + 40, abs=2)


def test_positions_at_the_end_of_the_range():
    session, rail = rails(Switch(1, LOW, -1700), position=-1_000_000_000)
    session.accept(p.MotorResetPosition(1, -(2**31) + 100))
    home(session, 1)
    assert rail.steps[1] == -100  # no farther than the lowest position
    assert trust(session) == (LOST, NOT_FOUND)
    session.accept(p.MotorResetPosition(1, 2**31 - 1))
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    assert session.position(1) == -1_000_000_000 + 200


@pytest.mark.provokes("pins")  # nothing on the port says that it has begun
def test_button():
    """Without a request it homes the motors whose position is lost."""
    settings = {"limits": [{"low": LOW}], "home_input": 1, "inputs": [{"pin": HIGH}]}
    session, rail = rails(Switch(1, LOW, -700), rig=settings)
    assert session.moving == []
    session.input(HIGH, 0).run(0.1)
    assert session.moving == [1]
    session.input(HIGH, 1).wait_idle()
    assert trust(session) == (KNOWN, HOMED)
    before = dict(rail.steps)
    session.input(HIGH, 0).run(0.5)
    assert rail.steps == before  # the position is known now


# ---- StallGuard


class End(Switch):
    """No switch but a TMC2209's DIAG: it is high while the motor pushes against the end of its
    rail, and low as soon as it rests."""

    def __post_init__(self):
        super().__post_init__()
        self.last = 0
        self.still = 0

    def levels(self, steps):
        self.still = 0 if steps != self.last else self.still + 1
        self.last = steps
        return [int(steps <= self.at and self.still < 5)]


def test_stall():
    """Homing finds the end of a rail twice, at the same speed."""
    rig = {
        "limits": [{"low": 22}],
        "motors": [
            {
                "driver": {"run_ma": 500, "microsteps": 32},
                "home": {"limit": 1, "travel": 3000, "stall": 60, "back_off": 300},
            }
        ],
    }
    session, rail = rails(End(1, 22, -700), rig=rig)
    session.run(1)
    chip = session.board.chips[0]
    # 12 MHz · 32 microsteps / (256 · 1000 steps/s) = 1500 clocks for a 256th of a step
    assert (chip.registers[0x14], chip.registers[0x40]) == (2250, 60)
    home(session, 1)
    assert trust(session) == (KNOWN, HOMED)
    assert session.position(1) == 300
    times, signs = session.steps(1)
    turns = [i for i in range(1, len(signs)) if signs[i] != signs[i - 1]]
    assert np.diff(times[turns[1] : turns[2]]).min() < 1.05 / 1000
    assert rail.steps[1] == pytest.approx(-700 + 300, abs=3)


# ---- the command, the REPL


@pytest.fixture
def framestep(said):
    """Return a command line on a session's board, which checks its status and gives its output."""
    return lambda session, line, status=0: said(session.leave().board, line, status)


def test_command(framestep):
    session, _ = rails(Switch(1, LOW, -300), Switch(3, LOW_2, -200), rig=THREE)
    assert framestep(session, "home") == "motor 1: 200, homed\nmotor 3: 200, homed"
    assert framestep(session, "home 3") == "motor 3: 200, homed"
    said = framestep(session, "status")
    assert "motor 3: 200, known: set by homing" in said


def test_command_that_fails(framestep):
    session, _ = rails(Switch(3, LOW_2, -200), rig=THREE)
    assert framestep(session, "home", REFUSED) == (
        "motor 3: 200, homed\n"
        "framestep: motor 1 is not homed; its position is lost: homing did not find its switch"
    )
    session, _ = rails(rig=THREE)
    assert framestep(session, "home 1 3", REFUSED) == (
        "framestep: motor 3 is not homed; its position is lost: homing did not find its switch; "
        "motor 1 is not homed"
    )


def test_refusals_of_the_command(framestep):
    session, _ = rails(rig=THREE)
    assert framestep(session, "home 2", REFUSED) == (
        "framestep: refused: the rig file has no `home` for motor 2 (docs/use/homing.md)"
    )
    assert framestep(session, "home 9", REFUSED) == (
        "framestep: refused: there is no motor 9, the device has motors 1 to 8"
    )
    session.come_back().accept(p.MotorResetPosition(1, 100), p.MotorSetLimits(1, 1, 1, 0, 0))
    assert framestep(session, "home 1", REFUSED) == (
        "framestep: refused: the position of a home switch is past the lower soft limit "
        "of its motor (set in Dragonframe's axis set-up, or in framestep console); "
        "soft limits count, as the position is known"
    )
    assert framestep(simulated(), "home", REFUSED) == (
        "framestep: refused: no motor has `home` in the rig file (docs/use/homing.md), "
        "or the firmware is older"
    )


@pytest.mark.inside
def test_repl(monkeypatch, capsys):
    session, _ = rails(Switch(1, LOW, -300), rig=THREE)
    board = session.board._board
    for name, value in (("hal", board.hal), ("controller", board.controller), ("runner", board)):
        monkeypatch.setattr(boot, name, value)

    def says(*motors):
        capsys.readouterr()
        repl.home(*motors)
        return capsys.readouterr().out

    assert says(2) == says(0) == says(9) == "refused: there is no such motor or value\n"
    assert says(1) == ""
    assert session.moving == [1]
    assert says(1).startswith("refused: it moves, is being homed")
    session.wait_idle()
    assert trust(session) == (KNOWN, HOMED)
    assert says() == ""
    session.wait_idle()
    board.controller.homing.report()
    assert capsys.readouterr().out == (
        "framestep: motor 3 did not find its home switch: its position is lost\n"
    )
    board = simulated().board._board
    monkeypatch.setattr(boot, "controller", board.controller)
    assert says(1) == "refused: no motor has `home` in the rig file\n"
