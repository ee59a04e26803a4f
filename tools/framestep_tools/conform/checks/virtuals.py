"""Virtual axes in type 1 with only a head: pan, tilt and, if there are enough motors, track.

They need no lengths: their motion follows from steps per unit. arms.py has arms and the other
types.
"""

import struct
from typing import Any

from .. import spec
from ..bench import Bench
from ..kit import Subject, only_if
from ..link import Failed
from ..sampling import moved, no_faster, ramps_down, ramps_up
from ..spec import Request

TRACK, EW, NS, PAN, TILT, ROLL = range(1, 7)
_SPU = 20  # steps per degree or unit
_MOTOR = {PAN: 1, TILT: 2, TRACK: 3}
_UNIT = 100_000
_SCALE = "MSG_VIRT_MOVE: Target position * 100000; note 9.2"


VIRTUALS = Subject(
    "virtuals", lambda bench: bench.hello.can & 0x04 and bench.hello.motors >= _MOTOR[PAN]
)


def _config(bench: Bench) -> Request:
    """Return VIRT_CONFIG: BOOM, SWING, TRACK, PAN, TILT, ROLL as motor, steps per unit, position;
    lengths, nodal offset."""
    motors = {axis: m if m <= bench.hello.motors else 0 for axis, m in _MOTOR.items()}
    order = (0, 0, motors[TRACK], motors[PAN], motors[TILT], 0)
    axes = b"".join(struct.pack("<IIi", motor, _SPU * 1000 if motor else 0, 0) for motor in order)
    return Request(spec.VIRT_CONFIG, b"\1" + axes + struct.pack("<5i", 1_000_000, 0, 0, 0, 0))


_NONE = Request(spec.VIRT_CONFIG, b"\0")


def _move(axis: int, units: float) -> Request:
    return Request(spec.VIRT_MOVE, struct.pack("<Bi", axis, round(units * _UNIT)))


def _configured(check):
    """Wrap a check: configure before it; remove the configuration and bring the motors back after
    it."""

    def run(bench: Bench, **values: Any):
        bench.expect(_config(bench))
        try:
            return check(bench, **values)
        finally:
            bench.idle()
            bench.expect(_NONE)
            bench.return_home()

    return run


def _pose(bench: Bench) -> tuple[int, ...]:
    data = bench.data(spec.VIRT_GET_POSITION)
    size = 37 if bench.hello.can & spec.CAN_AIM else 24
    if len(data) != size:
        raise Failed(f"VIRT_GET_POSITION has {len(data)} bytes, expected {size}")
    return struct.unpack_from("<6i", data)


@VIRTUALS.must("VIRT_CONFIG of type 0 is accepted", "MSG_VIRT_CONFIG: 0=none")
def _removed(bench: Bench):
    bench.expect(_NONE)


@VIRTUALS.must("VIRT_CONFIG of type 1 is accepted", "MSG_VIRT_CONFIG: Boom-Swing-Track; note 9.2")
@_configured
def _accepted(bench: Bench):
    pass


@VIRTUALS.must(
    "VIRT_GET_POSITION has a DWORD for each axis, and the aim point if there is one",
    "MSG_VIRT_GET_POSITION",
)
@_configured
def _has_pose(bench: Bench):
    _pose(bench)


@VIRTUALS.must(
    "VIRT_MOVE of {axis} to {units} moves its motor and is reported",
    _SCALE,
    axis={"vPan": PAN, "vTilt": TILT, "vTrack": TRACK},
    units=(5, -5, 10.5),
)
def _turns(bench: Bench, axis: int, units: float):
    only_if(bench.hello.motors >= _MOTOR[axis])
    _turned(bench, axis=axis, units=units)


