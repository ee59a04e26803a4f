"""The virtual axes in double precision, written from the field notes, not from the firmware.

Used by tests, judges and drawings. World: X = EW, Y = NS (up), Z = track; the camera at rest looks
along -Z. Angles are degrees.

    rig = Rig(kind=1, axes=(Axis(1, 1000.0, 0.0), ...), length=857.7, extension=78.0)
    rig.payload()                      VIRT_CONFIG
    rig.forward(joints)                pose of these joints
    rig.host_pose(pose)                the same in the host's coordinates, set by the payload
    rig.from_host(pose)                the reverse of host_pose()
    rig.inverse(pose, near=joints)     joints, on the same side of the rig as `near`; Unreachable
    rig.steps(joints)                  motor steps, as real numbers
"""

import functools
import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Numbers = Sequence[float] | np.ndarray

BOOM_SWING_TRACK, SWING_PAN, Y_SWING_TRACK, X_Y_Z = 1, 2, 3, 4
NAMES = {
    BOOM_SWING_TRACK: ("BOOM", "SWING", "TRACK", "PAN", "TILT", "ROLL"),
    SWING_PAN: ("SWING", "PAN"),
    Y_SWING_TRACK: ("Y", "SWING", "TRACK", "PAN", "TILT", "ROLL"),
    X_Y_Z: ("X", "Y", "Z", "PAN", "TILT", "ROLL"),
}
POSE = ("vTrack", "vEW", "vNS", "vPan", "vTilt", "vRoll")
STRAIGHT = ("TRACK", "X", "Y", "Z")
POSITION_OF = {
    "BOOM": 2,
    "SWING": 1,
    "TRACK": 0,
    "X": 1,
    "Y": 2,
    "Z": 0,
    "PAN": 3,
    "TILT": 4,
    "ROLL": 5,
}  # indices in a pose
TABLE_ANGLES = np.arange(-60.0, 61.0)

# From the frame of Rz(pan)·Rx(tilt)·Ry(roll), x right, y forward, z up, to the world's X, Y, Z
_TO_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


class Unreachable(ValueError):
    """The rig has no joints for this pose."""


@dataclass(frozen=True)
class Axis:
    """One axis.

    motor: its number, 0 for none; position: `pos` of VIRT_CONFIG, a number of the pose at that
    moment; step: the motor's position at that moment. A joint that turns is steps / steps_per_unit
    (without whole turns of `step`), a straight one the same counted from `step`; without a motor it
    is 0.
    """

    motor: int
    steps_per_unit: float = 1000.0
    position: float = 0.0
    step: int = 0


def rotation(pan: float, tilt: float, roll: float) -> np.ndarray:
    """Return the camera's rotation, from its own frame (x right, y forward, z up) to the same frame
    at rest (field note 9.4)."""
    (cp, ct, cr), (sp, st, sr) = (f(np.radians([pan, tilt, roll])) for f in (np.cos, np.sin))
    rz = np.array([[cp, -sp, 0.0], [sp, cp, 0.0], [0.0, 0.0, 1.0]])
    rx = np.array([[1.0, 0.0, 0.0], [0.0, ct, -st], [0.0, st, ct]])
    ry = np.array([[cr, 0.0, sr], [0.0, 1.0, 0.0], [-sr, 0.0, cr]])
    return rz @ rx @ ry


def line_direction(axis: int, pan: float, tilt: float, roll: float) -> np.ndarray:
    """Return the world direction of JOG_ON_LINE's X, Y or Z (0, 1, 2) at these angles."""
    local = np.eye(3)[axis]
    return _TO_WORLD @ rotation(pan, tilt, roll) @ _TO_WORLD.T @ local


def world(pose: Numbers) -> np.ndarray:
    """Return X, Y, Z of a pose."""
    return np.array([pose[1], pose[2], pose[0]], float)


def aim(place: Numbers, point: Numbers, safe: float = 0.0) -> tuple[float, float]:
    """Return pan and tilt from a place to an aim point, both X, Y, Z. Raises Unreachable within
    `safe`, a vertical cylinder."""
    x, y, z = np.asarray(point, float) - np.asarray(place, float)
    level = float(np.hypot(x, z))
    if level < safe or level == 0.0:
        raise Unreachable("inside the safe distance")
    return float(np.degrees(np.arctan2(-x, -z))), float(np.degrees(np.arctan2(y, level)))


