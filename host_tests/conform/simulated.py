"""The kit on a simulated board in virtual time: it sees the pins and presses the switches."""

from collections.abc import Iterable, Iterator
from typing import Any

from framestep_tools.conform import kit
from framestep_tools.conform.bench import Bench
from framestep_tools.conform.checks import every_check
from framestep_tools.conform.kit import Result
from framestep_tools.conform.link import Link
from framestep_tools.judge.trace import Edge
from framestep_tools.simulator.boards import LockstepPort, SimulatedBoard

from .fault_proxy import Behaviour, FaultProxy

RIG: dict[str, Any] = {
    "estop": "nc",
    "limits": [{"low": 26, "high": 27}],
    "outputs": [{"pin": 22}],
    "inputs": [{"pin": 28}],
}


class SimulatedPins:
    """The edges of a simulated board, as `behaviour` shows them."""

    def __init__(self, board: SimulatedBoard, behaviour: Behaviour):
        self.board, self.behaviour = board, behaviour

    def take(self) -> list[Edge]:
        """Return the edges since the last call."""
        return self.behaviour.edges(sorted(self.board.edges(), key=lambda edge: edge[0]))


class SimulatedHands:
    """Presses the switches that the rig file names."""

    slow = False

    def __init__(self, board: SimulatedBoard):
        self.board = board.host_board
        rig = self.board.rig
        self.pins: dict[str, tuple[str | int, bool]] = {}  # and whether pressed is low
        if rig.estop != "none":
            self.pins["E-stop"] = "estop", rig.estop == "no"
        for number, limit in enumerate(rig.limits, 1):
            for end, pin in (("upper", limit["high"]), ("lower", limit["low"])):
                self.pins[f"{end} limit {number}"] = pin, limit["contact"] == "no"
        for number, item in enumerate(rig.inputs, 1):
            self.pins[f"input {number}"] = item["pin"], True
        for what in self.pins:
            self.press(what, False)

    def has(self, what: str) -> bool:
        """Whether the rig file names it."""
        return what in self.pins

    def ready(self, what: str) -> None:
        """Return at once: the hands are always ready."""

    def press(self, what: str, on: bool) -> None:
        """Set the pin to its level with the switch pressed, or released."""
        pin, low = self.pins[what]
        self.board.set_input(pin, int(on != low))


def results(
    behaviour: Behaviour | None = None,
    subjects: Iterable[str] = (),
    motors: int | None = None,
    rig: dict[str, Any] | None = None,
) -> Iterator[Result]:
    """Yield the results of the kit on a simulated board, sound or with this behaviour, one by one.

    subjects: only these. motors: how many it has. rig: what its rig file has besides RIG.
    """
    with SimulatedBoard({**RIG, **(rig or {})}, motors) as board:
        hands = SimulatedHands(board)
        behaviour = behaviour or Behaviour()
        link = Link(FaultProxy(LockstepPort(board), behaviour))
        link.pump(0.3)
        checks = [c for c in every_check() if not subjects or c.subject in subjects]
        bench = Bench(link, True, SimulatedPins(board, behaviour), hands)
        yield from kit.results_of(bench, checks)
