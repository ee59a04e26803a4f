"""The observers find faults in sessions that somebody else conducts, and it is counted what they
watch."""

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import pytest

from framestep.protocol import messages as m
from framestep_tools.payloads import MotorMove
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests import observers
from host_tests.end_to_end.session import Session
from host_tests.fuzz.findings import Finding
from host_tests.fuzz.link import frame
from host_tests.fuzz.sessions import SESSIONS, Host
from host_tests.fuzz.test_trial import RULES, conduct
from host_tests.observers import timing
from host_tests.observers.__init__ import SCENARIOS, Table
from host_tests.targets import device, rp2040

MS = 1_000_000


class Conducted:
    """A watched board, with the interface of a trial."""

    def __init__(self, script):
        self.board = SimulatedBoard(script.rig, board=script.board)
        observers.begin(self.board)
        self.trial = self.board.watch.trial

    def __getattr__(self, name):
        return getattr(self.trial, name)

    def do(self, verb, argument=None):
        if verb == "rx":
            self.board.receive(argument)
        elif verb == "pin":
            self.board.host_board.set_input(*argument)
        else:
            self.board.open_port(verb == "open")

    def step(self):
        board = self.board
        end = (board.now_ns // MS + 1) * MS
        while board.now_ns < end:
            board.run_until(end, until_output=True)
            board.transmit()
        board.watch.follow()


@pytest.fixture(autouse=True)
def watches(monkeypatch):
    monkeypatch.setattr(observers, "watches", [])


@pytest.mark.parametrize("session", SESSIONS)
def test_nothing_is_found_where_nothing_is_wrong(session):
    host = Host({"motor_count": 2, "estop": "no", "motors": [{"jerk": 200}]}, make=Conducted)
    session(host)
    assert host.trial.counts["0x10"] > 1


# A scenario shows an exception by itself. The fault for coupled motors is put into the fuzzer's own
# engines.
ELSEWHERE = ("exception", "coupled")


@pytest.mark.parametrize(
    "fault, session, kind", [rule for rule in RULES if rule[2] not in ELSEWHERE]
)
def test_each_rule(fault, session, kind, monkeypatch):
    fault(monkeypatch)
    with pytest.raises(Finding, match=f"^({kind})"):
        conduct(fault, session, Conducted)


def test_time_does_not_run_ahead_with_many_answers():
    board = SimulatedBoard({"motor_count": 2})
    observers.begin(board)
    board.open_port(True)
    board.run_until(5 * MS)
    board.transmit()
    for number in range(1, 40):
        board.receive(frame(m.MSG_MOTOR_STATUS, b"", number))
        board.run_until(board.now_ns)  # answers within the same millisecond
        assert board.transmit()
    assert not board.watch.settle()
    assert board.watch.trial.ms <= 7


class OnAPort(device.Target):
    """A board of which only the port is there, without a port."""

    def __init__(self):
        self._port = None
        self._board = device.Inside()


def test_a_board_whose_pins_nobody_sees_is_not_watched(watches):
    observers.begin(OnAPort())
    assert observers.watches == []


OFF = """
import machine, time
begun = time.ticks_us()
state = machine.disable_irq()
%s
machine.enable_irq(state)
"""
# without a sleep, which may wait for an interrupt
WHILE = "while time.ticks_diff(time.ticks_us(), begun) < %d: pass"


@pytest.mark.parametrize(
    "moves, what, kind",
    [
        (False, WHILE % 400, "masked"),
        (True, WHILE % 1300, "late"),
        (False, "time.ticks_us()", None),  # without a branch, at which a pass may begin
    ],
    ids=["400 us", "1300 us", "a call"],
)
def test_ticks_of_an_emulated_chip(moves, what, kind):
    """A program on the REPL keeps interrupts off. That makes a tick late, too: then only this is
    looked for."""
    session = Session(rp2040.Target())
    watch = session.board.watch
    if moves:
        player = watch.trial.player
        player.within = replace(player.within, masked_us=1_000_000)
        session.accept(MotorMove(1, 5000)).run(0.3)
    repl = session.board.emulator.repl()
    repl.exec(OFF % what)
    found = watch.settle()
    assert (found and found.kind) == kind


@pytest.mark.parametrize(
    "busy, passes, found",
    [
        ([0], [(500, 7)], False),
        ([0], [(500, 9)], True),
        ([0, 320], [(500, 9)], False),  # still begun by a request
        ([0, 310], [(520, 9)], True),
        ([0, 600], [(500, 9)], True),  # the request came later
        ([0], [(500 + 100 * k, 3) for k in range(6)], False),
        ([0], [(500 + 100 * k, 3) for k in range(7)], True),
        ([0], [(500 + 200 * k, 3) for k in range(30)], False),
    ],
)
def test_passes_are_short_between_requests(busy, passes, found):
    ticks = SimpleNamespace(worst_late=lambda: 0, masked=lambda: 0, passes=lambda: passes, long=[])
    trial = SimpleNamespace(
        busy=busy,
        player=SimpleNamespace(within=observers.CHIP),
        rig=SimpleNamespace(remember_positions=False),
    )
    with pytest.raises(Finding, match="passes") if found else nullcontext():
        timing.judge(ticks, trial)


def run_of(table, subject, scenarios, *observers):
    """Play scenarios of a subject, each watched by these observers; return pytest's verdict."""
    for _ in range(scenarios):
        table.played(SCENARIOS / subject / "test_it.py")
        table.watched(SCENARIOS / subject / "test_it.py", set(observers))
    session = SimpleNamespace(config=SimpleNamespace(), testsfailed=0, exitstatus=0)
    table.pytest_sessionfinish(session)
    return session.exitstatus


@pytest.mark.parametrize(
    "chosen, share, scenarios, observers, missing",
    [
        (False, 1, 10, ("answers", "late", "quiet"), ""),
        (False, 1, 10, ("answers", "late"), "quiet"),
        (False, 5, 10, ("answers", "late"), ""),
        (False, 5, 10, ("answers", "quiet"), "late"),
        (False, 5, 9, (), ""),
        (True, 1, 10, (), ""),
    ],
)
def test_a_run_fails_if_an_observer_has_watched_nothing(
    chosen, share, scenarios, observers, missing, tmp_path
):
    table = Table("chip", {"answers", "late", "quiet"}, share, tmp_path / "table.md")
    table.chosen = chosen
    assert run_of(table, "io", scenarios, *observers) == bool(missing)
    assert table.failure == (missing and f"on chip nothing to watch for: {missing}")


def test_the_table_keeps_the_rows_of_other_runs(tmp_path):
    file = tmp_path / "table.md"
    run_of(Table("host", set(), file=file), "runs", 4, "answers", "frames")
    run_of(Table("chip", set(), file=file), "runs", 2, "late")
    run_of(Table("chip", set(), file=file), "runs", 3, "answers")
    rows = [
        line.split(" | ") for line in file.read_text().splitlines() if line.startswith("| runs")
    ]
    head = next(line for line in file.read_text().splitlines() if line.startswith("| subject"))
    column = {name: at for at, name in enumerate(head.split(" | "))}
    assert [row[1] for row in rows] == ["chip", "host"]
    assert [row[column["scenarios"]] for row in rows] == ["3", "4"]
    assert [row[column["answers"]] for row in rows] == ["3", "4"]
    assert [row[column["frames"]] for row in rows] == ["0", "4"]
    assert [row[column["late"]] for row in rows] == ["0", "0"]
