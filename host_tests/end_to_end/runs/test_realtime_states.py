"""Each message in each state of the real-time operations, and MOTOR_STATUS through all of them."""

import numpy as np
import pytest

from framestep.moves.operation_runner import POSITIONING
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.building.board_files import ROOT
from host_tests.end_to_end import realtime
from host_tests.end_to_end.realtime import FRAMES, loaded, rig
from host_tests.end_to_end.session import run_request

CODES = {
    "OK": p.Ack.OK, "12": p.Ack.ERR_MOVING, "13": p.Ack.ERR_UNSUPPORTED, "15": p.Ack.ERR_GENERAL,
    "16": p.Ack.ERR_NOT_IN_POSITION,
}  # fmt: skip
SLOW = 2000, 4000  # a state lasts for all the messages
# Requests that no state refuses
QUESTIONS = {
    r.TYPE
    for r in (
        p.Hi, p.MotorStatus, p.MotorGetPosition, p.Dmx, p.GioOut, p.GioIn, p.GioCam,
        p.MotorSetLimits,
    )
}  # fmt: skip


def test_what_sets_motors_in_motion_is_declared():
    """Such a message is accepted with a move uploaded, or for a run that is ready, but not while
    the E-stop is held."""
    tried = set()
    for _, request, answers in realtime.ANSWERS:
        reported = dict(zip(realtime.STATES, answers.split(), strict=True))
        if "OK" in reported.values():  # other messages need virtual axes or switches
            taken = "OK" in (reported["idle"], reported["ready"])
            refused = reported["estop"] == "15"
            assert (taken and refused) is request.MOVES, request
            tried.add(request.TYPE)
    assert len(tried) > 20


def slow(session):
    for motor in (1, 2):
        session.speed(motor, *SLOW)


def enter(state):
    """Return a session in that state."""
    session = (
        rig()
        if state in ("empty", "upload")
        else loaded(estop="no" if state == "estop" else "none")
    )
    if state == "upload":
        session.accept(p.RtUploadMoveBegin(1, 9))
    elif state == "idle":
        session.accept(p.RtPositionFrame(2)).wait_idle()
    elif state == "move":
        slow(session)
        session.accept(p.MotorMove(1, 9000))
    elif state == "positioning":
        session.accept(p.MotorMove(1, 9000)).wait_idle()
        session.accept(run_request(24, 1, FRAMES)).run(0.005)
    elif state in ("ready", "run", "ending"):
        for motor in (1, 2):
            # just enough for the run, so that a stop takes some time
            session.speed(motor, 20_000, 20_000)
        session.ready(run_request(24, 1, FRAMES))
        if state != "ready":
            session.accept(p.RtGo()).run(0.6)
        if state == "ending":
            session.accept(p.MotorStopAll())
    elif state == "next lap":
        session.ready(run_request(24, 1, 7, flags=2))
        session.accept(p.RtGo())
        controller = session.board._board.controller
        for _ in range(500):
            if controller.operations.running and controller.operations.state == POSITIONING:
                break
            session.run(0.01)
        assert controller.operations.state == POSITIONING
    elif state == "shoot":
        session.ready(p.RtShootFrame(9, 1, 400, 500))
        session.accept(p.RtGo()).run(0.9)
    elif state == "jog":
        session.accept(p.RtPositionFrame(2)).wait_idle()
        session.accept(p.RtJogAll(6000, 20)).run(0.3)
    elif state == "estop":
        session.input("estop", 0).run(0.05)
    return session


def code_of(session, request, answer):
    """Return the table's code, or the refusal of a device without virtual axes."""
    virtual = 0x0200 <= request.TYPE < 0x0300
    if virtual and request.TYPE not in session.board._board.controller.handlers:
        return p.Ack.ERR_UNSUPPORTED
    return CODES[answer]


def inside(session):
    """Return what a refusal must not change."""
    moves = session.board._board.controller.moves
    operations = moves.operations
    return (
        operations.state, operations.operation, operations.running, moves.store.state,
        moves.run.looping,
    )  # fmt: skip


