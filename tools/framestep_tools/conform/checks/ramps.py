"""Ramps, stops, jogs and JOG_ALL over time, judged by repeated requests for positions."""

from typing import NamedTuple

from .. import spec
from ..bench import FRAMES, Bench
from ..kit import Subject, once
from ..link import Failed
from ..sampling import Sample, moved, no_faster, of, ramps_down, ramps_up, sample, watch
from ..spec import Request

_SPEED = "MSG_MOTOR_SET_SPEED: MAX VELOCITY, MAX ACCEL"
_V, _A = 500, 1000  # a ramp takes 0.5 s and 125 steps


def _two(bench: Bench) -> bool:
    return bench.hello.motors > 1


RAMPS = Subject("ramps", lambda bench: bench.hello.motors > 0)


# ---- moves


class Way(NamedTuple):
    """A move from home: of the last motor or of the first."""

    last: bool
    steps: int
    velocity: int
    acceleration: int

    def __str__(self) -> str:
        return (
            f"{'last' if self.last else 'first'} motor, {self.steps} steps, "
            f"{self.velocity} steps/s, {self.acceleration} steps/s²"
        )

    def play(self, bench: Bench):
        """Return the motor and the samples of its motion."""
        motor = bench.hello.motors if self.last else 1
        request = spec.move(motor, bench.home[motor - 1] + self.steps)
        return motor, moved(bench, motor, request, self.velocity, self.acceleration)


_WAYS = (
    Way(False, 400, 500, 1000),
    Way(False, -400, 500, 1000),
    Way(False, 500, 800, 2000),
    Way(False, -250, 300, 500),
    Way(False, 100, 1000, 1000),
    Way(False, 300, 1000, 4000),
    Way(True, -400, 500, 1000),
)


@RAMPS.must("{way}: no steeper than MAX ACCEL at the start", _SPEED, way=_WAYS)
def _up(bench: Bench, way: Way):
    motor, seen = way.play(bench)
    ramps_up(seen, motor, way.acceleration)


@RAMPS.must("{way}: no steeper than MAX ACCEL at the end", _SPEED, way=_WAYS)
def _down(bench: Bench, way: Way):
    motor, seen = way.play(bench)
    ramps_down(seen, motor, way.acceleration)


@RAMPS.must("{way}: no faster than MAX VELOCITY", _SPEED, way=_WAYS)
def _held(bench: Bench, way: Way):
    motor, seen = way.play(bench)
    no_faster(seen, motor, way.velocity)


@RAMPS.must("{way}: straight to the target", "MSG_MOTOR_MOVE", way=_WAYS)
def _one_way(bench: Bench, way: Way):
    motor, seen = way.play(bench)
    steps = [p for _, _, p in of(seen, motor)]
    if steps != sorted(steps, reverse=way.steps < 0):
        raise Failed(f"motor {motor} turned back on its way to {way.steps}")
    if steps[-1] != way.steps:
        raise Failed(f"motor {motor} came to rest at {steps[-1]}, not at {way.steps}")


@RAMPS.should("{way}: as fast as it may", _SPEED, way=_WAYS)
def _prompt(bench: Bench, way: Way):
    _, seen = way.play(bench)
    to_top = way.velocity / way.acceleration
    ramp = min(to_top, (abs(way.steps) / way.acceleration) ** 0.5)
    expected = abs(way.steps) / way.velocity + ramp
    expected = max(expected, 2 * ramp) if to_top > ramp else expected
    took = seen[-1].came_s - seen[0].came_s
    if took > 1.3 * expected + 0.3:
        raise Failed(f"the move took {took:.2f} s, {expected:.2f} s are possible")


# ---- stops


