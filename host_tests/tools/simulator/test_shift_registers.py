"""The model of 74HC595 behind I2S, against one that shifts bit by bit."""

import random

import numpy as np
import pytest

from framestep_tools.judge.trace import BoardPins, Trace
from framestep_tools.simulator import shift_registers


def by_hand(samples):
    """Return the chain's outputs after each rise of WS, from the wires."""
    register, outputs, latched = 0, 0, []
    wire = 0  # the data line is a clock behind
    for at in range(0, len(samples), 4):
        left, right = (int.from_bytes(samples[at + n : at + n + 2], "little") for n in (0, 2))
        for clock in range(32):
            if clock == 16:  # WS rises between two rising edges of the clock
                outputs = register
                latched.append(outputs)
            register = (register << 1 | wire) & 0xFFFFFFFF
            wire = (left if clock < 16 else right) >> (15 - clock % 16) & 1
    return latched


def test_the_outputs_are_those_of_shift_registers():
    samples = random.Random(1).randbytes(4 * 300)
    buffers = [(0, samples[:400]), (400_000, samples[400:])]
    times, words = shift_registers.outputs(buffers, 250_000)
    assert words.tolist() == by_hand(samples)
    assert times.tolist() == [n * 4000 + 2000 for n in range(300)]


def test_changes_become_edges():
    """Bit 5 of memory's left half is bit 4 after the chain; steps count by the direction pin."""
    frames = np.zeros((8, 2), "<u2")
    frames[3:5, 0] = 1 << 5  # output 4
    frames[6, 0] = 1 << 5
    frames[5:, 0] |= 1 << 6  # output 5
    times, words = shift_registers.outputs([(0, frames.tobytes())], 250_000)
    trace = Trace.from_records(
        shift_registers.records(times, words), BoardPins((4,), (5,), {5: "dir1"})
    )
    assert [list(column) for column in trace.steps(1)] == [[14_000, 26_000], [-1, 1]]
    assert trace.signals["dir1"][0].tolist() == [2000, 22_000]


def test_nothing_played_has_no_edges(tmp_path):
    (tmp_path / "record").write_bytes(b"")
    assert shift_registers.played(tmp_path / "record") == []
    assert len(shift_registers.records(*shift_registers.outputs([], 250_000))) == 0


@pytest.mark.parametrize("cut", [1, 11, 13])
def test_a_record_that_is_cut_off_is_reported(tmp_path, cut):
    whole = (0).to_bytes(8, "little") + (4).to_bytes(4, "little") + b"\1\2\3\4"
    (tmp_path / "record").write_bytes(whole + whole[:cut])
    with pytest.raises(shift_registers.ChainError, match="ends within a buffer"):
        shift_registers.played(tmp_path / "record")
