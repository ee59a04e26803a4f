"""Pulses of the real kernel and PIO program on the emulated RP2040: every edge on the pins, and the
cost."""

import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from framestep.pulse import stepper
from framestep_emulator import Emulator, edge_times
from framestep_tools.building import images
from framestep_tools.prove.chips import CHIPS
from host_tests.pulse.engine import ONE, PER_TICK, PER_US, Bench, Profile, trapezoid

MOTORS = 8
NS = 8  # per cycle
FIRST_PIN = 2
_CONSTANT = re.compile(r"stepper\.([A-Z_]+)\b")

SETUP = Path(__file__).parent / "pulses_setup.py"


class Board:
    """The emulated board with kernel and engine, driven by the segments of ideal motions."""

    def __init__(self, emu, apart=(0,) * MOTORS):
        self.emu = emu
        self.repl = emu.repl()
        constants = f"APART = {apart}\nMICROSECONDS = {CHIPS['rp2040'].microseconds}\n"
        self.exec(constants + SETUP.read_text())

    def exec(self, code):
        """Run code with the kernel's constants as stepper.NAME, which the test replaces by
        numbers."""
        return self.repl.exec(_CONSTANT.sub(lambda m: str(getattr(stepper, m[1])), code)).strip()

    def play(self, profile, ms, motors=MOTORS, rest=True, brake=ONE // 10, meanwhile="", pins=None):
        """Play a motion on the first motors, and return the edges; `cost_us` and `worst_us` are the
        ticks'."""
        segments = [(*segment, 0, PER_TICK) for segment in profile.segments(rest)]
        for i in range(0, len(segments), 20):
            self.exec(f"moves.extend({segments[i : i + 20]})")
        self.emu.trace_start(pins or range(FIRST_PIN, FIRST_PIN + 2 * motors))
        with self.emu.measure() as measured:
            self.exec(f"start([], {motors}, {brake})\n{meanwhile}\nrun({ms})")
        ticks = measured["exceptions"]["irq3"]
        self.cost_us = ticks["cycles"] / ticks["count"] / PER_US
        self.worst_us = ticks["max"] / PER_US
        self.edges = self.emu.trace_stop()
        self.place, self.faults, self.late_us, self.lost, self.mode, self.spread = eval(
            self.exec("print(result())")
        )
        assert not self.lost
        return self

    def rises(self, motor=0):
        """Return the times of the rising edges, ns."""
        return edge_times(self.edges, FIRST_PIN + 2 * motor, 1).astype(float)

    def falls(self, motor=0):
        """Return the times of the falling edges, ns; a trace begins with a pin's level."""
        return edge_times(self.edges, FIRST_PIN + 2 * motor, 0).astype(float)[1:]

    def turns(self, motor=0):
        pin = self.edges[self.edges["pin"] == FIRST_PIN + 2 * motor + 1]
        return pin["t"][1:].astype(float)


@pytest.fixture(scope="module")
def board():
    # framestep does not start
    with Emulator(images.frozen(), files={"/main.py": b""}) as emu:
        yield Board(emu)


@pytest.fixture
def pulses(board):
    """Return the board with all motors at rest on 0."""
    board.exec("end()\nfresh()\nconfigure(0, 625, False)\ntime.sleep_ms(20)")
    return board


def errors_us(board, profile, motor=0, ticks=None, skipped=0.0):
    """Return the errors of the edges against the ideal, less their median."""
    ideal, _ = profile.steps()
    if ticks is not None:
        ideal = ideal[ideal < ticks]
    rises = board.rises(motor)[: len(ideal)]
    assert len(rises) == len(ideal)
    error = rises / 1000 - ideal * 1000
    error -= np.median(error)
    return error[ideal > skipped]


@pytest.mark.parametrize("rate, motors", [(350_000, MOTORS), (500_000, 1)])
def test_steady(pulses, rate, motors):
    """design: 350 000 steps/s by eight motors, 500 000 by one, edges within 0.5 µs, at most 60 µs a
    tick."""
    profile = Profile([(160, 0)], v=Fraction(rate, 1000))
    board = pulses.play(profile, 140, motors, rest=False)
    for motor in range(motors):
        error = errors_us(board, profile, motor, 130, skipped=3)
        assert len(error) > 120 * rate / 1000
        assert np.abs(error).max() < 0.5
    assert board.cost_us <= 60
    assert board.faults == 0


def test_ramp(pulses):
    """design: 2 µs in a ramp of 100 000 steps/s². The edges match the model of the
    engine."""
    profile = trapezoid(400, Fraction(1, 10), 20)
    board = pulses.play(profile, 840)
    for motor in range(MOTORS):
        error = errors_us(board, profile, motor)
        assert np.abs(error[:-1]).max() < 2
        # near rest the last bit of the position takes long
        assert abs(error[-1]) < 50
    assert (board.place, board.spread, board.faults, board.mode) == (
        profile.end, 0, 0, stepper.IDLE,
    )  # fmt: skip
    # all motors are in step: two of them differ by the microsecond of the clock and the code
    # between
    first = np.array([board.rises(motor) for motor in range(MOTORS)])
    assert np.ptp(first, axis=0).max() < 2500
    bench = Bench().settle()
    bench.play([profile.segments()])
    assert np.array_equal(np.diff(first[0]), np.diff(bench.times()[0]) * NS)


@pytest.mark.parametrize(
    "width, setup_us, invert", [(0, 5, False), (4, 20, True), (15, 100, False)]
)
def test_pulses_and_turns(pulses, width, setup_us, invert):
    """Pulse width and set-up time are as set, and each edge as in the model."""
    pulses.exec(f"configure({width}, {setup_us * PER_US}, {invert})")
    profile = Profile([(60, Fraction(1, 10)), (120, Fraction(-1, 10)), (60, Fraction(1, 10))])
    board = pulses.play(profile, 260, 1)
    rises, falls, turns = board.rises(), board.falls(), board.turns()
    assert set((falls - rises).tolist()) == {(50 + 25 * width) * NS}
    for turn in turns:
        assert not ((rises <= turn) & (falls > turn)).any()
        later = rises[rises > turn]
        assert not len(later) or later[0] - turn >= setup_us * 1000
    bench = Bench(width=width, setup=setup_us * PER_US, invert=invert).settle()
    bench.play([profile.segments()])
    model = bench.engines[0]
    model_turns = np.array(model.turns)
    assert np.array_equal(np.diff(rises), np.diff(model.rises) * NS)
    # In the model direction pins change a cycle late; the first change belongs to the start, timed
    # by the clock.
    there, here = (
        times[times > first] - first
        for times, first in ((turns, rises[0]), (model_turns, model.rises[0]))
    )
    assert len(there) == len(here)
    assert np.abs(there - here * NS).max(initial=0) <= NS
    assert board.place == profile.end


def test_steps_on_both_edges():
    """Each edge is as in the model, next to motors with pulses in the same PIO block: at full
    speed, and when the direction changes, which is set up before the edge."""
    setup_us, apart = 20, 50 * PER_US // 100
    with Emulator(images.frozen(), files={"/main.py": b""}) as emu:
        board = Board(emu, (0, apart, apart, 0, apart, apart, apart, apart))
        top = Profile([(160, 0)], v=Fraction(500))
        board.play(top, 140, rest=False)
        assert board.faults == 0
        for motor in range(MOTORS):
            edges = edge_times(board.edges, FIRST_PIN + 2 * motor).astype(float)[1:]
            steps = edges if motor not in (0, 3) else board.rises(motor)
            ideal = top.steps()[0]
            ideal = ideal[ideal < 130]
            error = steps[: len(ideal)] / 1000 - ideal * 1000
            error = (error - np.median(error))[ideal > 3]
            assert len(error) > 60_000
            assert np.abs(error).max() < 0.5
        assert board.cost_us <= 60
        board.exec(f"end()\nfresh()\nconfigure(4, {setup_us * PER_US}, False)\ntime.sleep_ms(20)")
        a = Fraction(1, 20)
        profile = Profile([(56, a), (110, -a), (54, a)])
        board.play(profile, 262, 3)
    assert (board.place, board.faults, board.mode) == (profile.end, 0, stepper.IDLE)
    edges = edge_times(board.edges, FIRST_PIN + 2).astype(float)[1:]
    for turn in board.turns(1):
        later = edges[edges > turn]
        assert not len(later) or later[0] - turn >= setup_us * 1000
    bench = Bench(setup=setup_us * PER_US, apart=apart).settle()
    bench.play([profile.segments()])
    assert np.array_equal(np.diff(edges), np.diff(bench.times()[0]) * NS)


@pytest.mark.parametrize("after_us, away_us", [(500, 200), (500, 1000), (50, 2000)])
def test_interrupts_off_for_a_while(pulses, after_us, away_us):
    """No edge moves. after_us: from a tick to the gap; the next tick is late if the gap goes beyond
    it."""
    profile = Profile([(160, 0)], v=Fraction(20_000, 1000))
    meanwhile = (
        "time.sleep_ms(20)\n"
        f"away({after_us}, {away_us})\n"
        "time.sleep_ms(5)\n"
        f"away({after_us}, {away_us})"
    )
    board = pulses.play(profile, 110, rest=False, meanwhile=meanwhile)
    for motor in range(MOTORS):
        assert np.abs(errors_us(board, profile, motor, 130, skipped=3)).max() < 0.5
    assert board.faults == 0
    assert board.late_us > after_us + away_us - 1000 - 20


@pytest.mark.parametrize("after_us, away_us", [(900, 2000), (500, 50_000)])
def test_interrupts_off_for_too_long(pulses, after_us, away_us):
    """A fault and a ramp from the remaining velocity: no edge is faster than before, there is no
    burst, and no step is lost or added."""
    rate, brake = 20_000, 1000  # a brake of 1000 steps/s each ms
    profile = Profile([(160, 0)], v=Fraction(rate, 1000))
    meanwhile = f"time.sleep_ms(20)\naway({after_us}, {away_us})"
    board = pulses.play(profile, 100, rest=False, brake=ONE, meanwhile=meanwhile)
    assert board.faults == stepper.FAULT_LATE
    assert board.mode == stepper.IDLE
    assert board.spread == 0
    for motor in range(MOTORS):
        rises = board.rises(motor)
        assert len(rises) == board.place
        gaps = np.diff(rises)[100:]
        assert gaps.min() > 0.99e9 / rate
        if away_us > 1000 * rate / brake:
            # the ramp would have ended by the end of the gap
            assert gaps.max() < 1.01e9 / rate
            continue
        hole = int(np.argmax(gaps > 1.5e9 / rate))
        after = 1e9 / gaps[hole + 1 :]
        assert len(after) > 50
        assert after.max() <= rate - brake + 1
        assert (np.diff(after) < 20).all()
    # the next motion is exact again
    pulses.exec(
        "kernel.state[stepper.FAULTS] = 0\n"
        "for b in kernel.blocks: b[stepper.POSITION] = b[stepper.FAULT] = 0"
    )
    profile = trapezoid(40, Fraction(1, 10), 0)
    board = pulses.play(profile, 100)
    assert (board.place, board.spread, board.faults) == (profile.end, 0, 0)
    assert np.abs(errors_us(board, profile)[:-1]).max() < 2
