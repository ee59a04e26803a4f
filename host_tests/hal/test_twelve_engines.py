"""The pulse engines of twelve motors: three PIO blocks, which only the RP2350 has. The emulated
board does not."""

import contextlib
import importlib
import sys
from types import SimpleNamespace
from typing import ClassVar

import pytest

from framestep.base import native_cpython
from framestep_tools.building.board_files import board_data

# RP2350 datasheet 11.7: blocks, TXF0 and FDEBUG
BLOCKS = (0x50200000, 0x50300000, 0x50400000)
TXF0, FDEBUG_WORD = 0x10, 2


class Machine:
    made: ClassVar[list] = []

    def __init__(self, number, program, freq, pull_thresh, set_base, out_base):
        assert pull_thresh == 18  # no rounds
        Machine.made.append((number, set_base.number, out_base.number))

    def active(self, on):
        assert on


class Pin:
    OUT = 1

    def __init__(self, number, mode, value):
        assert value == 0
        self.number = number


@pytest.fixture
def pulses(monkeypatch):
    """Return framestep.hal.rp2.pulses on a fake chip."""
    pio = SimpleNamespace(OUT_LOW=0, SHIFT_RIGHT=1, JOIN_TX=1)
    rp2 = SimpleNamespace(
        PIO=pio, asm_pio=lambda **_: lambda program: program, StateMachine=Machine
    )
    monkeypatch.setitem(sys.modules, "rp2", rp2)
    monkeypatch.setitem(sys.modules, "machine", SimpleNamespace(Pin=Pin, mem32={}))
    claims = SimpleNamespace(Claim=lambda *pins: contextlib.nullcontext())
    monkeypatch.setitem(sys.modules, "framestep.hal.rp2.pin_guard", claims)
    monkeypatch.delitem(sys.modules, "framestep.hal.rp2.pulses", raising=False)
    monkeypatch.setattr(Machine, "made", [])
    yield importlib.import_module("framestep.hal.rp2.pulses")
    sys.modules.pop("framestep.hal.rp2.pulses", None)


def test_every_motor_has_its_own(pulses):
    board = board_data("pico2")
    shapes = [(0, 625, False, 0, 0)] * len(board["step"])
    engine = pulses.PulseEngine(board["step"], board["dir"], 75_000_000, shapes)
    assert Machine.made == list(zip(range(12), board["step"], board["dir"], strict=True))
    assert [engine.fifo(i) for i in range(12)] == [
        block + TXF0 + 4 * i for block in BLOCKS for i in range(4)
    ]


class Register(dict):
    """FDEBUG: writing ones clears bits."""

    def __setitem__(self, index, value):
        super().__setitem__(index, self[index] & ~value)


@pytest.mark.parametrize("motor", range(12))
def test_a_lost_command_is_its_motors(pulses, monkeypatch, motor):
    for number, block in enumerate(BLOCKS):
        over = 1 << (16 + motor % 4) if motor // 4 == number else 0
        monkeypatch.setitem(
            native_cpython._memory, block, Register({FDEBUG_WORD: over | 0x0F000000})
        )
    assert pulses.lost_commands(12) == 1 << motor
    assert pulses.lost_commands(12) == 0