@once
def _halted(bench: Bench, requests: tuple[Request, ...], between_s: float = 0.05):
    """Return how far motor 1 went after these requests at full velocity, and the samples."""
    bench.expect(spec.speed(1, _V, _A))
    bench.link.pump(1.2)  # so an earlier STOP_ALL does not count as the first of two
    bench.expect(spec.move(1, bench.home[0] + 900))
    bench.link.pump(0.9)
    before = sample(bench)
    for request in requests:
        bench.expect(request)
        if request is not requests[-1]:
            bench.link.pump(between_s)
    seen = [before, *watch(bench, lambda: not bench.moving())]
    bench.prepare()
    bench.go(1, 0)
    return seen


def _went(seen: list[Sample]) -> int:
    return seen[-1].steps[0] - seen[0].steps[0]


_FULL = _V * _V / (2 * _A)
_ALL = Request(spec.STOP_ALL)


@RAMPS.must(
    "{request} at full speed begins its ramp at once",
    "MSG_MOTOR_STOP",
    request={"STOP": spec.stop(1)},
)
@RAMPS.must(
    "{request} at full speed begins its ramp at once",
    "MSG_MOTOR_STOP_ALL: should decelerate",
    request={"STOP_ALL": _ALL},
)
def _stops(bench: Bench, request: Request):
    seen = _halted(bench, (request,))
    # the motor runs on until the answer, which may be slow
    late = (seen[1].asked_s - seen[0].asked_s + 0.03) * _V
    if _went(seen) > _FULL * 1.1 + late:
        raise Failed(
            f"{_went(seen)} steps after the request the motor came to rest; "
            f"a ramp with MAX ACCEL takes {_FULL:.0f}"
        )


@RAMPS.should(
    "{request} at full speed decelerates with MAX ACCEL",
    "MSG_MOTOR_STOP; MSG_MOTOR_SET_SPEED",
    request={"STOP": spec.stop(1)},
)
@RAMPS.should(
    "{request} at full speed decelerates with MAX ACCEL",
    "MSG_MOTOR_STOP_ALL: should decelerate; MSG_MOTOR_SET_SPEED",
    request={"STOP_ALL": _ALL},
)
def _gently(bench: Bench, request: Request):
    seen = _halted(bench, (request,))
    if _went(seen) < _FULL * 0.7:
        raise Failed(
            f"the motor came to rest within {_went(seen)} steps, "
            f"a ramp with MAX ACCEL takes {_FULL:.0f}"
        )
    ramps_down(seen, 1, _A)


@RAMPS.should(
    "a second STOP_ALL soon after the first stops harder",
    "MSG_MOTOR_STOP_ALL: HARD STOP, decelerate faster than normal",
)
def _harder(bench: Bench):
    once, twice = _went(_halted(bench, (_ALL,))), _went(_halted(bench, (_ALL, _ALL)))
    if twice > 0.85 * once:
        raise Failed(f"with a second STOP_ALL the motor went {twice} steps, without it {once}")


@RAMPS.should(
    "a hard stop is a ramp, too",
    "MSG_MOTOR_STOP_ALL: always decelerate rather than simply stop sending signals",
)
def _no_cut(bench: Bench):
    if _went(_halted(bench, (_ALL, _ALL), 0.002)) < 8:
        raise Failed("a hard stop took the motor from full speed to rest within 8 steps")


@RAMPS.must("STOP_ALL stops every motor", "MSG_MOTOR_STOP_ALL: stop all motors")
def _every(bench: Bench):
    for motor in range(1, bench.hello.motors + 1):
        sign = 1 if motor % 2 else -1
        bench.expect(spec.move(motor, bench.home[motor - 1] + sign * 900))
    bench.link.pump(0.2)
    bench.expect(_ALL)
    bench.link.pump(0.5)
    moving = bench.moving()
    bench.expect(_ALL)
    bench.idle()
    bench.return_home()
    if moving:
        raise Failed(f"0.5 s after STOP_ALL the motors 0x{moving:X} still move")


# ---- jogs


