"""The store of uploaded positions against a dictionary."""

import itertools
import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from framestep.moves.upload.store import UploadStore, bytes_for
from host_tests.moves.upload import uploads
from host_tests.moves.upload.uploads import ERR_GENERAL, ERR_RANGE, OK, answers, axis


@given(uploads.uploads())
@settings(max_examples=250, deadline=None)
def test_any_upload(script):
    for (line, step), answer, wanted in zip(
        script, uploads.replay(line for line, _ in script), uploads.expected(script), strict=True
    ):
        assert answer == wanted, (line[:60], step[:4])


def test_sections_in_any_order_and_again():
    ramp = list(range(0, 3000, 10))
    sections = [(200, ramp[200:]), (0, ramp[:100]), (100, [5] * 100), (100, ramp[100:200])]
    answered = answers(
        "NEW 1 8000",
        "BEGIN 1 300",
        *(axis(1, at, 0, part) for at, part in sections),
        "FINISH",
        "READ 0 0",
    )
    assert answered[1:-1] == [str(OK)] * 6
    assert answered[-1] == ",".join(map(str, ramp))


def test_the_last_section_repeats_its_final_value():
    answered = answers(
        "NEW 1 8000",
        "BEGIN 1 200",
        axis(1, 0, 0, [9] * 150),
        axis(1, 10, 1, [1, 2, 3]),
        "FINISH",
        "READ 0 0",
    )
    assert answered[-1] == ",".join(map(str, [9] * 10 + [1, 2] + [3] * 188))


def test_frames_never_sent_hold_the_one_before():
    answered = answers(
        "NEW 2 8000",
        "BEGIN 1 200",
        axis(1, 5, 0, [7, 8]),
        axis(1, 150, 0, [2**31 - 1]),
        "FINISH",
        "READ 0 0",
    )
    assert answered[-1] == ",".join(map(str, [7] * 6 + [8] * 144 + [2**31 - 1] * 50)) + " -"


@pytest.mark.parametrize("at", [0, 1, 127, 128, 129, 199])
@pytest.mark.parametrize("near", [0, 1])
def test_the_lowest_position_is_refused_wherever_it_stands(at, near):
    positions = [-(2**31) + 1 if near else 5] * 200
    positions[at] = -(2**31)
    good = [3] * 200
    lines = [
        "NEW 1 8000",
        "BEGIN 1 200",
        axis(1, 0, 0, positions),
        axis(1, 0, 0, good),
        axis(1, 0, 0, positions),
    ]
    answered = answers(*lines, "FINISH", "READ 0 0")
    assert answered[2:5] == [str(ERR_RANGE), str(OK), str(ERR_RANGE)]
    assert answered[-1] == ",".join(map(str, good))


def test_a_refused_section_leaves_no_trace_behind_what_has_been_sent():
    # small steps at first, which are packed as they come; then the position that is refused
    refused = axis(1, 10, 0, [100 + i for i in range(60)] + [-(2**31)])
    answered = answers(
        "NEW 1 8000", "BEGIN 1 200", axis(1, 0, 0, [7] * 10), refused, "FINISH", "READ 0 0"
    )
    assert answered[2:4] == [str(OK), str(ERR_RANGE)]
    assert answered[-1] == ",".join(["7"] * 200)


@pytest.mark.parametrize("again", [(5, [900] * 5), (0, list(range(10, 20)))])
def test_going_on_after_the_last_frames_were_sent_again(again):
    index, positions = again
    go_on = [1000 + i for i in range(90)]
    sections = [axis(1, 0, 0, [1] * 10), axis(1, index, 0, positions), axis(1, 10, 0, go_on)]
    answered = answers("NEW 1 8000", "BEGIN 1 100", *sections, "FINISH", "READ 0 0")
    assert answered[-1] == ",".join(map(str, [1] * index + positions + go_on))


