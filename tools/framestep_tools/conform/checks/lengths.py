"""Each message with data that is too short, and messages of fixed layout with extra data."""

import struct
from collections.abc import Callable
from typing import NamedTuple

from .. import spec
from ..bench import Bench
from ..kit import Subject, only_if
from ..link import Failed
from ..spec import Request

LENGTHS = Subject("lengths")
_SHORT = "MSG_FLAG_ACK: ERR_RANGE; note 1.8"


def _can(bit: int):
    return lambda bench: bool(bench.hello.can & bit)


def _motors(bench: Bench) -> bool:
    return bench.hello.motors > 0


class Message(NamedTuple):
    """A message's length, and which devices have it."""

    type: int
    length: int
    has: Callable[[Bench], bool] = _motors


_HARMLESS = (
    Message(spec.STOP, 1),
    Message(spec.CONFIGURE, 2),
    Message(spec.SET_SPEED, 9),
    Message(spec.SET_LIMITS, 12),
    Message(spec.BEGIN, 8, _can(spec.CAN_RUN)),
    Message(spec.AXIS, 5, _can(spec.CAN_RUN)),
)
_MIGHT_MOVE = (  # a device that ignores the length
    Message(spec.GIO_OUT, 4, lambda bench: bench.hello.outputs > 0),
    Message(spec.GIO_CAM, 4, lambda bench: True),
    Message(spec.MOVE, 5),
    Message(spec.RESET, 5),
    Message(spec.JOG, 7),
    Message(spec.POSITION_FRAME, 4, _can(spec.CAN_RUN)),
    Message(spec.RUN, 29, _can(spec.CAN_RUN)),
    Message(spec.SHOOT, 11, _can(spec.CAN_SHOOT)),
    Message(spec.SHOOT2, 12, _can(spec.CAN_SHOOT2)),
    Message(spec.JOG_ALL, 8, _can(spec.CAN_RUN)),
)


def _shortened(messages: tuple[Message, ...]) -> dict[str, tuple[Message, int]]:
    return {
        f"{spec.NAMES[message.type]} with {size} of {message.length} bytes": (message, size)
        for message in messages
        for size in range(message.length)
        if size in (0, 1, message.length // 2, message.length - 2, message.length - 1)
    }


@LENGTHS.should("{row} is refused", _SHORT, rows=_shortened(_HARMLESS))
@LENGTHS.should("{row} is refused", _SHORT, rows=_shortened(_MIGHT_MOVE), full=True)
def _short(bench: Bench, message: Message, size: int):
    only_if(message.has(bench))
    before = bench.positions().steps if bench.hello.motors else ()
    # a device may report another fault first: nothing uploaded, nothing configured
    data = (b"\1" + bytes(40))[:size]
    bench.expect(Request(message.type, data), spec.ERR_RANGE, spec.ERR_GENERAL)
    if before:
        bench.idle()
        if bench.positions().steps != before:
            raise Failed("a message that was refused moved a motor")


@LENGTHS.should(
    "UPLOAD_MOVE_AXIS with {extra} bytes of a position is refused",
    _SHORT,
    extra=(1, 2, 3),
    needs=_can(spec.CAN_RUN),
)
def _ragged(bench: Bench, extra: int):
    request = Request(spec.AXIS, struct.pack("<BIi", 1, 0, 0) + bytes(extra))
    bench.expect(request, spec.ERR_RANGE, spec.ERR_GENERAL)


@LENGTHS.should(
    "{make} with {extra} bytes more than known is accepted",
    "note 1.8",
    make={
        "MOVE": lambda bench: spec.move(1, bench.home[0]),
        "STOP": lambda bench: spec.stop(1),
        "CONFIGURE": lambda bench: spec.configure(1, 1),
        "SET_LIMITS": lambda bench: spec.limits(1),
        "STOP_ALL": lambda bench: Request(spec.STOP_ALL, bytes(4)),
    },
    extra=(1, 4, 32),
    needs=_motors,
)
def _longer(bench: Bench, make: Callable[[Bench], Request], extra: int):
    type, payload = make(bench)
    bench.expect(Request(type, payload + bytes(extra)))


@LENGTHS.must("STOP_ALL without flags", "MSG_MOTOR_STOP_ALL: optional", needs=_motors)
def _without_flags(bench: Bench):
    bench.expect(Request(spec.STOP_ALL))


@LENGTHS.must("STOP_ALL with the silent flag", "MSG_MOTOR_STOP_ALL: Flags", needs=_motors)
def _silent(bench: Bench):
    bench.expect(Request(spec.STOP_ALL, b"\1\0\0\0"))
