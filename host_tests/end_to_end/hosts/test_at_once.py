"""Answers at once (framestep/answers.py) are those that the handlers give, byte for byte."""

from array import array

import numpy as np
import pytest

from framestep.moves.operation_runner import (
    ENDING,
    GONE,
    IDLE,
    LEAVING,
    POSITIONING,
    READY,
    RUNNING,
    STARTING,
)
from framestep.protocol import messages as m
from framestep.protocol.frames import FrameReader
from framestep_tools import payloads as p
from framestep_tools.client.client import LAST_SECTION
from framestep_tools.client.wire import encode
from framestep_tools.payloads import Hi, MotorGetPosition, MotorStatus
from host_tests.end_to_end import realtime
from host_tests.end_to_end.realtime import loaded
from host_tests.end_to_end.runs.test_realtime_states import enter
from host_tests.end_to_end.session import DIALECTS, run_request, simulated

pytestmark = pytest.mark.inside

QUESTIONS = (MotorStatus(), MotorGetPosition(), Hi())
BUFFER = 128


def at_once(session, request, number):
    """Return the answer at once, b"" if it is left to a pass."""
    controller = session.board._board.controller
    to = bytearray(BUFFER)
    question = bytearray(b"DF" + encode(request.TYPE, request.pack(), number))
    return bytes(to[: controller.answer(question, 2, to)])


def handled(session, request, number):
    """Return the answer of the handler, as a pass gives it, with the operation as it is now."""
    controller = session.board._board.controller
    if controller.operations.state in (POSITIONING, ENDING):
        controller.operations.poll()
    reader, writer = FrameReader(), controller.writer
    data = encode(request.TYPE, request.pack(), number)
    reader.feed(data, 0, len(data))
    reader.poll()
    kept, controller.reader = controller.reader, reader
    before = writer.pending
    assert controller._handle(reader) == 0
    controller.reader = kept
    to = bytearray(BUFFER)
    count = writer.take(to, BUFFER)
    assert before == 0
    return bytes(to[:count])


def same_answers(session):
    """Assert it for each question; return which were answered at once."""
    found = set()
    for number, request in enumerate(QUESTIONS, 0x12345678):
        now = at_once(session, request, number)
        then = handled(session, request, number)
        assert now in (b"", then), (request, now.hex(), then.hex())
        if now:
            found.add(request.TYPE)
    return found


@pytest.mark.parametrize("state", realtime.STATES)
def test_in_each_state(state):
    """Tick by tick from there on, with and without samples in between."""
    session = enter(state)
    board = session.board._board
    found = []
    for step in range(400):
        board.run_until(board.now_ns + (1 if step % 7 else 9) * 1_000_000)
        board.transmit()
        found.append(same_answers(session))
    times = [sum(request.TYPE in each for each in found) for request in QUESTIONS]
    if state == "jog":
        assert min(times[0], times[2]) > 300, times
    else:
        assert min(times) > 300, times


@pytest.mark.parametrize("state", realtime.STATES)
def test_within_passes(state):
    """Wherever a pass lets the port look, an answer is that of the handler at that moment."""
    session = enter(state)
    board = session.board._board
    found = []

    def glance():
        if board.controller.writer.pending == 0:
            found.append(same_answers(session))

    board.hal.port.glance = glance
    for _ in range(40):
        board.run_until(board.now_ns + 5_000_000)
        board.transmit()
    assert sum(MotorStatus.TYPE in each for each in found) > 8


def test_rt_end_comes_before_a_status_that_nothing_moves():
    """Also if the question is answered within the pass that ends the run."""
    session = loaded()
    session.speed(1, 20_000, 50_000).ready(run_request(24, 1, 3, pre=0, post=0))
    session.accept(p.RtGo())
    board = session.board._board
    idle = []

    def glance():
        answer = at_once(session, MotorStatus(), 1)
        if answer and not any(answer[10:14]):
            idle.append(board.transmit())

    board.hal.port.glance = glance
    sent = b""
    while not idle:
        sent += board.transmit()
        board.run_until(board.now_ns + 1_000_000)
    ended = encode(p.RtEnd.TYPE, b"", 0)
    assert ended in sent + idle[0]


def test_between_a_go_and_the_pass_that_goes_on_with_it():
    session = loaded()
    session.ready(run_request(24, 1, 3)).run(0.3)  # until the start is planned
    assert at_once(session, p.RtGo(), 1)
    operations = session.board._board.controller.operations
    assert operations.state == GONE
    assert not at_once(session, MotorGetPosition(), 2)  # MOVE TIME is the run's from the pass on
    found = [(each, at_once(session, each, 3)) for each in (MotorStatus(), Hi())]
    operations.adopt()
    assert all(answer == handled(session, each, 3) for each, answer in found)


@pytest.mark.parametrize("fps", [1, 23.976, 25, 60])
def test_move_time_in_a_run(fps):
    """Also at frames and between them, at the end, and on the way back."""
    session = loaded()
    session.speed(1, 20_000, 50_000)
    session.ready(run_request(fps, 1, 4 if fps == 1 else 20, pre=200, post=200))
    session.accept(p.RtGo())
    board = session.board._board
    positions = 0
    for _ in range(6000 if fps == 1 else 1800):
        board.run_until(board.now_ns + 1_000_000)
        board.transmit()
        positions += MotorGetPosition.TYPE in same_answers(session)
    assert positions > 1400


