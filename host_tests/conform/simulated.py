"""The kit on a simulated or emulated board in virtual time: it sees the pins and presses the
switches."""

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from framestep.rig import Rig
from framestep_tools.building.board_files import board_data
from framestep_tools.conform import kit
from framestep_tools.conform.bench import Bench
from framestep_tools.conform.checks import every_check
from framestep_tools.conform.kit import Result
from framestep_tools.conform.link import Link
from framestep_tools.judge.trace import Edge
from framestep_tools.simulator.boards import Board, EmulatedBoard, LockstepPort, SimulatedBoard
from framestep_tools.simulator.esp32_board import BOARD as ESP32
from framestep_tools.simulator.esp32_board import PROCESSOR, Esp32Board

from .fault_proxy import Behaviour, FaultProxy

RIG: dict[str, Any] = {
    "estop": "nc",
    "limits": [{"low": 26, "high": 27}],
    "outputs": [{"pin": 22}],
    "inputs": [{"pin": 28}],
}
CHAIN_RIG: dict[str, Any] = {  # with the pins of an ESP32's board
    "estop": "nc",
    "limits": [{"low": 25, "high": 26}],
    "outputs": [{"pin": 83}],
    "inputs": [{"pin": 27}],
    "motor_count": 4,
}
BOARDS = ("pico", "pico2", ESP32)  # which have the pins of these rig files


class SeenPins:
    """The edges of a board, as `behaviour` shows them."""

    def __init__(self, board: Board, behaviour: Behaviour):
        self.board, self.behaviour = board, behaviour

    def take(self) -> list[Edge]:
        """Return the edges since the last call."""
        edges = sorted(self.board.edges(), key=lambda edge: edge[0])
        return self.behaviour.edges(
            [(time, signal.replace("out", "gio"), level) for time, signal, level in edges]
        )


class Hands:
    """Presses the switches that the rig file names. set_pin: sets the level of a pin."""

    slow = False

    def __init__(self, rig: Rig, set_pin: Callable[[int, int], object]):
        self.set_pin = set_pin
        self.pins: dict[str, tuple[int, bool]] = {}  # and whether pressed is low
        if rig.estop != "none":
            self.pins["E-stop"] = rig.board["estop"], rig.estop == "no"
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
        self.set_pin(pin, int(on != low))


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
        hands = Hands(board.host_board.rig, board.host_board.set_input)
        yield from _judged(board, hands, subjects, behaviour)


def results_on(
    name: str, subjects: Iterable[str] = (), processor: str = PROCESSOR
) -> Iterator[Result]:
    """Yield the results of the kit on an emulated board, or a simulated ESP32 with a processor.

    name: one of BOARDS; subjects: only these.
    """
    if name == ESP32:
        with Esp32Board(CHAIN_RIG, name, processor=processor) as chain:
            yield from _judged(chain, Hands(chain.rig, chain.set_pin), subjects)
        return
    rig = {**RIG, "motor_count": 4}
    with EmulatedBoard(rig, board=name) as board:
        yield from _judged(
            board, Hands(Rig(rig, board_data(name)), board.emulator.set_pin), subjects
        )


def _judged(
    board: Board, hands: Hands, subjects: Iterable[str], behaviour: Behaviour | None = None
) -> Iterator[Result]:
    behaviour = behaviour or Behaviour()
    link = Link(FaultProxy(LockstepPort(board), behaviour))
    link.pump(0.3)
    checks = [check for check in every_check() if not subjects or check.subject in subjects]
    bench = Bench(link, True, SeenPins(board, behaviour), hands)
    yield from kit.results_of(bench, checks)
