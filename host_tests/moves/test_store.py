"""The store of uploaded positions against a dictionary."""

import runpy
from array import array
from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from framestep.moves.store import UploadStore, bytes_for
from framestep.protocol.frames import FRAME, FrameReader
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


@pytest.mark.parametrize("at", [0, 1, 127, 128, 129, 199])
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
    stairs = [max(-(2**31), -(2**28) - 300_000 * i) for i in range(7500)]
    first = stairs.index(-(2**31))
    sections = [axis(1, i, 0, stairs[i : i + 257]) for i in range(0, first, 257)]
    answered = answers("NEW 1 60000", f"BEGIN 0 {first + 256}", *sections)
    assert set(answered[2:-1]) == {str(OK)}
    assert answered[-1] == str(ERR_RANGE)


@pytest.mark.parametrize("there", [2**31 - 1, 2**30, -(2**30), -(2**31) + 1])
@pytest.mark.parametrize("at", [1, 129])
def test_far_out_after_the_first_frame_of_a_chunk(at, there):
    move = [-there] * at + [there] * (200 - at)
    answered = answers(
        "NEW 1 2000", "BEGIN 1 200", axis(1, 0, 0, move[:at]), axis(1, at, 0, move[at:]), "FINISH", "READ 0 0"
    )
    assert answered[-1] == ",".join(map(str, move))


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


