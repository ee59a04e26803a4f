"""Questions that come between two passes of the main loop, as a USB port has them answered."""

from types import SimpleNamespace

import numpy as np
import pytest

from framestep.moves.operation_runner import IDLE, PLANNED, READY, RUNNING
from framestep.protocol.messages import ERR_MOVING, MSG_FLAG_ACK, VIRT_MOTOR_EW
from framestep.pulse import stepper
from framestep_tools import payloads as p
from framestep_tools.client.wire import FrameDecoder, encode
from host_tests.end_to_end.realtime import STILLS, VIDEO, loaded
from host_tests.end_to_end.session import SWITCHES, calm, run_request, simulated
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
    asked = (p.MotorStatus(), p.MotorGetPosition(), p.Hi())
    for request in asked:
        assert between(rig, frame(request)) == [request.TYPE]
    assert between(rig, b"".join(map(frame, asked))) == [each.TYPE for each in asked]


def test_everything_else_waits_and_the_order_stays(rig):
    jog, status = frame(p.MotorJog(1, 1000, 1000)), frame(p.MotorStatus())
    assert between(rig, status + jog + status) == [p.MotorStatus.TYPE]
    assert not rig.board._board.moving()
    assert between(rig, status) == []  # it came after the jog
    a_pass(rig)
    assert rig.board._board.moving()
    assert sent(rig) == [p.MotorJog.TYPE | MSG_FLAG_ACK, p.MotorStatus.TYPE, p.MotorStatus.TYPE]


def test_an_answer_that_a_report_keeps_waiting_goes_out_before_the_pass_goes_on(rig, monkeypatch):
    """The port learns only in glance() that the report has gone."""
    board = rig.board._board
    port, io = board.hal.port, board.controller.io
    send, poll = port.send, io.poll
    before = []
    monkeypatch.setattr(port, "send", lambda writer: 1)
    monkeypatch.setattr(port, "glance", lambda: send(board.controller.writer))
    monkeypatch.setattr(io, "poll", lambda now: before.extend(sent(rig)) or poll(now))
    board.receive(frame(p.MotorSetSpeed(1, 1000, 1000)))
    a_pass(rig)
    assert before == [p.MotorSetSpeed.TYPE | MSG_FLAG_ACK]


GO_OK = p.RtGo.TYPE | MSG_FLAG_ACK
WAITS = {"pre": 200, "post": 200, "end": 20}
OPERATIONS = {
    "run": run_request(**WAITS),
    "video": run_request(**WAITS, flags=VIDEO),
    "stills": run_request(**WAITS, flags=STILLS, open_angle=90, close_angle=270),
    "lights": run_request(**WAITS, sync_dmx=1),
    "no pre-roll": run_request(end=20, pre=0, post=0),
    "go-motion": p.RtShootFrame(
        3, 1, 500, 500, (p.BlurMotor(1, 100, 300), p.BlurMotor(2, -50, 50))
    ),
}


def planned(operation="run", **settings):
    """Return a session whose operation waits for GO, its start planned."""
    session = loaded(**settings)
    session.ready(OPERATIONS[operation]).run(0.3)
    operations = session.board._board.controller.operations
    assert (operations.state, operations.early_plan) == (READY, PLANNED)
    session.forget()
    return session


def moves_in_next_tick(session):
    """Return whether all motors of the operation start in the next tick."""
    controller = session.board._board.controller
    bits = controller.operations.bits
    return bits and controller.axes.moving_bits() & bits == bits


@pytest.mark.parametrize("operation", OPERATIONS)
def test_a_go_begins_before_its_pass(operation):
    session = planned(operation)
    assert between(session, frame(p.RtGo())) == [GO_OK]
    assert moves_in_next_tick(session)
    assert between(session, frame(p.MotorStatus())) == [p.MotorStatus.TYPE]
    assert between(session, frame(p.MotorGetPosition())) == []
    a_pass(session)
    assert session.board._board.controller.operations.state == RUNNING
    assert sent(session) == [p.MotorGetPosition.TYPE]


@pytest.mark.parametrize("operation", OPERATIONS)
def test_what_a_go_before_its_pass_begins_is_the_same(operation):
    """All edges, levels and messages, but for up to two milliseconds by which it begins later."""
    seen = []
    for ask in (False, True):
        session = planned(operation)
        board = session.board._board
        board.receive(frame(p.RtGo()))
        if ask:
            board.hal.port.ask()
        session.run(3)
        edges = session.board.edges()
        begun = min(ns for ns, *_ in edges)
        kinds = [type(event.message) for event in session.client.events]
        assert p.RtEnd in kinds
        seen.append(
            (
                sorted((ns - begun, *rest) for ns, *rest in edges),
                [kind for kind in kinds if kind is not p.Positions],
                bytes(board.controller.io.lights.levels),
            )
        )
    assert len(seen[0][0]) > 50
    assert seen[0] == seen[1]


