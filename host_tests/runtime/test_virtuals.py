"""The kinematics as machine code on 32 bits, with the heap locked, give the same bits as on
CPython.

On CPython virtual_precision compares them with double precision; so this is the proof for the
board's numbers.
"""

import contextlib
import io
from array import array
from pathlib import Path

import numpy as np
import pytest

from framestep.protocol import messages
from framestep_tools.bench.virtual_precision import BANDS, RIGS, cases, errors, read
from framestep_tools.move.kinematics import put
from host_tests.runtime import virtuals_replay

REPLAY = Path(__file__).parent / "virtuals_replay.py"


def registers(*numbers):
    r = array("i", [0] * (2 * len(numbers)))
    for i, number in enumerate(numbers):
        put(r, 2 * i, float(number))
    return " ".join(map(str, r))


def expected(lines):
    """Return CPython's answers."""
    wanted = io.StringIO()
    with contextlib.redirect_stdout(wanted):
        virtuals_replay.play(lines)
    return wanted.getvalue().splitlines()


def script(rig, count):
    """Return poses of every rig to places and back, also out of reach, and aim points around."""
    random = np.random.default_rng(3)
    steps = [0] * 8
    found = read(rig)
    numbers = [*found.motors, *found.steps_per_unit, *found.positions, *found.lengths]
    table = bytes(found.table[found.table_at :][: 4 * 121]).hex() if found.table_at >= 0 else ""
    lines = [
        f"CONFIG {rig.kind} {' '.join(map(str, numbers))} x{table} {' '.join(map(str, steps))}"
    ]
    for n, (stand, pose, _) in enumerate(cases(rig, count, BANDS[-1])):
        for motor, step in stand.items():
            steps[motor - 1] = step
        if n % 10 == 9:
            pose[:3] += random.uniform(-2000, 2000, 3)
        lines += ["LOCATE " + " ".join(map(str, steps)), "POSE " + registers(*pose)]
        point = pose[[1, 2, 0]] + random.uniform(-3000, 3000, 3)
        lines.append(f"AIM {registers(*point)} {registers(*pose)}")
    return lines


def test_the_same_bits_as_cpython(runtime):
    lines = [line for rig in RIGS.values() for line in script(rig, 120)]
    lines.append("POSE " + registers(0, 1e9, 1e9, 0, 0, 0))
    wanted = expected(lines)
    codes = {line.split()[0] for line in wanted}
    assert codes == {"0", str(messages.ERR_RANGE)}
    answers = runtime.run(
        REPLAY, stdin="".join(line + "\n" for line in lines).encode()
    ).splitlines()
    for line, answer, want in zip(lines, answers, wanted, strict=True):
        assert answer == want, line[:80]


@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("limit, most", [(80, 0.1), (88, 0.5)])
def test_near_double_precision(name, limit, most):
    """With a track of 20 m and 1000 steps per millimetre: a tenth of a step, and half a step at the
    end of an arm's reach."""
    worst = errors(RIGS[name], 300, limit, seed=5).max(axis=0)
    assert (worst < most).all(), worst
