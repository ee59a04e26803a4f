"""Records what happens to a controller on the host HAL, and what it does, so that another runtime
can repeat it.

A recording is a file for runtime/recording_replay.py: a line of JSON that describes the board, then

    S 12 30        a tick and a pass, in each of the milliseconds 12 to 41
    T 12007        a single tick, at this microsecond
    P 12           a single pass, with the clock at this millisecond
    A 12           questions are answered between two passes
    R 4446…        bytes from the host
    O, C           the port is opened, closed
    L 19 0         an input's level
    G              the replay prints how many bytes of the heap are taken: `heap 12345`
    F 1, F 0       the host stops taking bytes, takes them again
    W - 05ff…      what the drivers' wire receives in the next pass, call by call
    X 2            results of take_lost_commands() in the next pass, call by call
    Y -1 2         results of reclaim() in the next pass, call by call

`did` has the lines that the replay prints. After each pass that has done something: its millisecond
and what it did, bytes sent (<), outputs driven (o), drivers switched (e), LED (l), lights (d),
telegrams to drivers (w, c) and lines about them (s). After a tick that gave cues: its microsecond
and the cues. At the end: the positions of the motors.
"""

import contextlib
import inspect
import itertools
import json
import math
import os
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from framestep.base.clock import WIDE_WRAP, WRAP
from framestep.hal import CHANGED
from framestep.hal.host import HostFlash
from framestep.hal.host_board import HostBoard
from framestep.pulse import engine, stepper
from framestep.pulse.kernel import wider


@dataclass
class Recording:
    """One board's history. test: which test made it."""

    test: str
    head: dict[str, Any]
    lines: list[str] = field(default_factory=list)
    did: list[str] = field(default_factory=list)


# A board with more passes is not recorded; which test made it decides how many they are
MostPasses = Callable[[str], float]


def _all(test: str) -> float:
    return math.inf


def board_data(board: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in board.items() if key != "page"}