@pytest.mark.each_processor
@pytest.mark.needs("inside")
@pytest.mark.parametrize("state", realtime.STATES)
def test_refusals_and_questions(state):
    """In a row in one session, refusals, questions and settings do not change the state."""
    session = enter(state)
    was = inside(session)
    for request, answer in realtime.expected(state):
        if answer not in ("OK", "--") or request.TYPE in QUESTIONS:
            assert session.code(request) == code_of(session, request, answer), (state, request)
            assert inside(session) == was, (state, request)


@pytest.mark.needs("inside")
@pytest.mark.parametrize("state", realtime.STATES)
def test_accepted(state):
    """Each in its own session; whatever it starts must come to its end."""
    for request, answer in realtime.expected(state):
        if answer != "OK":
            continue
        if request.TYPE in QUESTIONS:
            continue  # test_refusals_and_questions tests it
        session = enter(state)
        before = inside(session)
        assert session.code(request) == p.Ack.OK, (state, request)
        session.accept(p.MotorStopAll(), p.MotorStopAll()).run(1.5)
        assert not session.moving, (state, request)
        if state in ("run", "next lap", "ending", "shoot"):
            assert len(session.events(p.RtEnd)) == 1, (state, request)
        elif state in ("empty", "upload", "idle", "move", "estop", "jog"):
            prepared = request.TYPE in (0x0111, 0x0112, 0x0115)
            assert len(session.events(p.RtEnd)) == prepared, (state, request)
        assert before[0] or not inside(session)[0]


@pytest.mark.each_processor
@pytest.mark.needs("inside")
def test_landing():
    """A JOG_ALL that lands counts as running."""
    for request, answer in realtime.expected("jog"):
        session = enter("jog")
        session.accept(p.MotorStopAll()).run(0.1)
        if answer != "--" and request.TYPE != 0x0033:
            assert session.code(request) == code_of(session, request, answer), request


def test_every_message_is_in_the_table():
    names = {value: name for name, value in vars(m).items() if name.startswith("MSG_")}
    asked = {request.TYPE for _, request, _ in realtime.ANSWERS}
    missing = ", ".join(sorted(names[kind] for kind in m.SIZES.keys() - asked))
    assert not missing, (
        "add a line to ANSWERS in realtime.py, what is answered in each of its STATES, "
        f"for {missing}; then "
        "run python -m host_tests.end_to_end.realtime > docs/internals/realtime.md"
    )
    for _, request, answers in realtime.ANSWERS:
        given, wanted = len(answers.split()), len(realtime.STATES)
        assert given == wanted, f"{type(request).__name__} has {given} answers for {wanted} states"


def test_page():
    """docs/internals/realtime.md is the table's page."""
    page = (ROOT / "docs/internals/realtime.md").read_text()
    assert page == realtime.page(), (
        "run python -m host_tests.end_to_end.realtime > docs/internals/realtime.md"
    )


# ---- MOTOR_STATUS (field note 4.7) ---------------------------------------------------------------


class Poll:
    """Asks for MOTOR_STATUS about every millisecond; keeps all answers with their times."""

    def __init__(self, session):
        self.session = session
        # (the latest start and the earliest end of the answer's time, bits)
        self.reported = []

    def once(self):
        asked = self.session.now
        bits = self.session.ask(p.MotorStatus()).motor_bits
        self.reported.append((asked, self.session.now, bits))
        return bits

    def until_zero(self, seconds=30):
        end = self.session.now + seconds
        while self.once():
            assert self.session.now < end

    def for_seconds(self, seconds):
        end = self.session.now + seconds
        while self.session.now < end:
            self.once()

    def check(self):
        """Assert that no motor has an edge while its bit was 0: before an answer with 0 or between
        two."""
        for motor in range(1, 9):
            times, _ = self.session.steps(motor)
            for (_, reported, bits), (asked, _, later) in zip(
                self.reported, self.reported[1:], strict=False
            ):
                if not (bits | later) >> (motor - 1) & 1:
                    within = (times > reported + 1e-6) & (times < asked - 1e-6)
                    assert not within.any(), (motor, times[within][0])


