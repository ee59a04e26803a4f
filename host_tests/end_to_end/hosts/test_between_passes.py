"""Questions that come between two passes of the main loop, as a USB port has them answered."""

import numpy as np
import pytest

from framestep.protocol.messages import MSG_FLAG_ACK, VIRT_MOTOR_EW
from framestep.pulse import stepper
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.payloads import (
    Hi,
    MotorConfigure,
    MotorGetPosition,
    MotorJog,
    MotorMove,
    MotorStatus,
    MotorStop,
    MotorStopAll,
    RtGo,
    RtJogAll,
    VirtMove,
)
from host_tests.end_to_end.session import run_request, simulated
from host_tests.end_to_end.virtual_axes.judging import BOOM_NODAL, configured

pytestmark = pytest.mark.inside


def between(session, data):
    """Return the types of the answers to bytes that the port looks at as they come."""
    board = session.board._board
    board.receive(data)
    board.hal.port.ask()
    return sent(session)


def sent(session):
    """Return the types of what the board has sent since."""
    return [frame.type for frame in FrameDecoder().feed(session.board._board.transmit())]


def frame(request):
    return encode(request.TYPE, request.pack(), 9)


def a_pass(session):
    board = session.board._board
    board.controller.poll(board.hal.ticks_ms())


def test_questions_are_answered_at_once(rig):
    asked = (MotorStatus(), MotorGetPosition(), Hi())
    for request in asked:
        assert between(rig, frame(request)) == [request.TYPE]
    assert between(rig, b"".join(map(frame, asked))) == [each.TYPE for each in asked]


def test_everything_else_waits_and_the_order_stays(rig):
    jog, status = frame(MotorJog(1, 1000, 1000)), frame(MotorStatus())
    assert between(rig, status + jog + status) == [MotorStatus.TYPE]
    assert not rig.board._board.moving()
    assert between(rig, status) == []  # it came after the jog
    a_pass(rig)
    assert rig.board._board.moving()
    assert sent(rig) == [MotorJog.TYPE | MSG_FLAG_ACK, MotorStatus.TYPE, MotorStatus.TYPE]


def test_a_go_waits_for_its_pass(rig):
    """Passes begin at a fixed time after a tick, and the one that reads a GO releases the motors at
    a fixed time after that."""
    rig.client.upload_move(1, 4, {1: np.arange(4) * 100})
    rig.accept(run_request(end=4))
    rig.client.wait_idle()
    rig.run(0.5)
    assert between(rig, frame(RtGo())) == []
    a_pass(rig)
    assert RtGo.TYPE | MSG_FLAG_ACK in sent(rig)


def test_a_damaged_question_and_a_partial_one_wait(rig):
    status = frame(MotorStatus())
    for i in range(len(status)):
        damaged = bytearray(status)
        damaged[i] ^= 1
        assert between(rig, bytes(damaged)) == []
        rig.run(0.3)  # so that the rest of a frame with a damaged length is dropped
        sent(rig)
    assert between(rig, status[:-1]) == []
    a_pass(rig)
    assert between(rig, status[-1:]) == []  # the pass has begun to wait for it
    a_pass(rig)
    assert sent(rig) == [MotorStatus.TYPE]


def test_a_port_that_has_just_been_opened_is_left_to_the_pass(rig):
    rig.leave()
    rig.come_back()
    assert between(rig, frame(MotorStatus())) == []
    a_pass(rig)
    assert sent(rig) == [MotorStatus.TYPE]


STOP_ALL = (MotorStopAll(), MotorStopAll(1))


def slowing(session):
    """Return the motors that slow down by a ramp of the tick."""
    blocks = session.board._board.hal.kernel.blocks
    return {n for n, block in enumerate(blocks, 1) if block[stepper.MODE] == stepper.STOP}


def under_way(session, *motors):
    for motor in motors:
        session.accept(MotorMove(motor, 30_000))
    session.run(0.3)
    assert session.board._board.moving()
    assert not slowing(session)


@pytest.mark.parametrize(
    ("stop", "stopped"), [*((each, {1, 2, 3}) for each in STOP_ALL), (MotorStop(2), {2})]
)
def test_a_stop_begins_before_its_pass(rig, stop, stopped):
    under_way(rig, 1, 2, 3)
    assert between(rig, frame(stop)) == []
    assert slowing(rig) == stopped
    a_pass(rig)
    assert slowing(rig) == stopped
    assert sent(rig) == [stop.TYPE | MSG_FLAG_ACK]


@pytest.mark.parametrize("stop", [MotorStopAll(), MotorStop(2)], ids=["STOP_ALL", "STOP"])
def test_a_stop_of_a_run_begins_for_all_its_motors(rig, stop):
    rig.client.upload_move(1, 100, {n: np.arange(100) * 100 for n in (1, 2)})
    rig.accept(run_request(end=100))
    rig.client.wait_idle()
    rig.accept(RtGo())
    rig.run(1)
    assert between(rig, frame(stop)) == []
    assert slowing(rig) == {1, 2}
    rig.wait_idle()


@pytest.mark.parametrize("stop", [MotorStopAll(), MotorStop(2)], ids=["STOP_ALL", "STOP"])
def test_a_stop_on_a_frame_is_left_to_its_pass(rig, stop):
    rig.client.upload_move(1, 100, {n: np.arange(100) * 100 for n in (1, 2)})
    rig.play(run_request(end=12))
    rig.accept(RtJogAll(24_000, 90))
    rig.run(1)
    assert rig.board._board.moving()
    assert between(rig, frame(stop)) == []
    assert not slowing(rig)
    rig.wait_idle()
    assert rig.position(1) % 100 == 0


def test_a_stop_of_a_virtual_motion_is_left_to_its_pass():
    rig = configured(BOOM_NODAL)
    rig.accept(VirtMove(VIRT_MOTOR_EW, 120 * 100_000), MotorMove(8, 30_000))
    rig.run(0.4)
    between(rig, frame(MotorStopAll()))
    assert slowing(rig) == {8}
    rig.wait_idle()


def test_a_stop_within_a_jerk_limit_is_left_to_its_pass():
    session = simulated({"motors": [{}, {"jerk": 200_000}, {"jerk": 200_000}]}, 5)
    session.accept(MotorConfigure(3, 1 | 0x20))  # couples 3 and 4
    under_way(session, 1, 2, 3, 5)
    between(session, frame(MotorStopAll()))
    assert slowing(session) == {1, 5}
    session.wait_idle()


@pytest.mark.parametrize("motor", [1, 2])
def test_a_stop_of_one_of_two_coupled_motors_begins_for_both(rig, motor):
    rig.accept(MotorConfigure(1, 1 | 0x20))
    under_way(rig, 1, 3)
    between(rig, frame(MotorStop(motor)))
    assert slowing(rig) == {1, 2}


def test_no_other_stop_begins_before_its_pass(rig):
    """Behind another request, damaged, of no motor, of a wrong length."""
    under_way(rig, 1, 2)
    stop = frame(MotorStopAll())
    wrong = [frame(MotorStop(each)) for each in (0, 9, 33, 255)]
    wrong += [encode(MotorStop.TYPE, b"", 9), encode(MotorStopAll.TYPE, b"\0", 9)]
    wrong += [stop[:i] + bytes([stop[i] ^ 1]) + stop[i + 1 :] for i in range(len(stop))]
    for each in (*wrong, frame(MotorMove(1, 25_000)) + stop, frame(MotorStop(1))[:-1]):
        between(rig, each)
        assert not slowing(rig)
        rig.board._board.hal.port.incoming.clear()
