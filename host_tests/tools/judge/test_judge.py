"""The judge, given good runs and runs with one known fault each: it must find every one of
them."""

from functools import partial

import numpy as np
import pytest

from framestep_tools.judge import judge as judging
from framestep_tools.judge.judge import Limits, NoRun, frame_times_ns
from framestep_tools.judge.reference import Reference
from framestep_tools.judge.trace import Trace
from framestep_tools.move.move_file import read_move

FPS_MILLI = 24_000
ORIGIN_NS = 3_123_456_789
ROLL_S = 1.0
GRID_S = 20e-6


def judge(trace, move, fps_milli=FPS_MILLI, **options):
    return judging.judge(trace, move, fps_milli, **{"smooth": False, **options})


def slopes(positions, seconds):
    """Return the velocity at each frame, 0 at holds and turns; the mean of both sides elsewhere."""
    v = np.diff(positions) / seconds
    inner = np.where(
        v[:-1] * v[1:] > 0, np.minimum(np.abs(v[:-1]), np.abs(v[1:])) * np.sign(v[1:]), 0.0
    )
    return np.concatenate(([v[0]], inner, [v[-1]]))


class Path:
    """The path of an ideal device: a cubic per frame with continuous velocity, run-up and
    run-out."""

    def __init__(self, positions, fps_milli=FPS_MILLI, kind="cubic"):
        self.p = np.asarray(positions, float)
        self.t = frame_times_ns(len(positions), fps_milli) * 1e-9
        self.m = slopes(self.p, self.t[1] - self.t[0])
        self.kind = kind

    def __call__(self, seconds):
        seconds = np.asarray(seconds, float)
        i = np.clip(np.searchsorted(self.t, seconds, side="right") - 1, 0, len(self.t) - 2)
        h = self.t[i + 1] - self.t[i]
        u = np.clip((seconds - self.t[i]) / h, 0, 1)
        p, q, v, w = self.p[i], self.p[i + 1], self.m[i] * h, self.m[i + 1] * h
        x = p + v * u + (3 * (q - p) - 2 * v - w) * u**2 + (2 * (p - q) + v + w) * u**3
        if self.kind == "linear":
            x = p + (q - p) * u
        before = np.clip(seconds + ROLL_S, 0, None)
        behind = np.clip(self.t[-1] + ROLL_S - seconds, 0, None)
        x = np.where(
            seconds < 0, self.p[0] + self.m[0] * (before**2 / (2 * ROLL_S) - ROLL_S / 2), x
        )
        return np.where(
            seconds > self.t[-1],
            self.p[-1] + self.m[-1] * (ROLL_S / 2 - behind**2 / (2 * ROLL_S)),
            x,
        )


class SmoothPath:
    """One motor's path with the rig file's `smoothing`."""

    def __init__(self, positions, fps_milli):
        self.t = frame_times_ns(len(positions), fps_milli) * 1e-9
        self.reference = Reference({1: positions}, fps_milli, 1000 * ROLL_S, 1000 * ROLL_S)

    def __call__(self, seconds):
        return self.reference(1, seconds)


def crossings(path, begin, end):
    """Return (times in s, directions) of the steps: step k when the path reaches k."""
    t = np.append(np.arange(begin, end, GRID_S), end)
    t = np.union1d(t, path.t)
    # 1e-9 of a step decides what "reaches" means if the path only touches a whole step
    x = np.round(path(t), 9)
    made, times, signs = round(float(x[0])), [], []
    direction = np.sign(np.diff(x))
    moving = np.flatnonzero(direction)
    breaks = (np.diff(moving) > 1) | (np.diff(direction[moving]) != 0)  # holds and turns
    stretches = np.split(moving, np.flatnonzero(breaks) + 1)
    for stretch in stretches:
        if not len(stretch):
            continue
        low, high = stretch[0], stretch[-1] + 1
        sign = int(direction[stretch[0]])
        last = int(np.floor(x[high])) if sign > 0 else int(np.ceil(x[high]))
        steps = np.arange(made + sign, last + sign, sign)
        if len(steps):
            xs, ts = x[low : high + 1] * sign, t[low : high + 1]
            times.append(np.interp(steps * sign, xs, ts))
            signs.append(np.full(len(steps), sign))
            made = last
    return (
        (np.concatenate(times), np.concatenate(signs)) if times else (np.zeros(0), np.zeros(0, int))
    )


