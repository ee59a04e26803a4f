"""A board to measure: its protocol port, its REPL, its pins. A real one, or the emulated one."""

import ast
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ..client import Client
from ..errors import ToolError
from ..payloads import DeviceInfo, Hi
from .instrument import Instrument

MOTORS_OF_A_BLOCK = 4
# of the emulated board: a pulse of the default width is too long for 500 000 steps/s
EMULATED_RIG: dict[str, Any] = {"motors": [*[{}] * 7, {"pulse_us": 0.5}]}
_CHIP = "rp2040"
_IO_BANK = 0x40014000  # RP2040 datasheet 2.19.6: status and control of each pin
_FORCED_LOW, _FORCED_HIGH = 2 << 8, 3 << 8
_FORCED = 3 << 8
_BOARD = "print(__import__('json').dumps(boot.hal.board))"
_FREE = "import gc\ngc.collect()\nprint(gc.mem_free())"


@dataclass
class Board:
    """What is measured. run: code on the REPL, and what it prints; rig: its rig file's settings."""

    client: Client
    run: Callable[[str], str]
    rig: Mapping[str, Any]
    where: str

    def __post_init__(self) -> None:
        self.info: DeviceInfo = self.client.request(Hi())
        self.run("from framestep import boot")
        self.free_bytes = int(self.run(_FREE))
        self.data: dict[str, Any] = json.loads(self.run(_BOARD))
        self.clock_hz = int(self.run("import machine\nprint(machine.freq())"))
        if self.data.get("chip") != _CHIP or len(self.data["step"]) != 2 * MOTORS_OF_A_BLOCK:
            raise ToolError(
                f"{self.data['name']} cannot measure itself yet: that takes an RP2040 with eight "
                "motors, so that four of them can stand while the others are watched"
            )
        if self.rig.get("servos") or self.rig.get("virtuals"):
            raise ToolError("the rig file has servos or virtual axes: set them aside first")
        self.instrument = Instrument(self.run, self.clock_hz)

    def step(self, motor: int) -> int:
        """The pin of a motor's steps; motors from 1."""
        return self.data["step"][motor - 1]

    def direction(self, motor: int) -> int:
        """The pin of a motor's direction."""
        return self.data["dir"][motor - 1]

    def watchers(self, motor: int) -> int:
        """The PIO block whose motors are others than those of this one."""
        return 1 - (motor - 1) // MOTORS_OF_A_BLOCK

    @property
    def kept_off(self) -> dict[int, int]:
        """Pins that enable drivers, and the level at which they are off."""
        enable = self.data["enable"]
        pins = enable if isinstance(enable, list) else [enable]
        motors = self.rig.get("motors") or []
        found = {}
        for i, pin in enumerate(pins):
            high = i < len(motors) and bool((motors[i] or {}).get("enable_high"))
            found[pin] = 0 if high else 1
        return found

    @contextmanager
    def drivers_off(self) -> Iterator[None]:
        """The chip itself holds the drivers' pins at the level at which they are off, whatever
        framestep wants of them; as they were afterwards."""
        pins = self.kept_off
        registers = {pin: _IO_BANK + 8 * pin + 4 for pin in pins}
        before = ast.literal_eval(self.run(f"get({','.join(map(str, registers.values()))})"))
        words = dict(zip(pins, before, strict=True))

        def write(values: Mapping[int, int]) -> None:
            pairs = ",".join(f"{registers[pin]},{word}" for pin, word in values.items())
            self.run(f"put({pairs})")

        write(
            {
                pin: words[pin] & ~_FORCED | (_FORCED_HIGH if level else _FORCED_LOW)
                for pin, level in pins.items()
            }
        )
        try:
            yield
        finally:
            write(words)


@contextmanager
def emulated(args: tuple[str, ...] = (), board: str = "pico") -> Iterator[Board]:
    """The emulated board with the frozen image."""
    from ..boards import EmulatedBoard, LockstepPort

    with EmulatedBoard(EMULATED_RIG, trace=False, board=board, frozen=True, args=args) as chip:
        client = Client(LockstepPort(chip))
        client.wait_event(DeviceInfo, 10)
        repl = chip.emulator.repl()

        def run(code: str) -> str:
            printed = repl.exec(code)
            chip.run_until(chip.emulator.ns)  # the clock of the client goes on as well
            return printed

        found = Board(client, run, EMULATED_RIG, "emulated")
        found.chip = chip  # type: ignore[attr-defined]
        yield found


@contextmanager
def real(device: str | None, port: str | None, say: Callable[[str], None]) -> Iterator[Board]:
    """The board on USB. device: the protocol's port, port: the REPL's, where they are not found."""
    from .. import ports
    from ..commands.common import talking
    from ..device import RIG_FILE, Device
    from ..rig_file import parse

    if port is None and device is not None:
        port = next((p.path for p in ports.siblings(device) if p.use == ports.REPL), None)
    with Device(port, say) as repl:
        if not repl.state.background:
            raise ToolError(
                "framestep does not run on this board with a REPL beside it: "
                'prove needs both ports ("ports": 2)'
            )
        if repl.state.moving:
            raise ToolError("motors move, or a run is prepared: stop them first")
        content = repl.read(RIG_FILE)
        rig = parse(content, RIG_FILE) if content else {}
        with talking(device or ports.protocol_of(repl.path)) as client:
            yield Board(client, repl.run, rig, client.name)