@pytest.mark.parametrize("width", range(8, 34))
@pytest.mark.parametrize("more", [-1, 0, 1])
@pytest.mark.parametrize("at", [1, 2, 127, 128, 129])
def test_changes_at_the_edge_of_a_width(width, more, at):
    """Of the steps per frame, up and down, at once and in order; each needs as many bits as the next less."""
    change = 2 ** (width - 1) + more
    first = max(-(2**31) + 1, -change // 2)
    there_and_back = [first] * at + [min(2**31 - 1, first + change)] * (260 - at)
    for move in (there_and_back, [-position for position in there_and_back]):
        in_order = [axis(1, i, 0, move[i : i + 10]) for i in range(0, 260, 10)]
        backwards = [axis(2, i, 0, move[i : i + 10]) for i in range(250, -1, -10)]
        answered = answers("NEW 2 8000", "BEGIN 1 260", *in_order, *backwards, "FINISH", "READ 0 0")
        assert set(answered[1:-1]) == {str(OK)}
        assert answered[-1] == " ".join([",".join(map(str, move))] * 2)


WILD = [0, 2**31 - 1] * 64  # a chunk that takes all twelve units
EVEN = list(range(0, 128 * 30_000, 30_000))  # one that takes none
CHUNK, UNIT = 2 * uploads.CHUNK, 2 * uploads.UNIT  # bytes


def memory_for(chunks, units):
    """Bytes of a store for one motor with that many chunks, all of it promised, and so many units."""
    memory = chunks * CHUNK + units * UNIT
    assert UploadStore(1, memory).capacity_frames(1) >= 128 * chunks
    return memory


def test_memory_for_one_wild_chunk():
    answered = answers(
        f"NEW 1 {memory_for(12, 12)}",
        f"BEGIN 0 {12 * 128 - 1}",
        axis(1, 128, 0, WILD),
        axis(1, 384, 0, WILD),
        axis(1, 0, 0, WILD + EVEN),  # the room in chunk 1 comes too late
        axis(1, 128, 0, EVEN + WILD),
        axis(1, 384, 0, WILD),
        axis(1, 256, 0, EVEN),
        axis(1, 384, 0, WILD),
        axis(1, 0, 1, EVEN),
        axis(1, 640, 0, WILD),
        "FINISH",
        "READ 0 0",
    )
    assert answered[2:-1] == [str(c) for c in (OK, ERR_RANGE, ERR_RANGE, OK, ERR_RANGE, OK, OK, OK, OK, OK)]
    assert answered[-1] == ",".join(map(str, EVEN + EVEN[-1:] * 512 + WILD + EVEN[-1:] * 768))


def test_memory_given_back_in_pieces_serves_others():
    """Units come and go in a hundred different orders; as many are there at the end as at the beginning."""
    chunks, random = 24, Random(1)
    lines, sent = [f"NEW 1 {memory_for(chunks, 24)}", f"BEGIN 0 {chunks * 128 - 1}"], {}
    model = uploads.Model(1, memory_for(chunks, 24))
    model.begin(0, chunks * 128 - 1)
    wanted = []
    for _ in range(400):
        bend = random.choice([0, 1, 200, 1000, 10_000, 10**6, 10**8])
        at = random.randrange(chunks)
        chunk = [(i // 2 % 2) * bend for i in range(128)]
        lines.append(axis(1, 128 * at, 0, chunk))
        wanted.append(model.section(0, 128 * at, False, chunk))
        if wanted[-1] == OK:
            sent[at] = chunk
    lines += [axis(1, 128 * at, 0, EVEN) for at in range(chunks)]
    lines += [axis(1, 0, 0, WILD + WILD), axis(1, 512, 0, WILD), "FINISH", "READ 0 0"]
    answered = answers(*lines)
    assert answered[2:-1] == [*map(str, wanted), *[str(OK)] * (chunks + 1), str(ERR_RANGE), str(OK)]
    assert ERR_RANGE in wanted
    assert len(sent) == chunks
    assert answered[-1] == ",".join(map(str, WILD + WILD + EVEN * (chunks - 2)))


def test_a_refused_end_leaves_no_trace():
    lines = [
        f"NEW 2 {4 * CHUNK + 4 * UNIT}",
        "BEGIN 0 255",
        axis(1, 128, 0, [0, 10_000] * 20),  # nor does an earlier upload
        "BEGIN 0 255",
        axis(1, 0, 0, [1] * 10),
        axis(2, 0, 0, [0] * 70),
        axis(2, 140, 0, [100_000] * 10),  # frames 128 to 139 will hold 0, so there will be a jump within a chunk
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


def test_a_jump_over_frames_never_sent_takes_memory_at_the_end():
    lines = [f"NEW 1 {memory_for(2, 2)}", "BEGIN 0 255", axis(1, 0, 0, [0] * 70), axis(1, 80, 0, [100_000] * 10)]
    assert answers(*lines)[2:] == [str(OK), str(ERR_RANGE)]  # a jump within a chunk, and no memory for it
    lines[3] = axis(1, 128, 0, [100_000] * 10)
    assert answers(*lines, "FINISH")[2:] == [str(OK)] * 3
    lines[3:] = [axis(1, 140, 0, [100_000] * 10), "FINISH", axis(1, 128, 0, [100_000] * 12), "FINISH", "READ 0 0"]
    answered = answers(*lines)
    assert answered[2:-1] == [str(c) for c in (OK, OK, ERR_RANGE, OK, OK)]
    assert answered[-1] == ",".join(map(str, [0] * 128 + [100_000] * 128))


def test_what_lies_behind_the_upload_takes_no_memory_at_the_end():
    positions = [50 * k * k for k in range(141)]  # 14 000 steps per frame where it ends
    lines = [f"NEW 1 {memory_for(2, 2)}", "BEGIN 0 150", axis(1, 10, 0, positions), "FINISH", "READ 0 0"]
    assert answers(*lines)[2:] == [str(OK), str(OK), ",".join(map(str, [0] * 10 + positions))]


def test_what_a_refused_section_needed_is_not_counted_at_the_end():
    lines = [f"NEW 1 {memory_for(4, 6)}", "BEGIN 0 511", axis(1, 0, 0, [0] * 70), axis(1, 256, 0, [0, 100_000] * 100)]
    answered = answers(*lines, axis(1, 140, 0, [100_000] * 10), "FINISH")  # five units needed, and six there
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
        "NEW 1 8000", "BEGIN 1 2", axis(1, 0, 0, [4, 5]), "FINISH", "BEGIN 1 100000", "BEGIN 2 1", "READ 1 1", "ONE 0 1"
    )
    assert answered[4:] == [str(ERR_RANGE), str(ERR_RANGE), "4,4,5,5", "5"]


def test_room_for_the_moves_that_are_promised():
    assert bytes_for(8, 10_000) < 109_000  # frozen image on an RP2040
    store = UploadStore(8, bytes_for(8, 10_000))
    assert store.capacity_frames(8) >= 10_000
    assert store.capacity_frames(4) >= 20_000


def bends(random, count):
    """Positions whose steps per frame change by up to 511 from one frame to the next, and go to 30 000."""
    positions, position, slope = [], 0, random.randrange(-30_000, 30_000)
    for i in range(count):
        slope += random.choice([-511, 511] if i % 200 < 100 else [-511, 511, 511] if slope < 0 else [-511, -511, 511])
        positions.append(position := position + slope)
    return positions


@pytest.mark.parametrize("size", [1, 2, 100, 257])
def test_the_capacity_holds_the_steepest_moves_that_are_promised(size):
    """All motors in turn, in sections of any size, into the last byte; a change of 512 once is too much then."""
    capacity = int(answers("NEW 3 2600")[0])
    moves = [bends(Random(motor), capacity) for motor in range(3)]
    lines = [
        axis(motor + 1, at, 0, moves[motor][at : at + size]) for at in range(0, capacity, size) for motor in range(3)
    ]
    more = axis(1, 130, 0, [0, 0, 512])
    lines = [f"NEW 3 {bytes_for(3, capacity)}", f"BEGIN 0 {capacity - 1}", *lines]
    assert set(answers(*lines, "FINISH")[1:]) == {str(OK)}
    answered = answers(*lines, more, "FINISH", "READ 0 0")
    assert set(answered[1:-3]) == {str(OK)}
    assert answered[-3:-1] == [str(ERR_RANGE), str(OK)]
    assert answered[-1] == " ".join(",".join(map(str, move)) for move in moves)


@pytest.mark.parametrize("jump", [300, 5000, 10**6, 2**31 - 1])
def test_memory_ends_at_any_point(jump):
    """Moves that take ever more memory until it is used up: what is refused changes nothing, what is not is there."""
    capacity, random = int(answers("NEW 2 1800")[0]), Random(jump)
    model = uploads.Model(2, 1800)
    lines, wanted = ["NEW 2 1800", f"BEGIN 0 {capacity - 1}"], []
    model.begin(0, capacity - 1)
    for motor in 0, 1:
        lines.append(axis(motor + 1, 0, 1, [0]))
        wanted.append(model.section(motor, 0, True, [0]))
    while wanted.count(ERR_RANGE) < 40:
        motor, at = random.randrange(2), random.randrange(capacity)
        positions = [random.randrange(jump + 1) for _ in range(min(random.randrange(1, 258), capacity - at))]
        lines.append(axis(motor + 1, at, 0, positions))
        wanted.append(model.section(motor, at, False, positions))
    model.finish()
    answered = answers(*lines, "FINISH", "READ 0 0")
    assert answered[2:-1] == [*map(str, wanted), str(OK)]
    assert answered[-1] == model.read(0, 0)


@given(
    st.lists(st.tuples(st.integers(-3, 400), st.integers(1, 40)), max_size=30),
    st.sampled_from([1, 300, 10**6, 2**30]),
    st.randoms(use_true_random=False),
)
@settings(max_examples=100, deadline=None)
def test_frames_read_in_any_order(reads, bend, random):
    """From wherever the frame before was read: forward, backward, within a chunk and out of it."""
    move = [random.randrange(bend) for _ in range(397)]
    store = UploadStore(2, 8000)
    store.begin(0, 396)
    reader = FrameReader()
    for motor in 0, 1:
        for at in 0, 200:
            frame = bytes.fromhex(axis(motor + 1, at, 0, move[at : at + 200]))
            reader.feed(frame, 0, len(frame))
            assert reader.poll() == FRAME
            assert store.section(motor, at, 0, reader, 5, len(move[at : at + 200])) == OK
    store.finish()
    words = array("i", [0] * 40)
    for index, count in reads:
        assert store.positions(index % 2, index, count, words, 0)
        assert list(words[:count]) == [move[min(max(i, 0), 396)] for i in range(index, index + count)]


@given(st.integers(1, 32), st.integers(1, 3000))
def test_memory_for_so_many_frames_is_enough_and_not_much_more(motors, frames):
    memory = bytes_for(motors, frames)
    assert UploadStore(motors, memory).capacity_frames(motors) >= frames
    assert UploadStore(motors, memory + 2).capacity_frames(motors) < frames + 256


@pytest.mark.parametrize("motors", [1, 2, 8, 12, 32])
def test_too_little_memory_is_refused_with_what_is_needed(motors):
    with pytest.raises(ValueError, match=rf"an upload of {motors} motors needs \d+ bytes or more, not 170") as refused:
        UploadStore(motors, 170)
    needed = int(str(refused.value).split(" bytes")[0].split()[-1])
    assert UploadStore(motors, needed).capacity_frames(motors) == 128
    with pytest.raises(ValueError):
        UploadStore(motors, needed - 2)


@pytest.mark.parametrize("frames", [1, 5, 127, 128, 129, 200])
@pytest.mark.parametrize("last", [0, 1])
def test_a_section_past_the_end_is_stored_as_far_as_it_fits(frames, last):
    """Field note 5.3: in one piece, in pieces, again; what lies past the end is not even looked at."""
    whole = [(-3) ** (i % 5) + i for i in range(frames)]
    beyond = [-(2**31), 2**31 - 1, 5]
    for cut in {0, frames // 2, frames - 1}:
        sections = [axis(1, 0, 0, whole[:cut])] if cut else []
        sections += [axis(1, cut, last, whole[cut:] + beyond), axis(1, frames - 1, last, whole[-1:] + beyond)]
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
