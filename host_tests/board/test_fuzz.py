"""The fuzzer and its judge with an emulated board (fuzz/chip_player.py): nothing is found in the
firmware, and faults are. `make fuzz TARGET=rp2350` plays other sessions."""

import collections
import functools

import pytest

from framestep.protocol import messages as m
from framestep_emulator import Emulator
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board import timing_faults
from host_tests.board.conftest import PICO
from host_tests.board.modules import edited, ident_of, on_board
from host_tests.fuzz import chip_player, fuzz
from host_tests.fuzz.findings import Finding
from host_tests.fuzz.replies import Replies
from host_tests.fuzz.sessions import Host, moves, outputs_on, pressed, run
from host_tests.observers import timing
from host_tests.selection import sweep

SEED = "1/5"
REPL_SEEDS = ("1/40", "1/57")  # their first draws let somebody work on the REPL
PICO_PLAYER = chip_player.CHIPS["rp2040"]
REQUESTS = 60


def target(chip):
    return "rp2040" if chip is PICO else "rp2350"


def test_random_requests(chip):
    trial, finding = fuzz.session(SEED, REQUESTS, target=target(chip))
    assert finding is None
    assert trial.counts["requests"] >= REQUESTS
    assert trial.counts["edges"] > 100


def test_random_requests_beside_work_on_the_repl(monkeypatch):
    """The tick and the planning of motion are compiled on the board's heap, not frozen."""
    modules = [f"framestep/{name}.mpy" for name in ("pulse/tick", "motors/axis", "controller")]
    files = on_board(ident_of("pico"), {name: edited(name) for name in modules})
    changed = PICO_PLAYER._replace(make=functools.partial(EmulatedBoard, files=files))
    monkeypatch.setitem(chip_player.CHIPS, "rp2040", changed)
    monkeypatch.setattr(timing, "addresses", {})
    conditions = []
    form = Replies._form

    def noted(replies, kind, payload):
        if kind == m.MSG_CONDITION:
            conditions.append(int.from_bytes(payload[:4], "little"))
        form(replies, kind, payload)

    monkeypatch.setattr(Replies, "_form", noted)
    asked = Host(target="rp2040")
    asked.send(m.MSG_CONDITION, ms=40)
    asked.trial.close()
    counts = collections.Counter()
    for seed in REPL_SEEDS:
        trial, finding = fuzz.session(seed, REQUESTS, target="rp2040")
        assert finding is None
        counts.update(trial.counts)
    assert counts["REPL"] > 5
    assert counts["edges"] > 100
    assert conditions
    assert all(bits & m.CONDITION_OVERLAY for bits in conditions)


@pytest.fixture
def host(chip):
    host = Host(
        {"motor_count": 2, "estop": "no", "motors": [{"invert": True}]}, target=target(chip)
    )
    yield host
    host.trial.close()


@pytest.mark.parametrize("session", [run, pressed, outputs_on])
def test_nothing_is_found_where_nothing_is_wrong(host, session):
    session(host)
    assert host.trial.counts["runs judged"] == (session is run)


def lost_step(edges):
    """Leave out a step in a hundred."""
    return [edge for k, edge in enumerate(edges) if k % 100 or edge[1] != "m1"]


def stuck(edges):
    """Never lower an output."""
    return [edge for edge in edges if not edge[1].startswith("gio") or edge[2]]


@pytest.mark.parametrize(
    "fault, session, kinds",
    [(lost_step, moves, ("goal", "pins", "positions")), (stuck, outputs_on, ("outputs",))],
)
def test_a_fault_of_the_pins_is_found(host, monkeypatch, fault, session, kinds):
    edges = EmulatedBoard.edges
    monkeypatch.setattr(EmulatedBoard, "edges", lambda board: fault(edges(board)))
    with pytest.raises(Finding) as found:
        session(host)
        host.wait(100)
    assert found.value.kind in kinds


def test_interrupts_that_are_off_for_long_are_found(host, monkeypatch):
    cycles = Emulator.cycles

    def masked(emulator, clear=False):
        return cycles(emulator, clear) | {"masked": {"us": 141}}

    monkeypatch.setattr(Emulator, "cycles", masked)
    with pytest.raises(Finding) as found:
        moves(host)
    assert found.value.kind == "masked"


def test_each_fault_of_time_has_its_place():
    for fault in timing_faults.FAULTS.values():
        assert timing_faults.edited(fault)


@pytest.mark.parametrize(
    "name",
    sweep(
        [*timing_faults.FAULTS], "pass_of_3_ms", "rest_said_a_tick_early", "command_lost_in_a_FIFO"
    ),
)
def test_a_fault_of_time_in_the_image_is_found(name):
    fault = timing_faults.FAULTS[name]
    found = timing_faults.found(fault)
    assert timing_faults.as_expected(fault, found), f"{found}, expected: {fault.kinds or 'nothing'}"