def at_a_switch(session):
    calm(session)
    session.accept(p.MotorSetLimits(1, 0, 0, 0, 0, 1)).run(0.5).input(26, 1).run(0.02)


def held(session):
    session.input("estop", 0)


def of_another_speed(session):
    session.accept(p.MotorSetSpeed(1, 10_000, 60_000))


def beside_a_motor(session):
    session.accept(p.MotorMove(3, 20_000)).run(0.3)


def not_planned(session):
    session.accept(p.MotorSetSpeed(1, 10_000, 60_000)).run(0.102)  # it is being planned again


def before_a_driver_is_awake(session):
    session.board._board.controller.axes.wake(50)


@pytest.mark.parametrize(
    "state",
    [
        at_a_switch, held, of_another_speed, beside_a_motor, not_planned, before_a_driver_is_awake,
    ],
)  # fmt: skip
def test_a_go_is_left_to_its_pass(state):
    """Wherever a pass has to look at something, or to refuse."""
    session = planned(**({**SWITCHES, "outputs": []} if state is at_a_switch else {"estop": "no"}))
    state(session)
    operations = session.board._board.controller.operations
    before = session.board._board.controller.axes.moving_bits() & operations.bits
    assert between(session, frame(p.RtGo())) == []
    assert session.board._board.controller.axes.moving_bits() & operations.bits == before
    a_pass(session)
    assert GO_OK in sent(session)


def bytes_wait(session, controller):
    between(session, frame(p.MotorStatus())[:-1])
    a_pass(session)


def a_message_waits(session, controller):
    controller.writer.begin(p.RtEnd.TYPE, None)
    assert controller.writer.end()


def rt_end_is_due(session, controller):
    controller.operations.rt_end_due = True


def port_opened_again(session, controller):
    controller.port.openings += 1


def a_driver_is_not_ready(session, controller):
    controller.drivers = SimpleNamespace(ready=(1 << controller.axes.count) - 2)


def homing(session, controller):
    controller.interlock.homing = 8


@pytest.mark.parametrize(
    "state",
    [
        bytes_wait, a_message_waits, rt_end_is_due, port_opened_again, a_driver_is_not_ready,
        homing,
    ],
)  # fmt: skip
def test_a_go_does_not_overtake(state):
    session = planned()
    board = session.board._board
    state(session, board.controller)
    board.receive(frame(p.RtGo()))
    board.hal.port.ask()
    assert board.controller.operations.state == READY
    assert not moves_in_next_tick(session)


def test_no_other_go_begins_before_its_pass():
    """Behind another request, damaged, of a wrong length, twice, without an operation."""
    session = planned()
    go = frame(p.RtGo())
    wrong = [go[:i] + bytes([go[i] ^ 1]) + go[i + 1 :] for i in range(len(go))]
    wrong += [encode(p.RtGo.TYPE, b"\0", 9), frame(p.GioOut(0)) + go, go[:-1]]
    for each in wrong:
        between(session, each)
        assert not moves_in_next_tick(session)
        session.board._board.hal.port.incoming.clear()
    assert between(session, go + go) == [GO_OK]
    a_pass(session)
    (second,) = FrameDecoder().feed(session.board._board.transmit())
    assert second.payload[0] == ERR_MOVING
    session.until(p.RtEnd, 10).wait_idle()
    assert between(session, go) == []


def stop_all(session):
    session.board._board.receive(frame(p.MotorStopAll()))


def leave(session):
    session.leave()


def fault(session):
    session.board._board.controller.stops.fault_stop()


@pytest.mark.parametrize("end", [stop_all, held, leave, fault])
@pytest.mark.parametrize("ticks", [0, 1, 3])
def test_what_stops_a_run_before_its_first_pass(end, ticks):
    """The motors ramp down and come to rest, and the run is over, as if a pass had seen its GO."""
    session = planned("stills", estop="no")
    board = session.board._board
    controller = board.controller
    stood = [block[stepper.POSITION] for block in board.hal.kernel.blocks]
    assert between(session, frame(p.RtGo())) == [GO_OK]
    poll = controller.poll
    controller.poll = lambda now: False
    board.run_until(board.now_ns + ticks * 1_000_000)
    controller.poll = poll
    end(session)
    board.run_until(board.now_ns + 1_000_000_000)
    assert not controller.axes.moving
    assert controller.operations.state == IDLE
    made = {motor: session.made(motor) for motor in (1, 2)}
    assert max(abs(steps) for steps in made.values()) < 60
    for motor, steps in made.items():
        assert controller.axes[motor - 1].block[stepper.POSITION] - steps == stood[motor - 1]


