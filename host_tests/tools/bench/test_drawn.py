"""Drawn moves: they are within what is promised of them, and a wrong one ends the run."""

import re
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from framestep_tools.bench import drawn
from framestep_tools.errors import ToolError


def moves(seed, count=12):
    return [drawn.drawn_move(np.random.default_rng((seed, n)), 12) for n in range(count)]


def test_all_motors_move_and_none_too_fast():
    fastest, resting = [], 0
    for fps, move in moves(1):
        assert len(move) == 12
        assert {len(path) for path in move.values()} == {len(move[1])}
        for path in move.values():
            assert path[0] == 0
            fastest.append(np.abs(np.diff(path)).max() * fps)
            resting += not path.any()
    assert 10_000 < max(fastest) < 20_000 * 1.02
    assert 0 < resting < len(fastest) / 4


def test_a_move_is_known_by_its_seed_and_number():
    for (fps, move), (again, same) in zip(moves(7, 3), moves(7, 3), strict=True):
        assert fps == again
        assert all(np.array_equal(move[n], same[n]) for n in move)
    assert not np.array_equal(moves(7, 1)[0][1][1], moves(8, 1)[0][1][1])


@pytest.mark.parametrize(
    ("worst_position", "worst_us", "complaints", "said"),
    [
        (1, 1.0, [], "judged"),
        (0, 900.0, [], "judged"),
        (0, 1.0, ["HARD_STOP 1 was sent"], "HARD_STOP 1"),
    ],
)
def test_the_first_wrong_move_ends_it(
    monkeypatch, capsys, worst_position, worst_us, complaints, said
):
    played = []

    class Wrong:
        info = SimpleNamespace(motors=12)

        def __init__(self, board):
            pass

        def prepare(self, move, velocity, fps):
            return move

        def play(self, move):
            played.append(move)
            wrong = len(played) == 2
            return SimpleNamespace(
                complaints=complaints if wrong else [],
                verdict=SimpleNamespace(
                    motors=[SimpleNamespace(edge_times_s=np.zeros(5))],
                    worst_position=worst_position if wrong else 0,
                    worst_time_us=worst_us if wrong else 1.0,
                    summary=lambda: "judged",
                ),
            )

    monkeypatch.setattr(drawn, "Session", Wrong)
    monkeypatch.setattr(drawn, "EmulatedBoard", lambda rig, board: nullcontext())
    with pytest.raises(ToolError, match=f"move 6 of seed 3 .*{re.escape(said)}"):
        drawn.main(board="pico2", minutes=60, seed=3, first=5)
    assert len(played) == 2
    assert "move 6:" in capsys.readouterr().out


@pytest.mark.repeats
def test_an_emulated_board_plays_one(capsys):
    drawn.main(board="pico", minutes=0.01, seed=4, first=1)
    assert re.search(r"frames of 8 motors, \d{5,} steps, 0 steps off", capsys.readouterr().out)