def looks(pan: float, tilt: float) -> np.ndarray:
    """Return the world direction in which a camera with these angles looks."""
    return _TO_WORLD @ rotation(pan, tilt, 0.0) @ np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Rig:
    """A virtual configuration. axes: in the order of the type's name. nodal: x right, y forward, z
    up."""

    kind: int
    axes: tuple[Axis, ...]
    length: float = 0.0
    extension: float = 0.0
    nodal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    table: tuple[int, ...] | None = None
    safe: float | None = None

    def payload(self) -> bytes:
        """Return the payload of VIRT_CONFIG, with rounded numbers."""
        if self.kind == SWING_PAN:
            swing, pan = self.axes
            return struct.pack("<BIiIi", 2, swing.motor, _spu(swing), pan.motor, _spu(pan))
        out = bytes([self.kind])
        for a in self.axes:
            out += struct.pack("<Iii", a.motor, _spu(a), round(a.position * 100000))
        if self.kind != X_Y_Z:
            out += struct.pack("<ii", round(self.length * 1000), round(self.extension * 1000))
        out += struct.pack("<3i", *(round(n * 1000) for n in self.nodal))
        if self.table is not None:
            out += struct.pack("<121i", *self.table)
        if self.safe is not None:
            out += struct.pack("<i", round(self.safe * 1000))
        return out

    def offset(self, pan: float, tilt: float, roll: float) -> np.ndarray:
        """Return the world vector from the intersection of the camera's axes to the nodal point."""
        if not any(self.nodal):
            return np.zeros(3)
        return _TO_WORLD @ rotation(pan, tilt, roll) @ np.array(self.nodal, float)

    def forward(self, joints: Numbers) -> np.ndarray:
        """Return the pose for joints in units and degrees. Swing-pan only has a vPan."""
        q = np.asarray(joints, float)
        if self.kind == SWING_PAN:
            return np.array([0.0, 0.0, 0.0, q[0] + q[1], 0.0, 0.0])
        if self.kind == X_Y_Z:
            place = q[:3]
            pan = q[3]
        else:
            swing = np.radians(q[1])
            reach, height = self._arm(q[0])
            place = np.array([reach * np.sin(swing), height, q[2] - reach * np.cos(swing)])
            pan = q[3] + q[1]
        x, y, z = place + self.offset(pan, q[4], q[5])
        return np.array([z, x, y, pan, q[4], q[5]])

    def _arm(self, first: float) -> tuple[float, float]:
        """Return reach and height for the boom's angle or the column's position."""
        if self.kind == Y_SWING_TRACK:
            return self.length + self.extension, first
        return self.length * np.cos(np.radians(first)) + self.extension, self.length * np.sin(
            np.radians(first)
        )

    def inverse(self, pose: Numbers, near: Numbers | None = None) -> np.ndarray:
        """Return the joints for a pose. near: previous joints; the swing stays on their side, and
        swing-pan's swing stays where it is."""
        p = np.asarray(pose, float)
        old = np.zeros(len(self.axes)) if near is None else np.asarray(near, float)
        if self.kind == SWING_PAN:
            return np.array([old[0], p[3] - old[0]])
        x, y, z = world(p) - self.offset(*p[3:])
        if self.kind == X_Y_Z:
            return np.array([x, y, z, *p[3:]])
        first = y
        if self.kind == BOOM_SWING_TRACK:
            if abs(y) >= self.length:
                raise Unreachable("higher or lower than the boom is long")
            first = np.degrees(np.arcsin(y / self.length))
        reach, _ = self._arm(first)
        if reach <= 0 or abs(x) >= reach:
            raise Unreachable("farther to the side than the arm reaches")
        # the arc sine, on the half turn of `old`, so the swing never crosses ±90°, ±270° ...
        half = np.round(old[1] / 180.0)
        swing = 180.0 * half + (-1.0) ** half * np.degrees(np.arcsin(x / reach))
        return np.array(
            [first, swing, z + reach * np.cos(np.radians(swing)), p[3] - swing, p[4], p[5]]
        )

    @functools.cached_property
    def home(self) -> np.ndarray:
        """Return the joints at the moment of the configuration."""
        out = np.zeros(len(self.axes))
        for i, (a, name) in enumerate(zip(self.axes, NAMES[self.kind], strict=True)):
            if a.motor and name not in STRAIGHT:
                out[i] = a.step / a.steps_per_unit
                out[i] -= 360 * np.floor(out[i] / 360 + 0.5)
        if self.table is not None:
            out[0] = self._boom(self.axes[0].step)
        return out

    @functools.cached_property
    def _shift(self) -> np.ndarray:
        """Return the host's coordinates minus those of forward()."""
        out = np.zeros(6)
        if self.kind == SWING_PAN:
            out[3] = sum(a.step / a.steps_per_unit for a in self.axes)
        else:
            for a, name in zip(self.axes, NAMES[self.kind], strict=True):
                out[POSITION_OF[name]] = a.position
        return out - self.forward(self.home)

    def host_pose(self, pose: Numbers) -> np.ndarray:
        """Return a pose in the host's coordinates: VIRT_CONFIG's pose plus the change of forward()
        since (note 9.2)."""
        return np.asarray(pose, float) + self._shift

    def from_host(self, pose: Numbers) -> np.ndarray:
        """Return the pose for the host's coordinates."""
        return np.asarray(pose, float) - self._shift

    def steps(self, joints: Numbers) -> np.ndarray:
        """Return steps of the axes' motors, 0 without a motor. Raises Unreachable if the boom is
        off its table."""
        out = np.array(
            [
                a.step + (q - h) * a.steps_per_unit if a.motor else 0.0
                for a, q, h in zip(self.axes, joints, self.home, strict=True)
            ]
        )
        if self.table is not None:
            if abs(joints[0]) > 60.0:
                raise Unreachable("off the boom table")
            out[0] = np.interp(joints[0], TABLE_ANGLES, self.table)
        return out

    def joints(self, steps: Numbers) -> np.ndarray:
        """Return the joints for motor steps."""
        out = np.array(
            [
                h + (s - a.step) / a.steps_per_unit if a.motor else 0.0
                for a, s, h in zip(self.axes, steps, self.home, strict=True)
            ]
        )
        if self.table is not None:
            out[0] = self._boom(steps[0])
        return out

    def _boom(self, step: float) -> float:
        """Return the boom's angle from its table."""
        assert self.table is not None
        order = np.argsort(self.table)
        table = np.array(self.table, float)[order]
        if not table[0] <= step <= table[-1]:
            raise Unreachable("off the boom table")
        return float(np.interp(step, table, TABLE_ANGLES[order]))


def _spu(axis: Axis) -> int:
    return round(axis.steps_per_unit * 1000)
