"""Ramps, stops, jogs and JOG_ALL over time, judged by repeated requests for positions."""

from .. import spec
from ..bench import FRAMES, Bench
from ..kit import MUST, SHOULD, Check
from ..link import Failed
from ..sampling import Sample, moved, no_faster, of, ramps_down, ramps_up, sample, watch
from ..spec import Request

CHECKS: list[Check] = []
_SPEED = "MSG_MOTOR_SET_SPEED: MAX VELOCITY, MAX ACCEL"
_V, _A = 500, 1000  # a ramp takes 0.5 s and 125 steps


def _motors(bench: Bench) -> bool:
    return bench.hello.motors > 0


def _two(bench: Bench) -> bool:
    return bench.hello.motors > 1


def _put(name, source, run, level=MUST, needs=_motors):
    CHECKS.append(Check("ramps", name, source, run, level, needs))


# ---- moves


def _move(bench: Bench, last: bool, steps: int, velocity: int, acceleration: int):
    motor = bench.hello.motors if last else 1
    request = spec.move(motor, bench.home[motor - 1] + steps)
    return motor, moved(bench, motor, request, velocity, acceleration)


def _up(*way):
    def run(bench: Bench):
        motor, seen = _move(bench, *way)
        ramps_up(seen, motor, way[-1])

    return run


def _down(*way):
    def run(bench: Bench):
        motor, seen = _move(bench, *way)
        ramps_down(seen, motor, way[-1])

    return run


def _held(*way):
    def run(bench: Bench):
        motor, seen = _move(bench, *way)
        no_faster(seen, motor, way[-2])

    return run


def _prompt(*way):
    def run(bench: Bench):
        _, seen = _move(bench, *way)
        _, steps, velocity, acceleration = way
        ramp = min(velocity / acceleration, (abs(steps) / acceleration) ** 0.5)
        expected = abs(steps) / velocity + ramp
        expected = max(expected, 2 * ramp) if velocity / acceleration > ramp else expected
        took = seen[-1].came_s - seen[0].came_s
        if took > 1.3 * expected + 0.3:
            raise Failed(f"the move took {took:.2f} s, {expected:.2f} s are possible")

    return run


def _one_way(*way):
    def run(bench: Bench):
        motor, seen = _move(bench, *way)
        steps = [p for _, _, p in of(seen, motor)]
        if steps != sorted(steps, reverse=way[1] < 0):
            raise Failed(f"motor {motor} turned back on its way to {way[1]}")
        if steps[-1] != way[1]:
            raise Failed(f"motor {motor} came to rest at {steps[-1]}, not at {way[1]}")

    return run


for _way in (
    (False, 400, 500, 1000),
    (False, -400, 500, 1000),
    (False, 500, 800, 2000),
    (False, -250, 300, 500),
    (False, 100, 1000, 1000),
    (False, 300, 1000, 4000),
    (True, -400, 500, 1000),
):
    _last, _steps, _velocity, _acceleration = _way
    _text = (
        f"{'last' if _last else 'first'} motor, {_steps} steps, {_velocity} steps/s, "
        f"{_acceleration} steps/s²"
    )
    _put(f"{_text}: no steeper than MAX ACCEL at the start", _SPEED, _up(*_way))
    _put(f"{_text}: no steeper than MAX ACCEL at the end", _SPEED, _down(*_way))
    _put(f"{_text}: no faster than MAX VELOCITY", _SPEED, _held(*_way))
    _put(f"{_text}: straight to the target", "MSG_MOTOR_MOVE", _one_way(*_way))
    _put(f"{_text}: as fast as it may", _SPEED, _prompt(*_way), SHOULD)


# ---- stops


def _halted(bench: Bench, requests: tuple[Request, ...], between_s: float = 0.05):
    """Return how far motor 1 went after these requests at full velocity, and the samples."""
    key = "halted", requests
    if key in bench.kept:
        return bench.kept[key]
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
    bench.kept[key] = seen
    return seen


def _went(seen: list[Sample]) -> int:
    return seen[-1].steps[0] - seen[0].steps[0]


_FULL = _V * _V / (2 * _A)


def _stops(*requests: Request):
    def run(bench: Bench):
        seen = _halted(bench, requests)
        # the motor runs on until the answer, which may be slow
        late = (seen[1].asked_s - seen[0].asked_s + 0.03) * _V
        if _went(seen) > _FULL * 1.1 + late:
            raise Failed(
                f"{_went(seen)} steps after the request the motor came to rest; "
                f"a ramp with MAX ACCEL takes {_FULL:.0f}"
            )

    return run


