"""Each message with data that is too short, and messages of fixed layout with extra data."""

import struct

from .. import spec
from ..bench import Bench
from ..kit import MUST, SHOULD, Check
from ..spec import Request

CHECKS: list[Check] = []
_SHORT = "MSG_FLAG_ACK: ERR_RANGE; note 1.8"


def _can(bit: int):
    return lambda bench: bool(bench.hello.can & bit)


def _motors(bench: Bench) -> bool:
    return bench.hello.motors > 0


# length, devices that it concerns, whether a device that ignores the length might move
_MESSAGES = {
    spec.GIO_OUT: (4, lambda b: b.hello.outputs > 0, True),
    spec.GIO_CAM: (4, lambda b: True, True),
    spec.MOVE: (5, _motors, True),
    spec.STOP: (1, _motors, False),
    spec.RESET: (5, _motors, True),
    spec.JOG: (7, _motors, True),
    spec.CONFIGURE: (2, _motors, False),
    spec.SET_SPEED: (9, _motors, False),
    spec.SET_LIMITS: (12, _motors, False),
    spec.BEGIN: (8, _can(spec.CAN_RUN), False),
    spec.AXIS: (5, _can(spec.CAN_RUN), False),
    spec.POSITION_FRAME: (4, _can(spec.CAN_RUN), True),
    spec.RUN: (29, _can(spec.CAN_RUN), True),
    spec.SHOOT: (11, _can(spec.CAN_SHOOT), True),
    spec.SHOOT2: (12, _can(spec.CAN_SHOOT2), True),
    spec.JOG_ALL: (8, _can(spec.CAN_RUN), True),
}


def _short(type: int, size: int):
    def run(bench: Bench):
        before = bench.positions().steps if bench.hello.motors else ()
        # a device may report another fault first: nothing uploaded, nothing configured
        bench.expect(Request(type, (b"\1" + bytes(40))[:size]), spec.ERR_RANGE, spec.ERR_GENERAL)
        if before:
            bench.idle()
            if bench.positions().steps != before:
                from ..link import Failed

                raise Failed("a message that was refused moved a motor")

    return run


for _type, (_length, _needs, _moves) in _MESSAGES.items():
    for _size in sorted({0, 1, _length // 2, _length - 2, _length - 1}):
        if 0 <= _size < _length:
            CHECKS.append(
                Check("lengths", f"{spec.NAMES[_type]} with {_size} of {_length} bytes is refused",
                      _SHORT, _short(_type, _size), SHOULD, _needs, _moves)
            )  # fmt: skip


def _ragged(request: Request):
    return lambda bench: bench.expect(request, spec.ERR_RANGE, spec.ERR_GENERAL)


for _extra in (1, 2, 3):
    CHECKS.append(
        Check("lengths", f"UPLOAD_MOVE_AXIS with {_extra} bytes of a position is refused", _SHORT,
              _ragged(Request(spec.AXIS, struct.pack("<BIi", 1, 0, 0) + bytes(_extra))), SHOULD,
              _can(spec.CAN_RUN))
    )  # fmt: skip


def _longer(make, extra: int):
    def run(bench: Bench):
        type, payload = make(bench)
        bench.expect(Request(type, payload + bytes(extra)))

    return run


for _name, _make in (
    ("MOVE", lambda b: spec.move(1, b.home[0])),
    ("STOP", lambda b: spec.stop(1)),
    ("CONFIGURE", lambda b: spec.configure(1, 1)),
    ("SET_LIMITS", lambda b: spec.limits(1)),
    ("STOP_ALL", lambda b: Request(spec.STOP_ALL, bytes(4))),
):
    for _extra in (1, 4, 32):
        CHECKS.append(
            Check("lengths", f"{_name} with {_extra} bytes more than known is accepted", "note 1.8",
                  _longer(_make, _extra), SHOULD, _motors)
        )  # fmt: skip


def _silent(flags: bytes):
    return lambda bench: bench.expect(Request(spec.STOP_ALL, flags))


CHECKS.append(Check("lengths", "STOP_ALL without flags", "MSG_MOTOR_STOP_ALL: optional",
                    _silent(b""), MUST, _motors))  # fmt: skip
CHECKS.append(Check("lengths", "STOP_ALL with the silent flag", "MSG_MOTOR_STOP_ALL: Flags",
                    _silent(b"\1\0\0\0"), MUST, _motors))  # fmt: skip
