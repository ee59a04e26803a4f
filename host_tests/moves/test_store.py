"""The store of uploaded positions against a dictionary."""

import runpy
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from framestep.moves.store import UploadStore, bytes_for
from host_tests.moves import uploads
from host_tests.moves.uploads import ERR_GENERAL, ERR_RANGE, OK, axis

replay = runpy.run_path(str(Path(__file__).parents[1] / "runtime" / "store_replay.py"))["replay"]


def answers(*lines):
    return list(replay(lines))


@given(uploads.uploads())
@settings(max_examples=250, deadline=None)
def test_any_upload(script):
    for (line, step), answer, wanted in zip(
        script, replay(line for line, _ in script), uploads.expected(script), strict=True
    ):
        assert answer == wanted, (line[:60], step[:4])


def test_sections_in_any_order_and_again():
    ramp = list(range(0, 3000, 10))
    sections = [(200, ramp[200:]), (0, ramp[:100]), (100, [5] * 100), (100, ramp[100:200])]
    answered = answers(
        "NEW 1 8000", "BEGIN 1 300", *(axis(1, at, 0, part) for at, part in sections), "FINISH", "READ 0 0"
    )
    assert answered[1:-1] == [str(OK)] * 6
    assert answered[-1] == ",".join(map(str, ramp))


def test_the_last_section_repeats_its_final_value():
    answered = answers(
        "NEW 1 8000", "BEGIN 1 200", axis(1, 0, 0, [9] * 150), axis(1, 10, 1, [1, 2, 3]), "FINISH", "READ 0 0"
    )
    assert answered[-1] == ",".join(map(str, [9] * 10 + [1, 2] + [3] * 188))


def test_frames_never_sent_hold_the_one_before():
    answered = answers(
        "NEW 2 8000", "BEGIN 1 200", axis(1, 5, 0, [7, 8]), axis(1, 150, 0, [2**31 - 1]), "FINISH", "READ 0 0"
    )
    assert answered[-1] == ",".join(map(str, [7] * 6 + [8] * 144 + [2**31 - 1] * 50)) + " -"


@pytest.mark.parametrize("at", [0, 1, 63, 64, 65, 128, 199])
@pytest.mark.parametrize("near", [0, 1])
def test_the_lowest_position_is_refused_wherever_it_stands(at, near):
    positions = [-(2**31) + 1 if near else 5] * 200
    positions[at] = -(2**31)
    good = [3] * 200
    lines = ["NEW 1 8000", "BEGIN 1 200", axis(1, 0, 0, positions), axis(1, 0, 0, good), axis(1, 0, 0, positions)]
    answered = answers(*lines, "FINISH", "READ 0 0")
    assert answered[2:5] == [str(ERR_RANGE), str(OK), str(ERR_RANGE)]
    assert answered[-1] == ",".join(map(str, good))


def test_small_steps_down_to_the_lowest_position():
    stairs = [max(-(2**31), -(2**29) - 32767 * i) for i in range(49_500)]
    first = stairs.index(-(2**31))
    sections = [axis(1, i, 0, stairs[i : i + 257]) for i in range(0, first, 257)]
    answered = answers("NEW 1 120000", f"BEGIN 0 {first + 256}", *sections)
    assert set(answered[2:-1]) == {str(OK)}
    assert answered[-1] == str(ERR_RANGE)


def test_a_refused_section_leaves_no_trace_behind_what_has_been_sent():
    # small steps at first, so that it is packed as it comes; then the position that is refused
    refused = axis(1, 10, 0, [100 + i for i in range(60)] + [-(2**31)])
    answered = answers("NEW 1 8000", "BEGIN 1 200", axis(1, 0, 0, [7] * 10), refused, "FINISH", "READ 0 0")
    assert answered[2:4] == [str(OK), str(ERR_RANGE)]
    assert answered[-1] == ",".join(["7"] * 200)


