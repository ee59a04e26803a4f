"""Four 74HC595 at pins of the emulated board: what its trace shows of them is what the edges on
their pins make of any words, in whatever way the emulator gets there."""

import random

import numpy as np
import pytest

from framestep_emulator import Emulator
from framestep_tools.building import images

FIRST = 64
DATA, CLOCK, LATCH, ENABLE = 2, 3, 4, 5
WORD_CYCLES = 80
PROGRAM = f"""
import machine, rp2, time
from machine import Pin
machine.freq(125_000_000)

@rp2.asm_pio(
    out_init=rp2.PIO.OUT_LOW,
    sideset_init=(rp2.PIO.OUT_LOW, rp2.PIO.OUT_LOW),
    out_shiftdir=rp2.PIO.SHIFT_LEFT,
    fifo_join=rp2.PIO.JOIN_TX,
)
def send():
    wrap_target()
    pull(block).side(0)
    set(y, 31).side(0)[6]
    label("bit")
    out(pins, 1).side(0)
    jmp(y_dec, "bit").side(1)
    nop().side(2)[7]
    wrap()

sm = rp2.StateMachine(0, send, freq=10_000_000, out_base=Pin({DATA}), sideset_base=Pin({CLOCK}))
sm.active(1)
enable = Pin({ENABLE}, Pin.OUT, value=1)
"""
REGISTERS = ",".join(map(str, (DATA, CLOCK, LATCH, ENABLE, FIRST)))


@pytest.fixture(scope="module")
def board():
    with Emulator(images.emulator_ready(), files={}, args=["--registers", REGISTERS]) as emulator:
        repl = emulator.repl()
        repl.exec(PROGRAM)
        yield emulator, repl


def traced(board, code, pins=()):
    """Return the edges of the registers, and of these pins, while the board runs code."""
    emulator, repl = board
    emulator.trace_start([*range(FIRST, FIRST + 32), *pins])
    repl.exec(code)
    return emulator.trace_stop()


def outputs(edges):
    """Return the times of changes of the outputs, and the words then."""
    mine = edges[edges["pin"] >= FIRST]
    found = []
    word = 0
    for t in np.unique(mine["t"]):
        for _, pin, level in mine[mine["t"] == t].tolist():
            bit = 1 << (pin - FIRST)
            word = word & ~bit | bit * level
        found.append((int(t), word))
    return found[1:] if found else []


def sending(words):
    return f"for word in {words}: sm.put(word)\ntime.sleep_us(200)"


def test_outputs_follow_the_latch(board):
    """Each word appears once it is latched, and only while the outputs are enabled."""
    rng = random.Random(595)
    words = [0xFFFF0000, *(rng.getrandbits(32) for _ in range(20)), 0]
    assert outputs(traced(board, sending(words))) == []
    board[1].exec("enable(0)")
    found = outputs(traced(board, sending(words)))
    assert [word for _, word in found] == words
    assert min(np.diff([t for t, _ in found])) >= WORD_CYCLES * 100


def test_as_from_the_edges_of_its_pins(board):
    """With its data and clock in the trace each edge is made, and the outputs are the same at the
    same times, counted from the first latch."""
    rng = random.Random(74)
    words = [1, *(rng.getrandbits(32) for _ in range(6)), 0]
    code = f"enable(0)\nsm.active(0)\n{sending(words)}".replace("time", "sm.active(1)\ntime", 1)
    quick = outputs(traced(board, code))
    seen = traced(board, code, [DATA, CLOCK, LATCH])
    assert (seen["pin"] == CLOCK).sum() > 2 * 32 * (len(words) - 1)
    slow = outputs(seen)
    assert [word for _, word in quick] == [word for _, word in slow] == words
    times = np.array([[t for t, _ in found] for found in (quick, slow)])
    assert np.array_equal(*(times - times[:, :1]))


def test_random_at_power_up(board):
    """Registers begin with random levels, which only OE keeps from the outputs."""
    emulator = Emulator(images.emulator_ready(), files={}, args=["--registers", REGISTERS])
    with emulator:
        repl = emulator.repl()
        enable = f"from machine import Pin\nPin({ENABLE}, Pin.OUT, value=0)"
        shown = traced((emulator, repl), enable)
        word = outputs(shown)[-1][1]
        assert word not in (0, 0xFFFFFFFF)


def test_no_such_pin(board):
    with pytest.raises(Exception, match="no pin 96"):
        board[0].trace_start([96])