def test_backlash_and_lights():
    """Loads that motors drag, and lights that ramp."""
    session = loaded(motors=[{"backlash": 40}] * 2, dmx_ramp_ms=300)
    board = session.board._board
    lit = 0
    for turn in range(6):
        session.accept(p.MotorMove(1, (-1) ** turn * 300), p.Dmx(1, 5, [turn * 40]))
        for _ in range(60):
            board.run_until(board.now_ns + 1_000_000)
            board.transmit()
            same_answers(session)
            lit += at_once(session, MotorStatus(), 1)[14]
    assert lit > 100


def test_whatever_else_comes_is_left_to_the_passes(rig):
    controller = rig.board._board.controller
    to = bytearray(BUFFER)
    status = encode(MotorStatus.TYPE, b"", 7)
    assert controller.answer(bytearray(status), 0, to) == 17
    for i in range(len(status)):
        for flip in (1, 0x80):
            damaged = bytearray(status)
            damaged[i] ^= flip
            assert controller.answer(damaged, 0, to) == 0
    for _, request, _ in realtime.ANSWERS:
        if request.TYPE not in [each.TYPE for each in QUESTIONS]:
            data = bytearray(encode(request.TYPE, request.pack(), 7)) + bytes(12)
            assert controller.answer(data, 0, to) == 0


@pytest.mark.parametrize("motors", range(1, 9))
def test_positions_of_any_number_of_motors(motors):
    session = simulated(motors=motors)
    for motor in range(1, motors + 1):
        session.accept(p.MotorResetPosition(motor, int(np.int32(-(2**31) + motor * 0x01234567))))
    assert same_answers(session) == {request.TYPE for request in QUESTIONS}


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("seed", range(4))
def test_sections_are_stored_and_acknowledged_as_by_passes(dialect, seed):
    """Of two boards only one stores sections at once. Both get sections in order and out of order,
    again, to the end, too many, too long, of motors that are not there, with steep changes, and
    damaged; and questions and other requests between them."""
    dice = np.random.default_rng(seed)
    boards = [simulated({"dialect": dialect}, motors=3) for _ in range(2)]
    quick = boards[0].board.host_board
    receive, at_once = quick.receive, []

    def receive_and_ask(data):
        receive(data)
        quick.hal.port.ask()
        at_once.append(not quick.hal.port.incoming)

    quick.receive = receive_and_ask
    frames = int(dice.integers(300, 2000))
    requests = [p.RtUploadMoveBegin(1, frames)]
    sent = dict.fromkeys((1, 2, 3), 0)
    for _ in range(60):
        motor = int(dice.choice((1, 1, 2, 3, 3, 0, 4)))
        count = int(dice.choice((0, 1, 5, 100, 257)))
        index = sent.get(motor, 0)
        if dice.random() < 0.2:
            index = int(dice.integers(0, frames + 20))
        steep = int(dice.choice((3, 3, 3, 200, 100_000, 2**31 - 1)))
        steps = np.cumsum(dice.integers(-steep, steep, count, endpoint=True)) if count else []
        steps = np.array(steps, np.int64).astype(np.int32).tolist()
        sent[motor] = index + count
        last = LAST_SECTION if dice.random() < 0.05 else 0
        requests.append(p.RtUploadMoveAxis(motor, index | last, steps))
        if dice.random() < 0.1:
            requests.append(dice.choice((MotorStatus(), p.GioOut(1))))
    requests.append(p.RtUploadMoveEnd())
    for number, request in enumerate(requests, 0x7FFF0000):
        more = b"\0" * int(dice.integers(1, 4)) if dice.random() < 0.05 else b""
        data = bytearray(encode(request.TYPE, request.pack() + more, number))
        if dice.random() < 0.1 and request.TYPE == p.RtUploadMoveAxis.TYPE:
            data[dice.integers(2, len(data))] ^= 1 << int(dice.integers(0, 8))
            data += bytes(400)  # so that a length that is too long is no partial frame
        answers = [board.bytes_for(bytes(data), 0.3) for board in boards]
        assert answers[0] == answers[1], (number, request)
    assert at_once.count(True) > 20
    stores = [board.board.host_board.controller.moves.store for board in boards]
    assert bytes(stores[0].memory) == bytes(stores[1].memory)
    for motor in range(3):
        read = [array("i", [0] * frames) for _ in stores]
        for store, words in zip(stores, read, strict=True):
            store.positions(motor, 0, frames, words, 0)
        assert read[0] == read[1]


def test_a_section_waits_for_what_came_before_it(rig):
    """While a run goes on, or bytes of another request wait, it is left to the passes."""
    controller = rig.board._board.controller
    rig.accept(p.RtUploadMoveBegin(1, 20))
    section = p.RtUploadMoveAxis(1, 0, [0, 1, 2])
    data = bytearray(encode(section.TYPE, section.pack(), 7))
    to = bytearray(BUFFER)
    controller.reader.feed(b"DF", 0, 2)
    assert controller.answer(data, 0, to) == 0
    controller.reader.clear()
    controller.reports.send_hi(None)
    assert controller.answer(data, 0, to) == 0
    controller.writer.clear()
    controller.operations.rt_end_due = True
    assert controller.answer(data, 0, to) == 0
    controller.operations.rt_end_due = False
    for state in (LEAVING, POSITIONING, READY, RUNNING, ENDING, STARTING):
        controller.operations.state = state
        assert controller.answer(data, 0, to) == 0
    controller.operations.state = IDLE
    assert not controller.moves.store.has(0)
    size = controller.answer(data, 0, to)
    assert bytes(to[:size]) == encode(section.TYPE | m.MSG_FLAG_ACK, bytes((m.OK, 0)), 7)
    assert controller.moves.store.has(0)
