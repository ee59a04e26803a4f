"""Virtual axes of an arm, a column and straight axes: types 1 to 4, if there are enough motors.

The specification says that VIRT_MOVE must end at its target. No reliable public description has
formulas, signs and the layouts of types 3 and 4 (notes 9.2 to 9.4), so their checks are a should.
"""

import struct
from typing import Any, NamedTuple

import numpy as np

from ...judge.virtual_reference import NAMES, POSE, Axis, Rig, line_direction
from .. import spec
from ..bench import Bench
from ..kit import Subject, only_if
from ..link import Failed
from ..sampling import motion, no_faster
from ..spec import Request

ARMS = Subject("arms")
TRACK, EW, NS, PAN, TILT, ROLL = range(6)  # indices in a pose
_UNIT = 100_000
_CAN = {1: 0x04, 2: 0x08, 3: 0x10, 4: 0x20}
_LENGTH, _EXT = 200.0, 40.0
_STRAIGHT = 5.0  # steps per unit
_TURN = 20.0  # steps per degree, with the motor close to a whole turn
_SLACK = 1.6  # steps by which the motors together may miss a point
_VELOCITY = 1000


class Arm(NamedTuple):
    """A type and its axes with motors, in the order of motors 1, 2, ..."""

    kind: int
    driven: tuple[str, ...]
    nodal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    safe: float | None = None
    pos: tuple[float, ...] = (0.0,) * 6
    table: int = 0  # steps per degree in a boom table, or 0

    def __str__(self) -> str:
        besides = " with a nodal offset" if any(self.nodal) else ""
        if self.table:
            besides += f" with a boom table that {'rises' if self.table > 0 else 'falls'}"
        return f"type {self.kind} of {', '.join(self.driven)}{besides}"


def _per_degree(step: int) -> float:
    """Return steps per degree for which this step is a whole number of turns, or almost level."""
    if abs(step) <= 8 * _TURN:
        return _TURN
    turns = max(1, round(abs(step) / (360 * _TURN)))
    return round(abs(step) / (360 * turns), 3)


def _rig(bench: Bench, arm: Arm) -> Rig:
    axes = []
    for i, name in enumerate(NAMES[arm.kind]):
        motor = arm.driven.index(name) + 1 if name in arm.driven else 0
        step = bench.home[motor - 1] if motor else 0
        steps = _STRAIGHT if name in ("TRACK", "X", "Y", "Z") else _per_degree(step)
        axes.append(Axis(motor, steps, arm.pos[i], step) if motor else Axis(0, 0.0, arm.pos[i]))
    table = None
    if arm.table:  # replaces the boom's steps per unit, which differ from it
        table = tuple(axes[0].step + arm.table * degree for degree in range(-60, 61))
    return Rig(arm.kind, tuple(axes), _LENGTH, _EXT, arm.nodal, table, arm.safe)


def _with_rig(check):
    """Wrap a check: configure the arm before it; remove it and bring the motors back after it."""

    def run(bench: Bench, arm: Arm, *row: Any, **values: Any) -> None:
        only_if(bench.hello.can & _CAN[arm.kind] and bench.hello.motors >= len(arm.driven))
        rig = _rig(bench, arm)
        bench.expect(Request(spec.VIRT_CONFIG, rig.payload()))
        try:
            check(bench, rig, *row, **values)
        finally:
            bench.idle()
            bench.expect(Request(spec.VIRT_CONFIG, b"\0"))
            bench.return_home()

    return run


_SPECIFIED = (Arm(1, ("SWING", "BOOM")), Arm(2, ("SWING", "PAN")))
_NOTED = (Arm(3, ("SWING", "Y")), Arm(4, ("X", "Y")))
_PAIRS = (*_SPECIFIED, *_NOTED)
_POS = (7.0, -3.5, 150.0, 12.25, -4.0, 2.5)
_FORWARD = "MSG_VIRT_GET_POSITION; note 9.4"
_NODAL = (20.0, 35.5, -12.0)
_HEAD = Arm(4, ("X", "Z", "PAN"), _NODAL)
_WITH_TILT = Arm(4, ("X", "Z", "PAN", "Y", "TILT"), safe=50.0)


