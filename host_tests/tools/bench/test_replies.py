"""`make profile ARGS=answers`: how long answers take in each state."""

import io

import pytest
from rich.console import Console

from framestep_tools.bench import replies
from framestep_tools.bench.moves import CLOCK_MHZ
from framestep_tools.errors import ToolError

COUNT = 9
WORST_MS = 3
NAMES = [
    "at rest", "upload", "positioning", "ready", "run at 25 frames/s", "run at 60 frames/s",
    "to the end frame", "to the next lap", "SHOOT_FRAME", "JOG_ALL", "single moves", "jogs",
    "virtual move", "jog on a line", "homing",
]  # fmt: skip
# All of these move eight motors. Before the start of an operation a question may wait for a pass.
MOVING = ("run at 60 frames/s", "single moves", "jogs")
OTHERS = ("upload", "ready")


def test_every_state_is_there_when_it_is_asked(monkeypatch):
    """And where eight motors move, questions are answered at once."""
    assert [state.name for state in replies.STATES] == NAMES
    states = [state for state in replies.STATES if state.name in MOVING + OTHERS]
    never = replies.State("never", lambda session: None, lambda now: now.moving == -1)
    looks, asked = [], []
    look, ask = replies._Looker.__call__, replies.Asker.ask
    monkeypatch.setattr(replies._Looker, "__call__", lambda s: looks.append(look(s)) or looks[-1])
    monkeypatch.setattr(replies.Asker, "ask", lambda s: asked.append(looks[-1]) or ask(s))
    found = replies.measured("pico", CLOCK_MHZ, states=states, count=COUNT)
    assert list(found) == [state.name for state in states]
    for state, (at_once, waiting) in zip(states, found.values(), strict=True):
        seen, asked[:COUNT] = asked[:COUNT], []
        assert len(seen) == len(at_once) + len(waiting) == COUNT
        assert len(waiting) == COUNT // 3
        assert all(map(state.holds, seen)), state.name
        assert not any(other.holds(now) for other in states for now in seen if other is not state)
        if state.name in MOVING:
            assert seen[-1].moving == 2**8 - 1
            assert max(at_once) < WORST_MS
    monkeypatch.setattr(replies, "_COMES_S", 0)
    with pytest.raises(ToolError, match="no answers were timed in never: the board is at Look"):
        replies.measured("pico", CLOCK_MHZ, states=[never], count=1)


def test_the_histogram():
    out = io.StringIO()
    table = replies.histogram("answers", {"at rest": [0.2, 0.25, 0.3, 3.5, 0.9]})
    Console(file=out, width=120).print(table)
    rows = [line.strip("│┃ ") for line in out.getvalue().splitlines()]
    cells = next(row for row in rows if row.startswith("at rest")).split("│")
    assert [cell.strip() for cell in cells] == [
        "at rest", "2", "1", "1", "", "", "", "1", "5", "0.30", "3.50",
    ]  # fmt: skip
