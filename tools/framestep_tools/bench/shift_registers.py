"""Sixteen motors and more on a Pico 2, as a prototype: `python -m
framestep_tools.bench.shift_registers`.

PIO sends words to chains of 74HC595 (shift_registers_on_board.py). All of it runs on the emulated
board; what is behind the registers is rebuilt from the edges on their three pins.
"""

import subprocess
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from framestep.pulse.stepper import POSITION, TICKS
from framestep_emulator import Emulator

from ..building import images
from ..building.board_files import board_data, compiled, folded, march
from ..errors import ToolError

CHAIN = 16  # motors of a chain of four registers
BITS = 32
WORD_US = 4
COUNTS = (16, 24, 32)
RATES = (1_000, 20_000, 60_000, 100_000)
MOST_US = 0.5  # that an edge may be off a grid of WORD_US, besides
PINS = (2, 3, 4, 6, 7, 8)  # data, clock and latch of each chain
BOARDS = {"pico2": (150, "irq10"), "pico": (200, "irq11")}  # MHz, DMA's interrupt
_ACCELERATION = 2_000_000
_STOP_MS = 150
_SPREAD = 37  # steps/s by which a motor is slower than the one before, so that no two agree
_TICKS = f"board.kernel.state[{TICKS}]"
_SCRIPT = Path(__file__).with_name("shift_registers_on_board.py")
_IN_C = Path(__file__).with_suffix(".c")
_GCC = ("arm-none-eabi-gcc", "-mcpu=cortex-m33", "-mthumb", "-O2", "-ffreestanding", "-fPIC")
_CODE = """
@micropython.asm_thumb
def paint(r0, r1, r2, r3):
    bl(CODE)
    b(END)
    align(4)
    label(CODE)
{words}
    label(END)
"""
_PARTS = ("__init__", "base/", "pulse/", "motors/", "motion/", "hal/__init__", "shift")
_SETUP = """
import gc, machine, sys, time
from array import array
for name in list(sys.modules):
    if name.startswith("framestep"):
        del sys.modules[name]
sys.path.insert(0, "/prototype")
from framestep import shift
gc.collect()
free = gc.mem_free()
board = shift.Board({motors}, {pins})
gc.collect()
taken = free - gc.mem_free()
target = array("i", [0, 0])
def go(moves):
    for motor, (rate, acceleration, steps) in moves.items():
        board.axes[motor].set_speed(rate, acceleration)
    for motor, (rate, acceleration, steps) in moves.items():
        target[1] = board.kernel.blocks[motor][{POSITION}] + steps
        board.axes[motor].move_to(board, target, 1)
def run(ms):
    end = time.ticks_add(time.ticks_ms(), ms)
    while time.ticks_diff(end, time.ticks_ms()) > 0:
        board.axes.feed()
        machine.idle()
"""


@cache
def files(board: str) -> dict[str, bytes]:
    """Return the file system of a board with the prototype: the core, built for a stream of
    words."""
    chip = board_data(board)["chip"]
    modules = folded({"framestep/shift.py": _SCRIPT.read_text()}, False, "stream", rp2=chip)
    wanted = tuple(f"framestep/{part}" for part in _PARTS)
    return {"/main.py": b""} | {
        f"/prototype/{name.removesuffix('.py')}.mpy": compiled(name, source, march(chip))
        for name, source in modules.items()
        if name.startswith(wanted)
    }


def in_c() -> bytes:
    """Return a module with `paint` as a compiler makes it of C."""
    with tempfile.TemporaryDirectory(prefix="paint-") as folder:
        made, code = Path(folder, "paint.o"), Path(folder, "paint.bin")
        subprocess.run([*_GCC, "-c", _IN_C, "-o", made], check=True)
        copy = ("arm-none-eabi-objcopy", "-O", "binary", "-j", ".text")
        subprocess.run([*copy, made, code], check=True)
        halves = np.frombuffer(code.read_bytes(), "<u2").tolist()
    text = _CODE.format(words="\n".join(f"    data(2, {half})" for half in halves))
    return compiled("painted.py", text.encode(), march("rp2350"))


