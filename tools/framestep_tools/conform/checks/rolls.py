"""Runs over time: long ones at NTSC rates, pre-roll and post-roll of a path that does not begin and
end at rest, reports of reached frames."""

from .. import spec
from ..bench import FRAMES, Bench
from ..kit import Subject, once
from ..link import Failed
from ..sampling import Sample, of, sample, took
from ..spec import Request

_RUN = "MSG_RT_RUN_MOVE"
_LONG = 240  # frames
_DRIFT = 4e-4  # as a part of the rate; 24 instead of 23.976 is 1e-3
_STEP, _FPS, _ROLL_S = 10, 24, 0.5


def _can(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_RUN) and bench.hello.motors > 0


ROLLS = Subject("runs", _can)


@ROLLS.must(
    f"{_LONG} frames at {{fps}} frames/s drift by less than {_DRIFT:.2%}",
    f"{_RUN}: Speed in FPS * 1000",
    fps=(23.976, 29.97),
    full=True,
)
def _drift(bench: Bench, fps: float):
    """The rate, from a straight line through the times of all frames."""
    if bench.hello.frames < _LONG:
        return
    bench.expect(spec.begin(1, _LONG))
    positions = [bench.home[0] + abs(i % 120 - 60) for i in range(_LONG)]
    for at in range(0, _LONG, 120):
        last = spec.LAST if at + 120 == _LONG else 0
        bench.expect(spec.axis(1, at | last, positions[at : at + 120]))
    bench.expect(Request(spec.UPLOAD_END))
    bench.expect(spec.run(fps, 1, _LONG))
    bench.idle()
    bench.link.reports.clear()
    bench.expect(Request(spec.GO))
    end = bench.link.clock() + _LONG / fps + 4
    while not bench.ends() and bench.link.clock() < end:
        bench.link.pump(0.1)
    times = {
        p.move_time // 1000: p.time_s
        for p in bench.reports()
        if p.move_time % 1000 == 0 and 1000 < p.move_time < 1000 * _LONG
    }
    bench.idle()
    bench.return_home()
    if len(times) < _LONG / 2:
        raise Failed(f"only {len(times)} of {_LONG} frames were reported")
    period = _slope(times)
    if abs(period * fps - 1) > _DRIFT:
        raise Failed(f"frames came at {1 / period:.4f} frames/s, asked for were {fps}")


def _slope(times: dict[int, float]) -> float:
    count = len(times)
    middle = sum(times) / count
    mean = sum(times.values()) / count
    return sum((n - middle) * (t - mean) for n, t in times.items()) / sum(
        (n - middle) ** 2 for n in times
    )


@once
def _steady(bench: Bench) -> tuple[list[Sample], float]:
    """Play a path of constant velocity, forward. Return the samples from before GO until RT_END,
    and its time."""
    bench.expect(spec.begin(1, FRAMES))
    path = [bench.home[0] + _STEP * i for i in range(FRAMES)]
    bench.expect(spec.axis(1, spec.LAST, path))
    bench.expect(Request(spec.UPLOAD_END))
    roll = round(1000 * _ROLL_S)
    bench.expect(spec.run(_FPS, 1, FRAMES, roll, roll))
    bench.idle()
    bench.link.reports.clear()
    seen = [sample(bench)]
    bench.expect(Request(spec.GO))
    limit = bench.link.clock() + 10
    while not bench.ends():
        if bench.link.clock() > limit:
            raise Failed("no RT_END within 10 s of GO")
        seen.append(sample(bench))
        bench.link.pump(0.002)
    end = bench.ends()[0]
    bench.idle()
    bench.return_home()
    return seen, end


_SPEED = _STEP * _FPS
_WAY = _SPEED * _ROLL_S / 2  # distance of a roll with constant acceleration


def _came(seen: list[Sample], wanted: int) -> float:
    """Return when motor 1 was first seen at a position or beyond it."""
    for _, came, steps in of(seen, 1):
        if steps >= wanted:
            return came
    raise Failed(f"motor 1 never came to {wanted}")


