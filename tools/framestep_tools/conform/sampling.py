"""Motion as a host can see it: positions asked for again and again, and what they rule out.

Each sample belongs to a moment between its question and its answer, so nothing is held against a
device that answers slowly; it is only judged less sharply.
"""

import itertools
from collections.abc import Callable, Iterable
from typing import NamedTuple

from . import spec
from .bench import Bench
from .link import Failed
from .spec import Request

_STEP_S = 0.004
SLACK = 1.12  # of accelerations and velocities
_STEPS = 2.5  # rounding of two positions


class Sample(NamedTuple):
    """Positions at some moment between two, in seconds of the host's clock, in steps from home."""

    asked_s: float
    came_s: float
    steps: tuple[int, ...]


def sample(bench: Bench) -> Sample:
    """One look."""
    asked = bench.link.clock()
    steps = bench.positions().steps
    home = bench.home
    return Sample(asked, bench.link.clock(), tuple(p - h for p, h in zip(steps, home, strict=True)))


def watch(bench: Bench, until: Callable[[], bool], limit_s: float = 15.0) -> list[Sample]:
    """Samples until `until()` is true; Failed where it never is."""
    seen = [sample(bench)]
    end = bench.link.clock() + limit_s
    while not until():
        if bench.link.clock() > end:
            raise Failed(f"what should have ended goes on after {limit_s:g} s")
        bench.link.pump(_STEP_S)
        seen.append(sample(bench))
    seen.append(sample(bench))
    return seen


def motion(bench: Bench, request: Request) -> list[Sample]:
    """A request and its motion up to its end. The first sample is from before."""
    seen = [sample(bench)]
    bench.expect(request)
    return seen + watch(bench, lambda: not bench.moving())


def of(samples: Iterable[Sample], motor: int) -> list[tuple[float, float, int]]:
    """One motor's."""
    return [(s.asked_s, s.came_s, s.steps[motor - 1]) for s in samples]


def ramps_up(samples: list[Sample], motor: int, acceleration: float) -> None:
    """From rest a motor gets no further in a time than its acceleration takes it."""
    track = of(samples, motor)
    _, start, origin = track[0]
    for _, came, steps in track[1:]:
        most = acceleration * SLACK * (came - start) ** 2 / 2 + _STEPS
        if abs(steps - origin) > most:
            raise Failed(
                f"{came - start:.3f} s after its start motor {motor} has gone "
                f"{abs(steps - origin)} steps; with MAX ACCEL it cannot be beyond {most:.0f}"
            )


def ramps_down(samples: list[Sample], motor: int, acceleration: float) -> None:
    """And no more than that is left of its way so long before its end."""
    track = of(samples, motor)
    last = track[-1][2]
    # the last step is made before the ramp ends
    end = next(came for _, came, steps in track if steps == last) + (2 / acceleration) ** 0.5
    for asked, _, steps in track:
        if asked >= end:
            break
        most = acceleration * SLACK * (end - asked) ** 2 / 2 + _STEPS
        if asked > track[0][1] and abs(last - steps) > most:
            raise Failed(
                f"{end - asked:.3f} s before its end motor {motor} has {abs(last - steps)} steps "
                f"left; with MAX ACCEL it cannot come to rest from beyond {most:.0f}"
            )


def no_faster(samples: list[Sample], motor: int, velocity: float, over_s: float = 0.2) -> None:
    """Over no stretch is it faster than its velocity."""
    track = of(samples, motor)
    begin = 0
    for _, came, steps in track:
        while came - track[begin][0] > over_s:
            asked, _, before = track[begin]
            most = velocity * 1.04 * (came - asked) + _STEPS
            if abs(steps - before) > most:
                raise Failed(
                    f"motor {motor} made {abs(steps - before)} steps in {came - asked:.3f} s, "
                    f"at most {most:.0f} are possible at {velocity:g} steps/s"
                )
            begin += 1


def crossing(samples: list[Sample], motor: int, steps: float) -> tuple[float, float]:
    """Between which moments a motor first came past a position; Failed if it did not."""
    track = of(samples, motor)
    for (asked, _, a), (_, came, b) in itertools.pairwise(track):
        if (a - steps) * (b - steps) <= 0 and a != b:
            return asked, came
    raise Failed(f"motor {motor} never passed step {steps:g} from its start")


def took(samples: list[Sample], motor: int, first: float, last: float) -> tuple[float, float]:
    """The shortest and the longest time that the way between two positions can have taken."""
    a, b = crossing(samples, motor, first)
    c, d = crossing(samples, motor, last)
    if d <= a:
        raise Failed(f"motor {motor} came past {last:g} before it came past {first:g}")
    return c - b, d - a


def moved(bench: Bench, motor: int, request: Request, velocity: int, acceleration: int):
    """A motor's motion at this speed, which is then set back. Played once for all checks."""
    key = "moved", motor, request, velocity, acceleration
    if key not in bench.kept:
        bench.expect(spec.speed(motor, velocity, acceleration))
        seen = motion(bench, request)
        bench.prepare()
        bench.go(motor, 0)
        bench.kept[key] = seen
    return bench.kept[key]
