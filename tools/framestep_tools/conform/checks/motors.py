"""Moves, jogs, stops, soft limits and positions, judged by position messages."""

from itertools import pairwise
from typing import NamedTuple

from .. import spec
from ..bench import ACCELERATION, VELOCITY, Bench
from ..kit import Subject
from ..link import Failed
from ..spec import Request

_UP_DOWN = {"up": 1, "down": -1}


_ALL = Subject("motors")
MOTORS = _ALL.where(lambda bench: bench.hello.motors > 0)


def _two(bench: Bench) -> bool:
    return bench.hello.motors > 1


@MOTORS.must(
    "the first motor moves {steps} steps and back, exactly",
    "MSG_MOTOR_MOVE",
    steps=(1, -1, 2, -7, 40, -40, 150, -150),
)
@MOTORS.must(
    "the first motor moves {steps} steps and back",
    "MSG_MOTOR_MOVE",
    steps=(3000, -3000),
    full=True,
)
def _first_moved(bench: Bench, steps: int):
    _moved(bench, 1, steps)


@MOTORS.must(
    "the last motor moves {steps} steps and back, exactly", "MSG_MOTOR_MOVE", steps=(3, -90)
)
def _last_moved(bench: Bench, steps: int):
    _moved(bench, bench.hello.motors, steps)


def _moved(bench: Bench, motor: int, steps: int):
    bench.go(motor, steps)
    bench.at(motor, steps)
    bench.go(motor, 0)
    bench.at(motor, 0)


@MOTORS.must("a MOVE moves no other motor", "MSG_MOTOR_MOVE", needs=_two)
def _alone(bench: Bench):
    before = bench.positions().steps[1:]
    bench.go(1, 30)
    after = bench.positions().steps[1:]
    bench.go(1, 0)
    if before != after:
        raise Failed("a MOVE of motor 1 moved another motor")


@MOTORS.must(
    "MOTOR_STATUS has the bit of the motor that moves, from the answer on",
    "MSG_MOTOR_STATUS; note 4.7",
)
def _bit(bench: Bench):
    for motor in (1, bench.hello.motors):
        bench.expect(spec.move(motor, bench.home[motor - 1] + 60))
        if (bits := bench.moving()) != 1 << motor - 1:
            raise Failed(f"motor {motor} alone moves and MOTOR_STATUS says 0x{bits:X}")
        bench.idle()
        bench.go(motor, 0)


@MOTORS.must("a move keeps to its velocity and acceleration", "MSG_MOTOR_SET_SPEED")
def _timing(bench: Bench):
    distance = 400
    bench.expect(spec.move(1, bench.home[0] + distance))
    start = bench.link.clock()
    bench.idle()
    took = bench.link.clock() - start
    expected = distance / VELOCITY + VELOCITY / ACCELERATION
    bench.go(1, 0)
    if took < expected * 0.9:
        raise Failed(
            f"{distance} steps took {took:.3f} s, faster than MAX VELOCITY "
            f"and MAX ACCEL allow ({expected:.3f} s)"
        )
    if took > expected * 2 + 0.5:
        raise Failed(f"{distance} steps took {took:.3f} s, expected about {expected:.3f} s")


@MOTORS.must("SET_SPEED takes effect", "MSG_MOTOR_SET_SPEED")
def _slower(bench: Bench):
    bench.expect(spec.speed(1, 200, ACCELERATION))
    start = bench.link.clock()
    bench.go(1, 200)
    took = bench.link.clock() - start
    bench.expect(spec.speed(1, VELOCITY, ACCELERATION))
    bench.go(1, 0)
    if not 0.9 < took < 2:
        raise Failed(f"200 steps at 200 steps/s took {took:.2f} s")