@_configured
def _turned(bench: Bench, axis: int, units: float):
    before = bench.positions().steps
    bench.expect(_move(axis, units))
    bench.idle()
    after = bench.positions().steps
    wanted = list(before)
    wanted[_MOTOR[axis] - 1] += round(units * _SPU)
    if list(after) != wanted:
        raise Failed(f"motors went from {before} to {after}, expected {tuple(wanted)}")
    pose = _pose(bench)
    for number, found in enumerate(pose, 1):
        expected = units * _UNIT if number == axis else 0
        if number not in (TRACK, NS, EW) and abs(found - expected) > _UNIT // _SPU:
            raise Failed(f"axis {number} is reported at {found / _UNIT:g}")
    if axis == TRACK and abs(pose[0] - units * _UNIT) > _UNIT // _SPU:
        raise Failed(f"vTrack is reported at {pose[0] / _UNIT:g}, moved to {units:g}")


@VIRTUALS.must("MOTOR_STATUS has the bits of a virtual move", "MSG_MOTOR_STATUS")
@_configured
def _bit(bench: Bench):
    bench.expect(_move(PAN, 20))
    if not bench.moving() & 1:
        raise Failed("during a virtual move MOTOR_STATUS lacks the bit of its motor")


@VIRTUALS.must(
    "{request} stops a virtual move",
    "MSG_VIRT_STOP",
    request={"VIRT_STOP": Request(spec.VIRT_STOP, bytes((PAN,)))},
)
@VIRTUALS.must(
    "{request} stops a virtual move",
    "MSG_MOTOR_STOP_ALL",
    request={"STOP_ALL": Request(spec.STOP_ALL)},
)
@_configured
def _halted(bench: Bench, request: Request):
    bench.expect(spec.speed(1, 500, 1000))
    bench.expect(_move(PAN, 40))
    bench.set_out(_MOTOR[PAN])
    bench.link.pump(0.5)
    bench.expect(request)
    bench.idle()
    bench.prepare()
    found = bench.positions().steps[0] - bench.home[0]
    if not 60 < found < 700:
        raise Failed(f"stopped after 0.5 s, the pan motor came to rest at {found} of 800 steps")


@VIRTUALS.must(
    "a virtual move keeps to its motor's velocity and acceleration", "MSG_MOTOR_SET_SPEED"
)
def _within(bench: Bench):
    bench.expect(_config(bench))
    seen = moved(bench, 1, _move(PAN, 20), 500, 1000)
    bench.expect(_NONE)
    ramps_up(seen, 1, 1000)
    ramps_down(seen, 1, 1000)
    no_faster(seen, 1, 500)


@VIRTUALS.must("a virtual move keeps to soft limits", "MSG_MOTOR_SET_LIMITS")
@_configured
def _limited(bench: Bench):
    bench.expect(spec.limits(1, None, bench.home[0] + 100))
    bench.ask(_move(PAN, 20))
    bench.idle()
    found = bench.positions().steps[0] - bench.home[0]
    bench.expect(spec.limits(1))
    if found > 100:
        raise Failed(f"a virtual move took a motor {found} steps up, its limit is at 100")


@VIRTUALS.should("VIRT_JOG goes toward its destination", "MSG_VIRT_JOG; note 9.6")
@_configured
def _jogged(bench: Bench):
    request = struct.pack("<BHi", PAN, 10000, bench.home[0] + 400)
    bench.expect(Request(spec.VIRT_JOG, request))
    bench.set_out(_MOTOR[PAN])
    bench.link.pump(0.1)
    bench.expect(Request(spec.VIRT_STOP, bytes((PAN,))))
    bench.idle()
    found = bench.positions().steps[0] - bench.home[0]
    if not 0 < found < 400:
        raise Failed(f"VIRT_JOG for 0.1 s took the pan motor {found} steps")


