"""The fuzzer and its judge with the simulated chip as a board (fuzz/chip_player.py): nothing is
found in the firmware, and faults behind the shift registers are."""

import pytest

from framestep_tools.simulator.esp32_board import Esp32Board
from host_tests.fuzz import fuzz
from host_tests.fuzz.findings import Finding
from host_tests.fuzz.sessions import Host, coupled, limited, moves, outputs_on, run
from host_tests.selection import sweep

SEED = "chip/72"
RIG = {"motor_count": 2, "motors": [{"jerk": 200, "invert": True}]}


@pytest.fixture
def host():
    host = Host(RIG, target="esp32")
    yield host
    host.trial.close()


def left_with_outputs_on(host):
    outputs_on(host)
    host.wait(100)


@pytest.mark.parametrize(
    "session",
    [
        run,
        left_with_outputs_on,
        *(pytest.param(session, marks=pytest.mark.repeats) for session in (limited, coupled)),
    ],
)
def test_nothing_is_found_where_nothing_is_wrong(host, session):
    session(host)
    assert host.trial.counts["0x10"] > 1
    assert host.trial.counts["runs judged"] == (session is run)


@pytest.mark.parametrize("requests", sweep((100, 150), 100))
def test_random_requests(requests):
    trial, finding = fuzz.session(SEED, requests, target="esp32")
    assert finding is None
    assert trial.counts["requests"] >= requests
    assert trial.counts["edges"] > 1000
    assert trial.counts["runs judged"] > 0


def lost_step(edges):
    """Leave out a step in a hundred."""
    return [edge for k, edge in enumerate(edges) if k % 100 or edge[1] != "m1"]


def late(edges):
    """Play everything 100 ms later than the board says."""
    return [(time + 100_000_000, *rest) for time, *rest in edges]


def stuck(edges):
    """Never lower an output."""
    return [edge for edge in edges if not edge[1].startswith("out") or edge[2]]


@pytest.mark.parametrize(
    "fault, session, kinds",
    [
        (lost_step, moves, ("goal", "pins", "positions")),
        (late, run, ("pins", "quiet")),
        (stuck, left_with_outputs_on, ("outputs",)),
    ],
)
def test_a_fault_behind_the_shift_registers_is_found(host, monkeypatch, fault, session, kinds):
    edges = Esp32Board.edges
    monkeypatch.setattr(Esp32Board, "edges", lambda board: fault(edges(board)))
    with pytest.raises(Finding) as found:
        session(host)
    assert found.value.kind in kinds


def test_a_fault_of_the_firmware_is_found(host):
    """A pause of the main loop that no script asks for ends a motion."""
    host.speed()
    host.move()
    host.wait(300)
    host.trial.player.chip.pause(100)
    with pytest.raises(Finding) as found:
        host.rest()
    assert found.value.kind == "fault"
