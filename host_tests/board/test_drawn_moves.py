"""Drawn moves (drawn_moves.py): none goes wrong, and what does go wrong is found."""

import pytest

from framestep_tools.building.board_files import board_data
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.board.drawn_moves import Off, play

SECONDS = 15


@pytest.mark.repeats
def test_all_motors_of_a_board(chip):
    motors = len(board_data(chip.board)["step"])
    with chip.emulated({"motor_count": motors}) as board:
        counts = play(board, motors, SECONDS)
    assert counts["steps"] > 50_000
    assert counts["frames"] > 12
    assert counts["moves"] > counts["played"] > 0


class Faulty(SimulatedBoard):
    """Loses a step in a thousand of the last motor."""

    def edges(self):
        found = super().edges()
        return [edge for k, edge in enumerate(found) if k % 1000 or edge[1] != "m12"]


def test_a_lost_step_is_found():
    with Faulty({"motor_count": 12}, board="pico2") as board, pytest.raises(Off, match="motor 12"):
        play(board, 12, SECONDS)
