"""Plays session scripts (script.py) on the simulated ESP32-S3, as script_player.Player does on the
host simulation.

The chip shows only its USB and its pins. Edges come as they are played, after the queue of I2S. A
script's `hold` and `skip` become pauses of the main loop that lose nothing.
"""

from framestep_tools.simulator.esp32_board import Esp32Board
from host_tests.fuzz.shown import CYCLE_NS, MS_NS, Shown
from host_tests.script import Script

BOARD = "esp32_s3_595"
QUEUE_MS = 40  # within which the queue of 24 buffers has been played, and its edges been read
LONGEST_MS = 20  # pause of the main loop that loses nothing
_OPENS_NS = 3_000_000
_READ_MS = 8  # from one reading of the edges to the next, unless the board says something


class ChipPlayer(Shown):
    """A board and its millisecond."""

    lag_ms = QUEUE_MS
    report_s = 0.01  # age of the positions in a report

    def __init__(self, script: Script, _on_edge=None):
        self.script = script
        self.chip = Esp32Board(script.rig, script.board)
        self._begun_ns = self.chip.now_ns
        rig = self.chip.rig
        count = len(rig.board["step"])
        super().__init__(rig, count)
        self._inverted = [rig.motor(i)["invert"] for i in range(count)]

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
            self.chip.set_pin(self.pin(signal), level)
        elif verb in ("hold", "skip"):
            self._held = min(argument, LONGEST_MS)
            self.chip.pause(self._held)
        elif verb != "prompt":
            raise ValueError(f"this board cannot {verb}")

    def _drop_old(self) -> None:
        """Drop the bytes that come as the port opens; the last host may have left them unread."""
        self.chip.run_until(self.chip.now_ns + _OPENS_NS)
        self.chip.protocol.transmit()

    def step(self) -> None:
        """Let this millisecond pass."""
        if self._held:
            self._held -= 1
        self.chip.run_until(self._begun_ns + (self.ms + 1) * MS_NS)
        data = self.chip.protocol.transmit()
        if data:
            self.sent.append((self.ms, data))
        if data or self.ms % _READ_MS == 0:
            self._read_edges()
        self.ms += 1

    def _read_edges(self) -> None:
        for time, signal, value in self.chip.edges():
            if signal[0] == "m" and signal[1:].isdigit():
                motor = int(signal[1:]) - 1
                self.board.hal.engines[motor].on_step(
                    (time - self._begun_ns) // CYCLE_NS, (value > 0) != self._inverted[motor]
                )
            else:
                self.level(signal, value)
