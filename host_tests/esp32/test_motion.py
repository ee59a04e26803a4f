"""Motors behind 74HC595 on the simulated ESP32, with a main loop as late as the test says. Compares
the edges of the chain's outputs with those of PIO's model."""

import random
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from framestep.pulse import stepper
from framestep_tools.judge.trace import BoardPins, Trace
from framestep_tools.simulator import shift_registers
from host_tests.hal import streams

REPLAY = Path(__file__).with_name("chain_replay.py")
RATE = 250_000
BUFFERS = 24
BUFFER_US = 1024
LATCH_US = 2  # from the start of a frame
LAG_US = 1000  # a tick's pulses are in the words of the next one
WORD_US = 4
SHOWN_US = 0.5  # two engines with different clocks
QUIET = ["pass 1000"] * 60  # until all waiting ticks have samples


@dataclass
class Played:
    """The edges, and what the board said during the play."""

    times: np.ndarray  # ns, of each word of outputs
    words: np.ndarray
    trace: Trace
    passes: list[list[int]]  # µs, ticks done, positions reported
    lost: int
    modes: list[int]
    faults: list[int]
    positions: list[int]

    def steps(self, motor):
        """Return µs and directions of a motor's steps."""
        times, ways = self.trace.steps(motor + 1)
        return times / 1000, ways if motor % 2 == 0 else -ways

    def position_at(self, motor, us):
        times, ways = self.steps(motor)
        return int(ways[: np.searchsorted(times, us, side="right")].sum())


@pytest.fixture
def play(chip, tmp_path):
    """Return play(lines, buffers, width): two motors, one in each half of the words, with pulses of
    4 µs."""

    def run(lines, buffers=BUFFERS, width=0):
        script = "".join(line + "\n" for line in [f"new 2 {width} {buffers}", *lines])
        said = chip.run(
            REPLAY, tmp_path / "played", path=[streams.REPLAY.parent], stdin=script.encode()
        ).splitlines()
        rows = [(line.split()[0], [int(word) for word in line.split()[1:]]) for line in said]
        times, words = shift_registers.outputs(shift_registers.played(tmp_path / "played"), RATE)
        pins = BoardPins((0, 20), (1, 21), {1: "dir1", 21: "dir2", 24: "shutter"})
        motors = [row for kind, row in rows if kind == "motor"]
        return Played(
            times,
            words,
            Trace.from_records(shift_registers.records(times, words), pins),
            [row for kind, row in rows if kind == "pass"],
            next(row[0] for kind, row in rows if kind == "end"),
            *map(list, zip(*motors, strict=True)),
        )

    return run


def check(found, lines, buffers=BUFFERS):
    """Assert that each step is within a word of PIO's, with no other, and no position lost."""
    done = [ticks for _, ticks, *_ in found.passes]
    batches = iter(np.diff(done, prepend=0))
    same = ["new 2 0"]
    for line in lines:
        if line.startswith("pass"):
            count = next(batches)
            same += [f"batch {count}"] if count else []
        else:
            same.append(line)
    for motor, (wanted, ways) in enumerate(streams.on_pio(same)):
        times, found_ways = found.steps(motor)
        assert np.array_equal(found_ways, ways), f"motor {motor}"
        assert found.positions[motor] == ways.sum()
        if len(ways):
            early = wanted - (times - LATCH_US - buffers * BUFFER_US - LAG_US)
            assert early.min() >= -SHOWN_US, f"motor {motor}: {early.min()} to {early.max()}"
            assert early.max() <= WORD_US + SHOWN_US, f"motor {motor}: {early.max()}"
    assert not found.lost
    assert not any(found.faults)


SESSION = [
    *QUIET,
    "speed 0 30000 300000",
    "speed 1 900 9000",
    "travel 0 6000",
    "travel 1 -150",
    *["pass 1000"] * 150,
    "travel 0 500",  # turns
    *["pass 1300"] * 250,
    "travel 1 300",
    "travel 0 9000",
    *["pass 700"] * 150,
    "stop 0 4",
    "stop 1 1",
    *["pass 1000"] * 200,
]