class Recorder:
    """Records a HostBoard. It replaces methods on the object, so the board must be new."""

    def __init__(
        self,
        board: HostBoard,
        rig: Any,
        data: dict[str, Any],
        broken: bool,
        flash: list[str] | None,
        most_passes: MostPasses = _all,
        weigh_ms: float = math.inf,
    ):
        """flash: content of its blocks when the board was made, in hex; None without a flash.

        weigh_ms: how often the replay prints how much of the heap is taken.
        """
        test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" (")[0]
        self.left = most_passes(test)
        self.weigh_ms = self.weigh_at = weigh_ms
        self.board = board
        hal = self.hal = board.hal
        kernel = hal.kernel
        self.recording = Recording(
            test,
            {
                "rig": rig,
                "board": board_data(data),
                "motors": hal.motors,
                "memory": hal.upload_bytes,
                "caused_reset": hal.watchdog.caused_reset,
                "broken": broken,
                "flash": flash,
                "shapes": [_shape(block) for block in kernel.blocks],
            },
        )
        self.finished: Recording | None = None
        self.steps = [0, 0]  # the S line being gathered
        self.ticked = None
        self.notes: list[str] = []
        self.cues: list[int] | None = None
        self.in_tick = False
        self.answers: list[str] = []
        self.troubles: list[int] = []
        self.taken: list[int] = []
        self.heard = False  # whether these three have anything but nothing
        self.colour = 0
        self.sent = bytearray()
        self.wire = bytearray()
        self.lights: str | None = None
        self._listen()

    # ---- the script

    def _flush(self):
        if self.steps[1]:
            self.recording.lines.append(f"S {self.steps[0]} {self.steps[1]}")
            self.steps = [0, 0]
        if self.ticked is not None:
            self.recording.lines.append(f"T {self.ticked}")
            self.ticked = None

    def _line(self, line):
        self._flush()
        self.recording.lines.append(line)

    def _extra(self):
        """Return lines with what the pass has received from outside, if it is not nothing."""
        extra = []
        if any(answer != "-" for answer in self.answers):
            extra.append("W " + " ".join(self.answers))
        if any(self.troubles):
            extra.append("X " + " ".join(map(str, self.troubles)))
        if any(found != -1 for found in self.taken):
            extra.append("Y " + " ".join(map(str, self.taken)))
        self.heard = False
        return extra

    def _noted(self, said):
        """Note what the pass has done, and clear it. said: lines printed meanwhile."""
        notes = self.notes + ["s" + text.split(" ", 4)[4].replace(" ", "_") for text in said]
        if self.wire:
            notes.append("w" + self.wire.hex())
        if self.lights:
            notes.append(self.lights)
        if self.sent:
            notes.append("<" + self.sent.hex())
        self.notes, self.wire, self.sent, self.lights = [], bytearray(), bytearray(), None
        return notes

    # ---- the board

    def _listen(self):
        board, hal, controller = self.board, self.hal, self.board.controller
        tick, poll, ask = hal.tick, controller.poll, hal.port.ask
        receive, open_port, set_level = board.receive, board.open_port, hal.set_level
        drive, enable, led, trouble = hal.drive, hal.enable, hal.led, hal.take_lost_commands
        wire_send, wire_receive, choose = (
            hal.driver_wire.send,
            hal.driver_wire.receive,
            hal.driver_wire.select,
        )
        port_send, reclaim = hal.port.send, hal.reclaim

        def note(kind, a, b):
            self.notes.append(f"{kind}{a},{b}")

        def on_tick():
            self._flush_tick()
            self.ticked = hal.now_ns // 1000
            self.in_tick, self.cues = True, None
            tick()
            self.in_tick = False
            if self.cues is not None:
                self.recording.did.append(f"{self.ticked}: t{self.cues[0]},{self.cues[1]}")

        def on_poll(now):
            self.left -= 1
            if self.left <= 0:
                if not self.finished:
                    self.finished = Recording("", {})
                    self.let_be()
                self.notes, self.wire, self.sent, self.lights = [], bytearray(), bytearray(), None
                self.recording.lines.clear()
                return poll(now)
            if self.notes or self.wire or self.lights or self.sent:
                self._noted(())  # not in a pass
            if self.answers or self.troubles or self.taken:
                self.answers, self.troubles, self.taken = [], [], []
            if now >= self.weigh_at:
                self.weigh_at = now + self.weigh_ms
                self._line("G")
            said = len(hal.said)
            usual = self.ticked is not None and self.ticked == now * 1000 + 7
            if not usual:
                self._flush_tick()
            found = poll(now)
            extra = self._extra() if self.heard else ()
            if extra or not usual:
                ticked, self.ticked = self.ticked, None
                self._flush()
                self.recording.lines += extra
                if usual:
                    self.steps = [now, 1]
                    self._flush()
                else:
                    self.ticked = ticked
                    self._line(f"P {now}")
            else:
                self.ticked = None
                if self.steps[1] and sum(self.steps) != now:
                    self._flush()
                if not self.steps[1]:
                    self.steps = [now, 0]
                self.steps[1] += 1
            if self.notes or self.wire or self.lights or self.sent or len(hal.said) > said:
                self.recording.did.append(f"{now} {' '.join(self._noted(hal.said[said:]))}")
            return found

        def on_ask():
            now = hal.ticks_ms()
            self._line(f"A {now}")
            if self.notes or self.wire or self.lights or self.sent:
                self._noted(())  # not in a pass
            before = len(hal.port.outgoing)
            ask()
            self.sent += hal.port.outgoing[before:]
            if self.notes or self.sent:
                self.recording.did.append(f"{now} {' '.join(self._noted(()))}")

        def on_receive(data):
            if data:
                self._line("R " + bytes(data).hex())
            receive(data)

        def on_open(is_open):
            if is_open and not hal.port.open:
                self._line("O")
            elif not is_open:
                self._line("C")
            open_port(is_open)

        def on_level(pin, level):
            self._line(f"L {pin} {level}")
            set_level(pin, level)

        def on_drive(high, low):
            if self.in_tick:
                raised, lowered = self.cues or (0, 0)
                # for each cue, the set register is written first
                self.cues = [high if self.writes == 0 else raised, low if self.writes else lowered]
                self.writes ^= 1
            else:
                note("o", high, low)
            drive(high, low)

        def on_enable(motor, on):
            note("e", motor, 1 if on else 0)
            enable(motor, on)

        def on_led(colour):
            if colour != self.colour:
                self.colour = colour
                note("l", colour, 0)
            led(colour)

        def on_trouble():
            found = trouble()
            self.troubles.append(found)
            self.heard |= found != 0
            return found

        def on_reclaim():
            found = reclaim()
            self.taken.append(found)
            self.heard |= found != -1
            return found

        def on_wire_send(buffer, count):
            self.wire += bytes(buffer[:count])
            wire_send(buffer, count)

        def on_wire_receive(buffer, at, limit):
            count = wire_receive(buffer, at, limit)
            self.answers.append(bytes(buffer[at : at + count]).hex() or "-")
            self.heard |= count > 0
            return count

        def on_choose(motor):
            note("c", motor, 0)
            choose(motor)

        def on_send(writer):
            before = len(hal.port.outgoing)
            port_send(writer)
            self.sent += hal.port.outgoing[before:]

        def on_full(full):
            self._line(f"F {int(full)}")

        self.full = on_full

        def on_show(lights):
            if lights.words[CHANGED]:
                self.lights = f"d{zlib.crc32(bytes(lights.levels))}"
            show(lights)

        self.writes = 0
        if hasattr(hal.dmx, "shown"):
            show = hal.dmx.show
            hal.dmx.show = on_show

        replaced = (
            (hal, "tick", on_tick, tick),
            (controller, "poll", on_poll, poll),
            (hal.port, "ask", on_ask, ask),
            (board, "receive", on_receive, receive),
            (board, "open_port", on_open, open_port),
            (hal, "set_level", on_level, set_level),
            (hal, "drive", on_drive, drive),
            (hal, "enable", on_enable, enable),
            (hal, "led", on_led, led),
            (hal, "take_lost_commands", on_trouble, trouble),
            (hal.driver_wire, "send", on_wire_send, wire_send),
            (hal.driver_wire, "receive", on_wire_receive, wire_receive),
            (hal.driver_wire, "select", on_choose, choose),
            (hal.port, "send", on_send, port_send),
            (hal, "reclaim", on_reclaim, reclaim),
        )

        def let_be():
            """Restore the board's own methods, except any that others have replaced since, because
            recording takes time."""
            for owner, name, ours, own in replaced:
                if getattr(owner, name) is ours:
                    setattr(owner, name, own)

        for owner, name, ours, _ in replaced:
            setattr(owner, name, ours)
        self.let_be = let_be

    def _flush_tick(self):
        if self.ticked is not None:
            self._flush()

    def finish(self) -> Recording:
        """Return the recording up to now, or to the first call; later events are not part of it.

        A board with too many passes has no head.
        """
        if self.finished:
            return self.finished
        self._flush()
        at = " ".join(str(block[stepper.POSITION]) for block in self.hal.kernel.blocks)
        self.recording.did.append("at " + at)
        self.finished, self.recording = self.recording, Recording("", {})
        return self.finished


