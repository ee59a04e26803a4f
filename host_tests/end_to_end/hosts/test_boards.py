"""The controller with the pins and counts of boards other than the Pico, in virtual time."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools.board.rig_file import read
from framestep_tools.building.board_files import ROOT, board_names
from framestep_tools.judge.judge import judge
from framestep_tools.payloads import (
    GioOut,
    HardStop,
    Hi,
    MotorConfigure,
    MotorMove,
    MotorSetLimits,
    RtEnd,
    RtGo,
)
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.session import Session, run_request

pytestmark = pytest.mark.needs("boards")


def session(name, rig=None):
    board = SimulatedBoard(rig, board=name)
    return Session(board, board._board.hal.motors), board


@pytest.mark.parametrize("name", board_names())
def test_example_rig_with_its_switches(name):
    """As in `make sim`, the motors move, because the stop button and the limit switches are
    there."""
    talk, board = session(name, read(ROOT / "boards" / name / "rig.json"))
    talk.run(2.0)
    talk.refuse(m.ERR_GENERAL, MotorMove(1, 100))
    board.wire_switches()
    talk.run(0.05)
    talk.forget()
    talk.accept(MotorSetLimits(1, 0, 0, 0, 0, min(1, talk.ask(Hi()).limit_sets)))
    for target in (100, -100):
        talk.ask(MotorMove(1, target))
        talk.wait_idle()
        assert talk.position(1) == target
    assert not talk.events(HardStop)


def test_twelve_motors():
    """Upload, run to the exact frames, limits of the last motor: everything with a bit or a word
    per motor."""
    twelve = tuple(range(1, 13))
    rig = {"estop": "nc"}
    talk, board = session("pico2", rig)
    board._board.set_input("estop", 0)
    talk.run(0.05)
    assert talk.ask(Hi()).motors == 12
    k = np.arange(30)
    moves = {i: np.round(100 * i * (1 - np.cos(2 * np.pi * k / 29))).astype(int) for i in twelve}
    for motor in twelve:
        talk.speed(motor, 20_000, 100_000)
    talk.upload(moves)
    talk.ready(run_request(24, 1, 30, 300, 300))
    stands = talk.positions
    talk.forget()
    talk.accept(RtGo())
    talk.client.wait_event(RtEnd, 10)
    talk.run(0.1)
    assert not talk.events(HardStop)
    verdict = judge(talk.trace(), moves, 24_000, stands, talk.positions)
    assert verdict.good, verdict.complaints
    talk.accept(*(MotorMove(motor, 40_000) for motor in twelve))
    assert tuple(talk.moving) == twelve
    talk.run(0.3)
    board._board.set_input("estop", 1)
    talk.run(0.5)
    assert not talk.moving
    assert [message for _, message in talk.events(HardStop)] == [HardStop(0)]


def test_limit_of_the_twelfth_motor():
    rig = {"motor_count": 12, "limits": [{"high": 23, "contact": "no"}]}
    talk, board = session("pico2", rig)
    talk.accept(MotorSetLimits(12, 0, 0, 0, 0, 1))
    talk.speed(12, 10_000, 50_000)
    talk.accept(MotorMove(12, 30_000), MotorMove(11, 2000))
    talk.run(0.5)
    board._board.set_input(23, 0)
    talk.run(0.5)
    assert [message for _, message in talk.events(HardStop)] == [HardStop(1, 12)]
    talk.refuse(m.ERR_HARD_UP, MotorMove(12, 30_000))
    assert talk.position(11) == 2000


@pytest.mark.parametrize("name", board_names())
def test_example_rig_file(name):
    """Every example starts, moves its motors, and stops at its E-stop."""
    talk, board = session(name, read(ROOT / "boards" / name / "rig.json"))
    hal = board._board.hal
    board._board.set_input("estop", 0)
    talk.run(0.6)  # until the drivers are set up
    talk.forget()  # forgets the E-stop before its button was there
    motors = tuple(range(1, hal.motors + 1))
    talk.accept(*(MotorMove(motor, 20_000) for motor in motors))
    talk.run(0.2)
    assert tuple(talk.moving) == motors
    board._board.set_input("estop", 1)
    talk.run(1.0)
    assert not talk.moving
    assert [message for _, message in talk.events(HardStop)] == [HardStop(0)]


def test_outputs_of_the_skr_pico():
    talk, board = session("skr_pico")
    names = [board._board.hal.names[pin] for pin in (20, 21, 23)]
    assert names == ["out1", "out2", "out3"]
    talk.forget()
    talk.accept(GioOut(5))
    levels = talk.trace().signals
    assert "out1" in levels
    assert "out3" in levels
    assert "out2" not in levels


def test_a_motor_that_is_not_there():
    talk, _ = session("pico", {"motor_count": 3})
    assert talk.ask(Hi()).motors == 3
    talk.refuse(m.ERR_RANGE, MotorMove(4, 10), MotorConfigure(4, 1))
    assert talk.ask(MotorMove(3, 10)).moving
