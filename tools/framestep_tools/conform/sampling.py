"""Motion as a host sees it: repeated requests for positions, and what they rule out.

Each sample belongs to some moment between its question and its answer. So a slow answer is never a
fault; it only makes the verdict less sharp.
"""

import itertools
from collections.abc import Callable, Iterable
from typing import NamedTuple

from ..judge.motion_limits import ACCELERATION, REPORTS, VELOCITY
from . import spec
from .bench import Bench
from .link import Failed
from .spec import Request

_STEP_S = 0.004


class Sample(NamedTuple):
    """Positions in steps from home, at some moment between two times in seconds of the host's
    clock."""

    asked_s: float
    came_s: float
    steps: tuple[int, ...]


def sample(bench: Bench) -> Sample:
    """Take one sample."""
    asked = bench.link.clock()
    steps = bench.positions().steps
    home = bench.home
    return Sample(asked, bench.link.clock(), tuple(p - h for p, h in zip(steps, home, strict=True)))


def watch(bench: Bench, until: Callable[[], bool], limit_s: float = 15.0) -> list[Sample]:
    """Take samples until `until()` is true. Raises Failed if it never is."""
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
    """Send a request and sample its motion to the end. The first sample precedes the request."""
    seen = [sample(bench)]
    bench.expect(request)
    return seen + watch(bench, lambda: not bench.moving())


def of(samples: Iterable[Sample], motor: int) -> list[tuple[float, float, int]]:
    """Return one motor's samples."""
    return [(s.asked_s, s.came_s, s.steps[motor - 1]) for s in samples]


def ramps_up(samples: list[Sample], motor: int, acceleration: float) -> None:
    """Limit a motor's distance from rest in a given time by its acceleration."""
    track = of(samples, motor)
    _, start, origin = track[0]
    for _, came, steps in track[1:]:
        most = REPORTS.most(ACCELERATION, acceleration / 2, came - start)
        if abs(steps - origin) > most:
            raise Failed(
                f"{came - start:.3f} s after its start motor {motor} has gone "
                f"{abs(steps - origin)} steps; with MAX ACCEL it cannot be beyond {most:.0f}"
            )


def ramps_down(samples: list[Sample], motor: int, acceleration: float) -> None:
    """Limit the remaining distance at a given time before the end."""
    track = of(samples, motor)
    last = track[-1][2]
    # the last step comes before the end of the ramp
    end = next(came for _, came, steps in track if steps == last) + (2 / acceleration) ** 0.5
    for asked, _, steps in track:
        if asked >= end:
            break
        most = REPORTS.most(ACCELERATION, acceleration / 2, end - asked)
        if asked > track[0][1] and abs(last - steps) > most:
            raise Failed(
                f"{end - asked:.3f} s before its end motor {motor} has {abs(last - steps)} steps "
                f"left; with MAX ACCEL it cannot come to rest from beyond {most:.0f}"
            )


def no_faster(samples: list[Sample], motor: int, velocity: float, over_s: float = 0.2) -> None:
    """Limit the velocity over each stretch."""
    track = of(samples, motor)
    begin = 0
    for _, came, steps in track:
        while came - track[begin][0] > over_s:
            asked, _, before = track[begin]
            most = REPORTS.most(VELOCITY, velocity, came - asked)
            if abs(steps - before) > most:
                raise Failed(
                    f"motor {motor} made {abs(steps - before)} steps in {came - asked:.3f} s, "
                    f"at most {most:.0f} are possible at {velocity:g} steps/s"
                )
            begin += 1


def crossing(samples: list[Sample], motor: int, steps: float) -> tuple[float, float]:
    """Return the moments between which a motor first passed a position. Raises Failed if it did
    not."""
    track = of(samples, motor)
    for (asked, _, a), (_, came, b) in itertools.pairwise(track):
        if (a - steps) * (b - steps) <= 0 and a != b:
            return asked, came
    raise Failed(f"motor {motor} never passed step {steps:g} from its start")


def took(samples: list[Sample], motor: int, first: float, last: float) -> tuple[float, float]:
    """Return the shortest and the longest possible time between two positions."""
    a, b = crossing(samples, motor, first)
    c, d = crossing(samples, motor, last)
    if d <= a:
        raise Failed(f"motor {motor} came past {last:g} before it came past {first:g}")
    return c - b, d - a


def moved(bench: Bench, motor: int, request: Request, velocity: int, acceleration: int):
    """Sample a motor's motion with these settings, and reset them. Played only once for all
    checks."""
    key = "moved", motor, request, velocity, acceleration
    if key not in bench.kept:
        bench.expect(spec.speed(motor, velocity, acceleration))
        seen = motion(bench, request)
        bench.prepare()
        bench.go(motor, 0)
        bench.kept[key] = seen
    return bench.kept[key]
