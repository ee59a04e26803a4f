"""Steps on the pins, if a trace shows them.

Their number must match the positions; none may be lost or go back; no pulse may come sooner than
velocity and acceleration allow; in a run each comes at its frame's time. A device may compensate
backlash. That is measured first, and then allowed at each turn.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...judge.motion_limits import REPORTS, too_close
from ...judge.trace import Edge
from .. import spec
from ..bench import FRAMES, Bench
from ..kit import Subject, once
from ..link import Failed
from ..spec import Request

_V, _A = 800, 2000


EDGES = Subject("edges", lambda bench: bench.pins is not None and bench.hello.motors > 0)


def _steps(edges: list[Edge], motor: int) -> list[tuple[float, int]]:
    """Return the times in seconds and the directions of a motor's steps."""
    return [(time * 1e-9, value) for time, name, value in edges if name == f"m{motor}"]


def _taken(bench: Bench, seconds: float = 0.2) -> list[Edge]:
    assert bench.pins
    bench.link.pump(seconds)
    return bench.pins.take()


@once
def _moved(bench: Bench, motor: int, *targets: int) -> list[list[tuple[float, int]]]:
    """Return the steps of successive moves from home and back. Made only once."""
    bench.expect(spec.speed(motor, _V, _A))
    _taken(bench)
    made = []
    for target in (*targets, 0):
        bench.go(motor, target)
        made.append(_steps(_taken(bench), motor))
    bench.prepare()
    return made


def _play(bench: Bench, motor: int) -> int:
    """Return the steps that the device adds at a turn."""
    _, down, up = _moved(bench, motor, 20, -20)
    return max(0, len(down) - 40, len(up) - 20)


def _is_right(made: int, wanted: int, play: int) -> bool:
    """Return whether the number of steps is right, with the backlash of a turn before or within."""
    return made - wanted in (-play, 0, play)


class Targets(NamedTuple):
    """Successive moves from home and back."""

    last: bool
    targets: tuple[int, ...]

    def __str__(self) -> str:
        motor = "last" if self.last else "first"
        return f"{motor} motor to {', '.join(map(str, self.targets))} and back"

    def steps(self, bench: Bench) -> list[list[tuple[float, int]]]:
        return _moved(bench, self.motor(bench), *self.targets)

    def motor(self, bench: Bench) -> int:
        return bench.hello.motors if self.last else 1


_MOVES = (
    Targets(False, (400,)),
    Targets(False, (-300,)),
    Targets(False, (1, -1, 3, -250, 10)),
    Targets(True, (350, -90)),
)


@EDGES.must("{moves}: a step for each, all one way", "MSG_MOTOR_MOVE", moves=_MOVES)
def _counted(bench: Bench, moves: Targets):
    play = _play(bench, moves.motor(bench))
    for steps, (a, b) in zip(moves.steps(bench), pairwise((0, *moves.targets, 0)), strict=True):
        made = sum(value for _, value in steps)
        if len(steps) != abs(made) or not _is_right(made, b - a, play):
            raise Failed(f"a move from {a} to {b} made {len(steps)} steps, {made} in all")


@EDGES.must("{moves}: MAX VELOCITY", "MSG_MOTOR_SET_SPEED", moves=_MOVES)
def _spaced(bench: Bench, moves: Targets):
    for steps in moves.steps(bench):
        times = np.array([time for time, _ in steps])
        if (at := too_close(times, 0.96 / _V)) is not None:
            raise Failed(
                f"two steps came {1e6 * (times[at + 1] - times[at]):.0f} µs apart, MAX VELOCITY "
                f"asks for {1e6 / _V:.0f} µs"
            )


@EDGES.must("{moves}: MAX ACCEL", "MSG_MOTOR_SET_SPEED", moves=_MOVES)
def _ramped(bench: Bench, moves: Targets):
    for steps in moves.steps(bench):
        times = [time for time, _ in steps]
        for way in (times, [-time for time in reversed(times)]):
            _from_rest(way)


def _from_rest(times: list[float]) -> None:
    """Require that the velocity after n steps from rest is at most the root of 2 n a."""
    for n, (a, b) in enumerate(pairwise(times), 2):
        if n >= 4 and 1 / (b - a) ** 2 > 2 * (n + 0.5) * _A * REPORTS.acceleration.share:
            raise Failed(
                f"{n} steps from rest the velocity is {1 / (b - a):.0f} steps/s; with MAX ACCEL "
                f"it is at most {(2 * n * _A) ** 0.5:.0f}"
            )