@ARMS.must("{arm}: VIRT_CONFIG is accepted", "MSG_VIRT_CONFIG", arm=_SPECIFIED)
@ARMS.should("{arm}: VIRT_CONFIG is accepted", "note 9.3", arm=_NOTED)
@_with_rig
def _accepted(bench: Bench, rig: Rig) -> None:
    pass


# ---- the camera's pose


def _pose(bench: Bench) -> np.ndarray:
    """Return VIRT_GET_POSITION in units and degrees."""
    data = bench.data(spec.VIRT_GET_POSITION)
    if len(data) not in (24, 37):
        raise Failed(f"VIRT_GET_POSITION has {len(data)} bytes, expected 24 or 37")
    return np.array(struct.unpack_from("<6i", data)) / _UNIT


def _joints(bench: Bench, rig: Rig) -> np.ndarray:
    steps = bench.positions().steps
    return rig.joints([steps[a.motor - 1] if a.motor else 0 for a in rig.axes])


def _grain(rig: Rig, joints: np.ndarray) -> np.ndarray:
    """Return the tolerance of each number of the pose if no motor is off by more than _SLACK."""
    here, out = rig.forward(joints), np.full(6, 2 / _UNIT)
    for i, axis in enumerate(rig.axes):
        if axis.motor:
            beside = joints.copy()
            beside[i] += _SLACK / axis.steps_per_unit
            out += np.abs(rig.forward(beside) - here)
    return out


def _compare(found: np.ndarray, expected: np.ndarray, grain: np.ndarray, when: str) -> None:
    for name, is_, should, within in zip(POSE, found, expected, grain, strict=True):
        if abs(is_ - should) > within:
            raise Failed(f"{when} {name} is {is_:.3f}, expected {should:.3f}")


def _check_pose(bench: Bench, rig: Rig, when: str) -> None:
    """Require that the reported pose matches the motors' steps."""
    joints = _joints(bench, rig)
    _compare(_pose(bench), rig.host_pose(rig.forward(joints)), _grain(rig, joints), when)


@ARMS.should(
    "{arm}: a VIRT_CONFIG that is one byte too short is refused", "ERR_RANGE; note 1.8", arm=_PAIRS
)
@_with_rig
def _cut_short(bench: Bench, rig: Rig) -> None:
    """A short message is refused, and the previous configuration stays."""
    request = Request(spec.VIRT_CONFIG, rig.payload()[:-1])
    bench.expect(request, spec.ERR_RANGE)
    _check_pose(bench, rig, "after a VIRT_CONFIG that was refused")


@ARMS.should(
    "{arm}: it reports the pose of `pos` at once",
    "note 9.2",
    arm=[arm._replace(pos=_POS) for arm in _PAIRS if arm.kind != 2],
)
@_with_rig
def _at_first(bench: Bench, rig: Rig) -> None:
    expected = rig.host_pose(rig.forward(rig.home))
    _compare(_pose(bench), expected, np.full(6, 2 / _UNIT), "right after VIRT_CONFIG")


@ARMS.should(
    "{row} moves the camera as the formulas say",
    _FORWARD,
    rows={f"{arm}: {name}": (arm, name, 300) for arm in _PAIRS for name in arm.driven},
)
@ARMS.should(
    "{arm}: BOOM moves the camera as the table says",
    "Boom Compensation Table; note 9.2",
    arm=[Arm(1, ("BOOM", "SWING"), table=slope) for slope in (12, -12)],
    name={"": "BOOM"},
    steps=(250,),
)
@ARMS.should(
    "{arm}: the nodal offset turns with the camera",
    "NODAL OFF X, Y, Z; note 9.4",
    arm=(_HEAD,),
    name={"": "PAN"},
    steps=(400,),
)
@_with_rig
def _jointwise(bench: Bench, rig: Rig, name: str, steps: int):
    """A motor moves alone, and the camera follows the formulas."""
    motor = rig.axes[NAMES[rig.kind].index(name)].motor
    for went in (steps, -steps):
        bench.go(motor, went)
        _check_pose(bench, rig, f"with {name} at {went} steps from its start")


