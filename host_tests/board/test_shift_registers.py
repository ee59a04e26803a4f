"""The prototype of an engine for more than twelve motors (bench/shift_registers.py), on an emulated
Pico 2: the steps behind its shift registers are those that the model of PIO's engine makes."""

import numpy as np
import pytest

from framestep.pulse.stepper import FAULT_LATE
from framestep_tools.bench.shift_registers import WORD_US, Prototype, off_us, rates, steady
from host_tests.covering import sweep
from host_tests.hal.streams import on_pio

SHOWN = 0.3  # µs by which engines with different clocks may differ, besides rounding to words
SETUP_US = 5
STOP_DMA = """
from machine import mem32
for channel in range(16):
    mem32[0x50000010 + 0x40 * channel] = 0
mem32[0x50000464] = 0xFFFF
time.sleep_ms(5)
"""  # as soft_reset.py does


@pytest.fixture(scope="module")
def board():
    with Prototype(16) as prototype:
        yield prototype


@pytest.fixture(autouse=True)
def at_rest(request):
    yield
    if "board" in request.fixturenames:
        request.getfixturevalue("board").stop()


def check_counts(board, seen, before):
    """Each motor has made the steps of its position, in its direction."""
    after = board.eval("board.state()[0]")
    made = [int(seen.steps(motor)[1].sum()) for motor in range(board.motors)]
    assert made == [new - old for new, old in zip(after, before, strict=True)]


def check_turns(seen, motors):
    """No direction changes within a pulse, or less than the setup time before one."""
    found = 0
    for motor in range(motors):
        times, _ = seen.steps(motor)
        for turn in seen.turns(motor):
            found += 1
            assert not ((times <= turn) & (turn < times + WORD_US - SHOWN)).any()
            after = times[times > turn]
            assert not len(after) or after[0] - turn >= SETUP_US
    assert found


def test_the_steps_of_pio_to_a_word(board):
    """Sixteen motors go and come back, each at its own rate and acceleration."""
    there = {
        motor: (20_000 - 800 * motor, 400_000 + 5_000 * motor, 150 - 4 * motor)
        for motor in range(16)
    }
    back = {motor: (*there[motor][:2], -80) for motor in there}
    before = board.eval("board.state()[0]")
    seen = board.watch(f"{board.go(there)}run(55)\n{board.go(back)}run(45)")
    lines = ["new 16 0"]
    for moves in (there, back):
        for motor, (rate, acceleration, steps) in moves.items():
            target = steps + (there[motor][2] if moves is back else 0)
            lines += [f"speed {motor} {rate} {acceleration}", f"travel {motor} {target}"]
        lines += ["batch 2"] * 80
    for motor, (times, ways) in enumerate(on_pio(lines)):
        found, directions = seen.steps(motor)
        assert np.array_equal(directions, ways), f"motor {motor + 1}"
        for move in (ways == 1, ways == -1):
            late = found[move] - times[move]
            assert np.ptp(late) <= WORD_US + 2 * SHOWN, f"motor {motor + 1}"
    check_counts(board, seen, before)
    check_turns(seen, 16)
    assert not board.complaints()


def test_sixteen_at_20000(board):
    """Every edge lies on the grid around its ideal, and half of the time is left."""
    seen, worst = steady(board, 20_000)
    assert worst <= WORD_US / 2 + SHOWN
    assert seen.worst_us < 500


@pytest.mark.repeats
def test_turns_in_motion(board):
    """Moves that are replaced while their motors run: no step is lost, directions are in time."""
    rng = np.random.default_rng(16)
    code = ""
    for _ in range(6):
        moves = {
            motor: (20_000, 2_000_000, int(rng.integers(-400, 400)))
            for motor in rng.permutation(16)[:5].tolist()
        }
        code += f"{board.go(moves)}run(9)\n"
    before = board.eval("board.state()[0]")
    seen = board.watch(code + "run(80)")
    check_counts(board, seen, before)
    check_turns(seen, 16)


@pytest.mark.parametrize("ms", sweep([2, 4, 13], 4))
def test_a_late_interrupt(board, ms):
    """Up to one block late nothing is lost. Then the ring runs dry: all steps are low, no word is
    played again, and whatever moves faults and ramps down."""
    away = (
        "state = machine.disable_irq()\nbegun = time.ticks_us()\n"
        f"while time.ticks_diff(time.ticks_us(), begun) < {1000 * ms - 700}: pass\n"
        "machine.enable_irq(state)\n"
    )
    board.repl.exec("board.kernel.state[8] = board.feed[5] = 0")
    moves = {motor: (rate, 1_000_000, 4_000) for motor, rate in enumerate(rates(15_000, 16))}
    before = board.eval("board.state()[0]")
    seen = board.watch(f"{board.go(moves)}run(40)\n{away}run(30)\nboard.axes.stop()\nrun(40)")
    _, modes, faults, _, misses = board.eval("board.state()")
    check_counts(board, seen, before)
    assert not any(modes)
    gaps = [float(np.diff(seen.steps(motor)[0][100:]).max()) / 1000 for motor in range(16)]
    if ms == 2:
        assert not misses
        assert not faults
    else:
        assert misses == 1
        assert faults == FAULT_LATE
        assert all(ms - 3 < gap for gap in gaps), gaps


@pytest.mark.repeats
def test_two_chains():
    """The seventeenth motor is the first of a second chain."""
    with Prototype(18) as board:
        before = board.eval("board.state()[0]")
        moves = {motor: (9_000 + 500 * motor, 1_000_000, 40 * motor) for motor in range(18)}
        seen = board.watch(f"{board.go(moves)}run(100)")
        check_counts(board, seen, before)
        assert not board.complaints()


@pytest.mark.repeats
def test_without_dma(board):
    """If DMA ends, the program sends zeros: no pulse stays high, and none follows."""
    moves = {motor: (rate, 2_000_000, 4_000) for motor, rate in enumerate(rates(20_000, 16))}
    seen = board.watch(f"{board.go(moves)}run(60)\n{STOP_DMA}")
    end = seen.latches[0][0][-1] / 1000
    assert not any(seen.high(motor) for motor in range(16))
    assert all(4000 < end - seen.steps(motor)[0][-1] < 6000 for motor in range(16))


def test_off_us():
    times = np.arange(50) * 50.0
    times[20] += 3
    assert off_us(times, 20_000) == pytest.approx(1.5)
