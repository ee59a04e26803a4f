"""TMC2209 drivers behind the whole controller, in virtual time: enabled only after their set-up,
refused while they do not work, and the effect of a fault in motion."""

from collections import Counter

import numpy as np
import pytest

from framestep.motors import positions
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.simulator.boards import SimulatedBoard
from framestep_tools.simulator.driver_chips import STANDSTILL
from host_tests.end_to_end.motors.home_switches import trust
from host_tests.end_to_end.session import Session, deceleration, run_request

pytestmark = pytest.mark.needs("boards")

DRIVER = {"run_ma": 800}
RIG = {"motors": [{"driver": DRIVER}] * 4}
SET_UP_S = 0.6


def session(rig=None, dead=(), name="skr_pico"):
    board = SimulatedBoard(rig or RIG, board=name)
    for motor in dead:
        board.chips[motor - 1].powered = False
    return Session(board, 4), board


def said(board):
    return board._board.hal.said


def enables(talk):
    """Return [(motor, level, time in s)] of the enable pins so far."""
    found = []
    for motor in range(1, 5):
        signal = talk.trace().signals.get(f"enable{motor}")
        if signal is not None:
            found += [(motor, int(value), t * 1e-9) for t, value in zip(*signal, strict=True)]
    return sorted(found, key=lambda each: each[2])


def test_enabled_only_once_set_up():
    talk, board = session()
    assert talk.ask(p.GetCondition()).bits == m.CONDITION_DRIVER
    talk.refuse(m.ERR_GENERAL, p.MotorMove(1, 100), p.MotorJog(1, 100, 100), p.RtJogAll(24_000, 1))
    talk.accept(p.MotorConfigure(1, m.MOTOR_ENABLED))
    assert not enables(talk)
    talk.run(SET_UP_S)
    assert talk.ask(p.GetCondition()).bits == 0
    assert all(chip.bridges_on and len(chip.writes) == 12 for chip in board.chips)
    talk.accept(*(p.MotorMove(motor, 100) for motor in (1, 3))).wait_idle()
    assert [(motor, level) for motor, level, _ in enables(talk)] == [(1, 1), (3, 1)]
    assert talk.made(1) == talk.made(3) == 100
    assert not said(board)


@pytest.mark.each_processor
def test_a_dead_driver_holds_up_its_motor_and_every_run():
    talk, board = session(dead=(2,))
    talk.run(SET_UP_S)
    assert said(board) == ["driver of motor 2 does not answer (check its power and its address)"]
    assert talk.ask(p.GetCondition()).bits == m.CONDITION_DRIVER
    talk.refuse(m.ERR_GENERAL, p.MotorMove(2, 100))
    talk.accept(p.MotorMove(1, 100)).wait_idle()
    path = np.arange(10) * 10
    talk.upload({1: path})
    talk.refuse(m.ERR_GENERAL, run_request(end=10), p.RtPositionFrame(1), p.RtJogAll(24_000, 1))
    # a motor that the host does not use does not matter; nor does a driver that comes back
    talk.accept(p.MotorConfigure(2, 0), p.RtPositionFrame(1)).wait_idle()
    talk.accept(p.MotorConfigure(2, m.MOTOR_ENABLED))
    board.chips[1].powered = True
    talk.run(1.5)
    assert said(board)[1:] == ["driver of motor 2 works again"]
    assert talk.ask(p.GetCondition()).bits == 0
    talk.accept(p.MotorMove(2, 100)).wait_idle()
    assert talk.made(2) == 100


def test_coupled_to_a_dead_driver():
    talk, _ = session(dead=(2,))
    talk.run(SET_UP_S).accept(p.MotorConfigure(1, m.MOTOR_ENABLED | m.MOTOR_COUPLE))
    talk.refuse(m.ERR_GENERAL, p.MotorMove(1, 100))


def under_way(talk):
    """Start motors 1 and 2, whose positions are known, and wait until they cruise."""
    talk.run(SET_UP_S)
    for motor in (1, 2, 3, 4):
        talk.accept(p.MotorResetPosition(motor, 0)).speed(motor, 10_000, 50_000)
    talk.accept(p.MotorMove(1, 30_000), p.MotorMove(2, 30_000)).run(0.5)
    talk.client.events.clear()
    return talk.now


