"""A board to measure, real or emulated: its protocol port, its REPL, its pins."""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from framestep.protocol.messages import CONDITION_OVERLAY

from ..building.board_files import board_data
from ..client.client import Client
from ..errors import ToolError
from ..payloads import DeviceInfo, GetCondition, Hi
from .chips import CHIPS
from .machine_choice import Layout, layout
from .pin_capture import Instrument
from .report import folder_of

# Of an emulated board's last motor, as the default width is too long for 500 000 steps/s
EMULATED_PULSE_US = 0.5
_FORCED_LOW, _FORCED_HIGH = 2, 3  # values of a pin's output override
_REMARK = re.compile(r"framestep: .*\r?\n?")  # framestep may print a remark at any time
_BOARD = "print(__import__('json').dumps(boot.hal.board))"
_FREE = "import gc\ngc.collect()\nprint(gc.mem_free())"


@dataclass
class Board:
    """A board to measure.

    run: runs code on the REPL and returns its output; rig: settings of its rig file; expected: the
    folder in boards/ of the board that the user expects, None for any. Raises ToolError, before any
    motor moves, for another board or one that cannot measure itself.
    """

    client: Client
    run: Callable[[str], str]
    rig: Mapping[str, Any]
    where: str
    expected: str | None = None

    def __post_init__(self) -> None:
        plain = self.run
        self.run = lambda code: _REMARK.sub("", plain(code))
        self.info: DeviceInfo = self.client.request(Hi())
        self.run("from framestep import boot")
        self.free_bytes = int(self.run(_FREE))
        self.data: dict[str, Any] = json.loads(self.run(_BOARD))
        self.folder = folder_of(self.data["name"])
        if self.expected not in (None, self.folder):
            raise ToolError(
                f"the board on {self.where} is {self.folder} ({self.data['name']}), not "
                f"{self.expected}: connect that one, or name this one with --board {self.folder}"
            )
        chip = CHIPS.get(self.data.get("chip", ""))
        if chip is None:
            raise ToolError(
                f"{self.data['name']} cannot measure itself: that takes one of the chips "
                f"{' and '.join(CHIPS)}, whose state machines can watch its pins"
            )
        if "registers" in self.data:
            raise ToolError(
                f"{self.data['name']} cannot measure itself: its motors are behind shift "
                "registers, and the chip sees only its own pins"
            )
        self._chip = chip
        self.overlay = self.client.request(GetCondition()).bits & CONDITION_OVERLAY
        self.clock_hz = int(self.run("import machine\nprint(machine.freq())"))
        self.instrument = Instrument(self.run, chip, self.clock_hz)
        self.layout: Layout = layout(
            self.data, self.rig, self.instrument.unused(), self.instrument.blocks()
        )
        self.layout.check()

    def settings(self, motor: int) -> Mapping[str, Any]:
        """Return the rig file's settings of a motor."""
        motors = self.rig.get("motors") or []
        return motors[motor - 1] or {} if motor <= len(motors) else {}

    def step(self, motor: int) -> int:
        """Return a motor's step pin; motors count from 1."""
        return self.data["step"][motor - 1]

    def direction(self, motor: int) -> int:
        """Return a motor's direction pin."""
        return self.data["dir"][motor - 1]

    @property
    def kept_off(self) -> dict[int, int]:
        """Return the drivers' enable pins, with the level that switches them off."""
        enable = self.data["enable"]
        pins = enable if isinstance(enable, list) else [enable]
        return {
            pin: 0 if self.settings(motor).get("enable_high") else 1
            for motor, pin in enumerate(pins, 1)
        }

    @contextmanager
    def drivers_off(self) -> Iterator[None]:
        """Let the chip hold the drivers' enable pins off, whatever framestep requests.

        Afterwards framestep has the pins again.
        """
        pins = self.kept_off
        registers = {pin: self._chip.pin_control + 8 * pin for pin in pins}
        words = dict(zip(pins, self.instrument.get([*registers.values()]), strict=True))
        shift = self._chip.output_override

        def write(values: Mapping[int, int]) -> None:
            self.instrument.put(*((registers[pin], word) for pin, word in values.items()))

        write(
            {
                pin: words[pin] & ~(3 << shift) | (_FORCED_HIGH if level else _FORCED_LOW) << shift
                for pin, level in pins.items()
            }
        )
        try:
            yield
        except BaseException:
            with suppress(Exception):  # the first error says more
                write(words)
            raise
        write(words)


def emulated_rig(board: str = "pico") -> dict[str, Any]:
    """Return the rig file with which an emulated board is measured."""
    others = len(board_data(board)["step"]) - 1
    return {"motors": [*[{}] * others, {"pulse_us": EMULATED_PULSE_US}]}


@contextmanager
def emulated(
    args: tuple[str, ...] = (), board: str = "pico", rig: Mapping[str, Any] | None = None
) -> Iterator[Board]:
    """Yield an emulated board with its frozen image. args: options of the emulator."""
    from ..simulator.boards import EmulatedBoard, LockstepPort

    settings = emulated_rig(board) if rig is None else rig
    with EmulatedBoard(settings, trace=False, board=board, args=args) as chip:
        client = Client(LockstepPort(chip))
        client.wait_event(DeviceInfo, 10)
        repl = chip.emulator.repl()

        def run(code: str) -> str:
            printed = repl.exec(code)
            chip.run_until(chip.emulator.ns)  # the client's clock goes on as well
            return printed

        found = Board(client, run, settings, "emulated", board)
        found.chip = chip  # type: ignore[attr-defined]
        yield found


_TWO_PORTS = (
    "this board has one port for the protocol and the REPL, and prove needs both: "
    'set "ports" to 2 in the rig file first (framestep rig edit)'
)


@contextmanager
def real(
    device: str | None, port: str | None, expected: str | None, say: Callable[[str], None]
) -> Iterator[Board]:
    """Yield the board on USB. device, port: ports of the protocol and the REPL, if they are not
    found; expected: see Board."""
    from ..board.repl_device import RIG_FILE, Device
    from ..board.rig_file import parse
    from ..client import port_finder
    from ..client.connection import connected

    if port is None and device is not None:
        port = next(
            (p.path for p in port_finder.siblings(device) if p.use == port_finder.REPL), None
        )
    named = port or device or port_finder.repl_port()
    known = port_finder.known(named)
    if known and known.use == port_finder.SINGLE:  # a Ctrl-C would end framestep there
        raise ToolError(f"{named}: {_TWO_PORTS}")
    with Device(port, say) as repl:
        if not repl.state.background:
            raise ToolError(
                f"{repl.path}: framestep does not run there with a REPL next to it: put it there "
                'with framestep install, set "ports" to 2 in the rig file, or reset the board'
            )
        if repl.state.moving:
            raise ToolError("motors move, or a run is prepared: stop them first")
        content = repl.read(RIG_FILE)
        rig = parse(content, RIG_FILE) if content else {}
        with connected(
            device or port_finder.protocol_of(repl.path), "framestep lab prove"
        ) as client:
            yield Board(client, repl.run, rig, client.name, expected)
