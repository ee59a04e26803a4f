"""The prompt of a simulated board."""

import pytest

from framestep_tools.simulator.boards import SimulatedBoard
from framestep_tools.simulator.prompt import KNOWN, PROMPT, Prompt


@pytest.fixture
def types():
    """Return a function that types a text and returns what the prompt says."""
    board = SimulatedBoard({"name": "crane", "estop": "no"}, 2)
    prompt = Prompt(board.host_board)

    def say(text):
        prompt.receive(text.encode())
        return prompt.transmit().decode()

    say.board = board
    return say


def test_a_command_runs_on_the_board(types):
    assert ", crane" in types("status()\r")
    assert types("move(2, 300)\r") == f"move(2, 300)\r\n{PROMPT}"
    types.board.run_until(3_000_000_000)
    assert "motor 2: 300" in types("status()\r").replace("  ", " ")
    assert "refused: there is no such motor" in types("move(3, 1)\r")
    assert "TypeError" in types("move(1)\r")
    assert "TypeError" in types("help('modules')\r")
    assert "why the motors were stopped" in types("help()\r")
    assert "refused: a command of the REPL, as there is no such motor" in types("why()\r")


@pytest.mark.parametrize(
    "line",
    [
        "help", "help.x()", "1 + 1", "import os", "__import__('os')", "status().x",
        "move(1, open('x'))", "(" * 150,
    ],
)  # fmt: skip
def test_nothing_else_runs(types, line):
    assert types(f"{line}\r").endswith(
        f"\r\nthe prompt of the simulated board knows {KNOWN}\r\n{PROMPT}"
    )


def test_a_line_is_edited(types):
    assert types("statusx\x7f") == "statusx\b \b"
    assert ", crane" in types("()\r")
    assert types("mov\x03") == f"mov\r\n{PROMPT}"
    assert types("\x7f\x1b[A") == ""
    assert types("\r") == f"\r\n{PROMPT}"
