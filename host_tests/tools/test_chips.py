"""Every chip of boards/chips.json has what docs/internals/new-chip.md asks for. Each failure says
what to add."""

import ast

import pytest

from framestep_tools.bench.record import recorded
from framestep_tools.building.board_files import CHIPS, ENGINES, FIRMWARE, board_data, board_names
from framestep_tools.chips import chips
from framestep_tools.client.client import Client
from framestep_tools.simulator.boards import LockstepPort, SimulatedBoard

HAL = FIRMWARE / "framestep" / "hal"


def names(module):
    """Return the names that a module of constants defines."""
    tree = ast.parse((FIRMWARE / module).read_text())
    return {node.targets[0].id for node in tree.body if isinstance(node, ast.Assign)}


@pytest.mark.parametrize("key", [key for key in chips() if chips()[key].uf2_family])
def test_a_simulated_board_has_the_memory_of_the_chip_and_somewhat_more(key):
    """So `framestep check` refuses nothing that the board has room for."""
    board = chips()[key].plain_board
    info = Client(LockstepPort(SimulatedBoard(board=board))).greet()
    # keys of bench.json: a Pico's have no board in them, other boards' end in its name
    figures = {f"upload_frames_{info.motors}", f"upload_frames_{info.motors}_{board}"}
    [measured] = [value for name, value in recorded().items() if name in figures]
    assert 1 <= info.upload_frames / measured < 2


@pytest.mark.parametrize("key", chips())
def test_its_parts_exist(key):
    chip = chips()[key]
    assert chip.engine in ENGINES, (
        f"{key}: add its engine {chip.engine!r} to ENGINES in "
        "tools/framestep_tools/building/board_files.py"
    )
    assert (HAL / chip.hal / "hal.py").exists(), (
        f"{key}: write its HAL, firmware/framestep/hal/{chip.hal}/hal.py"
    )
    board = chip.plain_board
    assert board in board_names(), (
        f"{key}: add boards/{board}, or name another board as its plain_board"
    )
    assert board_data(board)["chip"] == key, f"{key}: its plain_board {board} has another chip"


@pytest.mark.parametrize("key", [key for key in chips() if chips()[key].hal == "rp2"])
def test_it_is_described_to_the_hal_that_it_shares(key):
    """With all the constants, and no other."""
    assert key in CHIPS, (
        f"{key}: write a module like {CHIPS['rp2040']}, and add it to CHIPS in "
        "tools/framestep_tools/building/board_files.py"
    )
    assert names(CHIPS[key]) == names(CHIPS["rp2040"])


@pytest.mark.parametrize("engine", ENGINES)
def test_every_engine_has_the_same_constants(engine):
    """It may have more of its own."""
    missing = names(ENGINES["pio"]) - names(ENGINES[engine])
    assert not missing, (
        f"{ENGINES[engine]} needs {', '.join(sorted(missing))}, as pulse/engine.py has them"
    )