@MOTORS.should(
    "positions come about every 0.1 s while a motor moves, the last one at rest",
    "MSG_MOTOR_GET_POSITION",
)
def _reported(bench: Bench):
    bench.link.reports.clear()
    bench.go(1, 500)
    bench.link.pump(0.25)
    reports = bench.reports()
    bench.go(1, 0)
    seen = [r.steps[0] - bench.home[0] for r in reports]
    if len(reports) < 4:
        raise Failed(
            f"{len(reports)} positions came during half a second of motion, "
            "one each 0.1 s is expected"
        )
    if seen != sorted(seen) or seen[-1] != 500:
        raise Failed(f"the positions reported on the way to 500 were {seen}")
    gaps = [b.time_s - a.time_s for a, b in pairwise(reports)]
    if max(gaps) > 0.3:
        raise Failed(f"no position came for {max(gaps):.2f} s of motion")


@MOTORS.should(
    "no positions are reported at rest", "MSG_MOTOR_GET_POSITION: if any of the motors are moving"
)
def _quiet(bench: Bench):
    bench.link.pump(0.3)
    bench.link.reports.clear()
    bench.link.pump(0.6)
    if bench.reports():
        raise Failed("positions are reported while nothing moves")


@MOTORS.must(
    "{request} brings a motor to rest on its way", "MSG_MOTOR_STOP", request={"STOP": spec.stop(1)}
)
@MOTORS.must(
    "{request} brings a motor to rest on its way",
    "MSG_MOTOR_STOP_ALL",
    request={"STOP_ALL": Request(spec.STOP_ALL)},
)
def _stopped(bench: Bench, request: Request):
    bench.expect(spec.move(1, bench.home[0] + 900))
    bench.set_out(1)
    bench.link.pump(0.2)
    bench.expect(request)
    bench.idle(2)
    steps = bench.positions().steps[0] - bench.home[0]
    bench.link.pump(0.2)
    bench.at(1, steps)
    bench.go(1, 0)
    if not 50 < steps < 500:
        raise Failed(f"stopped after 0.2 s, the motor came to rest at {steps} of 900 steps")


@MOTORS.must("STOP of a motor at rest is accepted", "MSG_MOTOR_STOP")
def _stop_at_rest(bench: Bench):
    bench.expect(spec.stop(1))


@MOTORS.must("STOP of motor 2 does not stop motor 1", "MSG_MOTOR_STOP", needs=_two)
def _other_stop(bench: Bench):
    bench.expect(spec.move(1, bench.home[0] + 200))
    bench.expect(spec.stop(2))
    bench.idle()
    bench.at(1, 200)
    bench.go(1, 0)


@MOTORS.should("a MOVE gets a new target while it runs", "note 4.8")
def _retarget(bench: Bench):
    bench.expect(spec.move(1, bench.home[0] + 300))
    bench.link.pump(0.15)
    bench.go(1, -50)
    bench.at(1, -50)
    bench.go(1, 0)


@MOTORS.must(
    "JOG at {speed} {sign}, then STOP", "MSG_MOTOR_JOG", speed=(1000, 5000, 10000), sign=_UP_DOWN
)
def _jogged(bench: Bench, sign: int, speed: int):
    bench.expect(spec.jog(1, speed, bench.home[0] + sign * 5000))
    bench.set_out(1)
    bench.link.pump(0.2)
    bench.expect(spec.stop(1))
    bench.idle()
    steps = (bench.positions().steps[0] - bench.home[0]) * sign
    bench.go(1, 0)
    most = 0.2 * VELOCITY * speed / 10000 * 1.5 + 60
    if not 0 < steps < most:
        raise Failed(
            f"a jog of 0.2 s at {speed / 100:g} % went {steps} steps, "
            f"at most {most:.0f} are expected"
        )


@MOTORS.must("a JOG ends at its DESTINATION", "MSG_MOTOR_JOG")
def _jog_end(bench: Bench):
    bench.expect(spec.jog(1, 10000, bench.home[0] + 40))
    bench.idle()
    bench.at(1, 40)
    bench.go(1, 0)


class Limited(NamedTuple):
    """Soft limits, a target, and the code of a refusal or 0."""

    lower: int | None
    upper: int | None
    target: int
    code: int

    def __str__(self) -> str:
        answer = "refused" if self.code else "made"
        return f"limits {self.lower} and {self.upper}: a MOVE to {self.target} is {answer}"


