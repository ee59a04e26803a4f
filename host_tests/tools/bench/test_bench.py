"""The bench's own parts: its keys, its goals, its table, and that it distinguishes worse from
better figures."""

import io

import numpy as np
import pytest
import typer
from rich.console import Console

from framestep_tools.bench import esp32, pico2, shift_registers
from framestep_tools.bench.__main__ import conclude
from framestep_tools.bench.figures import AT_200, FIGURES, keyed, missed, plain_table, table
from framestep_tools.bench.measure import QUICK
from framestep_tools.bench.moves import FPS, MOTORS, RAMP, ROLL_MS, STEADY_RATES, mixed_move
from framestep_tools.bench.record import IDEAL, comparison, record, recorded, tolerance, worse
from framestep_tools.judge.reference import Reference
from framestep_tools.judge.trace import PinDecoder, Trace, load_board
from framestep_tools.simulator.esp32_board import Esp32Board

KEYS = [
    "steps_per_s_8", "steps_per_s_1", "pulses_steps_per_s_8", "both_edges_steps_per_s_8",
    "both_edges_steps_per_s_4", "both_edges_steps_per_s_2", "both_edges_steps_per_s_1",
    "edge_error_steady_us", "edge_error_ramp_us", "frame_error_us", "velocity_ripple",
    "acceleration_ripple", "smoothing_load_percent", "tick_us_8", "tick_late_us_worst",
    "cpu_load_8_percent", "upload_frames_8", "light_channels_with_2000_frames", "rx_bytes_per_s",
    "rx_bytes_per_s_small", "rx_bytes_per_s_single_port", "reply_ms_median", "reply_ms_max",
    "go_ms_median", "go_ms_spread", "stop_ms_worst", "virtual_stop_ms_worst",
    "virtual_reply_ms_max", "heap_bytes_per_hour", "virtual_update_us",
]  # fmt: skip


def test_keys():
    assert [figure.key for figure in FIGURES] == KEYS
    assert all(figure.how for figure in FIGURES)
    assert set(AT_200) <= set(KEYS)
    assert keyed({125: {"a": 1}, 200: {"a": 2}}) == {"a": 1, "a_200": 2}


@pytest.mark.parametrize(
    "key, mhz, good, bad",
    [
        ("steps_per_s_8", 125, 350_000, 349_999),
        ("steps_per_s_8", 200, 350_000, 349_999),
        ("tick_us_8", 125, 60, 60.1),
        ("tick_us_8", 200, 38, 38.1),
        ("rx_bytes_per_s", 200, 800_000, 799_999),
        ("heap_bytes_per_hour", 125, 0, 1),
    ],
)
def test_goals(key, mhz, good, bad):
    figure = {figure.key: figure for figure in FIGURES}[key].at(mhz)
    assert figure.reached(good) is True
    assert figure.reached(bad) is False


@pytest.mark.parametrize("explain", [False, True])
def test_table(explain):
    figures = dict.fromkeys(KEYS, 1.0) | {"upload_frames_8": 12_345, "tick_us_8": 61.25}
    out = io.StringIO()
    faster = figures | {"tick_us_8": 36.5}
    without_misses = figures | {"tick_us_8": 51.0}
    Console(file=out, width=240).print(table({125: figures, 200: faster}, without_misses, explain))
    rows = {row.split("│")[1].strip(): row for row in out.getvalue().splitlines() if "│" in row}
    assert set(KEYS) <= rows.keys()
    for part in ("≤ 60", "61.2", "missed", "≤ 38", "36.5", "reached", "51", "µs"):
        assert part in rows["tick_us_8"]
    assert "≥ 10 000" in rows["upload_frames_8"]
    assert "12 345" in rows["upload_frames_8"]
    assert ("gc.mem_alloc" in out.getvalue()) == explain


def test_missed_goals_end_the_bench():
    """With a list of them and a status of 1."""
    good = {
        figure.key: figure.at_least if figure.at_least is not None else figure.at_most or 0
        for figure in FIGURES
    }
    fast = good | AT_200
    assert missed({125: good, 200: fast}) == []
    lines = missed({125: good | {"tick_us_8": 61.25}, 200: fast | {"rx_bytes_per_s": 799_999}})
    assert lines == [
        "tick_us_8 at 125 MHz: 61.2 µs, the goal is ≤ 60",
        "rx_bytes_per_s at 200 MHz: 799 999 bytes/s, the goal is ≥ 800 000",
    ]
    out = io.StringIO()
    console = Console(file=out, width=150)
    conclude(console, [], [])
    conclude(console, lines, [], report=True)
    with pytest.raises(typer.Exit) as ended:
        conclude(console, lines, [])
    assert ended.value.exit_code == 1
    assert out.getvalue().splitlines() == [
        "all goals are reached",
        *2 * ["2 goals are missed:", *(f"  {line}" for line in lines)],
    ]


EVERY = (*FIGURES, *pico2.FIGURES, *shift_registers.FIGURES, *esp32.FIGURES)