@EDGES.must("after stops the position matches the steps", "MSG_MOTOR_GET_POSITION")
def _agrees(bench: Bench):
    """After a stop at any place, the position equals the steps."""
    play = _play(bench, 1)
    _taken(bench)
    at = bench.positions().steps[0]
    for target, seconds in ((900, 0.31), (-200, 0.27), (500, 0.44)):
        bench.expect(spec.move(1, bench.home[0] + target))
        bench.link.pump(seconds)
        bench.expect(spec.stop(1))
        bench.idle()
        made = sum(value for _, value in _steps(_taken(bench), 1))
        now = bench.positions().steps[0]
        if not _is_right(made, now - at, play):
            raise Failed(f"the position changed by {now - at} and {made} steps were made")
        at = now
    bench.return_home()


@EDGES.must("requests without motion make no step", "MSG_MOTOR_RESET_POSITION: does not move")
def _still(bench: Bench):
    _taken(bench)
    bench.expect(spec.move(1, bench.home[0]))
    bench.expect(spec.reset(1, bench.home[0] + 3))
    bench.expect(spec.reset(1, bench.home[0]))
    bench.expect(spec.configure(1, 1))
    bench.expect(Request(spec.STOP_ALL))
    if any(name.startswith("m") and name[1:].isdigit() for _, name, _ in _taken(bench)):
        raise Failed("a motor stepped without a request for motion")


def _runs(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_RUN)


@once
def _run(bench: Bench, fps: float, back: bool):
    """Return the steps of the first two motors since GO, from their start. Played only once."""
    first, last = (FRAMES, 1) if back else (1, FRAMES)
    bench.upload()
    bench.expect(spec.run(fps, first, last))
    bench.idle()
    _taken(bench)
    waits = bench.positions().steps
    bench.link.reports.clear()
    bench.expect(Request(spec.GO))
    end = bench.link.clock() + FRAMES / fps + 5
    while not bench.ends() and bench.link.clock() < end:
        bench.link.pump(0.1)
    edges = _taken(bench)
    bench.idle()
    bench.return_home()
    return waits, [_steps(edges, m) for m in range(1, min(2, len(waits)) + 1)]


def _at(steps: list[tuple[float, int]], start: int, time_s: float) -> int:
    return start + sum(value for time, value in steps if time <= time_s)


@EDGES.must(
    "{row}: each frame's steps are made at its time",
    "MSG_RT_RUN_MOVE: FPS; note 5.6",
    rows={
        "12 frames/s forward": (12, False),
        "24 frames/s backward": (24, True),
        "29.97 frames/s forward": (29.97, False),
    },
    needs=_runs,
)
def _framed(bench: Bench, fps: float, back: bool):
    waits, made = _run(bench, fps, back)
    order = [FRAMES - i if back else 1 + i for i in range(FRAMES)]
    path = [[bench.path(m)[n - 1] for n in order] for m in range(1, len(made) + 1)]
    start = _middle(made[0], waits[0], path[0]) - (FRAMES - 1) / 2 / fps
    for i, number in enumerate(order):
        for motor, steps in enumerate(made, 1):
            found = _at(steps, waits[motor - 1], start + i / fps)
            # the time of frame 1 is uncertain by one step at most
            if abs(found - path[motor - 1][i]) > 1:
                raise Failed(
                    f"at the time of frame {number} motor {motor} had stepped to {found}, "
                    f"uploaded is {path[motor - 1][i]}"
                )


def _middle(steps: list[tuple[float, int]], start: int, path: list[int]) -> float:
    """Return the time at which a motor reached the middle of a symmetric path."""
    wanted = (path[0] + path[-1]) / 2
    position = start
    for time, value in steps:
        position += value
        if (position - wanted) * (path[-1] - path[0]) >= 0:
            return time
    raise Failed("motor 1 did not step through the middle of its path")


@EDGES.should(
    "motors of a run start together",
    "note 6.3",
    needs=lambda bench: _runs(bench) and bench.hello.motors > 1,
)
def _together(bench: Bench):
    _waits, made = _run(bench, 12, False)
    if not all(made):
        raise Failed("a motor did not step")
    first = [steps[0][0] for steps in made]
    if max(first) - min(first) > 0.004:
        raise Failed(f"motors set off {1000 * (max(first) - min(first)):.1f} ms apart")