def test_a_ramp_a_steady_velocity_a_reversal_a_stop(play):
    found = play(SESSION)
    check(found, SESSION)
    times, _ = found.steps(0)
    assert len(times) > 10_000
    steady = np.diff(times)[(times[:-1] > 190_000) & (times[:-1] < 230_000)]
    assert set(steady) == {32, 36}, "on the grid around 33.3 µs"
    assert found.modes == [stepper.IDLE, stepper.IDLE]


@pytest.mark.parametrize("buffers", [8, 40])
def test_the_depth_of_the_ring_moves_edges_as_a_whole(play, buffers):
    """The depth also says how long a pause may be."""
    longest = (buffers - 3) * BUFFER_US
    lines = SESSION[: len(QUIET) + 60] + [f"pass {longest}", "pass 0"] * 5
    lines += ["stop 0 1", "stop 1 1"] + ["pass 1000"] * 150
    check(play(lines, buffers), lines, buffers)


def test_positions_are_reported_when_they_have_been_played(play):
    found = play(SESSION)
    moved = 0
    for us, _, *reported in found.passes[len(QUIET) :]:
        for motor, position in enumerate(reported):
            before = [found.position_at(motor, us - back) for back in range(0, 7000, 250)]
            assert min(before) <= position <= max(before), f"motor {motor} at {us} µs"
            moved += bool(position)
    assert moved > 500


def test_pauses_of_20_ms_lose_nothing(play):
    rng = random.Random(3)
    lines = [line for line in SESSION if not line.startswith("pass")]
    lines = QUIET + lines[:4] + ["pass 1000"] * 5 + ["pass 20000"] * 5
    lines += [f"pass {rng.randint(0, 20000)}" for _ in range(20)]
    lines += ["travel 0 100", "pass 20000", "stop 1 1"] + ["pass 20000"] * 20
    found = play(lines)
    check(found, lines)
    assert len(found.steps(0)[0]) > 10_000


@pytest.mark.parametrize("pause", [23_700, 26_000, 60_000, 400_000])
def test_a_longer_pause_is_a_fault(play, pause):
    """The motor ramps down from the speed that it had after the pause, its position is lost, and
    yet each step was made once; the other motor, at rest, is not affected."""
    lines = [*QUIET, "speed 0 20000 100000", "travel 0 20000", *["pass 1000"] * 330]
    found = play([*lines, f"pass {pause}", *["pass 1000"] * 400])
    assert found.faults == [stepper.FAULT_LATE, 0]
    assert found.modes == [stepper.IDLE, stepper.IDLE]
    assert found.lost == 1
    times, ways = found.steps(0)
    assert ways.sum() == found.positions[0] == len(ways)
    gap = np.diff(times).max()
    assert gap > 2 * BUFFER_US
    later = times[np.diff(times).argmax() + 1 :]
    if pause == 400_000:
        assert len(later) < 80, "what it owed: three ticks at most"
    else:
        assert len(later) > 1000, "a ramp"
        pace = np.diff(later)[200:]
        assert pace[-1] > 5 * pace[0], "slower and slower"
    assert not len(found.steps(1)[0])


def test_no_step_is_doubled_where_a_pulse_is_cut_off(play):
    """Pulses of 16 µs, with pauses that begin anywhere within them."""
    lines = [*QUIET, "speed 0 25000 900000", "speed 1 24000 900000"]
    for n in range(12):
        lines += ["travel 0 90000", "travel 1 -90000", *["pass 1000"] * 60, f"pass {30000 + 7 * n}"]
        lines += ["pass 1000"] * 120
    found = play(lines, width=3)
    assert found.faults == [stepper.FAULT_LATE] * 2
    for motor in range(2):
        assert found.steps(motor)[1].sum() == found.positions[motor]
        assert len(found.steps(motor)[0]) == abs(found.positions[motor]) > 10_000


