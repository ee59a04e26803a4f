"""Plays session scripts (script.py) on a simulated or emulated chip, as script_player.Player does
on the host simulation.

Such a board shows only its USB and its pins. On the ESP32-S3 edges come as they are played, after
the queue of I2S, and a script's `hold` and `skip` become pauses of the main loop that lose nothing.
On a Pico or Pico 2 ticks have to be in time, and interrupts on.
"""

from typing import NamedTuple

from framestep.rig import Rig
from framestep_tools.building.board_files import board_data
from framestep_tools.simulator.boards import EmulatedBoard
from framestep_tools.simulator.esp32_board import Esp32Board
from host_tests.fuzz.shown import CYCLE_NS, MS_NS, Shown
from host_tests.observers import CHIP, Tolerances, timing
from host_tests.script import Script

from .repl_work import ReplWork


class Chip(NamedTuple):
    """A target of the fuzzer: a board, and what plays it."""

    board: str  # a folder in boards/
    make: type
    within: Tolerances


# lag_ms of the ESP32: by then the queue of 24 buffers has been played, and its edges been read
CHIPS = {
    "esp32": Chip("esp32_s3_595", Esp32Board, Tolerances(lag_ms=40, report_s=0.01)),
    "rp2040": Chip("pico", EmulatedBoard, CHIP),
    "rp2350": Chip("pico2", EmulatedBoard, CHIP),
}
LONGEST_MS = 20  # pause of the main loop that loses nothing
_OPENS_NS = 3_000_000
_READ_MS = 8  # from one reading of the edges to the next, unless the board says something


class ChipPlayer(Shown):
    """A board and its millisecond."""

    def __init__(self, script: Script, _on_edge=None):
        self.script = script
        board, make, self.within = CHIPS[script.target]
        rig = Rig(script.rig, board_data(board))
        count = len(rig.board["step"])
        self._inverted = [rig.motor(i)["invert"] for i in range(count)]
        self.chip = make(script.rig, board=board)
        emulator = getattr(self.chip, "emulator", None)
        self._switches = emulator or self.chip
        self._begun_ns = self.chip.now_ns
        self.ticks = emulator and timing.watched(emulator, f"{board} {script.rig}", self._begun_ns)
        super().__init__(rig, count)
        self.pauses = hasattr(self.chip, "pause")
        self.repl = emulator is not None and self.chip.repl is not None
        self._work: ReplWork | None = None
        self._read_edges()  # the levels at first, of those boards that show them

    @property
    def now_ns(self) -> int:
        return self.chip.now_ns - self._begun_ns

    def close(self) -> None:
        """End the chip."""
        self.chip.close()

    def happen(self, verb: str, argument=None) -> None:
        """Carry out one event of a script now."""
        if verb == "rx":
            if self.board.hal.port.open:
                self.chip.protocol.receive(argument)
        elif verb in ("open", "close"):
            self.board.hal.port.open = verb == "open"
            self.chip.protocol.open_port(verb == "open")
            if verb == "open":
                self._drop_old()
        elif verb == "pin":
            signal, level = argument
            self.level(signal, level)
            self._switches.set_pin(self.pin(signal), level)
        elif verb in ("hold", "skip") and self.pauses:
            self._held = min(argument, LONGEST_MS)
            self.chip.pause(self._held)
        elif verb == "repl":
            if self._work:
                self._work.do(argument)
                self.working = self._work.look()
            elif self.ms == 0:
                self._work = ReplWork(self.chip.emulator)
                self._begun_ns = self.ticks.begun_ns = self.chip.emulator.ns
        elif verb != "prompt":
            raise ValueError(f"this board cannot {verb}")

    def _drop_old(self) -> None:
        """Drop the bytes that come as the port opens; the last host may have left them unread."""
        self.chip.run_until(self.chip.now_ns + _OPENS_NS)
        self.chip.protocol.transmit()

    def shift(self, ns: int) -> None:
        """Begin each millisecond so much later."""
        self._begun_ns += ns
        self.chip.run_until(self.chip.now_ns + ns)

    def step(self) -> None:
        """Let this millisecond pass."""
        if self._held:
            self._held -= 1
        end = self._begun_ns + (self.ms + 1) * MS_NS
        data = b""
        while self.chip.now_ns < end:
            self.chip.run_until(end, until_output=True)
            if more := self.chip.protocol.transmit():
                self.heard_ms = self.now_ns / MS_NS
                data += more
        if data:
            self.sent.append((self.ms, data))
        if data or self.ms % _READ_MS == 0:
            self._read_edges()
        self.ms += 1
        if self.working:
            self.working = self._work.look()
            self._held = 1

    def _read_edges(self) -> None:
        for time, signal, value in self.chip.edges():
            if signal[0] == "m" and signal[1:].isdigit():
                motor = int(signal[1:]) - 1
                self.board.hal.engines[motor].on_step(
                    (time - self._begun_ns) // CYCLE_NS, (value > 0) != self._inverted[motor]
                )
            else:
                self.level(signal, value)
