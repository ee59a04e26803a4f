"""Questions that come between two passes of the main loop, as a USB port has them answered."""

import numpy as np
import pytest

from framestep.protocol.messages import MSG_FLAG_ACK
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.payloads import Hi, MotorGetPosition, MotorJog, MotorStatus, RtGo
from host_tests.end_to_end.session import run_request

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