def _shape(block):
    level = block[stepper.WORD] & engine.DIRECTION
    invert = bool(level) == bool(block[stepper.DOWN])
    hold = block[stepper.HOLD]
    if block[stepper.FIXED] == engine.EDGE_CYCLES:
        setup = max(block[stepper.SETUP] - engine.EDGE_TURN_CYCLES, 0)
        return [0, setup, invert, hold, block[stepper.SHORTEST]]
    longer = block[stepper.FIXED] - engine.PERIOD_CYCLES
    rounds = 0
    while wider(rounds * engine.WIDTHS + engine.WIDTHS - 1) < longer:
        rounds += 1
    width = (longer - wider(rounds * engine.WIDTHS)) // engine.WIDTH_CYCLES
    high = engine.HIGH_CYCLES + longer
    setup = max(block[stepper.SETUP] - high - engine.TURN_CYCLES, 0)
    return [rounds * engine.WIDTHS + width, setup, invert, hold]


def write(recording: Recording, path) -> None:
    with open(path, "w") as file:
        file.write(json.dumps(recording.head) + "\n")
        for line in recording.lines:
            file.write(line + "\n")


REPLAY = Path(__file__).parent / "runtime" / "recording_replay.py"
_LED_MS = 2048  # the milliseconds at the start have to be a multiple of this
_TOGETHER = 30  # recordings
NEAR_THE_END = (WRAP - 900, 2**30 - 2048)  # ticks and milliseconds that wrap soon