def test_a_figure_that_becomes_worse_ends_the_bench():
    """Each one that is recorded, whatever its goal is, and also with --report."""
    kept = recorded()
    assert worse(EVERY, kept, kept) == []
    for key, value in kept.items():
        named = key, key.removesuffix("_200"), key.removesuffix(IDEAL)
        figure = next(f for f in EVERY if f.key in named)
        sign = -1 if figure.at_least is not None else 1
        for share, is_worse in ((0.9, False), (1.1, value != 0), (-2, False)):
            changed = kept | {key: value * (1 + sign * share * tolerance(key))}
            assert bool(worse(EVERY, changed, kept)) is is_worse, (key, share)
    none = {"heap_bytes_per_hour": 0.0}
    [line] = worse(EVERY, kept | {"heap_bytes_per_hour": 1.0}, kept | none)
    assert line == "heap_bytes_per_hour: 1 bytes/h, recorded 0"
    out = io.StringIO()
    for report in (False, True):
        with pytest.raises(typer.Exit) as ended:
            conclude(Console(file=out, width=150), [], [line], report)
        assert ended.value.exit_code == 1
    assert out.getvalue().splitlines()[-1] == f"  {line}"


def test_the_page_for_a_pull_request_begins_with_what_has_changed():
    kept = {key: value for key, value in recorded().items() if key != "stop_ms_worst"}
    values = kept | {
        "upload_frames_8": kept["upload_frames_8"] * 0.9,
        "tick_us_8": kept["tick_us_8"] * 0.9,
    }
    values |= {"go_ms_spread": kept["go_ms_spread"] * 1.02, "stop_ms_worst": 1.7}
    page = comparison(EVERY, values, kept, {"pico": (1_020_000, 29_000)})
    _, changed, images, _, every, _ = page.split("\n\n")
    rows = [line.strip("| ").split(" | ") for line in changed.splitlines()[2:]]
    assert {(row[0], row[-1]) for row in rows} == {
        ("tick_us_8", "better"),
        ("upload_frames_8", "**worse**"),
    }
    assert images.endswith("| pico | 1 020 000 | 29 000 |")
    assert len(every.splitlines()) == len(values) + 2
    assert "| stop_ms_worst | 1.7 | – |" in every
    same = comparison(EVERY, kept, kept, {})
    assert "No figure has changed beyond its tolerance." in same


def test_the_record(tmp_path):
    """It has figures of the bench only; a recorded one that is no longer measured is missed; a new
    record has what was measured."""
    keys = {figure.key for figure in EVERY} | {f"{figure.key}_200" for figure in FIGURES}
    keys |= {key + IDEAL for key in QUICK}
    assert set(recorded()) <= keys
    assert {"tick_us_8", "upload_frames_8", "rx_bytes_per_s", "go_ms_spread"} <= set(recorded())
    tolerances = {key: tolerance(key) for key in recorded()}
    assert tolerances["tick_us_8_ideal"] == 0.03 < tolerances["tick_us_8"]
    for end in ("pico2", "pico2_595"):
        assert tolerances["reply_ms_max"] == tolerance(f"reply_ms_max_{end}") > 0.03
    less = dict(list(recorded().items())[1:])
    assert worse(EVERY, recorded(), less) == []
    assert len(worse(EVERY, less, recorded())) == 1
    file = tmp_path / "record.json"
    record({"tick_us_8": 57.123456, "upload_frames_8": 10112}, file)
    assert recorded(file) == {"tick_us_8": 57.12, "upload_frames_8": 10110}


def test_mixed_move():
    """Ramps of 100 000 steps/s², and each velocity held exactly; only whole steps disturb the
    ramps."""
    moves = mixed_move()
    path = Reference(moves, FPS * 1000, ROLL_MS, ROLL_MS, smooth=False)
    for motor, rate in enumerate(STEADY_RATES, 1):
        assert abs(path.velocity(motor, np.array([1.2]))[0]) == pytest.approx(rate, rel=1e-12)
        assert path.acceleration(motor, np.array([1.2]))[0] == pytest.approx(0, abs=1e-4)
        if rate > 20_000:
            early = np.abs(path.acceleration(motor, np.arange(0.045, rate / RAMP - 0.1, 0.001)))
            assert np.abs(early - RAMP).max() < 0.03 * RAMP
            assert abs(path.velocity(motor, np.array([2.399]))[0]) == pytest.approx(RAMP * 0.001)


def test_trace_from_records():
    """The fast method gives the same trace as edge by edge."""
    board = load_board()
    random = np.random.default_rng(3)
    level = dict.fromkeys(board.pins, 0)
    rows = [(1000, pin, 0) for pin in board.pins]
    for t in range(2000, 40_000, 10):
        pin = int(random.choice(board.pins))
        level[pin] ^= 1
        rows.append((t, pin, level[pin]))
    records = np.array(rows, [("t", "u8"), ("pin", "u1"), ("level", "u1")])
    fast = Trace.from_records(records, board)
    slow = Trace.from_edges(PinDecoder(board).feed(records))
    assert fast.signals.keys() == slow.signals.keys()
    for signal, (times, values) in slow.signals.items():
        assert np.array_equal(fast.signals[signal][0], times)
        assert np.array_equal(fast.signals[signal][1], values)


def test_figures_of_an_esp32():
    """One motor at the highest rate, and a stop. A run that the main loop holds up is not taken for
    one that lost nothing."""
    with Esp32Board({"motors": [{"pulse_us": esp32.GRID_US}] * MOTORS}) as board:
        session = esp32.ChainSession(board)
        assert esp32.top_rate(session, 1) == 125_000
        assert 25 < esp32.stop_ms(session) < 50
        assert esp32.pause_ms(session, (60,)) == 0
    values = {figure.key: 1.0 for figure in esp32.FIGURES}
    out = io.StringIO()
    Console(file=out, width=150).print(plain_table(esp32.TITLE, esp32.FIGURES, values, True))
    for figure in esp32.FIGURES:
        assert figure.key in out.getvalue()
        assert figure.how[:20] in out.getvalue()
