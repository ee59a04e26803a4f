"""The watchdog is fed only while the main loop, the tick and the queue of reports are all
alive."""

from framestep.hal.host_board import HostBoard
from framestep.io.watchdog import CHECK_MS, HOST_UNREAD_MS, TIMEOUT_MS
from framestep.protocol import messages as m
from framestep_tools.payloads import GetCondition, HardStop, MotorMove, MotorStopAll, RtEnd, RtGo
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.session import Session, run_request, simulated

MS = 1_000_000


def dog(session):
    return session.board._board.hal.watchdog


def left(session):
    """Return the milliseconds until it strikes."""
    return (dog(session).strikes_at - session.board.now_ns) / MS


def test_only_while_something_moves():
    session = simulated()
    session.run(1)
    assert dog(session).strikes_at is None
    session.accept(MotorMove(1, 3000)).run(2 * CHECK_MS / 1000)
    while session.moving:
        assert TIMEOUT_MS - CHECK_MS - 2 <= left(session) <= TIMEOUT_MS
        session.run(0.05)
    session.run(2 * CHECK_MS / 1000)
    assert dog(session).strikes_at is None
    session.accept(MotorMove(1, 0)).run(0.3)
    assert left(session) > 0


def test_not_without_the_tick():
    session = simulated()
    session.accept(MotorMove(1, 300_000)).run(0.5)
    board = session.board._board
    board.hal.tick = lambda: None
    session.run(1)
    assert left(session) < TIMEOUT_MS - 1000 + CHECK_MS


def test_not_without_the_main_loop():
    session = simulated()
    session.accept(MotorMove(1, 300_000)).run(0.5)
    board = session.board._board
    board.controller.poll = lambda now: False
    board.run_until(board.now_ns + 3000 * MS)
    # the queue has run dry by then, and the motor has ramped down
    assert left(session) < TIMEOUT_MS - 3000 + CHECK_MS
    times, _ = session.steps(1)
    assert times[-1] < (board.now_ns - 2000 * MS) * 1e-9


class Deaf:
    """A host that has the port open and reads nothing."""

    def __init__(self, session):
        self.port = session.board._board.hal.port
        self.send, self.port.send = self.port.send, lambda writer: None

    def listen(self):
        self.port.send = self.send


def test_a_deaf_host_is_a_lost_host():
    session = simulated()
    session.upload({1: [10 * k for k in range(200)]})
    session.ready(run_request(end=200))
    session.accept(RtGo()).forget()
    deaf = Deaf(session)
    begin = session.now
    session.run(6)
    last = session.steps(1)[0][-1]
    assert HOST_UNREAD_MS / 1000 < last - begin < HOST_UNREAD_MS / 1000 + 2 * CHECK_MS / 1000 + 0.1
    assert dog(session).strikes_at is None
    deaf.listen()
    session.run(0.1)
    assert not session.events(RtEnd)
    session.accept(MotorMove(1, 0)).wait_idle()
    assert session.position(1) == 0


def test_a_slow_host_is_none():
    """A host that reads something every two seconds, and one that has nothing to read."""
    session = simulated()
    session.accept(MotorMove(1, 50_000))
    for _ in range(3):
        deaf = Deaf(session)
        session.run(HOST_UNREAD_MS / 1000 - 0.5)
        deaf.listen()
        session.run(0.01)
    assert session.moving == [1]
    session.accept(MotorStopAll()).wait_idle()
    deaf = Deaf(session)
    session.run(10)
    deaf.listen()
    session.accept(MotorMove(1, 0)).run(0.5)
    assert session.moving == [1]


def test_after_it_has_struck():
    """Reported to the next host, once, and to whoever asks."""
    board = SimulatedBoard()
    board._board = HostBoard(caused_reset=True)
    session = Session(board)
    session.run(0.1)
    assert [message for _, message in session.events(HardStop)] == [HardStop(100)]
    assert session.ask(GetCondition()).bits == m.CONDITION_WATCHDOG_RESET
    session.forget().leave().run(0.1)
    session.come_back().run(0.1)
    assert not session.events(HardStop)


def test_a_rig_without():
    session = simulated({"watchdog": False})
    session.accept(MotorMove(1, 300_000)).run(0.5)
    deaf = Deaf(session)
    session.run(6)
    deaf.listen()
    session.run(0.1)
    assert session.moving == []
