"""Plays session scripts (script.py) on the simulated ESP32-S3, as script_player.Player does on the
host simulation.

The chip shows only its USB and its pins. Edges come as they are played, after the queue of I2S. A
script's `hold` and `skip` become pauses of the main loop that lose nothing.
"""

from types import SimpleNamespace

from framestep.hal.host import CYCLES, pin_names
from framestep.motors.backlash import LOAD
from framestep_tools.judge.trace import pins_of
from framestep_tools.simulator.esp32_board import Esp32Board
from host_tests.script import Script

BOARD = "esp32_s3_595"
QUEUE_MS = 40  # within which the queue of 24 buffers has been played, and its edges been read
LONGEST_MS = 20  # pause of the main loop that loses nothing
_OPENS_NS = 3_000_000
_READ_MS = 8  # from one reading of the edges to the next, unless the board says something
_MS = 1_000_000
_NS = _MS // CYCLES  # of a cycle


class ChipPlayer:
    """A board and its millisecond, with the interface of Player. Its `board` has what a trial looks
    at, as seen from outside."""

    links = False
    lag_ms = QUEUE_MS
    report_s = 0.01  # age of the positions in a report
    recorder = None
    full = False

    def __init__(self, script: Script, _on_edge=None):
        self.script = script
        self.ms = 0
        self.sent: list[tuple[int, bytes]] = []
        self._held = self._off = 0
        self.chip = Esp32Board(script.rig, script.board)
        self._begun_ns = self.chip.now_ns
        rig = self.chip.rig
        count = len(rig.board["step"])
        self._inverted = [rig.motor(i)["invert"] for i in range(count)]
        self._pins = {
            name: pin for pin, name in pins_of(rig.board, script.rig, script.board).levels.items()
        }
        self._levels = 0
        self.board = SimpleNamespace(
            rig=rig,
            hal=SimpleNamespace(
                motors=count,
                engines=[SimpleNamespace(on_step=None) for _ in range(count)],
                port=SimpleNamespace(open=False, outgoing=b""),
                names=pin_names(rig.board),
                levels=lambda: self._levels,
                cycle=self._cycle,
            ),
            controller=SimpleNamespace(
                axes=[SimpleNamespace(backlash={LOAD: 0}) for _ in range(count)],
                faults=SimpleNamespace(fault=0),
            ),
        )

    def _cycle(self) -> int:
        return (self.chip.now_ns - self._begun_ns) // _NS

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
            name, level = argument
            names = self.board.hal.names
            pin = next((p for p, known in names.items() if known == name), name)
            self._levels = self._levels & ~(1 << pin) | level << pin
            self.chip.set_pin(pin, level)
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
        self.chip.run_until(self._begun_ns + (self.ms + 1) * _MS)
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
                    (time - self._begun_ns) // _NS, (value > 0) != self._inverted[motor]
                )
            elif signal in self._pins:
                pin = self._pins[signal]
                self._levels = self._levels & ~(1 << pin) | value << pin