def behind(edges: np.ndarray, pins: Iterable[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the times at which a chain latched, ns, and the words then: bit n is output n, output
    0 the first stage of the first register.

    edges: a trace of its data, clock and latch. A register takes its data at a rising clock and
    shows what it has at a rising latch.
    """
    levels = [edges[edges["pin"] == pin] for pin in pins]
    data = levels[0]
    clock, latch = (mine["t"][1:][mine["level"][1:] == 1] for mine in levels[1:])
    bits = data["level"][np.searchsorted(data["t"], clock, side="right") - 1].astype(np.uint64)
    ends = np.searchsorted(clock, latch)
    latch, ends = latch[ends >= BITS], ends[ends >= BITS]
    words = np.zeros(len(ends), np.uint64)
    for output in range(BITS):
        words |= bits[ends - 1 - output] << np.uint64(output)
    return latch, words


@dataclass
class Seen:
    """What came out of a board's chains, and what its interrupts took."""

    latches: list[tuple[np.ndarray, np.ndarray]]  # of each chain
    tick_us: float
    paint_us: float
    interrupt_us: float  # of each millisecond
    worst_us: float
    load: float

    def _bit(self, motor: int, which: int) -> tuple[np.ndarray, np.ndarray]:
        times, words = self.latches[motor // CHAIN]
        bit = np.uint64(2 * (motor % CHAIN) + which)
        return times, (words >> bit & np.uint64(1)).astype(np.int8)

    def steps(self, motor: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the times of a motor's steps, µs, and +1 or -1 for each."""
        times, levels = self._bit(motor, 0)
        ways = self._bit(motor, 1)[1]
        rises = np.flatnonzero(np.diff(levels) == 1) + 1
        return times[rises] / 1e3, np.where(ways[rises] == 1, 1, -1)

    def turns(self, motor: int) -> np.ndarray:
        """Return the times at which its direction changes, µs."""
        times, levels = self._bit(motor, 1)
        return times[np.flatnonzero(np.diff(levels)) + 1] / 1e3

    def high(self, motor: int) -> bool:
        """Return whether its step is high at the end."""
        return bool(self._bit(motor, 0)[1][-1])


class Prototype:
    """An emulated board with this engine. c: the words are painted by C, on a Pico 2 only."""

    def __init__(self, motors: int, c: bool = False, board: str = "pico2"):
        self.motors = motors
        self.mhz, self.interrupt = BOARDS[board]
        self.c = c
        self.chains = -(-motors // CHAIN)
        more = {"/painted.mpy": in_c()} if c else {}
        self.emu = Emulator(images.frozen(board), files=files(board) | more)

    def __enter__(self) -> "Prototype":
        self.emu.start()
        self.repl = self.emu.repl()
        self.repl.exec(f"from framestep.hal.rp2.clock import set_clock\nset_clock({self.mhz})")
        self.repl.exec(_SETUP.format(motors=self.motors, pins=list(PINS), POSITION=POSITION))
        if self.c:
            self.repl.exec("import painted\nshift.paint = painted.paint")
        self.emu.advance(10)
        return self

    def __exit__(self, *_: object) -> None:
        self.emu.close()

    def eval(self, expression: str) -> Any:
        return self.repl.eval(expression)

    def watch(self, code: str) -> Seen:
        """Run code on the board and record all edges meanwhile."""
        self.eval("board.times()")
        self.emu.trace_start(PINS[: 3 * self.chains])
        ticks = self.eval(_TICKS)
        with self.emu.measure() as measured:
            self.repl.exec(code)
        edges = self.emu.trace_stop()
        ticked, painted = self.eval("board.times()")
        ticks = self.eval(_TICKS) - ticks
        cost = measured["exceptions"][self.interrupt]
        return Seen(
            [behind(edges, PINS[3 * chain : 3 * chain + 3]) for chain in range(self.chains)],
            ticked / ticks,
            painted / ticks,
            cost["cycles"] / self.mhz / measured["ms"],
            cost["max"] / self.mhz,
            measured["load"],
        )

    def go(self, moves: Mapping[int, tuple[int, int, int]]) -> str:
        """Return code that begins moves. moves: of each motor, from 0 on, steps/s, steps/s² and
        steps."""
        return f"go({dict(moves)})\n"

    def stop(self) -> None:
        """Bring all motors to rest."""
        self.repl.exec(f"board.axes.stop()\nrun({_STOP_MS})")

    def complaints(self) -> list[str]:
        """Return the names of the faults since the start."""
        _, _, faults, lost, misses = self.eval("board.state()")
        found = {"faults": faults, "lost commands": any(lost), "the ring ran dry": misses}
        return [name for name, value in found.items() if value]


def rates(rate: int, motors: int) -> list[int]:
    """Return the velocity of each motor, steps/s: at most `rate`."""
    return [max(rate - _SPREAD * motor, rate // 2) for motor in range(motors)]


def off_us(times: np.ndarray, rate: int) -> float:
    """Return how far the times of steps at a constant velocity are off an ideal at most, µs."""
    off = times - np.arange(len(times)) * 1e6 / rate
    return float(np.ptp(off)) / 2


def steady(board: Prototype, rate: int, ms: int = 40) -> tuple[Seen, float]:
    """Let all motors move at constant velocities. Return what was seen, and the worst distance of
    an edge from its ideal, µs. Raises ToolError if an edge is not where it should be, or a fault is
    reported."""
    velocities = rates(rate, board.motors)
    moves = {
        motor: (velocity, _ACCELERATION, 2 * velocity * (-1 if motor % 2 else 1))
        for motor, velocity in enumerate(velocities)
    }
    begun = rate * 1000 // _ACCELERATION + 60
    board.repl.exec(board.go(moves) + f"run({begun})")
    seen = board.watch(f"run({ms})")
    worst = 0.0
    for motor, velocity in enumerate(velocities):
        times, ways = seen.steps(motor)
        if len(times) < velocity * ms // 1100:
            raise ToolError(f"motor {motor + 1} makes {len(times)} steps in {ms} ms")
        off = off_us(times, velocity)
        if off > WORD_US / 2 + MOST_US or np.ptp(ways):
            raise ToolError(f"motor {motor + 1} is {off:.2f} µs off")
        worst = max(worst, off)
    if complaints := board.complaints():
        raise ToolError(", ".join(complaints))
    return seen, worst


HEAD = (
    "board",
    "motors",
    "words by",
    "steps/s each",
    "tick, µs",
    "words, µs",
    "a ms, µs",
    "worst, µs",
    "edge off, µs",
    "heap, kB",
)


def figures(motors: int, c: bool, name: str, say: Callable[[Sequence[str]], None]) -> None:
    """Say a row for each rate that these motors reach. name: of the board."""
    with Prototype(motors, c, name) as board:
        heap = board.eval("taken") / 1000
        for rate in RATES:
            row = [name, str(motors), "C" if c else "viper", str(rate)]
            try:
                seen, worst = steady(board, rate)
            except ToolError as error:
                say([*row, str(error)])
                return
            times = (seen.tick_us, seen.paint_us, seen.interrupt_us, seen.worst_us)
            say([*row, *(f"{us:.0f}" for us in times), f"{worst:.2f}", f"{heap:.0f}"])
            board.stop()


if __name__ == "__main__":

    def say(row: Sequence[str]) -> None:
        print(" ".join(f"{cell:>12}" for cell in row), flush=True)

    say(HEAD)
    for count in COUNTS:
        for compiled_from_c in (False, True):
            figures(count, compiled_from_c, "pico2", say)
    figures(COUNTS[0], False, "pico", say)