@MOTORS.must(
    "{case}",
    "MSG_MOTOR_SET_LIMITS; ERR_SOFT_UP, ERR_SOFT_LOW; note 4.3",
    case=(
        Limited(-100, 100, 101, spec.ERR_SOFT_UP),
        Limited(-100, 100, -101, spec.ERR_SOFT_LOW),
        Limited(-100, 100, 100, 0),
        Limited(-100, 100, -100, 0),
        Limited(None, 100, 150, spec.ERR_SOFT_UP),
        Limited(None, 100, -150, 0),
        Limited(-100, None, -150, spec.ERR_SOFT_LOW),
        Limited(-100, None, 150, 0),
        Limited(None, None, 120, 0),
        Limited(None, None, -120, 0),
    ),
)
def _limited(bench: Bench, case: Limited):
    lower, upper, steps, code = case
    home = bench.home[0]
    at = [None if limit is None else home + limit for limit in (lower, upper)]
    bench.expect(spec.limits(1, *at))
    bench.expect(spec.move(1, home + steps), *((code,) if code else ()))
    bench.idle()
    bench.at(1, 0 if code else steps)
    bench.expect(spec.limits(1))
    bench.go(1, 0)


@MOTORS.should("a JOG {sign} ends at the soft limit", "note 4.2", sign=_UP_DOWN)
def _jog_limit(bench: Bench, sign: int):
    bench.expect(spec.limits(1, bench.home[0] - 60, bench.home[0] + 60))
    bench.expect(spec.jog(1, 10000, bench.home[0] + sign * 1000))
    bench.idle()
    bench.at(1, sign * 60)
    bench.expect(spec.limits(1))
    bench.go(1, 0)


@MOTORS.must(
    "RESET_POSITION to {position} changes it, moves nothing and is confirmed",
    "MSG_MOTOR_RESET_POSITION",
    position=(0, 1, -1),
)
@MOTORS.must(
    "RESET_POSITION to {position} changes it, moves nothing and is confirmed",
    "MSG_MOTOR_RESET_POSITION",
    position=(65536, -65536, 1_000_000, -1_000_000, 0x7FFFFF, -0x800000),
    full=True,
)
def _renamed(bench: Bench, position: int):
    home = bench.home[0]
    bench.link.reports.clear()
    bench.expect(spec.reset(1, position))
    bench.link.pump(0.15)
    found, reports, moved = bench.positions().steps[0], bench.reports(), bench.moving()
    bench.expect(spec.reset(1, home))
    if found != position or moved:
        raise Failed(f"RESET_POSITION to {position} gave {found}")
    if not reports or reports[-1].steps[0] != position:
        raise Failed(
            "RESET_POSITION is not followed by a GET_POSITION message with the new position"
        )


@MOTORS.should("RESET_POSITION of a motor that moves is refused", "ERR_MOVING; note 4.5")
def _reset_moving(bench: Bench):
    bench.expect(spec.move(1, bench.home[0] + 200))
    bench.expect(spec.reset(1, 0), spec.ERR_MOVING)
    bench.idle()
    bench.at(1, 200)
    bench.go(1, 0)


@MOTORS.must("two motors move at once", "MSG_MOTOR_MOVE", needs=_two)
def _together(bench: Bench):
    for motor in (1, 2):
        bench.expect(spec.move(motor, bench.home[motor - 1] + 100 * motor))
    if bench.moving() & 3 != 3:
        raise Failed("two motors move and MOTOR_STATUS lacks one of their bits")
    bench.idle()
    for motor in (1, 2):
        bench.at(motor, 100 * motor)
        bench.go(motor, 0)


@_ALL.must(
    "DMX 0 on channel 1 is accepted",
    "MSG_DMX",
    needs=lambda bench: bench.hello.lights > 0,
    full=True,
)
def _lights(bench: Bench):
    bench.expect(Request(spec.DMX, b"\0\1\0\0"))