@VIRTUALS.should("VIRT_JOG_ON_LINE runs until VIRT_STOP", "MSG_VIRT_JOG_ON_LINE; note 9.6")
@_configured
def _line(bench: Bench):
    bench.expect(Request(spec.VIRT_JOG_ON_LINE, struct.pack("<Bh", 3, 5000)))
    bench.set_out(_MOTOR[PAN])
    bench.link.pump(0.2)
    if not bench.moving():
        raise Failed("VIRT_JOG_ON_LINE ended without VIRT_STOP")
    bench.expect(Request(spec.VIRT_STOP, bytes((PAN,))))
    bench.idle()
    if bench.positions().steps[0] == bench.home[0]:
        raise Failed("VIRT_JOG_ON_LINE of PAN did not move the pan motor")


@VIRTUALS.should("virtual positions are reported with the others", "note 9.8")
@_configured
def _reported(bench: Bench):
    bench.link.reports.clear()
    bench.expect(_move(PAN, 20))
    bench.idle()
    if not [r for r in bench.link.reports if r.frame.type == spec.VIRT_GET_POSITION]:
        raise Failed("no VIRT_GET_POSITION came during a virtual move")


# ---- the aim point


@VIRTUALS.must(
    "VIRT_AIM_POINT {enable_and_point} is answered with the same data",
    "MSG_VIRT_AIM_POINT: The response contains the same data",
    enable_and_point={
        f"{enable} at {point}": (enable, *point)
        for enable, point in (
            (0, (0, 0, 0)),
            (0, (5000, -1000, -90000)),
            (1, (0, 0, -9_000_000)),
        )
    },
    needs=lambda b: b.hello.can & spec.CAN_AIM and b.hello.motors >= _MOTOR[TRACK],
)
@_configured
def _aimed(bench: Bench, enable_and_point: tuple[int, ...]):
    payload = struct.pack("<B3i", *enable_and_point)
    reply = bench.ask(Request(spec.AIM, payload))
    found = reply.frame.payload if reply.code is None else b""
    bench.ask(Request(spec.AIM, bytes(13)))
    if found != payload:
        raise Failed(f"VIRT_AIM_POINT {payload.hex()} is answered with {found.hex() or 'a code'}")


# ---- refusals


@VIRTUALS.must(
    "VIRT_MOVE of axis {axis} is refused",
    "MSG_VIRT_MOVE: Virtual motor number; ERR_RANGE; note 9.1",
    axis=(0, 7, 255),
)
@_configured
def _no_such_axis(bench: Bench, axis: int):
    bench.expect(_move(axis, 1), spec.ERR_RANGE)


@VIRTUALS.should(
    "VIRT_STOP of axis {axis} is refused",
    "MSG_VIRT_STOP: Virtual motor number; ERR_RANGE; note 9.1",
    axis=(0, 7, 255),
)
@_configured
def _no_such_stop(bench: Bench, axis: int):
    bench.expect(Request(spec.VIRT_STOP, bytes((axis,))), spec.ERR_RANGE)


@VIRTUALS.must(
    "VIRT_CONFIG of type {type} is refused", "MSG_VIRT_CONFIG: TYPE 0 to 4", type=(5, 255)
)
def _no_such_type(bench: Bench, type: int):
    bench.refused(Request(spec.VIRT_CONFIG, bytes((type,)) + bytes(92)))


@VIRTUALS.should(
    "VIRT_CONFIG of type 1 with {size} of 93 bytes is refused",
    "ERR_RANGE; note 1.8",
    size=(0, 2, 40, 92),
)
def _short(bench: Bench, size: int):
    bench.expect(Request(spec.VIRT_CONFIG, _config(bench).payload[:size]), spec.ERR_RANGE)


@VIRTUALS.should(
    "{request} without a configuration is refused",
    "note 9.8",
    request={
        "VIRT_MOVE": _move(PAN, 1),
        "VIRT_JOG": Request(spec.VIRT_JOG, struct.pack("<BHi", PAN, 10, 10)),
        "VIRT_JOG_ON_LINE": Request(spec.VIRT_JOG_ON_LINE, struct.pack("<Bh", 3, 10)),
    },
)
def _unset(bench: Bench, request: Request):
    bench.expect(_NONE)
    bench.refused(request)
