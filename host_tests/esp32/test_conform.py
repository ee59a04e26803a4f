"""The conformance kit on the simulated ESP32, through its UART, in virtual time: it sees the edges
behind the shift registers and presses the switches."""

import pytest

from framestep_tools.conform import kit
from framestep_tools.conform.bench import Bench
from framestep_tools.conform.checks import every_check
from framestep_tools.conform.link import Link
from framestep_tools.simulator.boards import LockstepPort
from framestep_tools.simulator.esp32_board import PROCESSOR, RISC_V, Esp32Board

RIG = {
    "estop": "nc",
    "limits": [{"low": 25, "high": 26}],
    "outputs": [{"pin": 83}],
    "inputs": [{"pin": 27}],
    "motor_count": 4,
}
# its pin, and whether pressed is low
SWITCHES = {
    "E-stop": (32, False),
    "upper limit 1": (26, False),
    "lower limit 1": (25, False),
    "input 1": (27, True),
}
SHORT = {"framing", "lengths", "numbers"}


class Pins:
    def __init__(self, board):
        self.board = board

    def take(self):
        edges = [
            (t, signal.replace("out", "gio"), value) for t, signal, value in self.board.edges()
        ]
        return sorted(edges, key=lambda edge: edge[0])


class Hands:
    slow = False

    def __init__(self, board):
        self.board = board
        for what in SWITCHES:
            self.press(what, False)

    def has(self, what):
        return what in SWITCHES

    def ready(self, what):
        pass

    def press(self, what, on):
        pin, low = SWITCHES[what]
        self.board.set_pin(pin, int(on != low))


def judged(subjects, short, processor):
    """Return {verdict: [result]} of these subjects, or of all others."""
    with Esp32Board(RIG, processor=processor) as board:
        hands = Hands(board)
        link = Link(LockstepPort(board))
        link.pump(0.3)
        bench = Bench(link, True, Pins(board), hands)
        checks = [check for check in every_check() if (check.subject in subjects) == short]
        found = {}
        for result in kit.results_of(bench, checks):
            found.setdefault(result.verdict, []).append(result)
        return found


@pytest.mark.parametrize(
    ("short", "processor"),
    [
        pytest.param(True, PROCESSOR, id="short"),
        pytest.param(False, PROCESSOR, marks=pytest.mark.repeats, id="long"),
        pytest.param(True, RISC_V, marks=pytest.mark.repeats, id="on a RISC-V"),
    ],
)
def test_it_conforms(short, processor):
    found = judged(SHORT, short, processor)
    wrong = [
        f"{result.check.subject}: {result.check.name}: {result.text}"
        for verdict in found.keys() - {"passed", "left out", "reading"}
        for result in found[verdict]
    ]
    assert not wrong
    assert len(found["passed"]) > (90 if short else 500)