def test_after_a_fault_it_moves_again(play):
    """Ticks begin on the same grid as before, and two pauses in a row are no worse than one."""
    lines = [*QUIET, "speed 0 20000 100000", "travel 0 9000", *["pass 1000"] * 200]
    lines += ["pass 60000", "pass 50000", "pass 0", "pass 40000", *["pass 1000"] * 400]
    before = play(lines)
    lines += [f"drive {1 << 24} 0", "travel 0 3000", *["pass 1000"] * 700]
    found = play(lines)
    _, ways = found.steps(0)
    assert found.positions[0] == ways.sum() == 3000
    assert before.positions[0] != 3000
    assert found.modes[0] == stepper.IDLE
    shutter = found.trace.signals["shutter"][0]
    grid = (shutter[1] // 1000 - LATCH_US - BUFFERS * BUFFER_US) % 1000
    assert len(shutter) == 2
    assert grid == 0


def test_outputs_go_with_their_tick(play):
    """All words of the tick have it, and the direction comes with the step's own chain."""
    lines = [*QUIET, f"cue 80 {1 << 24} 0", *["pass 1000"] * 40, f"drive 0 {1 << 24}"]
    found = play([*lines, *["pass 1000"] * 60])
    times, levels = found.trace.signals["shutter"]
    assert levels.tolist() == [0, 1, 0]
    assert times[1] == (BUFFERS * BUFFER_US + 79 * 1000 + LATCH_US) * 1000


@pytest.mark.parametrize("buffers", [8, 24, 40])
def test_how_late_outputs_are(play, buffers):
    """A change comes after everything that waits: the ring, and up to two painted ticks."""
    lines, rng = [*QUIET], random.Random(buffers)
    for n in range(40):
        lines += [f"pass {rng.randint(200, 1500)}" for _ in range(3)]
        lines += [f"drive {1 << 24} 0" if n % 2 == 0 else f"drive 0 {1 << 24}"]
    found = play([*lines, *["pass 1000"] * 60], buffers)
    changes = found.trace.signals["shutter"][0][1:] / 1000
    made = [found.passes[len(QUIET) + 3 * n + 3][0] for n in range(40)]
    late = changes - made
    assert len(late) == 40
    assert late.min() >= (buffers - 1) * BUFFER_US + 1000 - 1500, "less what the pass before left"
    assert late.max() <= buffers * BUFFER_US + 2100


@pytest.mark.parametrize(
    "settings, wanted",
    [("0 7", "buffers: 8 to 40"), ("0 41", "buffers: 8 to 40")],
)
def test_a_ring_too_short_or_too_long_is_refused(chip, tmp_path, settings, wanted):
    script = f"new 2 {settings}\n".encode()
    with pytest.raises(pytest.fail.Exception, match=f"ValueError: {wanted}"):
        chip.run(REPLAY, tmp_path / "played", path=[streams.REPLAY.parent], stdin=script)


def test_a_write_to_flash_at_rest_moves_nothing(play):
    """The ring plays its levels repeatedly; a later motion is complete, and survives pauses."""
    lines = [*QUIET, f"drive {1 << 24} 0", *["pass 1000"] * 60]
    lines += ["flash 80000", "pass 0"] * 8 + ["pass 1000"] * 60
    lines += ["speed 0 20000 100000", "travel 0 2000", *["pass 12000"] * 40]
    found = play(lines)
    assert found.positions == [2000, 0]
    assert found.steps(0)[1].sum() == 2000
    assert found.faults == [0, 0]
    assert not found.lost


def test_deinit_ends_all_pulses_at_once(play):
    lines = [*QUIET, "speed 0 20000 100000", "travel 0 9000", *["pass 1000"] * 200]
    found = play([*lines, "deinit"])
    assert found.lost == 1
    assert found.times[-1] <= (found.passes[-1][0] + 1000) * 1000
    assert len(found.steps(0)[0]) < found.positions[0]
