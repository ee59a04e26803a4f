"""Motor numbers, speeds and other parameters out of their ranges."""

from .. import spec
from ..bench import Bench
from ..kit import MUST, SHOULD, Check
from ..link import Failed
from ..spec import Request

CHECKS: list[Check] = []
_SOURCE = "Motor number, 1-MOTOR_COUNT; ERR_RANGE: a parameter was out of range"


def _motors(bench: Bench) -> bool:
    return bench.hello.motors > 0


_BY_MOTOR = {
    "MOVE": lambda motor: spec.move(motor, 0),
    "STOP": spec.stop,
    "RESET_POSITION": lambda motor: spec.reset(motor, 0),
    "JOG": lambda motor: spec.jog(motor, 1, 0),
    "CONFIGURE": lambda motor: spec.configure(motor, 1),
    "SET_SPEED": lambda motor: spec.speed(motor, 500, 500),
    "SET_LIMITS": spec.limits,
}


def _refused(make, which):
    return lambda bench: bench.expect(make(which(bench)), spec.ERR_RANGE)


for _name, _make in _BY_MOTOR.items():
    for _text, _which in (
        ("0", lambda b: 0),
        ("MOTOR_COUNT + 1", lambda b: b.hello.motors + 1),
        ("33", lambda b: 33),
        ("128", lambda b: 128),
        ("255", lambda b: 255),
    ):
        CHECKS.append(
            Check(
                "numbers",
                f"{_name} of motor {_text} is refused",
                _SOURCE,
                _refused(_make, _which),
                MUST,
                _motors,
            )
        )


def _at_speed(speed: int):
    return lambda bench: bench.expect(spec.jog(1, speed, bench.home[0]), spec.ERR_RANGE)


for _speed in (0, 10001, 0x7FFF, 0xFFFF):
    CHECKS.append(
        Check(
            "numbers",
            f"JOG with speed {_speed} is refused",
            "MSG_MOTOR_JOG: 1 to 10000; note 4.1",
            _at_speed(_speed),
            SHOULD,
            _motors,
        )
    )
CHECKS.append(
    Check(
        "numbers",
        "SET_SPEED with velocity 0 is refused",
        "note 4.1",
        lambda b: b.expect(spec.speed(1, 0, 1000), spec.ERR_RANGE),
        SHOULD,
        _motors,
    )
)


def _lowest(which: int, make):
    def run(bench: Bench):
        motor = bench.hello.motors if which else 1
        bench.expect(make(bench, motor))

    return run


for _name, _request_of in {
    "MOVE to its present position": lambda b, m: spec.move(m, b.home[m - 1]),
    "STOP": lambda b, m: spec.stop(m),
    "CONFIGURE": lambda b, m: spec.configure(m, 1),
    "SET_SPEED": lambda b, m: spec.speed(m, 1000, 8000),
    "SET_LIMITS": lambda b, m: spec.limits(m),
    "RESET_POSITION to its present position": lambda b, m: spec.reset(m, b.home[m - 1]),
}.items():
    for _end, _text in ((0, "the first"), (1, "the last")):
        CHECKS.append(
            Check(
                "numbers",
                f"{_name} of {_text} motor is taken",
                "MSG_FLAG_ACK: OK",
                _lowest(_end, _request_of),
                MUST,
                _motors,
            )
        )


def _shape(bench: Bench):
    reply = bench.ask(spec.move(1, bench.home[0]))
    if reply.code is None and (len(reply.frame.payload) != 1 or reply.frame.payload[0] > 1):
        raise Failed(f"MOTOR STATUS is a BYTE, 1 or 0, found {reply.frame.payload.hex()}")
    return None if reply.code is None else "MOVE is acknowledged, without its MOTOR STATUS"


CHECKS.append(Check("numbers", "answer to MOVE", "MSG_MOTOR_MOVE; note 1.4", _shape, MUST, _motors))


def _status(bench: Bench):
    data = bench.data(spec.STATUS)
    if len(data) != 5 or any(data[:4]):
        raise Failed(f"nothing moves and MOTOR_STATUS says {data.hex()}")


CHECKS.append(
    Check("numbers", "MOTOR_STATUS has 5 bytes, 0 at rest", "MSG_MOTOR_STATUS", _status, MUST)
)
CHECKS.append(
    Check(
        "numbers",
        "GIO_IN has 4 bytes",
        "MSG_GIO_IN",
        lambda b: _four(b.data(spec.GIO_IN)),
        MUST,
        lambda b: b.hello.inputs > 0,
    )
)


def _four(data: bytes) -> None:
    if len(data) != 4:
        raise Failed(f"GIO_IN has {len(data)} bytes")


def _needless(request: Request, codes: tuple[int, ...]):
    return lambda bench: bench.expect(request, *codes)


for _name, _request, _bit in (
    ("RT_POSITION_FRAME", spec.frame(0), spec.CAN_RUN),
    ("RT_RUN_MOVE", spec.run(24, 1, 2), spec.CAN_RUN),
    ("RT_JOG_ALL", spec.jog_all(24, 1), spec.CAN_RUN),
    ("RT_GO_MOVE", Request(spec.GO), spec.CAN_RUN),
    ("VIRT_MOVE", Request(spec.VIRT_MOVE, b"\1" + bytes(4)), spec.CAN_VIRTUAL),
    ("MOTOR_MOVE", spec.move(1, 0), 0),
    ("DMX", Request(spec.DMX, b"\0\1\0\0"), 0),
):
    _absent = (
        (lambda b, bit=_bit: not b.hello.can & bit)
        if _bit
        else (lambda b, name=_name: not (b.hello.lights if name == "DMX" else b.hello.motors))
    )
    CHECKS.append(
        Check(
            "numbers",
            f"{_name} is refused by a device that cannot",
            "Capabilities",
            _needless(_request, tuple(c for c in spec.CODES if c != spec.OK)),
            SHOULD,
            _absent,
        )
    )
