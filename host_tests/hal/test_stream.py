"""The engine that is a stream of words in memory (hal/stream.py): its edges compared with those of
PIO's model."""

import random

import numpy as np
import pytest

from framestep.pulse import stepper
from host_tests.hal.streams import STEPS, WORD_US, WORDS, here, on_pio, read

LAG = 1000  # µs: a tick's pulses are in the words of the next tick
COARSE = 5  # µs by which PIO's edges, of fewer commands, are further off the curve in steep ramps
SHOWN = 0.3  # µs by which two engines with different clocks may differ, besides rounding to words


@pytest.fixture(params=["stream", "registers"])
def painted(request, tmp_path):
    """painted(lines): a session on the stream engine, in each form of its words."""

    def play(lines):
        out = here([*lines, "end"], tmp_path / "words", request.param)
        return read(out, int(lines[0].split()[1]), request.param)

    return play


# Outputs are in the words of one form only.
in_words = pytest.mark.parametrize("painted", ["stream"], indirect=True)


def session(rng, motors, count):
    """Draw moves that turn, bend and stop, with batches of any size."""
    yield f"new {motors} 0"
    for motor in range(motors):
        yield (
            f"speed {motor} {round(10 ** rng.uniform(1, 4.8))} {round(10 ** rng.uniform(3.5, 5.7))}"
        )
    for _ in range(count):
        motor = rng.randrange(motors)
        if rng.random() < 0.8:
            yield f"travel {motor} {round(rng.gauss(0, 4000))}"
        else:
            yield f"stop {motor} {rng.choice([1, 4])}"
        yield from (f"batch {rng.randint(1, 20)}" for _ in range(rng.randint(1, 12)))
    for motor in range(motors):
        yield f"stop {motor} 1"
    yield from ("batch 20" for _ in range(60))


def check_steps(found, lines):
    """Each step is in the word that is sent when PIO would make it, or near it."""
    coarse = COARSE if found.engine == "registers" else 0
    for motor, (times, ways) in enumerate(on_pio(lines)):
        rises = found.rises(found.step(motor))
        assert np.array_equal(found.ways(motor), ways), f"motor {motor}"
        early = times - (rises * WORD_US - LAG)
        if len(rises):
            least, most = -SHOWN - coarse, WORD_US + SHOWN + coarse
            assert least <= early.min() <= early.max() <= most, f"motor {motor}: {early}"
        assert found.positions[motor] == ways.sum()
    assert not found.lost
    assert not any(found.faults)


@pytest.mark.parametrize("seed", range(4))
def test_the_steps_of_pio_to_a_word(painted, seed):
    lines = list(session(random.Random(seed), 4, 10))
    found = painted(lines)
    assert sum(len(found.rises(found.step(motor))) for motor in range(4)) > 500
    check_steps(found, lines)


