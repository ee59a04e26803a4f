"""The memory of the upload store: codes of every width, units taken and returned, frames read in
any order."""

from array import array
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from framestep.moves.upload.store import UploadStore, bytes_for
from host_tests.moves.upload import uploads
from host_tests.moves.upload.uploads import ERR_RANGE, OK, answers, axis


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
        "NEW 1 2000", "BEGIN 1 200", axis(1, 0, 0, move[:at]), axis(1, at, 0, move[at:]), "FINISH",
        "READ 0 0",
    )  # fmt: skip
    assert answered[-1] == ",".join(map(str, move))


@pytest.mark.parametrize("width", range(8, 34))
@pytest.mark.parametrize("more", [-1, 0, 1])
@pytest.mark.parametrize("at", [1, 2, 127, 128, 129])
def test_changes_at_the_edge_of_a_width(width, more, at):
    """The steps per frame change by about 2^(width - 1), up or down; the host sends the frames in
    order and backward."""
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


CHUNK = 2 * uploads.CHUNK  # bytes


UNIT = 2 * uploads.UNIT


def memory_for(chunks, units):
    """Return the bytes of a store for one motor with that many chunks, all of it promised, and
    that many units."""
    memory = chunks * CHUNK + units * UNIT
    assert UploadStore(1, memory).capacity_frames(1) >= 128 * chunks
    return memory


def test_memory_given_back_in_pieces_serves_others():
    """Units come and go in a hundred different orders; at the end as many are free as at the
    beginning."""
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


def bends(random, count):
    """Return positions whose steps per frame change by up to 511 from frame to frame, and reach
    30 000."""
    positions, position, slope = [], 0, random.randrange(-30_000, 30_000)
    for i in range(count):
        slope += random.choice(
            [-511, 511] if i % 200 < 100 else [-511, 511, 511] if slope < 0 else [-511, -511, 511]
        )
        positions.append(position := position + slope)
    return positions


@pytest.mark.parametrize("size", [1, 2, 100, 257])
def test_the_capacity_holds_the_steepest_moves_that_are_promised(size):
    """All motors in turn, in sections of any size, down to the last byte; then a single change of
    512 does not fit."""
    capacity = int(answers("NEW 3 2600")[0])
    moves = [bends(Random(motor), capacity) for motor in range(3)]
    lines = [
        axis(motor + 1, at, 0, moves[motor][at : at + size])
        for at in range(0, capacity, size)
        for motor in range(3)
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
    """Moves that take more and more memory until none is left: a refusal changes nothing, and what
    is accepted is stored."""
    capacity, random = int(answers("NEW 2 1800")[0]), Random(jump)
    model = uploads.Model(2, 1800)
    lines, wanted = ["NEW 2 1800", f"BEGIN 0 {capacity - 1}"], []
    model.begin(0, capacity - 1)
    for motor in 0, 1:
        lines.append(axis(motor + 1, 0, 1, [0]))
        wanted.append(model.section(motor, 0, True, [0]))
    while wanted.count(ERR_RANGE) < 40:
        motor, at = random.randrange(2), random.randrange(capacity)
        positions = [
            random.randrange(jump + 1) for _ in range(min(random.randrange(1, 258), capacity - at))
        ]
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
    """In any order: forward, backward, within a chunk and out of it."""
    move = [random.randrange(bend) for _ in range(397)]
    loaded = uploads.Store(2, 8000)
    loaded.begin(0, 396)
    for motor in 0, 1:
        for at in 0, 200:
            assert loaded.section(motor, at, 0, move[at : at + 200]) == OK
    loaded.finish()
    words = array("i", [0] * 40)
    for index, count in reads:
        assert loaded.store.positions(index % 2, index, count, words, 0)
        assert list(words[:count]) == [
            move[min(max(i, 0), 396)] for i in range(index, index + count)
        ]