def test_a_damaged_question_and_a_partial_one_wait(rig):
    status = frame(p.MotorStatus())
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
    assert sent(rig) == [p.MotorStatus.TYPE]


def test_a_port_that_has_just_been_opened_is_left_to_the_pass(rig):
    rig.leave().come_back()
    assert between(rig, frame(p.MotorStatus())) == []
    a_pass(rig)
    assert sent(rig) == [p.MotorStatus.TYPE]


STOP_ALL = (p.MotorStopAll(), p.MotorStopAll(1))


def slowing(session):
    """Return the motors that slow down by a ramp of the tick."""
    blocks = session.board._board.hal.kernel.blocks
    return {n for n, block in enumerate(blocks, 1) if block[stepper.MODE] == stepper.STOP}


def under_way(session, *motors):
    for motor in motors:
        session.accept(p.MotorMove(motor, 30_000))
    session.run(0.3)
    assert session.board._board.moving()
    assert not slowing(session)


@pytest.mark.parametrize(
    ("stop", "stopped"), [*((each, {1, 2, 3}) for each in STOP_ALL), (p.MotorStop(2), {2})]
)
def test_a_stop_begins_before_its_pass(rig, stop, stopped):
    under_way(rig, 1, 2, 3)
    assert between(rig, frame(stop)) == []
    assert slowing(rig) == stopped
    a_pass(rig)
    assert slowing(rig) == stopped
    assert sent(rig) == [stop.TYPE | MSG_FLAG_ACK]


@pytest.mark.parametrize("stop", [p.MotorStopAll(), p.MotorStop(2)], ids=["STOP_ALL", "STOP"])
def test_a_stop_of_a_run_begins_for_all_its_motors(rig, stop):
    rig.client.upload_move(1, 100, {n: np.arange(100) * 100 for n in (1, 2)})
    rig.accept(run_request(end=100))
    rig.client.wait_idle()
    rig.accept(p.RtGo()).run(1)
    assert between(rig, frame(stop)) == []
    assert slowing(rig) == {1, 2}
    rig.wait_idle()


@pytest.mark.parametrize("stop", [p.MotorStopAll(), p.MotorStop(2)], ids=["STOP_ALL", "STOP"])
def test_a_stop_on_a_frame_is_left_to_its_pass(rig, stop):
    rig.client.upload_move(1, 100, {n: np.arange(100) * 100 for n in (1, 2)})
    rig.play(run_request(end=12))
    rig.accept(p.RtJogAll(24_000, 90)).run(1)
    assert rig.board._board.moving()
    assert between(rig, frame(stop)) == []
    assert not slowing(rig)
    rig.wait_idle()
    assert rig.position(1) % 100 == 0


def test_a_stop_of_a_virtual_motion_is_left_to_its_pass():
    rig = configured(BOOM_NODAL)
    rig.accept(p.VirtMove(VIRT_MOTOR_EW, 120 * 100_000), p.MotorMove(8, 30_000)).run(0.4)
    between(rig, frame(p.MotorStopAll()))
    assert slowing(rig) == {8}
    rig.wait_idle()


def test_a_stop_within_a_jerk_limit_is_left_to_its_pass():
    session = simulated({"motors": [{}, {"jerk": 200_000}, {"jerk": 200_000}]}, 5)
    session.accept(p.MotorConfigure(3, 1 | 0x20))  # couples 3 and 4
    under_way(session, 1, 2, 3, 5)
    between(session, frame(p.MotorStopAll()))
    assert slowing(session) == {1, 5}
    session.wait_idle()


@pytest.mark.parametrize("motor", [1, 2])
def test_a_stop_of_one_of_two_coupled_motors_begins_for_both(rig, motor):
    rig.accept(p.MotorConfigure(1, 1 | 0x20))
    under_way(rig, 1, 3)
    between(rig, frame(p.MotorStop(motor)))
    assert slowing(rig) == {1, 2}


def test_no_other_stop_begins_before_its_pass(rig):
    """Behind another request, damaged, of no motor, of a wrong length."""
    under_way(rig, 1, 2)
    stop = frame(p.MotorStopAll())
    wrong = [frame(p.MotorStop(each)) for each in (0, 9, 33, 255)]
    wrong += [encode(p.MotorStop.TYPE, b"", 9), encode(p.MotorStopAll.TYPE, b"\0", 9)]
    wrong += [stop[:i] + bytes([stop[i] ^ 1]) + stop[i + 1 :] for i in range(len(stop))]
    for each in (*wrong, frame(p.MotorMove(1, 25_000)) + stop, frame(p.MotorStop(1))[:-1]):
        between(rig, each)
        assert not slowing(rig)
        rig.board._board.hal.port.incoming.clear()