@ROLLS.must(
    "the pre-roll lasts its time", f'{_RUN}: accelerate into full speed after "pre-roll time"'
)
def _pre_time(bench: Bench):
    seen, _ = _steady(bench)
    low, high = took(seen, 1, seen[0].steps[0] + 2, 0)
    # two steps are done after sqrt(4 / a)
    wanted = _ROLL_S - (4 * _ROLL_S / _SPEED) ** 0.5
    if not (low - 0.06 <= wanted <= high + 0.06):
        raise Failed(f"the pre-roll took {low:.2f} s from its third step, expected {wanted:.2f} s")


@ROLLS.should(
    "the first frame comes a pre-roll after GO", "MSG_RT_GO; " + f"{_RUN}: PRE-ROLL TIME; note 6.2"
)
def _go_time(bench: Bench):
    seen, _ = _steady(bench)
    late = _came(seen, 0) - seen[0].came_s - _ROLL_S
    if late > 0.2:
        raise Failed(f"the first frame came {late:.2f} s later than the pre-roll after GO")


@ROLLS.must("after the pre-roll the motor has full speed", f"{_RUN}: full speed")
def _pre_speed(bench: Bench):
    seen, _ = _steady(bench)
    low, high = took(seen, 1, 0.5 * _STEP, 5.5 * _STEP)
    wanted = 5 / _FPS
    if low > wanted * 1.05 or high < wanted * 0.95:
        raise Failed(f"five frames took {low:.3f} to {high:.3f} s, expected {wanted:.3f} s")


@ROLLS.should("the post-roll is a ramp that lasts its time", f"{_RUN}: POST-ROLL TIME; note 6.2")
def _post_way(bench: Bench):
    seen, _ = _steady(bench)
    most = max(steps for _, _, steps in of(seen, 1)) - _STEP * (FRAMES - 1)
    # the last frame may have its own period before the post-roll begins (note 6.11)
    if not _WAY - 5 <= most <= _WAY + _STEP + 5:
        raise Failed(
            f"the post-roll went {most} steps past the end frame; with constant acceleration over "
            f"its time it is {_WAY:.0f} to {_WAY + _STEP:.0f}"
        )


@ROLLS.should(
    "RT_END does not come before the post-roll is over",
    "MSG_RT_END: the process is over; note 6.11",
)
def _post_end(bench: Bench):
    seen, end = _steady(bench)
    last = _came(seen, _STEP * (FRAMES - 1))
    if end - last < _ROLL_S * 0.85:
        raise Failed(f"RT_END came {end - last:.2f} s after the end frame, before the post-roll")


@ROLLS.must(
    "a frame is reported when it is reached",
    "MSG_RT_GO: each time it reaches a new frame; slightly after is ok",
)
def _fresh(bench: Bench):
    fps = 6
    bench.upload()
    bench.expect(spec.run(fps, 1, FRAMES))
    bench.idle()
    bench.link.reports.clear()
    bench.expect(Request(spec.GO))
    worst, seen = 0, 0
    limit = bench.link.clock() + FRAMES / fps + 4
    while not bench.ends() and bench.link.clock() < limit:
        bench.link.pump(0.01)
        for report in bench.reports():
            if report.move_time in range(4000, 9001, 1000):
                now = bench.positions().steps[0]
                worst = max(worst, abs(now - report.steps[0]))
                seen += 1
        bench.link.reports[:] = [r for r in bench.link.reports if r.frame.type == spec.END]
    bench.idle()
    bench.return_home()
    fastest = max(abs(b - a) for a, b in zip(bench.path(1), bench.path(1)[1:], strict=False)) * fps
    if not seen:
        raise Failed("no frame was reported")
    if worst > fastest * 0.1 + 2:
        raise Failed(
            f"when a frame was reported motor 1 was {worst} steps further, "
            f"which takes {worst / fastest:.2f} s at least"
        )