@pytest.mark.parametrize("again", [(5, [900] * 5), (0, list(range(10, 20)))])
def test_going_on_after_the_last_frames_were_sent_again(again):
    index, positions = again
    go_on = [1000 + i for i in range(90)]
    sections = [axis(1, 0, 0, [1] * 10), axis(1, index, 0, positions), axis(1, 10, 0, go_on)]
    answered = answers("NEW 1 8000", "BEGIN 1 100", *sections, "FINISH", "READ 0 0")
    assert answered[-1] == ",".join(map(str, [1] * index + positions + go_on))


@pytest.mark.parametrize("step", [32767, -32767, 32768, -32768, 32769, -32769, 65535, 65536, -65536])
@pytest.mark.parametrize("at", [1, 63, 64, 65])
@pytest.mark.parametrize("first", [0, 7, -7])
def test_differences_at_the_edge_of_16_bits(step, at, first):
    move = [first] * at + [first + step] * (100 - at)
    in_order = [axis(1, i, 0, move[i : i + 10]) for i in range(0, 100, 10)]
    backwards = [axis(2, i, 0, move[i : i + 10]) for i in range(90, -1, -10)]
    answered = answers("NEW 2 8000", "BEGIN 1 100", *in_order, *backwards, "FINISH", "READ 0 0")
    assert set(answered[1:-1]) == {str(OK)}
    assert answered[-1] == " ".join([",".join(map(str, move))] * 2)


def test_going_on_in_a_chunk_that_is_kept_whole():
    move = [0, 100_000, 0, 1, 2] + list(range(3, 98))
    refused = axis(1, 5, 0, [3, -(2**31)])
    sections = [axis(1, 0, 0, move[:5]), refused, axis(1, 5, 0, move[5:])]
    answered = answers("NEW 1 8000", "BEGIN 1 100", *sections, "FINISH", "READ 0 0")
    assert answered[2:-1] == [str(OK), str(ERR_RANGE), str(OK), str(OK)]
    assert answered[-1] == ",".join(map(str, move))
    answered = answers("NEW 1 8000", "BEGIN 1 100", *sections[:2], "FINISH", "READ 0 0")
    assert answered[-1] == ",".join(map(str, move[:5] + [2] * 95))


def test_a_refused_end_leaves_no_trace():
    lines = [
        "NEW 2 3784",
        "BEGIN 0 831",
        axis(1, 640, 0, [0, 100_000]),  # nor does an earlier upload
        "BEGIN 0 831",  # leaves room to keep one chunk whole
        axis(1, 0, 0, [1] * 10),
        axis(2, 320, 0, [0, 100_000]),
        axis(2, 0, 0, [0] * 70),
        axis(2, 140, 0, [100_000] * 10),  # frames 128 to 139 will hold 0, so there will be a jump within a chunk
        "FINISH",
        axis(1, 9, 0, [5]),
        axis(1, 300, 0, [6]),
        axis(2, 128, 0, [100_000] * 12),
        "FINISH",
        "READ 0 0",
    ]
    answered = answers(*lines)
    assert answered[8:13] == [str(ERR_RANGE), *[str(OK)] * 4]
    motors = [1] * 9 + [5] * 291 + [6] * 532, [0] * 128 + [100_000] * 192 + [0] + [100_000] * 511
    assert answered[-1] == " ".join(",".join(map(str, motor)) for motor in motors)


def test_memory_for_one_jumping_chunk():
    still, jumps = [5] * 64, [0, 100_000] * 32
    answered = answers(
        "NEW 1 2000",
        "BEGIN 0 767",  # leaves room to keep one chunk whole
        axis(1, 64, 0, jumps),
        axis(1, 192, 0, jumps),
        axis(1, 0, 0, jumps + still),  # the room in chunk 1 comes too late
        axis(1, 64, 0, still + jumps),
        axis(1, 192, 0, jumps),
        axis(1, 128, 0, still),
        axis(1, 192, 0, jumps),
        axis(1, 0, 1, still),
        axis(1, 320, 0, jumps),
        "FINISH",
        "READ 0 0",
    )
    assert answered[2:-1] == [str(c) for c in (OK, ERR_RANGE, ERR_RANGE, OK, ERR_RANGE, OK, OK, OK, OK, OK)]
    assert answered[-1] == ",".join(map(str, [5] * 320 + jumps + [5] * 384))