@pytest.mark.parametrize("painted", ["registers"], indirect=True)
def test_each_step_of_a_steep_ramp_in_its_word(painted):
    """With up to five steps in a tick, as where a motor turns."""
    slope, velocity = 355_000, 4_500
    lines = ["new 1 0", f"speed 0 {velocity} {slope}", "travel 0 300", *["batch 20"] * 6]
    times = WORD_US * painted(lines).rises(STEPS["registers"][0])
    ramp = np.arange(1, velocity**2 // (2 * slope) - 1)  # not its end
    off = times[: len(ramp)] - 1e6 * np.sqrt(2 * ramp / slope)
    assert np.ptp(off) / 2 <= WORD_US / 2 + SHOWN


@pytest.mark.parametrize("width", [0, 1, 3])
def test_pulses_are_as_wide_as_set(painted, width):
    """Wide enough, as far apart as they are wide, with the direction set before them: with 5 µs two
    words."""
    fastest = round(1e6 / (WORD_US * 2 * (width + 1)))
    lines = [
        f"new 2 {width}", f"speed 0 {fastest} 400000", "speed 1 3000 400000", "travel 0 9000",
        "travel 1 300",
    ]  # fmt: skip
    lines += ["batch 20"] * 15 + ["travel 0 -2000", "travel 1 -100"] + ["batch 20"] * 45
    found = painted(lines)
    for motor in range(2):
        step = found.bit(found.step(motor))
        rises, falls = (np.flatnonzero(np.diff(step, prepend=0) == way) for way in (1, -1))
        assert set(falls - rises) == {width + 1}
        assert (rises[1:] - falls[:-1]).min() >= width + 1
        for turn in found.changes(found.step(motor) + 1):
            assert not step[turn]
            after = rises[rises >= turn]
            assert not len(after) or after[0] - turn >= 2
        assert found.ways(motor).sum() == found.positions[motor]
    assert not found.lost
    assert not any(found.faults)


def test_batches_make_no_difference(painted):
    """However many ticks are done at a time, the words are the same."""
    wanted = None
    for sizes in ([20], [1], [7, 13]):
        lines = [
            "new 2 0", "speed 0 30000 200000", "speed 1 900 9000", "travel 0 4000", "travel 1 -150",
        ]  # fmt: skip
        for n in range(600 // sum(sizes)):
            lines += [f"batch {size}" for size in sizes]
            if (n + 1) * sum(sizes) == 300:
                lines += ["travel 0 100"]
        words = painted(lines).words
        assert wanted is None or np.array_equal(words, wanted)
        wanted = words


@in_words
def test_outputs_change_with_the_tick_of_their_cue(painted):
    """All words of that tick have it, whether a motor moves or not; a driven level holds from the
    next words on."""
    lines = [
        "new 1 0", "speed 0 20000 200000", "travel 0 3000", f"cue 12 {1 << 8 | 1 << 29} 0",
        "batch 20",
    ]  # fmt: skip
    lines += [f"cue 25 {1 << 9} {1 << 8}", "batch 7", f"drive {1 << 10} {1 << 29}", "batch 3"]
    found = painted(lines)
    # the first tick is number 1
    assert [list(found.changes(bit)) for bit in (8, 9, 10, 29)] == [
        [11 * WORDS, 24 * WORDS], [24 * WORDS], [27 * WORDS], [11 * WORDS, 27 * WORDS],
    ]  # fmt: skip


@pytest.mark.parametrize("ticks", [1, 3, 400])
def test_words_that_ran_out_are_a_fault(painted, ticks):
    """The motor makes the missing steps at once, then ramps down from the remaining velocity. No
    step is lost."""
    lines = ["new 2 0", "speed 0 20000 100000", "speed 1 500 9000", "travel 0 20000"] + [
        "batch 20"
    ] * 20
    before = painted(lines)
    lines += [f"miss {ticks}"] + ["batch 20"] * 20
    found = painted(lines)
    assert found.faults == [stepper.FAULT_LATE, 0]
    assert found.modes == [stepper.IDLE, stepper.IDLE]
    assert found.ways(0).sum() == found.positions[0]
    assert found.positions[1] == 0
    rises = found.rises(0)
    end = len(before.words) + WORDS + 1  # the last one owed may come as the next tick begins
    owed = rises[(rises >= len(before.words)) & (rises < end)]
    assert len(before.rises(0)) + len(owed) == before.positions[0]
    later = rises[rises >= end]
    if ticks == 400:
        assert not len(later), "the load has come to rest long since"
    else:
        assert len(later) > 1000, "slower from step to step"
        assert (np.diff(np.diff(later)) >= -1).all(), "slower from step to step"
    assert not found.lost


def test_commands_that_find_no_room_are_reported(painted):
    """Pulses of that width cannot be made so fast; the controller allows no such velocity."""
    lines = [
        "new 2 3", "speed 0 60000 400000", "speed 1 100 400000", "travel 0 20000", "travel 1 10",
    ]  # fmt: skip
    assert painted(lines + ["batch 20"] * 20).lost == 1
