"""`make demo` on each board, simulated here; a workflow plays it on those that are emulated."""

import re

import pytest

from framestep_tools import demo
from framestep_tools.building.board_files import board_data, board_names

MOTORS = 4  # of the example move


@pytest.mark.parametrize("board", board_names())
def test_the_example_fits_each_board(board, tmp_path, capsys):
    assert demo.app.status(["--host", "--board", board, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert f"bringing up a simulated {board_data(board)['name']}" in said
    judged = re.findall(r"^ +(\d)  +[a-z]+  +\d+ ", said, re.MULTILINE)
    assert judged == [str(n + 1) for n in range(min(MOTORS, len(board_data(board)["step"])))]
    assert "worst position error at a frame 0 steps" in said