def test_a_refused_end_leaves_no_trace():
    lines = [
        f"NEW 2 {2 * (4 * uploads.CHUNK + 4 * uploads.UNIT)}",
        "BEGIN 0 255",
        axis(1, 128, 0, [0, 10_000] * 20),  # nor does an earlier upload
        "BEGIN 0 255",
        axis(1, 0, 0, [1] * 10),
        axis(2, 0, 0, [0] * 70),
        # frames 128 to 139 hold 0, so a jump lies within a chunk
        axis(2, 140, 0, [100_000] * 10),
        "FINISH",
        axis(1, 9, 0, [5]),
        axis(1, 200, 0, [6]),
        axis(2, 128, 0, [100_000] * 12),
        "FINISH",
        "READ 0 0",
    ]
    answered = answers(*lines)
    assert answered[7:12] == [str(ERR_RANGE), *[str(OK)] * 4]
    motors = [1] * 9 + [5] * 191 + [6] * 56, [0] * 128 + [100_000] * 128
    assert answered[-1] == " ".join(",".join(map(str, motor)) for motor in motors)


def test_codes():
    assert (
        answers(
            "NEW 2 8000",
            axis(1, 0, 0, [1]),  # nothing begun
            "FINISH",
            "BEGIN 5 4",
            "BEGIN 1 100",
            axis(1, 100, 0, [1]),  # past the range
            axis(1, 101, 0, [1, 2]),
            axis(3, 0, 0, [1]),
            axis(0, 0, 0, [1]),
            axis(1, 2**30, 0, [1]),
            axis(1, 0, 1, []),
            axis(1, 0, 0, []),
            axis(1, 0, 0, [-(2**31)]),
            axis(1, 99, 0, [1]),
            "FINISH",
            "FINISH",
            axis(1, 0, 0, [1]),  # finished
        )[1:]
        == [
            str(code)
            for code in (
                *(ERR_GENERAL, ERR_GENERAL, ERR_RANGE, OK),
                *(ERR_RANGE, ERR_RANGE, ERR_RANGE, ERR_RANGE, ERR_RANGE, ERR_RANGE, OK, ERR_RANGE),
                *(OK, OK, OK, ERR_GENERAL),
            )
        ]
    )


def test_a_refused_begin_leaves_the_upload():
    answered = answers(
        "NEW 1 8000",
        "BEGIN 1 2",
        axis(1, 0, 0, [4, 5]),
        "FINISH",
        "BEGIN 1 100000",
        "BEGIN 2 1",
        "READ 1 1",
        "ONE 0 1",
    )
    assert answered[4:] == [str(ERR_RANGE), str(ERR_RANGE), "4,4,5,5", "5"]


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


@pytest.mark.parametrize("frames", [1, 5, 127, 128, 129, 200])
@pytest.mark.parametrize("last", [0, 1])
def test_a_section_past_the_end_is_stored_as_far_as_it_fits(frames, last):
    """Field note 5.3: in one piece, in pieces, again; the store does not even look at what lies
    past the end."""
    whole = [(-3) ** (i % 5) + i for i in range(frames)]
    beyond = [-(2**31), 2**31 - 1, 5]
    for cut in {0, frames // 2, frames - 1}:
        sections = [axis(1, 0, 0, whole[:cut])] if cut else []
        sections += [
            axis(1, cut, last, whole[cut:] + beyond),
            axis(1, frames - 1, last, whole[-1:] + beyond),
        ]
        answered = answers("NEW 1 8000", f"BEGIN 1 {frames}", *sections, "FINISH", "READ 0 0")
        assert set(answered[1:-1]) == {str(OK)}
        assert answered[-1] == ",".join(map(str, whole))


def test_frame_numbers_of_a_million():
    begins = [
        "BEGIN 999990 1000000",
        "BEGIN -1000000 -999990",
        "BEGIN 1000000 1000000",
        "BEGIN 999990 1000001",
        "BEGIN -1000001 -999990",
        "BEGIN 1000001 1000001",
        f"BEGIN {2**30 - 5} {2**30 - 1}",
    ]
    assert answers("NEW 1 8000", *begins)[1:] == [str(OK)] * 3 + [str(ERR_RANGE)] * 4
