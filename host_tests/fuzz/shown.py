"""A board of which only the port and the pins are seen."""

from types import SimpleNamespace

from framestep.hal.host import CYCLES, pin_names
from framestep.motors.backlash import LOAD

MS_NS = 1_000_000
CYCLE_NS = MS_NS // CYCLES  # of a cycle


class Shown:
    """What such a board has shown, with the interface of script_player.Player. Its `board` has what
    a trial looks at."""

    recorder = None
    ticks = None  # of an emulated chip, if a trial is to judge them as it goes
    full = False
    links = pauses = False
    repl = False  # whether somebody may work on its REPL
    working = False  # whether somebody does, so that passes may be late
    now_ns = 0

    def __init__(self, rig, motors: int, levels=0, is_open=False):
        self.ms = 0
        self.heard_ms = 0.0  # when the last of `sent` came
        self.sent: list[tuple[int, bytes]] = []
        self._held = self._off = 0
        self._levels = levels
        names = pin_names(rig.board)
        self._pins = {name: pin for pin, name in names.items()}
        self.board = SimpleNamespace(
            rig=rig,
            hal=SimpleNamespace(
                motors=motors,
                engines=[SimpleNamespace(on_step=None) for _ in range(motors)],
                port=SimpleNamespace(open=is_open, outgoing=b""),
                names=names,
                levels=lambda: self._levels,
                cycle=lambda: self.now_ns // CYCLE_NS,
            ),
            controller=SimpleNamespace(
                axes=[SimpleNamespace(backlash={LOAD: 0}) for _ in range(motors)],
                faults=SimpleNamespace(fault=0),
            ),
        )

    def pin(self, signal: str | int) -> int | None:
        """Return the number of a pin that a trial looks at; None for any other signal."""
        return signal if isinstance(signal, int) else self._pins.get(signal)

    def level(self, signal: str | int, level: int) -> None:
        """Take a level of such a pin."""
        pin = self.pin(signal)
        if pin is not None:
            self._levels = self._levels & ~(1 << pin) | level << pin
