"""Virtual axes in type 1 with only a head: pan, tilt and, if there are enough motors, track.

They need no lengths: their motion follows from steps per unit. arms.py has arms and the other
types.
"""

import struct
from collections.abc import Iterable

from .. import spec
from ..bench import Bench
from ..kit import MUST, SHOULD, Check
from ..link import Failed
from ..sampling import moved, no_faster, ramps_down, ramps_up
from ..spec import Request

CHECKS: list[Check] = []
TRACK, EW, NS, PAN, TILT, ROLL = range(1, 7)
_SPU = 20  # steps per degree or unit
_MOTOR = {PAN: 1, TILT: 2, TRACK: 3}
_UNIT = 100_000
_SCALE = "MSG_VIRT_MOVE: Target position * 100000; note 9.2"


def _can(bench: Bench) -> bool:
    return bool(bench.hello.can & 0x04) and bench.hello.motors > 0


def _put(name, source, run, level=MUST, axis=PAN, needs=_can):
    def has(bench: Bench) -> bool:
        return needs(bench) and bench.hello.motors >= _MOTOR.get(axis, 1)

    CHECKS.append(Check("virtuals", name, source, run, level, has))


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

    def run(bench: Bench):
        bench.expect(_config(bench))
        try:
            return check(bench)
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


_put("VIRT_CONFIG of type 0 is accepted", "MSG_VIRT_CONFIG: 0=none", lambda b: b.expect(_NONE))
_put(
    "VIRT_CONFIG of type 1 is accepted",
    "MSG_VIRT_CONFIG: Boom-Swing-Track; note 9.2",
    _configured(lambda bench: None),
)
_put(
    "VIRT_GET_POSITION has a DWORD for each axis, and the aim point if there is one",
    "MSG_VIRT_GET_POSITION",
    _configured(lambda bench: _pose(bench) and None),
)


def _turned(axis: int, units: float):
    def check(bench: Bench):
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

    return _configured(check)


for _axis, _name in ((PAN, "vPan"), (TILT, "vTilt"), (TRACK, "vTrack")):
    for _units in (5, -5, 10.5):
        _put(
            f"VIRT_MOVE of {_name} to {_units} moves its motor and is reported",
            _SCALE,
            _turned(_axis, _units),
            axis=_axis,
        )


def _bit(bench: Bench):
    bench.expect(_move(PAN, 20))
    if not bench.moving() & 1:
        raise Failed("during a virtual move MOTOR_STATUS lacks the bit of its motor")


_put("MOTOR_STATUS has the bits of a virtual move", "MSG_MOTOR_STATUS", _configured(_bit))


def _halted(make):
    def check(bench: Bench):
        bench.expect(spec.speed(1, 500, 1000))
        bench.expect(_move(PAN, 40))
        bench.set_out(_MOTOR[PAN])
        bench.link.pump(0.5)
        bench.expect(make())
        bench.idle()
        bench.prepare()
        found = bench.positions().steps[0] - bench.home[0]
        if not 60 < found < 700:
            raise Failed(f"stopped after 0.5 s, the pan motor came to rest at {found} of 800 steps")

    return _configured(check)


_put(
    "VIRT_STOP stops a virtual move",
    "MSG_VIRT_STOP",
    _halted(lambda: Request(spec.VIRT_STOP, bytes((PAN,)))),
)
_put("STOP_ALL stops a virtual move", "MSG_MOTOR_STOP_ALL", _halted(lambda: Request(spec.STOP_ALL)))


def _within(bench: Bench):
    bench.expect(_config(bench))
    seen = moved(bench, 1, _move(PAN, 20), 500, 1000)
    bench.expect(_NONE)
    ramps_up(seen, 1, 1000)
    ramps_down(seen, 1, 1000)
    no_faster(seen, 1, 500)


_put(
    "a virtual move keeps to its motor's velocity and acceleration", "MSG_MOTOR_SET_SPEED", _within
)