@RAMPS.should(
    "JOG at {speed} of the velocity",
    "MSG_MOTOR_JOG: between 1% and 100% of the jog speed; note 4.2",
    speed={"2000 has 20 %": 2000, "5000 has 50 %": 5000, "10000 has 100 %": 10000},
)
def _jog_speed(bench: Bench, speed: int):
    bench.expect(spec.jog(1, speed, bench.home[0] + 800))
    bench.link.pump(0.25)
    first = sample(bench)
    bench.link.pump(0.1)
    last = sample(bench)
    bench.expect(spec.stop(1))
    bench.idle()
    bench.go(1, 0)
    went = last.steps[0] - first.steps[0]
    wanted = 1000 * speed / 10000
    low = 0.7 * wanted * (last.asked_s - first.came_s) - 2
    high = 1.3 * wanted * (last.came_s - first.asked_s) + 2
    if not low <= went <= high:
        raise Failed(
            f"a jog at {speed / 100:g} % made {went} steps in "
            f"{last.came_s - first.came_s:.2f} s, expected about "
            f"{wanted * (last.came_s - first.came_s):.0f}"
        )


@RAMPS.must(
    "JOG {sign} keeps to velocity and acceleration",
    "MSG_MOTOR_JOG: using the max velocity and acceleration",
    sign={"up": 1, "down": -1},
)
def _jog_ramps(bench: Bench, sign: int):
    request = spec.jog(1, 10000, bench.home[0] + sign * 200)
    seen = moved(bench, 1, request, _V, _A)
    ramps_up(seen, 1, _A)
    ramps_down(seen, 1, _A)
    no_faster(seen, 1, _V)
    if seen[-1].steps[0] != sign * 200 and not bench.moving():
        raise Failed(f"the jog to {sign * 200} ended at {seen[-1].steps[0]}")


@RAMPS.should("a motor that is not enabled does not move", "MSG_MOTOR_CONFIGURE: 0x01")
def _disabled(bench: Bench):
    bench.expect(spec.configure(1, 0))
    bench.ask(spec.move(1, bench.home[0] + 30))
    bench.link.pump(0.3)
    found = sample(bench).steps[0]
    bench.prepare()
    bench.go(1, 0)
    if found:
        raise Failed("a motor that is not enabled moved")


# ---- JOG_ALL

_LEAD = [10 * i for i in range(FRAMES)]
_TRAIL = [0] * 6 + [5 * (i + 1) ** 2 for i in range(FRAMES - 6)]


@once
def _along(bench: Bench, fps: float) -> list[Sample]:
    bench.expect(spec.begin(1, FRAMES))
    for motor, path in enumerate((_LEAD, _TRAIL)[: bench.hello.motors], 1):
        positions = [bench.home[motor - 1] + p for p in path]
        bench.expect(spec.axis(motor, spec.LAST, positions))
    bench.expect(Request(spec.UPLOAD_END))
    bench.expect(spec.frame(1))
    bench.idle()
    before = sample(bench)
    bench.expect(spec.jog_all(fps, FRAMES))
    seen = [before, *watch(bench, lambda: not bench.moving())]
    bench.return_home()
    return seen


def _runs(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_RUN) and bench.hello.motors > 0


@RAMPS.must(
    "JOG_ALL at {fps} frames/s is no faster than that",
    "MSG_RT_JOG_ALL: Speed in FPS",
    fps=(3, 6),
    needs=_runs,
)
def _rate(bench: Bench, fps: float):
    no_faster(_along(bench, fps), 1, 10 * fps * 1.05, 0.5)


@RAMPS.should(
    "JOG_ALL keeps the motors together on the path",
    "MSG_RT_JOG_ALL; note 6.10",
    needs=lambda bench: _runs(bench) and _two(bench),
)
def _on_path(bench: Bench):
    for seen in _along(bench, 3):
        lead, trail = seen.steps[:2]
        frame = min(max(lead / 10, 0), FRAMES - 1)
        low, high = int(frame), min(int(frame) + 1, FRAMES - 1)
        wanted = _TRAIL[low] + (_TRAIL[high] - _TRAIL[low]) * (frame - low)
        if abs(trail - wanted) > 6:
            raise Failed(
                f"at frame {frame + 1:.1f} by motor 1, motor 2 is {trail - wanted:+.0f} steps off"
            )