def trace_of(move, fps_milli=FPS_MILLI, kind="cubic", start=0, jitter_ns=0, seed=1):
    """Return the edges of all motors, in a positioning move to the pre-roll and in the run."""
    rng = np.random.default_rng(seed)
    signals = {}
    for motor, positions in move.items():
        smooth = kind == "smooth"
        path = SmoothPath(positions, fps_milli) if smooth else Path(positions, fps_milli, kind)
        first = round(float(path(-ROLL_S)))
        count = abs(first - start)
        to = np.linspace(0.2, 1.8, count) if count else np.zeros(0)
        times, signs = crossings(path, -ROLL_S, path.t[-1] + ROLL_S + 1.1)  # a frame of 1 s
        ns = np.concatenate((np.rint(to * 1e9), np.rint(times * 1e9) + ORIGIN_NS)).astype(np.int64)
        ns += rng.integers(-jitter_ns, jitter_ns + 1, len(ns))
        values = np.concatenate((np.full(count, np.sign(first - start), int), signs))
        signals[f"m{motor}"] = (ns, values)
    return Trace(signals)


def curves(frames=60, seed=3):
    """Return a move with a hold, a turn and speeds from slow to fast."""
    rng = np.random.default_rng(seed)
    n = np.arange(frames)
    hold = np.clip(np.abs(n - frames // 2) - 4, 0, None) * np.sign(n - frames // 2)
    return {
        1: np.rint(250 * hold + 2 * hold**2 * np.sign(hold)).astype(int),
        2: np.rint(3000 * np.sin(n / 9.7)).astype(int),
        3: np.rint(n * 1.5).astype(int),
        5: np.cumsum(rng.integers(100, 140, frames)),
    }


FPS = [1000, 12_000, 23_976, 24_000, 25_000, 29_970, 30_000, 60_000]


@pytest.mark.parametrize("fps_milli", FPS)
def test_frame_times_are_the_rational_ones(fps_milli):
    exact = [(n * 10**9 * 2 + fps_milli) // (2 * fps_milli) * 1000 for n in range(10_000)]
    assert frame_times_ns(10_000, fps_milli).tolist() == exact


@pytest.mark.parametrize("fps_milli", FPS)
def test_a_good_run_is_good(fps_milli):
    frames = 12 if fps_milli == 1000 else 60
    move = {motor: steps[:frames] for motor, steps in curves().items()}
    verdict = judge(trace_of(move, fps_milli, jitter_ns=1000), move, fps_milli)
    assert verdict.complaints == []
    assert verdict.worst_position <= 1
    assert verdict.worst_time_us < 3
    assert abs(verdict.origin_ns - ORIGIN_NS) < 2000
    assert verdict.frames == frames
    assert verdict.summary().startswith(f"{frames} frames, worst position error at a frame ")


def test_the_demos_move_is_good():
    move = read_move()
    trace = trace_of(move.positions)
    verdict = judge(trace, move.positions, path=lambda m, s: Path(move.positions[m])(s))
    assert verdict.complaints == []
    assert max(np.nanmax(np.abs(m.edge_error_us)) for m in verdict.motors) < 2
    assert sum(len(m.edge_times_s) for m in verdict.motors) > 50_000


def test_a_backward_run_and_another_start():
    move = {motor: steps[::-1] for motor, steps in curves().items()}
    verdict = judge(trace_of(move, start=77), move, start=dict.fromkeys(move, 77))
    assert verdict.complaints == []


def edited(trace, motor, edit):
    """Return the trace with one motor's (times, values) changed."""
    times, values = trace.signals[f"m{motor}"]
    signals = {**trace.signals, f"m{motor}": edit(times.copy(), values.copy())}
    return Trace(signals)


def around_frame(times, frame):
    at = ORIGIN_NS + frame_times_ns(100, FPS_MILLI)
    return (times > (at[frame] + at[frame - 1]) // 2) & (times <= (at[frame] + at[frame + 1]) // 2)


def shifted(frame, ns):
    return lambda times, values: (times + ns * around_frame(times, frame), values)


def dropped(index):
    return lambda times, values: (np.delete(times, index), np.delete(values, index))


def inserted(frame, fraction, signs, gap_ns=100_000):
    """Return an edit with further steps at a fraction of the frame after a frame."""

    def edit(times, values):
        grid = ORIGIN_NS + frame_times_ns(100, 24_000)
        at = int(grid[frame] + fraction * (grid[frame + 1] - grid[frame]))
        more = at + gap_ns * np.arange(len(signs))
        order = np.argsort(np.concatenate((times, more)), kind="stable")
        return np.concatenate((times, more))[order], np.concatenate((values, signs))[order]

    return edit


FAULTS = {
    "frame 30 µs late": (5, shifted(20, 30_000), "off their time"),
    "frame 30 µs early": (5, shifted(20, -30_000), "off their time"),
    "slow motor 3 ms late": (3, shifted(20, 3_000_000), "off their"),
    "motor 50 µs behind the others": (
        5,
        lambda t, v: (t + 50_000 * (t > 2_500_000_000), v),
        "60 frames off their time",
    ),
    "step lost": (5, dropped(4000), "off their"),
    "step lost near a turn": (2, dropped(-9000), "off their"),
    "step lost in the run-out": (2, dropped(-100), "by its steps, but reports"),
    "all directions wrong": (5, lambda t, v: (t, -v), "off their position"),
    "step and back in a hold": (1, inserted(30, 0.5, [1, -1]), "while it should hold still"),
    "step and back in motion": (5, inserted(20, 0.5, [-1, 1], 2000), "against the motion"),
    "no steps at all": (5, lambda t, v: (t[:0], v[:0]), "off their position"),
}


@pytest.mark.parametrize("kind", ["cubic", "smooth"])
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found(name, kind):
    motor, edit, complaint = FAULTS[name]
    move = curves()
    good = trace_of(move, kind=kind)
    end = {m: int(good.position_at(m, [10**12])[0]) for m in move}
    judged = partial(judge, end=end)
    if kind == "smooth":
        path = Reference(move, 24_000, 1000 * ROLL_S, 1000 * ROLL_S)
        judged = partial(judged, path=path, smooth=True)
    assert judged(good, move).good
    verdict = judged(edited(good, motor, edit), move)
    assert not verdict.good
    assert any(c.startswith(f"motor {motor}: ") and complaint in c for c in verdict.complaints), (
        verdict.complaints
    )
    assert all(c.startswith(f"motor {motor}: ") for c in verdict.complaints), verdict.complaints


@pytest.mark.parametrize("fps_milli", FPS)
def test_a_good_smooth_run_is_good(fps_milli):
    """Its origin is known exactly from the ideal path, without it to a part of a step's time."""
    frames = 12 if fps_milli == 1000 else 60
    move = {motor: steps[:frames] for motor, steps in curves().items()}
    trace = trace_of(move, fps_milli, "smooth", jitter_ns=1000)
    path = Reference(move, fps_milli, 1000 * ROLL_S, 1000 * ROLL_S)
    verdict = judge(trace, move, fps_milli, path=path, smooth=True)
    assert verdict.complaints == []
    assert verdict.worst_position == 0
    assert verdict.worst_time_us < 3
    assert abs(verdict.origin_ns - ORIGIN_NS) < 2000
    verdict = judge(trace, move, fps_milli, smooth=True)
    assert verdict.complaints == []
    assert verdict.worst_time_us < 3
    assert abs(verdict.origin_ns - ORIGIN_NS) < 0.1e12 / fps_milli / 100
    assert not judge(trace, move, fps_milli).good


def test_a_smooth_run_without_its_path():
    """A motor may arrive before the frame's time and leave after it."""
    move = curves()
    good = trace_of(move, kind="smooth")
    times, _ = good.steps(5)
    at = ORIGIN_NS + frame_times_ns(21, 24_000)[-1]
    arrives, leaves = times[np.searchsorted(times, at) - 1 :][:2]
    for ns, ok in (
        (at - arrives, True),
        (at - leaves, True),
        (at - arrives + 30_000, False),
        (at - leaves - 30_000, False),
    ):
        trace = edited(good, 5, shifted(20, ns))
        verdict = judge(trace, move, limits=Limits(velocity_share=1), smooth=True)
        assert verdict.good == ok, (ns, verdict.complaints)


def test_errors_within_the_limits_are_reported_and_pass():
    move = curves()
    late = edited(trace_of(move), 5, shifted(20, 15_000))
    verdict = judge(late, move, limits=Limits(velocity_share=1))
    assert verdict.good
    assert verdict.worst_time_us == pytest.approx(15, abs=1)


def test_the_limit_may_be_a_part_of_a_step():
    """60 µs late is much at 2000 steps/s, and very little at 60 steps/s."""
    move = {1: np.arange(30) * 2, 2: np.arange(30) * 90}
    late = edited(edited(trace_of(move), 1, shifted(20, 60_000)), 2, shifted(10, 60_000))
    assert len(judge(late, move).complaints) == 4  # each: its position, its time
    complaints = judge(late, move, limits=Limits(time_steps=0.01, velocity_share=1)).complaints
    assert [complaint[:20] for complaint in complaints] == ["motor 2: 1 frames of"] * 2


def test_linear_interpolation_jumps():
    move = {1: np.rint(3000 * np.sin(np.arange(60) / 9.7)).astype(int), 2: np.arange(60) * 100}
    verdict = judge(trace_of(move, kind="linear"), move)
    assert any("motor 1: velocity jumps" in c for c in verdict.complaints)
    assert not any(c.startswith("motor 2") for c in verdict.complaints)
    assert verdict.worst_time_us < 1  # the frames themselves are right


def test_a_turn_between_frames():
    """A path that turns a little after the frame with the greatest position is smooth; one that
    goes on is not."""
    steps = np.array([0, 300, 600, 900, 1000, 960, 700, 400, 100, -200, -500])
    move = {1: steps, 2: np.arange(11) * 100}
    good = trace_of(move)
    assert judge(good, move).complaints == []
    # 4/27 of (960 - 900) / 2 is 4.4
    for pulses, fine in ((5, True), (6, False)):
        trace = edited(good, 1, inserted(4, 0.02, [1] * pulses + [-1] * pulses, 20_000))
        made = trace.positions(1)[1].max() - 1000
        verdict = judge(trace, move, limits=Limits(velocity_share=1, velocity_steps_s=1e5))
        assert made >= pulses, (made, verdict.complaints)
        assert ("against" not in str(verdict.complaints)) == fine, (made, verdict.complaints)


def test_with_the_path_given_a_turn_between_frames_is_judged_by_it():
    """The path has its peak after frame 4; the edges are right by it, and wrong by a path that
    turns at once."""
    steps = np.array([0, 300, 600, 900, 1000, 960, 700, 400, 100, -200, -500])
    move = {1: steps, 2: np.arange(11) * 100}
    turning = {motor: Path(p) for motor, p in move.items()}
    turning[1].m[4] = 24 * 120  # steps/s
    assert turning[1](turning[1].t[4] + 0.01) > 1010
    flat = {motor: Path(p) for motor, p in move.items()}
    edges, signs = crossings(turning[1], -ROLL_S, turning[1].t[-1] + ROLL_S)
    good = trace_of(move)
    run = good.steps(1)[0] < ORIGIN_NS - 10**9
    before = tuple(part[run] for part in good.signals["m1"])
    after = np.rint(edges * 1e9).astype(np.int64) + ORIGIN_NS, signs
    trace = Trace(
        {
            **good.signals,
            "m1": tuple(np.concatenate(parts) for parts in zip(before, after, strict=True)),
        }
    )
    verdict = judge(trace, move, path=lambda m, s: turning[m](s), limits=Limits(path_us=5))
    assert verdict.complaints == []
    complaints = judge(trace, move, path=lambda m, s: flat[m](s)).complaints
    assert any("against the motion of the path" in c for c in complaints)
    assert any("velocity is wrong" in c for c in complaints)


def test_a_steady_fault_of_velocity_is_found_with_the_path():
    """Linear interpolation of even steps, while the path bends: no jump would reveal it."""
    move = curves()
    good = trace_of(move)
    ideal = {motor: Path(steps) for motor, steps in move.items()}
    ideal[5].m = ideal[5].m + 300
    complaints = judge(good, move, path=lambda m, s: ideal[m](s)).complaints
    assert complaints
    assert all(c.startswith("motor 5: velocity is wrong at ") for c in complaints)


def test_an_edge_off_the_path_is_found_between_frames():
    move = curves()
    ideal = {motor: Path(steps) for motor, steps in move.items()}

    def shove(times, values):
        frame = ORIGIN_NS + frame_times_ns(60, 24_000)
        middle = np.flatnonzero((times > frame[20] + 10_000_000) & (times < frame[21] - 10_000_000))
        times[middle[0]] += 60_000
        return times, values

    limits = Limits(path_us=5)
    good = judge(trace_of(move), move, path=lambda m, s: ideal[m](s), limits=limits)
    assert good.complaints == []
    off = edited(trace_of(move), 5, shove)
    bad = judge(off, move, path=lambda m, s: ideal[m](s), limits=limits)
    assert any("µs off the path" in c for c in bad.complaints)


@pytest.mark.parametrize("played", [23_976, 25_000, 30_000])
def test_another_frame_rate_is_no_such_run(played):
    move = curves()
    try:
        verdict = judge(trace_of(move, played), move)
    except NoRun:
        return
    assert not verdict.good


def test_other_positions_are_no_such_run():
    move = curves()
    other = {motor: steps + 5 for motor, steps in move.items()}
    assert not judge(trace_of(move), other).good


def test_a_motor_that_has_no_business_in_the_run():
    move = curves()
    trace = Trace({**trace_of(move).signals, "m8": (np.array([ORIGIN_NS + 10**9]), np.array([1]))})
    assert judge(trace, move).complaints == [
        "motor 8: moved during the run without being in the upload"
    ]


def test_an_empty_trace_has_no_run():
    with pytest.raises(NoRun, match="no run of this move"):
        judge(Trace({}), curves())
    with pytest.raises(NoRun):
        # no motor passes through a frame
        judge(trace_of(curves()), {1: np.zeros(20, int)})


def test_the_first_full_pass_after_a_time():
    move = {1: np.arange(60) * 100}
    times, values = trace_of(move).steps(1)
    run = times > 2 * 10**9
    made = int(values[run].sum())
    back = np.linspace(times[-1] + 10**8, times[-1] + 10**9, made).astype(np.int64)
    later = 10**10
    twice = Trace(
        {
            "m1": (
                np.concatenate((times, back, times[run] + later)),
                np.concatenate((values, np.full(made, -1), values[run])),
            )
        }
    )
    for after, origin in ((0, ORIGIN_NS), (back[0], ORIGIN_NS + later)):
        verdict = judge(twice, move, after_ns=int(after))
        assert verdict.complaints == []
        assert verdict.origin_ns == pytest.approx(origin, abs=2000)
