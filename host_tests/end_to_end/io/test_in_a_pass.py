"""Ticks, the E-stop's interrupt and answers to questions in the middle of a pass."""

import numpy as np
import pytest

from framestep.hal.host_board import TICK_NS
from framestep.motors.positions import LOST
from framestep.protocol import messages as m
from framestep.pulse import stepper
from framestep_tools import payloads as p
from framestep_tools.client.wire import FrameDecoder, encode
from host_tests.end_to_end.session import run_request, simulated

pytestmark = pytest.mark.inside


def ticks(board, count):
    """Let ticks pass without the main loop."""
    for _ in range(count):
        board.hal.now_ns = board.next_tick
        board.hal.tick()
        board.next_tick += TICK_NS


def frame(request, id=9):
    return encode(request.TYPE, request.pack(), id)


@pytest.mark.parametrize("motor", [1, 2, 8])
def test_the_estop_while_motors_are_planned(motor):
    """Pressed just before this motor's plan begins: it does not start, nor do those after it."""
    session = simulated({"estop": "nc"})
    board = session.board._board
    session.input("estop", 0).run(0.05)
    for each in range(1, 9):
        session.speed(each, 50_000, 1_000_000)
    session.upload({each: [0, 4000] for each in range(1, 9)})
    session.accept(p.RtPositionFrame(1)).wait_idle()
    for axis in board.controller.axes.axes:

        def move_to(*args, axis=axis, move_to=axis.move_to):
            if axis is board.controller.axes[motor - 1]:
                session.input("estop", 1)
            result = move_to(*args)
            ticks(board, 2)
            return result

        axis.move_to = move_to
    session.code(p.RtPositionFrame(2))
    session.run(0.3)
    assert not any(board.steps(i) for i in range(motor - 1, 8))
    assert all(board.steps(i) < 200 for i in range(motor - 1))


@pytest.mark.parametrize("away", [0, 20])
def test_a_motor_that_stops_before_the_pass_has_lost_its_position(away):
    """The E-stop cuts the drivers' power, and the pass that sees it comes milliseconds later."""
    session = simulated({"estop": "nc", "estop_cuts_power": True}, motors=2)
    board = session.board._board
    session.input("estop", 0).run(0.05).accept(p.MotorResetPosition(1, 0))
    session.speed(1, 1000, 20_000).accept(p.MotorMove(1, 100)).run(0.06).input("estop", 1)
    ticks(board, away)
    session.run(0.1)
    assert board.controller.axes.positions.states[0] == LOST
    session.accept(p.MotorResetPosition(1, 0)).input("estop", 0).run(0.1)
    session.input("estop", 1).run(0.1)
    assert board.controller.axes.positions.states[0] != LOST  # at rest this time


def test_no_signal_of_a_run_outlives_a_fault():
    """Ticks give cues while a fault stops the motors, at moments around a shutter's opening."""

    def signals(board):
        return [int(board.trace().signals[name][1][-1]) for name in ("shutter", "meter")]

    for ms in range(640, 690, 2):
        session = simulated()
        frames = np.arange(24)
        session.upload({motor: (frames * 20).tolist() for motor in range(1, 9)})
        stills = {"flags": m.RUN_STILLS, "open_angle": 90, "close_angle": 180}
        session.ready(run_request(24, 1, 24, 500, 500, **stills))
        session.accept(p.RtGo())
        board = session.board._board
        board.run_until(board.now_ns + ms * 1_000_000)
        axis = board.controller.axes[7]

        def stop(*args, axis=axis, board=board, stop=axis.stop):
            axis.stop = stop
            ticks(board, 2)
            return stop(*args)

        axis.stop = stop
        board.controller.stops.fault_stop()
        session.run(1)
        assert signals(session) == [0, 0], ms


def test_the_answer_that_ends_a_run_of_lights():
    """RT_END comes before the answer to the next request."""
    for ms in range(290, 310):
        session = simulated(motors=1)
        session.accept(p.RtUploadMoveBegin(1, 3), p.RtUploadMoveDmx(1, 0, [10, 20, 30]))
        session.accept(p.RtUploadMoveEnd())
        run = run_request(fps=10, start=1, end=3, pre=0, post=0, sync_dmx=1)
        session.accept(run).wait_idle()
        session.accept(p.RtGo())
        board = session.board._board
        board.run_until(board.now_ns + ms * 1_000_000)
        board.receive(frame(p.Hi(), 3))
        board.hal.port.ask()
        board.controller.poll(board.hal.ticks_ms())
        board.receive(frame(p.MotorStatus(), 4) + frame(run, 5))
        board.controller.poll(board.hal.ticks_ms())
        board.run_until(board.now_ns + 500_000_000)
        frames = FrameDecoder().feed(board.transmit())
        ended = [each.type for each in frames].index(m.MSG_RT_END)
        assert ended < [each.id for each in frames].index(4) or frames[-1].type == m.MSG_RT_END


def test_move_time_of_motors_that_come_to_rest_after_the_sample():
    for ms in range(105, 114):
        session = simulated(motors=1)
        board = session.board._board
        session.speed(1, 20_000, 400_000).upload({1: [0, 1000]})
        session.accept(p.RtPositionFrame(2)).run((ms - 20) / 1000)
        ticks(board, 14)
        axes = board.controller.axes

        def choose(choose=axes.choose_sample, board=board):
            tick = choose()
            ticks(board, 1)
            return tick

        axes.choose_sample = choose
        board.receive(frame(p.MotorGetPosition()))
        board.controller.poll(board.hal.ticks_ms())
        (answer,) = (each for each in FrameDecoder().feed(board.transmit()) if each.id == 9)
        told = p.Positions.unpack(answer.payload)
        assert told.move_time != 2000 or told.steps[0] == 1000, ms


def test_a_fault_that_a_tick_adds_while_one_is_handled():
    session = simulated(motors=1)
    controller = session.board._board.controller
    stops, header = controller.stops, controller.header
    header[stepper.FAULTS] = stepper.FAULT_DRY
    note = stops._note

    def noting(fault, moved):
        note(fault, moved)
        header[stepper.FAULTS] |= stepper.FAULT_LATE

    stops._note = noting
    stops.on_fault(0)
    stops._note = note
    session.run(0.1)
    assert controller.faults.fault & stepper.FAULT_LATE
