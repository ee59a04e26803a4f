"""Cost of the parts of a tick on the emulated board: `python -m framestep_tools.bench.tick_cost`,
also part of `make bench`.

The kernel runs alone, from RAM. Each motor has one long segment; the cost of a motor is the
difference between eight motors and none. Times cover the whole interrupt, from the processor's
entry to its return, by the emulator's count of cycles.
"""

from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.table import Table

from ..building import images
from ..building.board_files import compiled, march

MOTORS = 8
_ONE = 1 << 22  # a step, Q22
_STEADY_MS = 40
_SETUP = """
import machine, time
from framestep.pulse import stepper
from framestep.pulse.kernel import StepKernel
from framestep.hal.rp2.pulses import PulseEngine
pins = list(range(2, 18, 2))
shapes = [(0, 625, False, 0, 0)] * len(pins)
engine = PulseEngine(pins, [pin + 1 for pin in pins], 125_000_000, shapes)
kernel = StepKernel(8, 125_000, 0x40054028)
for i in range(8):
    kernel.configure(i, engine.fifo(i), *shapes[i])
timer = machine.Timer(-1, period=1, mode=machine.Timer.PERIODIC, callback={callback}, hard=True)
def start(motors, velocity, acceleration):
    state = machine.disable_irq()
    for i in range(motors):
        b = kernel.blocks[i]
        q = kernel.queues[i]
        at = (b[{WRITE_INDEX}] & 15) * 8
        for k, value in enumerate((10000, b[{POSITION}], 0, velocity, acceleration, 0, 0, 125000)):
            q[at + k] = value
        b[{WRITE_INDEX}] += 1
        b[{MODE}] = {RUN_START}
    machine.enable_irq(state)
def stop():
    state = machine.disable_irq()
    for b in kernel.blocks:
        b[{MODE}] = b[{LEFT}] = b[{VELOCITY}] = b[{FRACTION}] = 0
    machine.enable_irq(state)
    time.sleep_ms(20)
"""

# each motor's motion: name, velocity (Q22 steps per tick), acceleration (Q27 steps per tick²)
_MOTIONS = (
    ("slower than a step per tick", _ONE // 1000, 0),
    ("one step per tick", _ONE + _ONE // 8, 0),
    ("30 steps per tick", 30 * _ONE + _ONE // 3, 0),
    ("100 steps per tick", 100 * _ONE + _ONE // 3, 0),
    ("a ramp of 100 000 steps/s², 3 to 7 steps per tick", 3 * _ONE, (_ONE << 5) // 10),
    ("a ramp of 100 000 steps/s², 30 to 34 steps per tick", 30 * _ONE, (_ONE << 5) // 10),
)


def measure(args: Sequence[str] = ()) -> list[tuple[str, float]]:
    """Return [(what, microseconds)]: the interrupt by itself, the tick with all motors at rest, the
    cost of a motor."""
    from framestep.pulse import stepper
    from framestep_emulator import Emulator

    names = {
        name: getattr(stepper, name)
        for name in ("WRITE_INDEX", "POSITION", "MODE", "LEFT", "VELOCITY", "FRACTION")
    }
    names["RUN_START"] = stepper.RUN | stepper.START
    files = {"/main.py": b""}  # framestep does not start
    found: list[tuple[str, float]] = []

    def cost(emu, ms: float) -> float:
        with emu.measure() as measured:
            emu.advance(ms)
        ticks = measured["exceptions"]["irq3"]
        return ticks["cycles"] / ticks["count"] / 125

    empty = compiled("empty.py", b"@micropython.viper\ndef empty(t): pass\n", march("rp2040"))
    with Emulator(images.frozen(), files={**files, "/empty.mpy": empty}, args=args) as emu:
        emu.repl().exec("from empty import empty\n" + _SETUP.format(callback="empty", **names))
        emu.advance(50)
        entry = cost(emu, _STEADY_MS)
        found.append(("the interrupt with an empty function", entry))
    with Emulator(images.frozen(), files=files, args=args) as emu:
        repl = emu.repl()
        repl.exec(_SETUP.format(callback="kernel.tick", **names))
        emu.advance(50)
        rest = cost(emu, _STEADY_MS)
        found.append(("the tick with all motors at rest, besides", rest - entry))
        for name, velocity, acceleration in _MOTIONS:
            repl.exec(f"start({MOTORS}, {velocity}, {acceleration})")
            emu.advance(5)
            found.append((f"each motor: {name}", (cost(emu, _STEADY_MS) - rest) / MOTORS))
            repl.exec("stop()")
    return found


def table(rows: Iterable[tuple[str, float, float]]) -> Table:
    """Return a table of (what, with the flash-cache model, without)."""
    result = Table(title="where the tick's time goes, µs at 125 MHz", title_justify="left")
    for name in ("part", "measured", "without cache misses"):
        result.add_column(name, justify="left" if name == "part" else "right", no_wrap=True)
    for name, modelled, ideal in rows:
        result.add_row(name, f"{modelled:.1f}", f"{ideal:.1f}")
    return result


def both() -> list[tuple[str, float, float]]:
    """Return measure() with and without the flash-cache model, side by side."""
    modelled, ideal = measure(), measure(["--xip-miss", "0"])
    return [(name, value, other) for (name, value), (_, other) in zip(modelled, ideal, strict=True)]


if __name__ == "__main__":
    Console(highlight=False, width=110).print(table(both()))