def test_a_jump_over_frames_never_sent_takes_memory_at_the_end():
    lines = ["NEW 1 2000", "BEGIN 0 831", axis(1, 0, 0, [0] * 70), axis(1, 80, 0, [100_000] * 10)]
    assert answers(*lines)[2:] == [str(OK), str(ERR_RANGE)]  # no room to keep a chunk whole
    lines[3] = axis(1, 128, 0, [100_000] * 10)
    assert answers(*lines, "FINISH")[2:] == [str(OK)] * 3
    lines[3:] = [axis(1, 140, 0, [100_000] * 10), "FINISH", axis(1, 128, 0, [100_000] * 12), "FINISH", "READ 0 0"]
    answered = answers(*lines)
    assert answered[2:-1] == [str(c) for c in (OK, OK, ERR_RANGE, OK, OK)]
    assert answered[-1] == ",".join(map(str, [0] * 128 + [100_000] * 704))


def test_what_a_refused_section_needed_is_not_counted_at_the_end():
    lines = ["NEW 1 2000", "BEGIN 0 767", axis(1, 0, 0, [0] * 70), axis(1, 192, 0, [0, 100_000] * 64)]
    answered = answers(*lines, axis(1, 140, 0, [100_000] * 10), "FINISH")  # one chunk to keep whole, and room for one
    assert answered[2:] == [str(OK), str(ERR_RANGE), str(OK), str(OK)]


def test_codes():
    assert (
        answers(
            "NEW 2 8000",
            axis(1, 0, 0, [1]),  # nothing begun
            "FINISH",
            "BEGIN 5 4",
            "BEGIN 1 100",
            axis(1, 100, 0, [1]),  # past the range
            axis(1, 99, 0, [1, 2]),
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
        "NEW 1 8000", "BEGIN 1 2", axis(1, 0, 0, [4, 5]), "FINISH", "BEGIN 1 100000", "BEGIN 2 1", "READ 1 1", "ONE 0 1"
    )
    assert answered[4:] == [str(ERR_RANGE), str(ERR_RANGE), "4,4,5,5", "5"]


def test_room_for_the_moves_that_are_promised():
    assert bytes_for(8, 10_000) < 169_000  # frozen image on an RP2040
    assert bytes_for(8, 5000) < 85_500  # files copied to it
    store = UploadStore(8, bytes_for(8, 10_000))
    assert store.capacity_frames(8) >= 10_000
    assert store.capacity_frames(4) >= 20_000


def test_the_capacity_holds_the_fastest_move_that_fits_16_bits():
    capacity = int(answers("NEW 2 9000")[0])
    there_and_back = [32767 * i if i < 100 else 32767 * (200 - i) for i in range(200)]
    move = (there_and_back * 20)[:capacity]
    lines = [axis(motor, at, 0, move[at : at + 257]) for motor in (1, 2) for at in range(0, capacity, 257)]
    answered = answers("NEW 2 9000", f"BEGIN 0 {capacity - 1}", *lines, "FINISH", "READ 0 0")
    assert set(answered[1:-1]) == {str(OK)}
    assert answered[-1] == " ".join([",".join(map(str, move))] * 2)


@given(st.integers(1, 32), st.integers(1, 3000))
def test_memory_for_so_many_frames_is_enough_and_not_much_more(motors, frames):
    memory = bytes_for(motors, frames)
    assert UploadStore(motors, memory).capacity_frames(motors) >= frames
    assert UploadStore(motors, memory + 2).capacity_frames(motors) < frames + 128


@pytest.mark.parametrize("motors", [1, 2, 8, 12, 32])
def test_too_little_memory_is_refused_with_what_is_needed(motors):
    with pytest.raises(ValueError, match=rf"an upload of {motors} motors needs \d+ bytes or more, not 150") as refused:
        UploadStore(motors, 150)
    needed = int(str(refused.value).split(" bytes")[0].split()[-1])
    assert UploadStore(motors, needed).capacity_frames(motors) == 64
    with pytest.raises(ValueError):
        UploadStore(motors, needed - 128)
