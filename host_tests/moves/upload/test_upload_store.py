"""The store of uploaded positions against a dictionary."""

import itertools
import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from framestep.moves.upload.store import UploadStore, bytes_for
from host_tests.moves.upload import uploads
from host_tests.moves.upload.uploads import ERR_RANGE, OK, answers


@given(uploads.uploads())
@settings(max_examples=600, deadline=None)
def test_any_upload(script):
    for step, answer, wanted in zip(
        script, answers(*script), uploads.expected(script), strict=True
    ):
        assert answer == wanted, step[:4]


def test_room_for_the_moves_that_are_promised():
    assert bytes_for(8, 10_000) < 109_000  # frozen image on an RP2040
    store = UploadStore(8, bytes_for(8, 10_000))
    assert store.capacity_frames(8) >= 10_000
    assert store.capacity_frames(4) >= 20_000


BOARD = 108_000  # bytes: about what an image on a Pico has for uploads


def upload_in(order, memory, motors, frames, seed, spare=0):
    """Upload a move of all motors, at the bound of what HI promises, each motor's sections in this
    order and the motors mixed. Return the last code."""
    dice = random.Random(seed)
    store = UploadStore(motors, memory + spare)
    assert store.begin(1, frames) == int(OK)
    queues = []
    for motor in range(motors):
        velocity, place, path = dice.randint(-2000, 2000), 0, []
        for _ in range(frames):
            path.append(place)
            # drawn back to rest, so that a long path stays in the range of positions
            velocity += min(max(dice.randint(-511, 511) - velocity // 64, -511), 511)
            place += velocity
        cuts = [0, *sorted(dice.sample(range(1, frames), max(2, frames // 150))), frames]
        parts = [
            (motor, at, path[at : min(at + 257, end)])
            for begin, end in itertools.pairwise(cuts)
            for at in range(begin, end, 257)
        ]
        queues.append(order(dice, parts))
    while any(queues):
        motor, at, part = dice.choice([queue for queue in queues if queue]).pop(0)
        code = store.section(motor, at, 0, struct.pack(f"<{len(part)}i", *part), 0, len(part))
        if code != int(OK):
            return code
    return store.finish()


@pytest.mark.parametrize("memory", [1500, 22_016, BOARD])
@pytest.mark.parametrize("motors", [1, 5, 8])
@pytest.mark.parametrize(
    "order", [lambda dice, parts: parts, lambda dice, parts: parts[::-1]], ids=["forward", "back"]
)
def test_the_promised_frames_fit_without_gaps(memory, motors, order):
    """Sections in the order of their frames, or the other way round: field note 5.7."""
    frames = UploadStore(motors, memory).capacity_frames(motors)
    for seed in range(3):
        assert upload_in(order, memory, motors, frames, seed) == int(OK)


@pytest.mark.parametrize("memory", [1500, 22_016])
def test_a_gap_takes_memory_until_it_is_filled(memory):
    """Up to 374 bytes for each 128 frames that have a gap, or end or begin at one."""

    def shuffled(dice, parts):
        return dice.sample(parts, len(parts))

    frames = UploadStore(8, memory).capacity_frames(8)
    spare = 374 * 8 * frames // 128
    codes = {upload_in(shuffled, memory, 8, frames, seed) for seed in range(20)}
    assert memory == 1500 or int(ERR_RANGE) in codes
    for seed in range(20):
        assert upload_in(shuffled, memory, 8, frames, seed, spare) == int(OK)


@given(st.integers(1, 32), st.integers(1, 3000))
def test_memory_for_so_many_frames_is_enough_and_not_much_more(motors, frames):
    memory = bytes_for(motors, frames)
    assert UploadStore(motors, memory).capacity_frames(motors) >= frames
    assert UploadStore(motors, memory + 2).capacity_frames(motors) < frames + 256


@pytest.mark.parametrize("motors", [1, 2, 8, 12, 32])
def test_too_little_memory_is_refused_with_what_is_needed(motors):
    with pytest.raises(
        ValueError, match=rf"an upload of {motors} motors needs \d+ bytes or more, not 170"
    ) as refused:
        UploadStore(motors, 170)
    needed = int(str(refused.value).split(" bytes")[0].split()[-1])
    assert UploadStore(motors, needed).capacity_frames(motors) == 128
    with pytest.raises(ValueError):
        UploadStore(motors, needed - 2)