@pytest.fixture
def polled():
    session = loaded()
    session.forget()
    return session, Poll(session)


@pytest.mark.parametrize(
    "request_",
    [
        run_request(24, 1, FRAMES, 300, 200),
        run_request(24, FRAMES, 1, 0, 0, sync_dmx=1),
        run_request(24, 7, 7, 200, 0),
        p.RtShootFrame(9, 1, 300, 500),
        p.RtShootFrame2(9, 300, -90, 400),
    ],
)
def test_wait_for_zero_then_go(polled, request_):
    """The bits are set from the acknowledgement on; with all bits zero GO is accepted, and after it
    the next request."""
    session, poll = polled
    for _ in range(2):
        session.accept(request_)
        assert poll.once(), "set from the moment of the acknowledgement"
        poll.until_zero()
        session.accept(p.RtGo())
        assert poll.once()
        poll.until_zero()
        session.client.take_event(p.RtEnd)
        session.accept(p.RtPositionFrame(3))
        poll.until_zero()
        session.accept(p.MotorMove(1, -200))
        assert poll.once() == 1
        poll.until_zero()
    poll.check()


@pytest.mark.parametrize("flags", [1, 2])
@pytest.mark.parametrize("pre", [0, 200])
def test_no_zero_in_a_loop(polled, flags, pre):
    """There is none at the turns and on the way back; zero means that RT_END has come or is
    next."""
    session, poll = polled
    session.accept(run_request(24, 1, 7, pre, pre, flags=flags))
    poll.until_zero()
    session.accept(p.RtGo())
    begun = len(poll.reported)
    poll.for_seconds(2.9)
    assert all(bits & 0b11 == 0b11 for _, _, bits in poll.reported[begun:])
    session.accept(p.RtStopLoop())
    poll.until_zero()
    session.run(0.005)
    assert len(session.events(p.RtEnd)) == 1
    session.accept(run_request(24, 1, 7, pre, pre, flags=flags))
    poll.check()


def test_status_of_holds_and_waits(polled):
    """A motor that holds within a run, or waits for its ramp, counts as moving, because it will
    move."""
    session, poll = polled
    session.accept(p.RtShootFrame2(9, 3000, -180, 360))
    poll.until_zero()
    session.accept(p.RtGo())
    begun = len(poll.reported)
    poll.for_seconds(2.9)
    assert all(bits == 0b11 for _, _, bits in poll.reported[begun:])
    poll.until_zero()
    assert session.client.take_event(p.RtEnd)
    poll.check()


def test_status_of_jogs_and_stops(polled):
    """Each request is given some time, or until the motors are at rest."""
    session, poll = polled
    stop, run = p.MotorStopAll(), run_request(24, 1, FRAMES)
    for requests, seconds in (
        ([p.RtPositionFrame(2)], None),
        ([p.RtJogAll(12000, 20)], 0.7), ([p.RtJogAll(12000, 4)], None),
        ([p.RtJogAll(12000, 20)], 0.4), ([stop], None),
        ([p.RtJogAll(12000, 1)], 0.3), ([stop, stop], None),
        ([run], 0.01), ([stop], None),
        ([run], None), ([p.RtGo()], 0.7), ([stop], None),
        ([run], None), ([p.MotorJog(2, 8000, 500)], 0), ([stop], None),
    ):  # fmt: skip
        session.accept(*requests)
        if seconds is None:
            poll.until_zero()
        else:
            bits = poll.once()
            assert bits == (2 if seconds == 0 else 0b11), requests
            poll.for_seconds(seconds)
    poll.check()
    assert np.all([len(session.steps(m)[0]) for m in (1, 2)])