def _gently(*requests: Request):
    def run(bench: Bench):
        seen = _halted(bench, requests)
        if _went(seen) < _FULL * 0.7:
            raise Failed(
                f"the motor came to rest within {_went(seen)} steps, "
                f"a ramp with MAX ACCEL takes {_FULL:.0f}"
            )
        ramps_down(seen, 1, _A)

    return run


_ALL = Request(spec.STOP_ALL)
for _name, _request in (("STOP", spec.stop(1)), ("STOP_ALL", _ALL)):
    _source = "MSG_MOTOR_STOP_ALL: should decelerate" if _request is _ALL else "MSG_MOTOR_STOP"
    _put(f"{_name} at full speed begins its ramp at once", _source, _stops(_request))
    _put(
        f"{_name} at full speed decelerates with MAX ACCEL",
        _source + "; MSG_MOTOR_SET_SPEED",
        _gently(_request),
        SHOULD,
    )


def _harder(bench: Bench):
    once, twice = _went(_halted(bench, (_ALL,))), _went(_halted(bench, (_ALL, _ALL)))
    if twice > 0.85 * once:
        raise Failed(f"with a second STOP_ALL the motor went {twice} steps, without it {once}")


_put(
    "a second STOP_ALL soon after the first stops harder",
    "MSG_MOTOR_STOP_ALL: HARD STOP, decelerate faster than normal",
    _harder,
    SHOULD,
)


def _no_cut(bench: Bench):
    if _went(_halted(bench, (_ALL, _ALL), 0.002)) < 8:
        raise Failed("a hard stop took the motor from full speed to rest within 8 steps")


_put(
    "a hard stop is a ramp, too",
    "MSG_MOTOR_STOP_ALL: always decelerate rather than simply stop sending signals",
    _no_cut,
    SHOULD,
)


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


_put("STOP_ALL stops every motor", "MSG_MOTOR_STOP_ALL: stop all motors", _every)


# ---- jogs


def _jog_speed(speed: int):
    def run(bench: Bench):
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

    return run


for _percent in (20, 50, 100):
    _put(
        f"JOG at {_percent * 100} has {_percent} % of the velocity",
        "MSG_MOTOR_JOG: between 1% and 100% of the jog speed; note 4.2",
        _jog_speed(_percent * 100),
        SHOULD,
    )


def _jog_ramps(sign: int):
    def run(bench: Bench):
        request = spec.jog(1, 10000, bench.home[0] + sign * 200)
        seen = moved(bench, 1, request, _V, _A)
        ramps_up(seen, 1, _A)
        ramps_down(seen, 1, _A)
        no_faster(seen, 1, _V)
        if seen[-1].steps[0] != sign * 200 and not bench.moving():
            raise Failed(f"the jog to {sign * 200} ended at {seen[-1].steps[0]}")

    return run


for _sign in (1, -1):
    _put(
        f"JOG {'up' if _sign > 0 else 'down'} keeps to velocity and acceleration",
        "MSG_MOTOR_JOG: using the max velocity and acceleration",
        _jog_ramps(_sign),
    )


def _disabled(bench: Bench):
    bench.expect(spec.configure(1, 0))
    bench.ask(spec.move(1, bench.home[0] + 30))
    bench.link.pump(0.3)
    found = sample(bench).steps[0]
    bench.prepare()
    bench.go(1, 0)
    if found:
        raise Failed("a motor that is not enabled moved")


_put("a motor that is not enabled does not move", "MSG_MOTOR_CONFIGURE: 0x01", _disabled, SHOULD)


# ---- JOG_ALL

_LEAD = [10 * i for i in range(FRAMES)]
_TRAIL = [0] * 6 + [5 * (i + 1) ** 2 for i in range(FRAMES - 6)]


def _along(bench: Bench, fps: float) -> list[Sample]:
    key = "jog all", fps
    if key not in bench.kept:
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
        bench.kept[key] = seen
    return bench.kept[key]


def _runs(bench: Bench) -> bool:
    return bool(bench.hello.can & spec.CAN_RUN) and bench.hello.motors > 0


def _rate(fps: float):
    def run(bench: Bench):
        no_faster(_along(bench, fps), 1, 10 * fps * 1.05, 0.5)

    return run


for _fps in (3, 6):
    _put(
        f"JOG_ALL at {_fps} frames/s is no faster than that",
        "MSG_RT_JOG_ALL: Speed in FPS",
        _rate(_fps),
        needs=_runs,
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


_put(
    "JOG_ALL keeps the motors together on the path",
    "MSG_RT_JOG_ALL; note 6.10",
    _on_path,
    SHOULD,
    lambda bench: _runs(bench) and _two(bench),
)
