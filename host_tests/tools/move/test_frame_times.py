"""Times in files are rounded; each still is its frame's."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep_tools.axes.axes_file import Axis
from framestep_tools.move.frame_times import last_decimal, to_frames
from framestep_tools.move.move_conversion import to_move
from framestep_tools.move.move_formats import FORMATS
from host_tests.tools.conftest import imported

RATES = [24000 / 1001, 24, 25, 30000 / 1001, 30, 48, 50, 60000 / 1001, 60, 90, 100, 120, 240]
RATES += [480, 960, 1000]
ONE = [Axis("a", 1, 1000.0, in_file="a", file_unit="units")]


def decimals_for(fps):
    """Return the decimals of seconds that leave each frame its own time."""
    return [n for n in (2, 3, 4, 6, 9) if 10**-n < 0.9 / fps]


def csv(times, values, clock="seconds"):
    rows = "".join(f"{time},{value}\n" for time, value in zip(times, values, strict=True))
    return FORMATS["csv"].read(f"{clock},a\n{rows}", "f")


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("first", [0, 1, 37])
def test_no_frame_is_lost_however_times_are_rounded(fps, first):
    for decimals in decimals_for(fps):
        for count in (1, 2, 3, 4, 5, 7, 23, 24, 41):
            values = [7 * i % 50 for i in range(count)]
            times = [f"{(first + i) / fps:.{decimals}f}" for i in range(count)]
            move, _ = to_move(csv(times, values), ONE, "f", fps)
            assert move.positions[1] == [1000 * value for value in values], (decimals, count)
            thousandths = [f"{(first + i) * 1000 / fps:.{decimals}f}" for i in range(count)]
            move, _ = to_move(csv(thousandths, values, "ms"), ONE, "f", fps)
            assert move.positions[1] == [1000 * value for value in values], (decimals, count)


@pytest.mark.parametrize("fps", RATES)
def test_times_that_are_cut_off_lose_no_frame(fps):
    for decimals in decimals_for(2 * fps):
        values = [3 * i % 10 for i in range(40)]
        times = [f"{int(i / fps * 10**decimals) / 10**decimals:.{decimals}f}" for i in range(40)]
        move, _ = to_move(csv(times, values), ONE, "f", fps)
        assert move.positions[1] == [1000 * value for value in values], decimals


@pytest.mark.parametrize("fps", [24, 25, 30, 24000 / 1001])
@pytest.mark.parametrize("rate", [10, 20, 50, 100, 1000])
def test_exact_times_of_another_rate_stay_between_frames(fps, rate):
    """A sample each hundredth of a second is no frame, though it has two decimals."""
    count = 3 * rate + 1
    decimals = len(str(rate)) - 1 + (rate in (20, 50))
    times = [f"{i / rate:.{decimals}f}" for i in range(count)]
    move, _ = to_move(csv(times, [i / rate for i in range(count)]), ONE, "f", fps)
    assert len(move.positions[1]) == math.ceil((count - 1) / rate * fps - 1e-6) + 1
    for i, steps in enumerate(move.positions[1]):
        assert steps == pytest.approx(1000 * min(i / fps, 3), abs=1.01)


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("decimals", [3, 4, 6])
def test_a_step_between_keys_is_on_its_frame(fps, decimals):
    """A key with a step a hair after its frame's time begins on its frame, not on the next."""
    if 10**-decimals > 0.2 / fps:
        decimals = 6
    frames = [0, 1, 5, 11, 12, 30]
    keys = "".join(
        f"{frame / fps:.{decimals}f} {value} step step 1 1 0;\n"
        for value, frame in enumerate(frames)
    )
    text = (
        "animVersion 1.1; timeUnit sec;\nanim x a a 0 0 0;\n"
        f"animData {{ input time; output unitless; keys {{ {keys} }} }}\n"
    )
    axes = [Axis("a", 1, 1000.0, in_file="a.a", file_unit="units")]
    move, _ = to_move(FORMATS["anim"].read(text, "f"), axes, "f", fps)
    expected = [1000 * max(i for i, f in enumerate(frames) if f <= n) for n in range(31)]
    assert move.positions[1] == expected


def test_the_last_frame_of_seconds_is_on_the_end_position(shot):
    text = "seconds,track,pan\n0,0,0\n0.1,1,1\n0.25,2.5,2.5\n"
    move = imported(shot, text, "--fps", "10")
    assert (move.end_frame, move.positions[1]) == (4, [0, 10, 20, 25])
    assert (
        imported(shot, text, "--fps", "10", "--to-fps", "25").positions[1][-1],
        imported(shot, text, "--fps", "100").positions[1][-1],
    ) == (25, 25)


def test_keys_a_hair_beside_their_frames_in_files_of_frames(shot, capsys):
    arc = (
        '<scene><axis name="track"><points x="0.999" y="0"/><points x="4.9990" y="4"/>'
        '<controlPoints x="2.333" y="1"/><controlPoints x="3.666" y="3"/></axis>'
        '<axis name="pan"><points x="1" y="2"/><points x="5.001" y="2"/>'
        '<controlPoints x="2" y="2"/><controlPoints x="4" y="2"/></axis></scene>'
    )
    move = imported(shot, arc)
    assert (move.start_frame, move.end_frame) == (1, 5)
    assert (move.positions[1][0], move.positions[1][-1]) == (0, 40)
    assert "is left out" not in capsys.readouterr().err
    half = arc.replace("0.999", "0.5").replace("4.9990", "4.5").replace("5.001", "4.5")
    assert imported(shot, half).end_frame == 4
    assert "ends at frame 4.5: what comes after frame 4 is left out\n" in capsys.readouterr().err


def test_the_whole_file_through_the_command(shot, capsys):
    rows = "".join(f"{i / 24:.6f},{i / 10},2\n" for i in range(240))
    move = imported(shot, "time,track,pan\n" + rows, "--fps", "24")
    assert (move.start_frame, move.end_frame, move.fps) == (1, 240, 24)
    assert move.positions[1] == list(range(240))
    assert "frames 1 to 240 at 24 frames/s for 2 motors" in capsys.readouterr().out


@given(
    st.lists(st.floats(0, 1e6), min_size=1, max_size=30, unique=True).map(sorted),
    st.integers(0, 9),
    st.sampled_from(RATES),
    st.booleans(),
)
def test_keys_stay_in_order(places, decimals, fps, from_zero):
    frame = to_frames([places], 10.0**-decimals, fps, from_zero)
    frames = [frame(place) for place in places]
    assert all(one < other for one, other in pairwise(frames))
    exact = [(place - (places[0] if from_zero else 0)) * fps for place in places]
    assert all(abs(a - b) <= 1.0 for a, b in zip(frames, exact, strict=True))


@pytest.mark.parametrize(
    ("texts", "value"),
    [(["1", "2"], 1), (["0.5", "0.042"], 0.001), (["1,25"], 0.01), (["4.2e-02"], 0.001), ([], 1)],
)
def test_the_last_decimal(texts, value):
    assert last_decimal(texts) == pytest.approx(value)