@ARMS.should(
    "{row}: both together do so", _FORWARD, rows={f"{arm}": (arm, *arm.driven) for arm in _PAIRS}
)
@_with_rig
def _turned_out(bench: Bench, rig: Rig, first: str, second: str):
    """As _jointwise, with another motor away from its start, where formulas with two angles
    differ."""
    for name, steps in ((first, 300), (second, -260)):
        bench.go(rig.axes[NAMES[rig.kind].index(name)].motor, steps)
    _check_pose(bench, rig, f"with {first} and {second} turned")


# ---- moves

_MOVES = {
    f"{arm}: {POSE[axis]} by {by:g}": (arm, axis, by)
    for arm, moves in (
        (Arm(1, ("SWING", "TRACK", "PAN")), ((EW, 25.0), (EW, -40.0), (TRACK, 30.0), (PAN, 20.0))),
        (Arm(1, ("SWING", "TRACK", "PAN", "BOOM")), ((NS, 30.0), (NS, -45.0), (EW, 35.0))),
        (Arm(2, ("PAN", "SWING")), ((PAN, 15.0), (PAN, -10.5))),
        (Arm(3, ("SWING", "TRACK", "PAN", "Y")), ((EW, 35.0), (EW, -20.0), (NS, 50.0))),
        (Arm(4, ("X", "Z")), ((EW, 60.0), (EW, -25.5), (TRACK, -60.0))),
        (_HEAD, ((PAN, 20.0), (EW, 30.0))),
    )
    for axis, by in moves
}


@ARMS.must("{row} ends at its target", "MSG_VIRT_MOVE: Target position * 100000", rows=_MOVES)
@_with_rig
def _reached(bench: Bench, rig: Rig, axis: int, by: float):
    """A virtual axis ends at its target by its own report."""
    target, _ = _go(bench, rig, axis, by)
    grain = _grain(rig, _joints(bench, rig))
    found = _pose(bench)[axis]
    if abs(found - target[axis]) > grain[axis]:
        raise Failed(f"{POSE[axis]} was sent to {target[axis]:.3f}, reports {found:.3f}")


@ARMS.should("{row} has the motors there", "note 9.4", rows=_MOVES)
@_with_rig
def _inverse(bench: Bench, rig: Rig, axis: int, by: float):
    """The motors end where the formulas put the camera at its target, with all else unchanged."""
    before = _joints(bench, rig)
    target, _ = _go(bench, rig, axis, by)
    wanted = rig.steps(rig.inverse(rig.from_host(target), before))
    steps = bench.positions().steps
    for one, name, should in zip(rig.axes, NAMES[rig.kind], wanted, strict=True):
        if one.motor and abs(steps[one.motor - 1] - should) > _SLACK:
            raise Failed(
                f"for {POSE[axis]} {target[axis]:.3f} the motor of {name} is at "
                f"{steps[one.motor - 1]}, expected {should:.1f}"
            )


@ARMS.should(
    "{row} is a straight line",
    "MSG_MOTOR_SET_SPEED; note 9.5",
    rows={name: row for name, row in _MOVES.items() if row[0].kind != 2},
)
@_with_rig
def _straight(bench: Bench, rig: Rig, axis: int, by: float):
    """No other virtual axis leaves its place during the move, and no motor is too fast."""
    start = _pose(bench)
    _, seen = _go(bench, rig, axis, by)
    for moment in seen:
        steps = [h + s for h, s in zip(bench.home, moment.steps, strict=True)]
        joints = rig.joints([steps[a.motor - 1] if a.motor else 0 for a in rig.axes])
        pose, grain = rig.host_pose(rig.forward(joints)), _grain(rig, joints)
        pose[axis] = start[axis]
        _compare(pose, start, grain, f"on the way of {POSE[axis]}")
    for motor in sorted(a.motor for a in rig.axes if a.motor):
        no_faster(seen, motor, _VELOCITY)


