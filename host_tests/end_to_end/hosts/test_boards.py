"""The controller with the pins and counts of boards other than the Pico, in virtual time."""

from dataclasses import replace

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.board.rig_file import read
from framestep_tools.building.board_files import ROOT, board_names
from framestep_tools.judge.judge import judge
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.session import Session, run_request
from host_tests.end_to_end.virtual_axes.judging import XYZ, configured, pose

pytestmark = pytest.mark.needs("boards")


def session(name, rig=None, motors=None):
    board = SimulatedBoard(rig, motors, board=name)
    return Session(board, board._board.hal.motors)


@pytest.mark.parametrize("name", board_names())
def test_example_rig_file(name):
    """Every example starts, moves its motors once the stop button and the limit switches are there,
    as in `make sim`, and stops at its E-stop."""
    talk = session(name, read(ROOT / "boards" / name / "rig.json"))
    talk.run(2.0).refuse(m.ERR_GENERAL, p.MotorMove(1, 100))
    talk.board.wire_switches()
    talk.run(0.05).forget()
    talk.accept(p.MotorSetLimits(1, 0, 0, 0, 0, min(1, talk.ask(p.Hi()).limit_sets)))
    for target in (100, -100):
        talk.accept(p.MotorMove(1, target)).wait_idle()
        assert talk.position(1) == target
    assert not talk.events(p.HardStop)
    motors = tuple(range(1, talk.motors + 1))
    talk.accept(*(p.MotorMove(motor, 20_000) for motor in motors)).run(0.2)
    assert tuple(talk.moving) == motors
    talk.input("estop", 1).run(1.0)
    assert not talk.moving
    assert [message for _, message in talk.events(p.HardStop)] == [p.HardStop(0)]


@pytest.mark.parametrize("count", [12, 16, 24])
def test_many_motors(count):
    """Upload, run to the exact frames, E-stop: everything with a bit or a word per motor."""
    every = tuple(range(1, count + 1))
    talk = session("pico2", {"estop": "nc"}, count)
    talk.input("estop", 0)
    talk.run(0.05)
    assert talk.ask(p.Hi()).motors == count
    k = np.arange(30)
    moves = {i: np.round(100 * i * (1 - np.cos(2 * np.pi * k / 29))).astype(int) for i in every}
    for motor in every:
        talk.speed(motor, 20_000, 100_000)
    talk.upload(moves)
    talk.ready(run_request(24, 1, 30, 300, 300))
    stands = talk.positions
    talk.forget().accept(p.RtGo()).until(p.RtEnd, 10).run(0.1)
    assert not talk.events(p.HardStop)
    verdict = judge(talk.trace(), moves, 24_000, stands, talk.positions)
    assert verdict.good, verdict.complaints
    talk.accept(*(p.MotorMove(motor, 40_000) for motor in every))
    assert tuple(talk.moving) == every
    talk.run(0.3)
    talk.input("estop", 1)
    talk.run(0.5)
    assert not talk.moving
    assert [message for _, message in talk.events(p.HardStop)] == [p.HardStop(0)]


@pytest.mark.parametrize("end", [1, -1], ids=["upper", "lower"])
@pytest.mark.parametrize("last", [12, 16, 24])
def test_limit_of_the_last_motor(last, end):
    """The others go on. Its switch is found again by the pass, whatever the number of motors."""
    rig = {"limits": [{"high" if end > 0 else "low": 23, "contact": "no"}]}
    talk = session("pico2", rig, last)
    talk.accept(p.MotorSetLimits(last, 0, 0, 0, 0, 1)).speed(last, 10_000, 50_000)
    talk.accept(p.MotorMove(last, 30_000 * end), p.MotorMove(last - 1, 2000)).run(0.5)
    talk.input(23, 0)
    talk.run(0.5)
    reason, refused = (1, m.ERR_HARD_UP) if end > 0 else (2, m.ERR_HARD_LOW)
    assert [message for _, message in talk.events(p.HardStop)] == [p.HardStop(reason, last)]
    talk.refuse(refused, p.MotorMove(last, 30_000 * end))
    assert talk.position(last - 1) == 2000
    assert not talk.moving


@pytest.mark.parametrize("last", [16, 24])
def test_virtual_axes_of_the_last_motors(last):
    """The camera goes along its line by motors with high numbers only."""
    axes = tuple(replace(axis, motor=last - i) for i, axis in enumerate(XYZ.axes))
    talk = configured(replace(XYZ, axes=axes), motors=last)
    before = pose(talk)
    talk.accept(p.VirtMove(m.VIRT_MOTOR_EW, round(100000 * (before[1] + 5)))).run(0.2)
    assert talk.moving
    talk.wait_idle()
    assert pose(talk) == pytest.approx(before + [0, 5, 0, 0, 0, 0], abs=0.01)


def test_outputs_of_the_skr_pico():
    talk = session("skr_pico")
    names = [talk.board._board.hal.names[pin] for pin in (20, 21, 23)]
    assert names == ["out1", "out2", "out3"]
    talk.forget().accept(p.GioOut(5))
    levels = talk.trace().signals
    assert "out1" in levels
    assert "out3" in levels
    assert "out2" not in levels


def test_a_motor_that_is_not_there():
    talk = session("pico", {"motor_count": 3})
    assert talk.ask(p.Hi()).motors == 3
    talk.refuse(m.ERR_RANGE, p.MotorMove(4, 10), p.MotorConfigure(4, 1))
    assert talk.ask(p.MotorMove(3, 10)).moving
