"""The stream engine as machine code on 32 bits, with the heap locked: every word is as on CPython,
whose edges other tests judge."""

import random
from pathlib import Path

import numpy as np
import pytest

from host_tests.hal.streams import REPLAY, here
from host_tests.hal.test_stream import session


@pytest.mark.parametrize("seed", range(2))
def test_the_same_words(stream_runtime, tmp_path, seed):
    rng = random.Random(seed)
    lines = list(session(rng, 3, 5))
    lines[40:40] = [
        "cue 400 256 512", "cue 405 512 256", "batch 6", "drive 1024 0", "miss 3", "batch 20",
    ]  # fmt: skip
    lines += ["new 1 2", "speed 0 40000 400000", "travel 0 500", *["batch 20"] * 5, "travel 0 -500"]
    lines += [*["batch 20"] * 8, "end"]
    stream_runtime.run(
        REPLAY, tmp_path / "there", stdin="".join(line + "\n" for line in lines).encode()
    )
    there = np.fromfile(Path(tmp_path / "there"), "<i4")
    wanted = np.frombuffer(here(lines, tmp_path / "here"), "<i4")
    assert len(there) == len(wanted) > 100_000
    assert np.array_equal(there, wanted), f"word {np.flatnonzero(there != wanted)[0]}"
