"""How reliable the kit is, `make conform`: no alarm on correct devices, one on each seeded fault.
All devices are simulated boards, in virtual time.

`make conform BOARD=pico2` runs the kit once on an emulated board, `BOARD=esp32_595` on a
simulated ESP32; ARGS="--subject framing" runs a part of it.
"""

import argparse
import itertools
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from framestep.rig import Rig
from framestep_tools.building.board_files import board_data
from framestep_tools.client.wire import Frame
from framestep_tools.conform import kit, report, spec
from framestep_tools.conform.bench import Bench
from framestep_tools.conform.checks import every_check
from framestep_tools.conform.kit import Result
from framestep_tools.conform.link import Link
from framestep_tools.judge.trace import Edge
from framestep_tools.simulator.boards import Board, EmulatedBoard, LockstepPort, SimulatedBoard
from framestep_tools.simulator.esp32_board import BOARD as ESP32
from framestep_tools.simulator.esp32_board import PROCESSOR, Esp32Board
from host_tests.conform import faults, motion_faults
from host_tests.conform.faults import Behaviour, Fault, FaultProxy

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


FAULTS = faults.FAULTS + motion_faults.FAULTS
_ALARMS = (kit.FAULT, kit.DEPARTS)


# Devices that are correct in another way than the simulator: none of them may cause an alarm.

_SLOW_S = 0.02


class Variant(NamedTuple):
    """A correct device: its motors, what else its rig file has, how it behaves."""

    name: str
    motors: int | None = None
    rig: dict[str, Any] | None = None
    behave: Callable[[], Behaviour] | None = None


class _ShortHi(Behaviour):
    """Answers HI as before 2020-10-02, without PROTOCOL VERSION."""

    def said(self, frame: Frame) -> Frame:
        return frame._replace(payload=frame.payload[:49]) if frame.type == spec.HI else frame


class _Slow(Behaviour):
    """Delays each message of the device, and keeps their order."""

    def said(self, frame: Frame) -> None:
        self.port.tell(frame, _SLOW_S)


class _LevelsUnseen(Behaviour):
    """Its trace has no light levels, like the emulated board's."""

    def edges(self, edges: list[Edge]) -> list[Edge]:
        return [edge for edge in edges if not edge[1].startswith("dmx")]


VARIANTS = (
    Variant("as the simulator is"),
    Variant("DWORD acknowledgements, an acknowledged MOVE", 2, {"dialect": "dmc-lite"}),
    Variant("HI of 49 bytes", 2, None, _ShortHi),
    Variant("no lights", 2, {"dmx": False}),
    Variant("lights that no trace shows", 2, None, _LevelsUnseen),
    Variant("each step at its frame's time", 2, {"smoothing": False}),
    Variant("one motor", 1),
    Variant("two motors", 2),
    Variant("answers after 20 ms", 3, None, _Slow),
    Variant("S-curve ramps and play in the gears", 2,
            {"motors": [{"jerk": 100, "backlash": 12}, {"backlash": 5}]}),
    Variant("no inputs, outputs or switches", 2,
            {"limits": [], "inputs": [], "outputs": [], "estop": "none"}),
)  # fmt: skip


def judge(variant: Variant, subjects: Iterable[str] = ()) -> list[Result]:
    """Return all results on a correct device."""
    behaviour = variant.behave() if variant.behave else None
    return list(results(behaviour, subjects, variant.motors, variant.rig))


def alarms(results: Iterable[Result]) -> list[str]:
    """Return the results that speak against the device."""
    return [report.line(result) for result in results if result.verdict in _ALARMS]


def found(fault: Fault) -> bool:
    """Whether a check of the fault's subject finds it."""
    try:
        found = results(fault.behave(), (fault.subject,))
        return any(result.verdict in _ALARMS for result in found)
    except kit.Failed:
        return True


def play_on(board: str, subjects: Iterable[str]) -> None:
    """Print what the kit finds on one board. SystemExit if there is an alarm, or no check."""
    reported: list[Result] = []
    played = itertools.groupby(results_on(board, subjects), lambda result: result.check.subject)
    for subject, results_of_it in played:
        found = list(results_of_it)
        print(f"{subject}: {report.counts(found)}", flush=True)
        for line in alarms(found):
            print(f"  {line}", flush=True)
        reported += found
    print(f"{board}: {len(reported)} checks: {report.counts(reported)}")
    if alarms(reported) or not reported:
        raise SystemExit(1)


def main(words: Sequence[str] = ()) -> None:
    """Print both scores, or play on one board."""
    names = sorted({check.subject for check in every_check()})
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--board", choices=BOARDS)
    parser.add_argument("--subject", action="append", choices=names, help="only this one")
    options = parser.parse_args(words)
    if options.subject and not options.board:
        parser.error("--subject needs --board")
    if options.board:
        play_on(options.board, options.subject or ())
        return
    if not VARIANTS or not FAULTS:
        raise SystemExit("no correct device, or no seeded fault, to try the kit on")
    false = 0
    for variant in VARIANTS:
        reported = judge(variant)
        if not reported:
            raise SystemExit(f"{variant.name}: no check has run")
        print(f"{variant.name}: {len(reported)} checks: {report.counts(reported)}")
        for line in alarms(reported):
            false += 1
            print(f"  {line}")
    missed = [fault.name for fault in FAULTS if not found(fault)]
    print(f"correct devices: {false} false alarms")
    print(f"seeded faults: {len(FAULTS) - len(missed)} of {len(FAULTS)} found")
    for name in missed:
        print(f"  missed: {name}")
    if missed or false:
        raise SystemExit(1)


if __name__ == "__main__":
    main(sys.argv[1:])