def _go(bench: Bench, rig: Rig, axis: int, by: float):
    """Move a virtual axis. Return the target pose and the positions on the way."""
    target = _pose(bench)
    target[axis] += by
    return target, motion(bench, _to(axis, target[axis]))


def _to(axis: int, units: float) -> Request:
    return Request(spec.VIRT_MOVE, struct.pack("<Bi", axis + 1, round(units * _UNIT)))


@ARMS.should(
    "{row} is refused",
    "ERR_RANGE",
    rows={
        f"{arm}: {text}": (arm, axis, units)
        for arm, text, axis, units in (
            (Arm(1, ("SWING", "TRACK", "PAN")), "vEW farther than the arm", EW, 1000),
            (Arm(1, ("SWING", "TRACK", "PAN", "BOOM")), "vNS higher than the boom", NS, 500),
        )
    },
)
@_with_rig
def _too_far(bench: Bench, rig: Rig, axis: int, units: float):
    before = bench.positions().steps
    bench.refused(_to(axis, _pose(bench)[axis] + units))
    bench.idle()
    if bench.positions().steps != before:
        raise Failed("a refused move has moved motors")


@ARMS.should(
    "{arm}: JOG_ON_LINE of {line} goes along the camera's own axis",
    "MSG_VIRT_JOG_ON_LINE: along the direction of the camera; notes 9.4, 9.6",
    arm=(Arm(4, ("X", "Z", "PAN")),),
    line={"Z backward": (2, TRACK, -6000), "Z": (2, TRACK, 6000), "X": (0, EW, 6000)},
)
@_with_rig
def _along_line(bench: Bench, rig: Rig, line: tuple[int, int, int]):
    """JOG_ON_LINE follows the camera's own direction, turned by its pan."""
    number, axis, speed = line
    bench.expect(_to(PAN, _pose(bench)[PAN] + 30))
    bench.idle()
    before = _pose(bench)
    bench.expect(Request(spec.VIRT_JOG_ON_LINE, struct.pack("<Bh", number, speed)))
    bench.link.pump(0.5)
    bench.expect(Request(spec.VIRT_STOP, bytes((axis + 1,))))
    bench.idle()
    after = _pose(bench)
    x, y, z = line_direction(number, *rig.forward(_joints(bench, rig))[3:])
    way, wanted = (after - before)[:3], np.array([z, x, y])
    gone = float(way @ wanted) * (1 if speed > 0 else -1)
    if gone < 5:
        raise Failed(f"in 0.5 s the camera went {gone:.1f} units along its line")
    beside = np.abs(way - (way @ wanted) * wanted).max()
    if beside > 0.03 * gone + 2 * _SLACK / _STRAIGHT:
        raise Failed(f"after {gone:.1f} units the camera is {beside:.1f} off its line")
    _compare(after, before, np.array([np.inf] * 3 + [0.2] * 3), "after a jog on a line")


@ARMS.should(
    "{row}",
    "SAFE DISTANCE; notes 3.2, 9.7",
    rows={
        f"{_WITH_TILT}: an aim point {text}": (_WITH_TILT, distance, code)
        for text, distance, code in (
            ("inside the safe distance is refused", 20.0, 0x19),
            ("outside the safe distance is accepted", 200.0, spec.OK),
        )
    },
    needs=lambda bench: bench.hello.can & spec.CAN_AIM,
)
@_with_rig
def _aim_inside(bench: Bench, rig: Rig, distance: float, expected: int):
    track = _pose(bench)[TRACK]
    point = struct.pack("<B3i", 1, 0, 0, round((track - distance) * 1000))
    reply = bench.ask(Request(spec.AIM, point))
    bench.ask(Request(spec.AIM, bytes(13)))
    code = spec.OK if reply.code is None else reply.code
    if code != expected:
        raise Failed(
            f"an aim point {distance:g} units away is answered with 0x{code:04X}, "
            f"the safe distance is {rig.safe:g}"
        )
