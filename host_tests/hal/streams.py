"""Sessions on the stream engine and on the model of PIO's: painted words, and times of edges."""

import os
import subprocess
import sys
import tempfile
from array import array
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from framestep.motors.axes import Axes
from framestep.pulse.stepper import AHEAD, DUE, FIFO
from framestep_tools.building.board_files import folded, write_tree
from host_tests.pulse.engine import PER_US, Bench

REPLAY = Path(__file__).parents[1] / "runtime" / "stream_replay.py"
WORDS = 250  # in a tick
WORD_US = 4
END_WORDS = 3  # of a motor
# bits of the motors' steps, as in stream_replay.py; the next is the direction's
STEPS = {"stream": (0, 16, 14, 3), "registers": (0, 30, 14, 3)}


@dataclass
class Painted:
    """The levels that a session has painted; tick n begins at words[n * WORDS]."""

    words: np.ndarray
    lost: int
    modes: list[int]
    faults: list[int]
    positions: list[int]
    engine: str  # a key of STEPS

    def step(self, motor: int) -> int:
        """Return the bit of a motor's step."""
        return STEPS[self.engine][motor]

    def bit(self, bit: int) -> np.ndarray:
        return (self.words.astype(np.int64) >> bit & 1).astype(int)

    def rises(self, bit: int) -> np.ndarray:
        """Return the indexes of the words in which it rises."""
        return np.flatnonzero(np.diff(self.bit(bit), prepend=0) == 1)

    def changes(self, bit: int) -> np.ndarray:
        return np.flatnonzero(np.diff(self.bit(bit), prepend=0))

    def ways(self, motor: int) -> np.ndarray:
        """Return +1 or -1 for each step."""
        up = 0 if motor % 2 else 1
        bit = self.step(motor)
        return np.where(self.bit(bit + 1)[self.rises(bit)] == up, 1, -1)


def read(data: bytes, motors: int, engine: str = "stream") -> Painted:
    """Read the output of stream_replay.py."""
    found = np.frombuffer(data, "<i4")
    frames, end = np.split(found, [len(found) - 1 - END_WORDS * motors])
    words = frames[1:]
    if engine == "stream":  # the upper levels leave a word early
        words = (frames[1:] & 0xFFFF | frames[:-1] & ~0xFFFF) >> 1
    modes, faults, positions = end[1:].reshape(motors, END_WORDS).T.tolist()
    return Painted(words, int(end[0]), modes, faults, positions, engine)


@cache
def _core(engine: str) -> Path:
    """Return the core built for this engine, as Python."""
    tree = Path(tempfile.mkdtemp(prefix="framestep-stream-"))
    write_tree(tree, folded({}, False, engine, {}))
    return tree


def here(lines: list[str], out: Path, engine: str = "stream") -> bytes:
    """Play a session on CPython."""
    subprocess.run(
        [sys.executable, REPLAY, out],
        input="".join(line + "\n" for line in lines).encode(),
        env={**os.environ, "PYTHONPATH": str(_core(engine))},
        check=True,
    )
    return out.read_bytes()


def on_pio(lines: list[str]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Play the same session on the model of PIO. Return for each motor the times of its steps and
    their directions. Times are µs from the start of the first tick's pulses."""
    _, motors, _ = lines[0].split()
    bench = Bench(int(motors), jitter_us=0)
    for i, engine in enumerate(bench.engines):
        bench.kernel.configure(i, bench.block(i)[FIFO], 0, 625, i % 2 == 1)
        engine.up = i % 2 ^ 1
    bench.settle()
    axes = Axes(bench)
    start = bench.state[DUE] + bench.state[AHEAD] / PER_US
    target = array("i", [0, 0])
    for line in lines[1:]:
        what, *words = line.split()
        numbers = [int(word) for word in words]
        if what == "speed":
            axes[numbers[0]].set_speed(*numbers[1:])
        elif what == "travel":
            target[1] = numbers[1]
            axes[numbers[0]].move_to(bench, target, 1)
        elif what == "stop":
            axes[numbers[0]].stop(bench, numbers[1])
        elif what == "batch":
            axes.feed()
            bench.run(numbers[0])
    found = []
    for motor in range(int(motors)):
        times, ways = bench.times(motor)
        found.append((times / PER_US - start, ways))
    return found