def assert_stopped(talk, board, at, lost):
    """Assert that all rest after ramps, the host knows, and the motor whose driver failed is off
    and its position lost."""
    assert not talk.moving
    assert [message for _, message in talk.events(p.HardStop)] == [p.HardStop(m.HARD_STOP_FAULT)]
    other = 3 - lost
    times, signs = talk.steps(other)
    assert times[-1] - at < 0.25 + 10_000 / 50_000 + 0.01
    assert deceleration(times, signs, times[-1] - 0.15) == pytest.approx(50_000, rel=0.1)
    assert trust(talk, lost) == (positions.LOST, positions.DRIVER)
    assert trust(talk, other) == (positions.KNOWN, positions.SET)
    assert [(motor, level) for motor, level, t in enables(talk) if t >= at] == [(lost, 0)]
    assert talk.position(other) == talk.made(other)


@pytest.mark.each_processor
@pytest.mark.provokes("fault")
def test_too_hot_in_motion():
    talk, board = session()
    at = under_way(talk)
    board.chips[0].status |= 2
    board.chips[0].gstat |= 2
    talk.run(1)
    assert said(board) == ["driver of motor 1 has switched off, too hot"]
    assert_stopped(talk, board, at, lost=1)
    talk.refuse(m.ERR_GENERAL, p.MotorMove(1, 0))
    board.chips[0].status &= ~2
    talk.run(1.5)
    # It moves again, but its position is lost until the host sets it
    assert trust(talk, 1) == (positions.LOST, positions.DRIVER)
    talk.accept(p.MotorResetPosition(1, 0), p.MotorMove(1, 50)).wait_idle()
    assert trust(talk, 1) == (positions.KNOWN, positions.SET)
    assert talk.position(1) == 50


@pytest.mark.provokes("fault")
def test_reset_in_motion():
    talk, board = session()
    at = under_way(talk)
    board.chips[1].reset()
    talk.run(1)
    assert said(board) == ["driver of motor 2 was reset: its supply broke down"]
    assert_stopped(talk, board, at, lost=2)
    talk.run(1)
    assert len(board.chips[1].writes) == 12  # set up again, and nothing has begun by itself
    assert [(motor, level) for motor, level, t in enables(talk) if t >= at] == [(2, 0)]


@pytest.mark.provokes("fault")
def test_no_answer_in_motion():
    talk, board = session()
    at = under_way(talk)
    board.chips[0].powered = False
    talk.run(1)
    assert_stopped(talk, board, at, lost=1)


def test_a_fault_of_a_driver_that_is_off_stops_nothing():
    talk, board = session()
    under_way(talk)
    board.chips[3].reset()
    talk.run(0.5)
    assert said(board) == ["driver of motor 4 was reset: its supply broke down"]
    assert tuple(talk.moving) == (1, 2)
    assert not talk.events(p.HardStop)
    assert trust(talk, 4) == (positions.KNOWN, positions.SET)


@pytest.mark.each_processor
def test_a_warning_stops_nothing():
    talk, board = session()
    under_way(talk)
    board.chips[0].status |= 1
    talk.run(0.5)
    assert said(board) == ["driver of motor 1 is hot, close to switching off"]
    assert tuple(talk.moving) == (1, 2)
    assert not talk.events(p.HardStop)


@pytest.mark.each_processor
def test_what_is_lost_on_the_wire_is_sent_again():
    """Every fifth write, question and answer."""
    talk, board = session()
    counts = Counter()

    def spoil(direction, data):
        kind = direction, len(data)
        counts[kind] += 1
        return data if counts[kind] % 5 else data[:-1]

    board._board.hal.driver_wire.spoil = spoil
    talk.run(1.5)
    assert talk.ask(p.GetCondition()).bits == 0
    assert all(chip.bridges_on and len(chip.writes) == 12 for chip in board.chips)
    assert len(counts) == 3
    assert min(counts.values()) > 5
    assert not said(board)


@pytest.mark.each_processor
def test_each_open_coil_is_reported_once():
    talk, board = session()
    talk.run(SET_UP_S)
    for status in (0x40, STANDSTILL, 0x80):  # coil A, then B
        board.chips[0].status = status
        talk.run(1)
    assert said(board) == ["driver of motor 1 finds no motor on one of its coils"] * 2


def test_drivers_of_a_pico():
    """One enable pin for all, the UART in place of the camera's outputs."""
    talk, board = session({"motors": [{"driver": DRIVER}, {}]}, name="pico")
    talk.refuse(
        m.ERR_GENERAL, p.MotorMove(1, 10), p.MotorMove(2, 10)
    )  # until the first round is over
    talk.run(SET_UP_S)
    assert len(board.chips[0].writes) == 12
    assert not board.chips[1].writes
    assert talk.ask(p.MotorMove(1, 10)).moving
    assert talk.ask(p.MotorMove(2, 10)).moving