def differences(
    runtime, recording: Recording, path: Path, wraps=NEAR_THE_END, script: Path = REPLAY
) -> str:
    """Replay it on 32-bit MicroPython, with counters that wrap soon; in the recording they began at
    0.

    Return "" if nothing changed and the heap has not grown, else the first difference. runtime: the
    fixture unix32f; path: file for the recording; wraps: ticks and milliseconds at the start (see
    wrapping_at()); script: the replaying script.
    """
    write(recording, path)
    printed = runtime.run(script, *wraps, path, heap="16M", timeout=3600)
    return _difference(recording, path, printed.split("\n")[:-1])


def all_differences(runtime, recordings: Sequence[Recording], folder: Path) -> list[str]:
    """Return the first difference of each of many recordings that has one.

    Thirty share a process: its start takes as long as five hundred passes.
    """
    numbered = [(each, folder / f"{number}.recording") for number, each in enumerate(recordings)]
    for recording, path in numbered:
        write(recording, path)
    found = []
    for begin in range(0, len(numbered), _TOGETHER):
        part = numbered[begin : begin + _TOGETHER]
        try:
            text = runtime.run(REPLAY, *NEAR_THE_END, *(path for _, path in part), heap="32M")
        except pytest.fail.Exception:
            for recording, path in part:
                differences(runtime, recording, path)  # fails with what this one printed
            raise
        printed: list[list[str]] = [[]]
        for line in text.split("\n")[:-1]:
            printed[-1].append(line)
            if line.startswith("at "):
                printed.append([])
        found += [
            _difference(recording, path, lines)
            for (recording, path), lines in zip(part, printed[:-1], strict=True)
        ]
    return [text for text in found if text]


def _difference(recording, path, printed):
    did = recording.did
    weights = [int(line.split()[1]) for line in printed if line.startswith("heap ")]
    said = [line for line in printed if not line.startswith(("heap ", "framestep: "))]
    if said == did:
        return growth(weights)
    path.with_suffix(".did").write_text("\n".join(did))
    at = next(
        (i for i, (a, b) in enumerate(zip(did, said, strict=False)) if a != b),
        min(len(did), len(said)),
    )
    lines = [f"here:  {line}" for line in did[at : at + 3]] + [
        f"there: {line}" for line in said[at : at + 3]
    ]
    return "\n".join([f"{recording.test}: {path}, line {at}", *lines])


def wrapping_at(ms: int) -> tuple[int, int]:
    """Return ticks and milliseconds to begin with so that all counters wrap near this moment."""
    ms = max(ms // _LED_MS, 1) * _LED_MS
    return WRAP + 1 - ms, WIDE_WRAP + 1 - ms


def growth(weights: list[int]) -> str:
    """Return "" unless the heap goes on growing. No pass can take memory, since the heap is locked;
    nor may anything between passes (a port that opens, bytes that come) keep any. A single rise is
    no leak if the next two weights are the same: MicroPython keeps some objects from their first
    use on, and even the length of a path decides whether that shows.
    """
    rises = [i for i, (a, b) in enumerate(itertools.pairwise(weights)) if b > a]
    if not rises or (len(rises) == 1 and rises[0] + 4 <= len(weights)):
        return ""
    return f"the heap grows: {weights} bytes"


@contextlib.contextmanager
def recorded(most_passes: MostPasses = _all, weigh_ms: float = math.inf):
    """Record every HostBoard that is made within. Yields the list of their Recorders.

    most_passes, weigh_ms: of each Recorder.
    """
    found: list[Recorder] = []
    made = HostBoard.__init__
    signature = inspect.signature(made)

    def make(self, *args, **kwargs):
        given = signature.bind(self, *args, **kwargs)
        given.apply_defaults()
        flash = given.arguments["chip"].get("flash")
        held = (
            None
            if flash is False
            else [bytes(block).hex() for block in (flash or HostFlash()).content]
        )
        made(self, *args, **kwargs)
        found.append(
            Recorder(
                self,
                *(given.arguments[name] for name in ("rig", "board", "broken")),
                held,
                most_passes,
                weigh_ms,
            )
        )

    HostBoard.__init__ = make  # type: ignore[method-assign]
    try:
        yield found
    finally:
        HostBoard.__init__ = made  # type: ignore[method-assign]
