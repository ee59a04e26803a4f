"""Motor numbers, speeds and other parameters out of their ranges."""

from collections.abc import Callable

from .. import spec
from ..bench import Bench
from ..kit import Subject, only_if
from ..link import Failed
from ..spec import Request


def _motors(bench: Bench) -> bool:
    return bench.hello.motors > 0


NUMBERS = Subject("numbers")


@NUMBERS.must(
    "{make} of motor {number} is refused",
    "Motor number, 1-MOTOR_COUNT; ERR_RANGE: a parameter was out of range",
    make={
        "MOVE": lambda motor: spec.move(motor, 0),
        "STOP": spec.stop,
        "RESET_POSITION": lambda motor: spec.reset(motor, 0),
        "JOG": lambda motor: spec.jog(motor, 1, 0),
        "CONFIGURE": lambda motor: spec.configure(motor, 1),
        "SET_SPEED": lambda motor: spec.speed(motor, 500, 500),
        "SET_LIMITS": spec.limits,
    },
    number={"0": 0, "MOTOR_COUNT + 1": None, "33": 33, "128": 128, "255": 255},
    needs=_motors,
)
def _refused(bench: Bench, make: Callable[[int], Request], number: int | None):
    bench.expect(make(bench.hello.motors + 1 if number is None else number), spec.ERR_RANGE)


@NUMBERS.should(
    "JOG with speed {speed} is refused",
    "MSG_MOTOR_JOG: 1 to 10000; note 4.1",
    speed=(0, 10001, 0x7FFF, 0xFFFF),
    needs=_motors,
)
def _at_speed(bench: Bench, speed: int):
    bench.expect(spec.jog(1, speed, bench.home[0]), spec.ERR_RANGE)


@NUMBERS.should("SET_SPEED with velocity 0 is refused", "note 4.1", needs=_motors)
def _no_velocity(bench: Bench):
    bench.expect(spec.speed(1, 0, 1000), spec.ERR_RANGE)


@NUMBERS.must(
    "{make} of {last} motor is taken",
    "MSG_FLAG_ACK: OK",
    make={
        "MOVE to its present position": lambda b, motor: spec.move(motor, b.home[motor - 1]),
        "STOP": lambda b, motor: spec.stop(motor),
        "CONFIGURE": lambda b, motor: spec.configure(motor, 1),
        "SET_SPEED": lambda b, motor: spec.speed(motor, 1000, 8000),
        "SET_LIMITS": lambda b, motor: spec.limits(motor),
        "RESET_POSITION to its present position": lambda b, motor: spec.reset(
            motor, b.home[motor - 1]
        ),
    },
    last={"the first": False, "the last": True},
    needs=_motors,
)
def _taken(bench: Bench, make: Callable[[Bench, int], Request], last: bool):
    bench.expect(make(bench, bench.hello.motors if last else 1))


@NUMBERS.must("answer to MOVE", "MSG_MOTOR_MOVE; note 1.4", needs=_motors)
def _shape(bench: Bench):
    reply = bench.ask(spec.move(1, bench.home[0]))
    if reply.code is None and (len(reply.frame.payload) != 1 or reply.frame.payload[0] > 1):
        raise Failed(f"MOTOR STATUS is a BYTE, 1 or 0, found {reply.frame.payload.hex()}")
    return None if reply.code is None else "MOVE is acknowledged, without its MOTOR STATUS"


@NUMBERS.must("MOTOR_STATUS has 5 bytes, 0 at rest", "MSG_MOTOR_STATUS")
def _status(bench: Bench):
    data = bench.data(spec.STATUS)
    if len(data) != 5 or any(data[:4]):
        raise Failed(f"nothing moves and MOTOR_STATUS says {data.hex()}")


@NUMBERS.must("GIO_IN has 4 bytes", "MSG_GIO_IN", needs=lambda bench: bench.hello.inputs > 0)
def _four(bench: Bench):
    if len(data := bench.data(spec.GIO_IN)) != 4:
        raise Failed(f"GIO_IN has {len(data)} bytes")


@NUMBERS.should(
    "{row} is refused by a device that cannot",
    "Capabilities",
    rows={
        "RT_POSITION_FRAME": (lambda b: b.hello.can & spec.CAN_RUN, spec.frame(0)),
        "RT_RUN_MOVE": (lambda b: b.hello.can & spec.CAN_RUN, spec.run(24, 1, 2)),
        "RT_JOG_ALL": (lambda b: b.hello.can & spec.CAN_RUN, spec.jog_all(24, 1)),
        "RT_GO_MOVE": (lambda b: b.hello.can & spec.CAN_RUN, Request(spec.GO)),
        "VIRT_MOVE": (
            lambda b: b.hello.can & spec.CAN_VIRTUAL,
            Request(spec.VIRT_MOVE, b"\1" + bytes(4)),
        ),
        "MOTOR_MOVE": (lambda b: b.hello.motors, spec.move(1, 0)),
        "DMX": (lambda b: b.hello.lights, Request(spec.DMX, b"\0\1\0\0")),
    },
)
def _needless(bench: Bench, can: Callable[[Bench], object], request: Request):
    only_if(not can(bench))
    bench.refused(request)