def _limited(bench: Bench):
    bench.expect(spec.limits(1, None, bench.home[0] + 100))
    bench.ask(_move(PAN, 20))
    bench.idle()
    found = bench.positions().steps[0] - bench.home[0]
    bench.expect(spec.limits(1))
    if found > 100:
        raise Failed(f"a virtual move took a motor {found} steps up, its limit is at 100")


_put("a virtual move keeps to soft limits", "MSG_MOTOR_SET_LIMITS", _configured(_limited))


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


_put("VIRT_JOG goes toward its destination", "MSG_VIRT_JOG; note 9.6", _configured(_jogged), SHOULD)


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


_put(
    "VIRT_JOG_ON_LINE runs until VIRT_STOP",
    "MSG_VIRT_JOG_ON_LINE; note 9.6",
    _configured(_line),
    SHOULD,
)


def _reported(bench: Bench):
    bench.link.reports.clear()
    bench.expect(_move(PAN, 20))
    bench.idle()
    if not [r for r in bench.link.reports if r.frame.type == spec.VIRT_GET_POSITION]:
        raise Failed("no VIRT_GET_POSITION came during a virtual move")


_put("virtual positions are reported with the others", "note 9.8", _configured(_reported), SHOULD)


# ---- the aim point


def _aimed(enable: int, *point: int):
    def check(bench: Bench):
        payload = struct.pack("<B3i", enable, *point)
        reply = bench.ask(Request(spec.AIM, payload))
        found = reply.frame.payload if reply.code is None else b""
        bench.ask(Request(spec.AIM, bytes(13)))
        if found != payload:
            raise Failed(
                f"VIRT_AIM_POINT {payload.hex()} is answered with {found.hex() or 'a code'}"
            )

    return _configured(check)


for _enable, _point in ((0, (0, 0, 0)), (0, (5000, -1000, -90000)), (1, (0, 0, -9_000_000))):
    _put(
        f"VIRT_AIM_POINT {_enable} at {_point} is answered with the same data",
        "MSG_VIRT_AIM_POINT: The response contains the same data",
        _aimed(_enable, *_point),
        axis=TRACK,
        needs=lambda b: _can(b) and bool(b.hello.can & spec.CAN_AIM),
    )

# ---- refusals


def _refused(request: Request, codes: Iterable[int]):
    return _configured(lambda bench: bench.expect(request, *codes))


for _axis in (0, 7, 255):
    _put(
        f"VIRT_MOVE of axis {_axis} is refused",
        "MSG_VIRT_MOVE: Virtual motor number; ERR_RANGE; note 9.1",
        _refused(_move(_axis, 1), (spec.ERR_RANGE,)),
    )
    _put(
        f"VIRT_STOP of axis {_axis} is refused",
        "MSG_VIRT_STOP: Virtual motor number; ERR_RANGE; note 9.1",
        _refused(Request(spec.VIRT_STOP, bytes((_axis,))), (spec.ERR_RANGE,)),
        SHOULD,
    )
for _type in (5, 255):
    _put(
        f"VIRT_CONFIG of type {_type} is refused",
        "MSG_VIRT_CONFIG: TYPE 0 to 4",
        lambda b, t=_type: b.refused(Request(spec.VIRT_CONFIG, bytes((t,)) + bytes(92))),
    )
for _size in (0, 2, 40, 92):
    _put(
        f"VIRT_CONFIG of type 1 with {_size} of 93 bytes is refused",
        "ERR_RANGE; note 1.8",
        lambda b, n=_size: b.expect(
            Request(spec.VIRT_CONFIG, _config(b).payload[:n]), spec.ERR_RANGE
        ),
        SHOULD,
    )


def _unset(request: Request):
    def run(bench: Bench):
        bench.expect(_NONE)
        bench.refused(request)

    return run


for _name, _request in (
    ("VIRT_MOVE", _move(PAN, 1)),
    ("VIRT_JOG", Request(spec.VIRT_JOG, struct.pack("<BHi", PAN, 10, 10))),
    ("VIRT_JOG_ON_LINE", Request(spec.VIRT_JOG_ON_LINE, struct.pack("<Bh", 3, 10))),
):
    _put(f"{_name} without a configuration is refused", "note 9.8", _unset(_request), SHOULD)
