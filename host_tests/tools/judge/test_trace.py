"""Traces: from pin levels to signals, to CSV as they happen, and back."""

import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep_tools.building.board_files import ROOT
from framestep_tools.errors import ToolError
from framestep_tools.judge.trace import (
    HEADER,
    PinDecoder,
    Trace,
    TraceError,
    TraceWriter,
    load_board,
)

RECORD = [("t", "<i8"), ("pin", "u1"), ("level", "u1")]


def records(*rows):
    return np.array(list(rows), dtype=RECORD)


def test_every_board_has_a_sound_pin_map():
    boards = sorted(p.parent.name for p in (ROOT / "boards").glob("*/board.json"))
    assert "pico" in boards
    for name in boards:
        raw = json.loads((ROOT / "boards" / name / "board.json").read_text())
        pins = load_board(name)
        assert len(pins.step) == len(pins.dir) == raw["motors"]
        used = [*pins.step, *pins.levels]
        used += [raw["dmx"][key] for key in ("tx", "rx") if "dmx" in raw]
        assert len(used) == len(set(used)), "a pin has two tasks"


def test_the_pico_is_wired_as_documented():
    pins = load_board("pico")
    assert pins.step == tuple(range(2, 18, 2))
    assert pins.dir == tuple(range(3, 18, 2))
    assert pins.levels[18] == "enable"
    assert [pins.levels[p] for p in (22, 26, 27, 28)] == ["gio1", "gio2", "gio3", "gio4"]


def test_pins_are_those_that_the_rig_file_leaves():
    assert load_board("pico", {"motor_count": 3}).step == (2, 4, 6)
    assert load_board("skr_pico").levels[7] == "enable2"
    assert load_board("pico", {"motors": [{"driver": {"run_ma": 500}}]}).levels[26] == "shutter"
    # a mistake: the board's defaults hold
    assert load_board("pico", {"motor_count": 99}) == load_board("pico")


def test_an_unknown_board_is_named():
    with pytest.raises(ToolError, match=r"no board 'nano': there are .*pico"):
        load_board("nano")


def test_steps_count_by_the_direction_pin():
    decoder = PinDecoder(load_board("pico"))
    start = (0, 2, 0), (0, 3, 1), (0, 20, 0)
    forward, back = ((100, 2, 1), (150, 2, 0)), ((300, 2, 1), (350, 2, 0), (400, 2, 1))
    edges = decoder.feed(records(*start, *forward, (200, 3, 0), *back, (410, 20, 1)))
    assert edges == [
        (0, "dir1", 1), (0, "shutter", 0), (100, "m1", 1), (200, "dir1", 0), (300, "m1", -1),
        (400, "m1", -1), (410, "shutter", 1),
    ]  # fmt: skip


def test_state_is_kept_between_chunks_and_a_high_start_is_no_step():
    decoder = PinDecoder(load_board("pico"), inverted=[2])
    assert decoder.feed(records((0, 4, 1), (0, 5, 1))) == [(0, "dir2", 1)]
    assert decoder.feed(records((10, 4, 0))) == []
    assert decoder.feed(records((20, 4, 1), (20, 4, 1))) == [(20, "m2", -1)]
    turned = decoder.feed(records((30, 5, 0), (40, 4, 0), (50, 4, 1)))
    assert turned == [(30, "dir2", 0), (50, "m2", 1)]


def test_both_edges_are_steps_if_the_rig_file_says_so():
    rig = {"motors": [{}, {"driver": {"run_ma": 500, "both_edges": True}}]}
    board = load_board("skr_pico", rig)
    first, step, turn = board.step[0], board.step[1], board.dir[1]
    made = records(
        (0, turn, 1), (0, step, 1), (0, first, 0), (0, board.dir[0], 0),
        (10, step, 0), (20, step, 1), (25, first, 1), (30, turn, 0), (40, step, 0), (50, first, 0),
    )  # fmt: skip
    steps = [(10, "m2", 1), (20, "m2", 1), (25, "m1", -1), (40, "m2", -1)]
    found = PinDecoder(board).feed(made)
    assert [edge for edge in found if edge[1] in ("m1", "m2")] == steps
    trace = Trace.from_records(made, board)
    assert [values.tolist() for values in trace.steps(2)] == [[10, 20, 40], [1, 1, -1]]


edges = st.lists(
    st.tuples(
        st.integers(0, 10**15), st.sampled_from(["m1", "m12", "dir1", "gio3"]), st.integers(-1, 1)
    )
)


@given(edges, st.lists(st.integers(0, 10**15), max_size=5))
def test_csv_is_in_order_and_complete(tmp_path_factory, happened, looks):
    """Edges come in blocks, in any order within a block, and are written by time, never before
    their time."""
    path = tmp_path_factory.mktemp("trace") / "t.csv"
    with TraceWriter(path) as writer:
        for begin, end in zip([-1, *sorted(looks)], [*sorted(looks), 10**15], strict=True):
            writer.add(edge for edge in happened if begin < edge[0] <= end)
            writer.release(end)
            writer.flush()
            rows = path.read_text().splitlines()
            assert len(rows) == 1 + sum(edge[0] <= end for edge in happened)
    rows = path.read_text().splitlines()
    assert rows[0] == HEADER
    times = [int(row.split(",")[0]) for row in rows[1:]]
    assert times == sorted(times)
    read, made = Trace.read(path), Trace.from_edges(happened)
    assert set(read.signals) == set(made.signals)
    for name, (when, value) in made.signals.items():
        assert np.array_equal(read.signals[name][0], when)
        assert np.array_equal(read.signals[name][1], value)


def test_future_edges_wait():
    out = io.StringIO()
    writer = TraceWriter(out)
    writer.add([(300, "m1", 1), (100, "m2", -1)])
    writer.release(200)
    assert out.getvalue().splitlines()[1:] == ["100,m2,-1"]
    writer.add([(250, "m1", 1)])
    writer.release(300)
    assert out.getvalue().splitlines()[1:] == ["100,m2,-1", "250,m1,1", "300,m1,1"]


@pytest.mark.parametrize(
    "text", ["", "time,signal,value\n", f"{HEADER}\n1,m1\n", f"{HEADER}\nsoon,m1,1\n"]
)
def test_what_is_no_trace_is_refused(tmp_path, text):
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(TraceError):
        Trace.read(path)


def test_edges_in_parts():
    edges = [(30, "m1", 1), (10, "m1", -1), (25, "dir1", 1), (20, "m1", 1), (25, "dir1", 0)]
    parts = Trace.from_edges(edges[:2]).with_edges(edges[2:])
    for trace in (Trace.from_edges(edges), parts):
        assert trace.signals["m1"][0].tolist() == [10, 20, 30]
        assert trace.signals["m1"][1].tolist() == [-1, 1, 1]
        assert trace.signals["dir1"][1].tolist() == [1, 0], "at one time, in their order"


def test_positions():
    trace = Trace.from_edges([(10, "m1", 1), (20, "m1", 1), (30, "m1", -1), (15, "dir1", 1)])
    assert trace.motors == [1]
    assert trace.position_at(1, [9, 10, 19, 20, 30, 99], start=100).tolist() == [
        100, 101, 101, 102, 101, 101,
    ]  # fmt: skip
    assert trace.position_at(2, [5]).tolist() == [0]
