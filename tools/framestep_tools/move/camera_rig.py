"""The rig that carries the camera: [camera] in axes.toml, and its kinematics.

    [camera]
    type = "boom-swing-track"
    length = 1200                 # boom, swing, track, pan, tilt, roll: the axes with these names
    extension = 300

docs/use/virtual-axes.md lists all keys. The firmware's own formulas lead from the camera's pose to
the joints; the axes' steps per unit and zeros lead from there to steps.
"""

import contextlib
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from framestep.virtual_axes.registers import BOOM, WRIST_EW, WRIST_NS

from ..axes.axes_file import AxesFileError, Axis
from ..axes.rig_axes import FILE, Axes
from ..axes.units import UNITS, factor
from ..errors import ToolError
from ..judge import virtual_reference as reference
from ..text.numerals import GREATEST
from .kinematics import Firmware, Refused

TYPES = {
    "boom-swing-track": reference.BOOM_SWING_TRACK,
    "swing-pan": reference.SWING_PAN,
    "Y-swing-track": reference.Y_SWING_TRACK,
    "X-Y-Z": reference.X_Y_Z,
}
_SWING_PAN = reference.SWING_PAN
_JOINTS = ("boom", "swing", "track", "x", "y", "z", "pan", "tilt", "roll")
_ALSO = {"x": "ew", "y": "ns", "z": "track"}  # names of axes of X-Y-Z
_STRAIGHT = [name.lower() for name in reference.STRAIGHT]
_LENGTHS = [unit for unit, (kind, _) in UNITS.items() if kind == "length"]
_ABSENT = 0.01  # millimetres or degrees that an axis without a motor may be off
_HALVINGS = 40
_STEPS = 1000.0  # steps per unit of the firmware's axes here, which are not used
_TABLE = 121


class OutOfReachError(ToolError):
    """The rig cannot reach a pose. The text has the frame, the axis, its value and what is
    allowed."""


@dataclass(frozen=True)
class CameraRig:
    """The rig of a camera. Lengths in millimetres, angles in degrees.

    kind: one of TYPES; axes: of its joints, by name; None: it has none
    nodal: from the camera's axes to the lens's nodal point, to the right, forward, up
    origin: x, y, z in the scene of the nodal point with all axes at 0; None: the file's first frame
    heading: by how much the rig is turned to the left in the scene
    unit: for messages, and of a file's lengths unless `file_unit` names another
    order, up: of the file's rotations and axes, if they are not the format's own
    ignore: joints without an axis that do not matter
    """

    kind: int
    axes: Mapping[str, Axis | None]
    unit: str = "mm"
    length: float = 0.0
    extension: float = 0.0
    nodal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    table: tuple[int, ...] | None = None
    origin: tuple[float, ...] | None = (0.0, 0.0, 0.0)
    heading: float = 0.0
    file_unit: str = ""
    order: str | None = None
    up: str | None = None
    ignore: frozenset[str] = field(default_factory=frozenset)

    @property
    def moved(self) -> list[Axis]:
        """The axes that a pose moves."""
        return [
            axis
            for name, axis in self.axes.items()
            if axis and not (self.kind == _SWING_PAN and name == "swing")
        ]

    @property
    def swing(self) -> Axis | None:
        """The axis that a pose does not move: the swing of swing-pan."""
        return self.axes.get("swing") if self.kind == _SWING_PAN else None

    def firmware(self) -> Firmware:
        """Return the firmware's kinematics of this rig, all joints at 0. Raises ToolError."""
        axes = tuple(reference.Axis(i + 1, _STEPS) for i in range(len(self.axes)))
        try:
            rig = reference.Rig(
                self.kind, axes, self.length, self.extension, self.nodal, self.table
            )
            return Firmware.of(rig)
        except (Refused, struct.error):
            raise ToolError(
                "expected lengths below 2 km, an arm that is longer than 0, and a boom_table "
                "that rises or falls throughout"
            ) from None

    def _has_table(self, name: str) -> bool:
        return name == "boom" and self.table is not None

    # ---- to the motors

    def positions(
        self, poses: np.ndarray, swing: Sequence[float], start_frame: int, path: str
    ) -> tuple[dict[int, list[float]], list[str]]:
        """Return {motor: its positions in the axis's unit} for poses in the scene, and what to
        say.

        poses: x, y, z, pan, tilt, roll in a row per frame; swing: of swing-pan, in degrees.
        Raises OutOfReachError for the first frame that the rig cannot reach.
        """
        firmware = self.firmware()
        home = np.array(firmware.pose())
        rows = self._to_rig(poses) + home
        joints, steps = [], []
        for i, row in enumerate(rows.tolist()):
            if self.kind == _SWING_PAN:
                firmware.forward([swing[i], 0.0])
            try:
                joints.append(firmware.inverse(row))
                if self.table:
                    steps.append(firmware.steps()[0])
            except Refused:
                raise OutOfReachError(
                    f"{path}, frame {start_frame + i}: {self._beyond(firmware, row, home)}"
                ) from None
        columns = dict(zip(self.axes, np.array(joints).T, strict=False))
        said = []
        found: dict[int, list[float]] = {}
        for name, axis in self.axes.items():
            if axis is None:
                said += self._without(name, columns[name], start_frame, path)
            elif self._has_table(name):
                found[axis.motor] = [axis.position(step) for step in steps]
            else:
                found[axis.motor] = (columns[name] * (factor(_unit(name), axis.unit) or 1)).tolist()
        if self.kind == _SWING_PAN:
            said.append("swing-pan keeps the heading only: positions, tilt and roll are left out")
        return found, said

    def _to_rig(self, poses: np.ndarray) -> np.ndarray:
        """Return rows of vTrack, vEW, vNS, vPan, vTilt, vRoll, counted from all axes at 0."""
        places = poses[:, :3] - self._origin(poses)
        angle = np.radians(self.heading)
        x = places[:, 0] * np.cos(angle) - places[:, 2] * np.sin(angle)
        z = places[:, 0] * np.sin(angle) + places[:, 2] * np.cos(angle)
        return np.stack([z, x, places[:, 1], poses[:, 3] - self.heading, *poses[:, 4:].T], axis=1)

    def _origin(self, poses: np.ndarray) -> np.ndarray:
        return poses[0, :3] if self.origin is None else np.array(self.origin)

    def _beyond(self, firmware: Firmware, row: list[float], home: np.ndarray) -> str:
        """Say which number of a pose is out of reach, and what is allowed."""
        x, y = ("x", 1, WRIST_EW), ("y", 2, WRIST_NS)
        for centred, (name, at, wrist) in (((), y), ((), x), ((x,), y)):
            pose = list(row)
            for _, i, register in centred:
                pose[i] -= self._wrist(firmware, pose, register)
            value = pose[at]
            middle = value - self._wrist(firmware, pose, wrist)
            if not self._reaches(firmware, pose, at, middle):
                continue
            far = abs(value - middle) + 1.0
            low, high = (
                self._edge(firmware, pose, at, middle, middle + side * far) - home[at]
                for side in (-1.0, 1.0)
            )
            return (
                f"{self._length(value - home[at], name)} is out of the rig's reach, allowed: "
                + (f"{self._plain(low)} to {self._plain(high)} {self.unit}")
            )
        return "the rig cannot reach this pose"

    @staticmethod
    def _wrist(firmware: Firmware, pose: list[float], register: int) -> float:
        """Return a length of the wrist, which inverse() sets before it refuses."""
        with contextlib.suppress(Refused):
            firmware.inverse(pose)
        return firmware.number(register)

    @staticmethod
    def _reaches(firmware: Firmware, pose: list[float], at: int, value: float) -> bool:
        try:
            firmware.inverse([*pose[:at], value, *pose[at + 1 :]])
            firmware.steps()
        except Refused:
            return False
        return True

    def _edge(
        self, firmware: Firmware, pose: list[float], at: int, inside: float, outside: float
    ) -> float:
        """Return the last number within reach between two."""
        if self._reaches(firmware, pose, at, outside):
            return outside
        for _ in range(_HALVINGS):
            middle = (inside + outside) / 2
            if self._reaches(firmware, pose, at, middle):
                inside = middle
            else:
                outside = middle
        return inside

    def _length(self, mm: float, name: str) -> str:
        return f"{name} at {self._plain(mm)} {self.unit}"

    def _plain(self, mm: float) -> str:
        return f"{mm * (factor('mm', self.unit) or 1):.7g}"

    def _without(self, name: str, joints: np.ndarray, start_frame: int, path: str) -> list[str]:
        """Check a joint without an axis. Return what to say if it is left out."""
        off = np.abs(joints)
        unit = _unit(name)
        if name in self.ignore:
            at = int(off.argmax())
            if off[at] <= _ABSENT:
                return []
            return [
                f"{name}: left out, the rig has no such axis; in frame {start_frame + at} it would "
                f"be at {joints[at]:.4g} {unit}"
            ]
        beyond = np.flatnonzero(off > _ABSENT)
        if len(beyond):
            at = int(beyond[0])
            raise OutOfReachError(
                f"{path}, frame {start_frame + at}: {name} would be at {joints[at]:.4g} {unit}, "
                f"and the rig has no such axis, allowed: 0 ± {_ABSENT:g} {unit}; "
                f'ignore = ["{name}"] in [camera] leaves it out'
            )
        return []

    # ---- and back

    def poses(self, positions: Mapping[int, Sequence[int]], start_frame: int) -> np.ndarray:
        """Return the poses in the scene at these steps, as `positions` takes them. Raises
        OutOfReachError, with the frame."""
        firmware = self.firmware()
        home = np.array(firmware.pose())
        frames = len(next(iter(positions.values())))
        joints = np.zeros((frames, len(self.axes)))
        for j, (name, axis) in enumerate(self.axes.items()):
            if axis and not self._has_table(name):
                times = factor(axis.unit, _unit(name)) or 1
                joints[:, j] = [axis.position(step) * times for step in positions[axis.motor]]
        boom = self.axes.get("boom") if self.table else None
        rows = []
        for i, row in enumerate(joints.tolist()):
            try:
                if boom:
                    firmware.locate({1: positions[boom.motor][i]})
                    row[0] = firmware.number(BOOM)
                rows.append(firmware.forward(row))
            except Refused:
                raise OutOfReachError(
                    f"frame {start_frame + i}: the arm is beyond its reach, at "
                    + ", ".join(
                        f"{n} {v:.5g} {_unit(n)}" for n, v in zip(self.axes, row, strict=True)
                    )
                ) from None
        found = np.array(rows) - home
        angle = np.radians(self.heading)
        z, x = found[:, 0], found[:, 1]
        places = np.stack(
            [
                x * np.cos(angle) + z * np.sin(angle),
                found[:, 2],
                z * np.cos(angle) - x * np.sin(angle),
            ],
            axis=1,
        )
        return np.hstack(
            [places + np.array(self.origin or (0.0, 0.0, 0.0)), found[:, 3:] + [self.heading, 0, 0]]
        )


def _unit(joint: str) -> str:
    return "mm" if joint in _STRAIGHT else "deg"


# ---- [camera]


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= GREATEST


def _three(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_number, value))


def _one_of(*words: str) -> tuple[str, Callable[[Any], bool]]:
    return f"one of {', '.join(words)}", lambda value: value in words


KEYS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "type": _one_of(*TYPES),
    **dict.fromkeys(_JOINTS, ("the name of an axis", lambda value: isinstance(value, str))),
    "unit": _one_of(*_LENGTHS),
    "length": ("a number", _number),
    "extension": ("a number", _number),
    "nodal": ("three numbers: to the right, forward, up", _three),
    "boom_table": (
        f"{_TABLE} whole numbers of steps",
        lambda value: (
            isinstance(value, list)
            and len(value) == _TABLE
            and all(type(step) is int and -(2**31) <= step < 2**31 for step in value)
        ),
    ),
    "origin": (
        'three numbers [x, y, z], or "first"', lambda value: value == "first" or _three(value)
    ),
    "heading": ("degrees", _number),
    "file_unit": _one_of(*_LENGTHS),
    "order": _one_of("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"),
    "up": _one_of("y", "z"),
    "ignore": (
        "a list of joints without an axis",
        lambda value: isinstance(value, list) and all(each in _JOINTS for each in value),
    ),
}  # fmt: skip


def rig_of(axes: Axes, changes: Mapping[str, Any] | None = None) -> CameraRig | None:
    """Return the rig of the camera, or None. changes: other values of keys of [camera].

    Raises AxesFileError, with the key and what is allowed, if [camera] has a mistake.
    """
    settings = axes.camera
    if settings is None and not changes:
        return None
    if changes and (settings is None or isinstance(settings, dict)):
        settings = {**(settings or {}), **changes}
    return _rig(settings, axes.list, str(axes.path or FILE))


def _rig(settings: Any, axes: Sequence[Axis], path: str) -> CameraRig:
    """Return the rig of [camera]. path: for errors."""
    where = f"{path}, [camera]"
    if not isinstance(settings, dict):
        raise AxesFileError(f"{path}: expected a table [camera], found {settings!r}")
    for key, value in settings.items():
        if key not in KEYS:
            raise AxesFileError(f'{where}: no key "{key}"; there are {", ".join(KEYS)}')
        allowed, right = KEYS[key]
        if not right(value):
            raise AxesFileError(f'{where}: "{key}": expected {allowed}, found {_shown(value)}')
    if "type" not in settings:
        raise AxesFileError(f'{where}: "type" is missing: {KEYS["type"][0]}')
    kind = TYPES[settings["type"]]
    joints = [name.lower() for name in reference.NAMES[kind]]
    for name in _JOINTS:
        if name in settings and name not in joints:
            raise AxesFileError(
                f'{where}: "{name}" is no joint of {settings["type"]}, which has '
                f"{', '.join(joints)}"
            )
    found = {name: _joint(name, kind, settings, axes, where) for name in joints}
    motors = [axis.motor for axis in found.values() if axis]
    if not motors:
        raise AxesFileError(
            f"{where}: expected an axis for one of {', '.join(joints)} at least, found none"
        )
    if len(set(motors)) < len(motors):
        raise AxesFileError(f"{where}: expected another axis for each joint, found one twice")
    if kind == _SWING_PAN and None in found.values():
        raise AxesFileError(f"{where}: swing-pan needs both axes, swing and pan")
    unit: str = settings.get("unit") or next(
        (axis.unit for name, axis in found.items() if axis and name in _STRAIGHT), "mm"
    )
    mm = factor(unit, "mm") or 1.0
    right, forward, up = (value * mm for value in settings.get("nodal", (0.0, 0.0, 0.0)))
    origin = settings.get("origin", [0, 0, 0])
    rig = CameraRig(
        kind,
        found,
        unit,
        settings.get("length", 0.0) * mm,
        settings.get("extension", 0.0) * mm,
        (right, forward, up),
        tuple(settings["boom_table"]) if "boom_table" in settings and found.get("boom") else None,
        None if origin == "first" else tuple(value * mm for value in origin),
        settings.get("heading", 0.0),
        settings.get("file_unit", unit),
        settings.get("order"),
        settings.get("up"),
        frozenset(settings.get("ignore", ())),
    )
    try:
        rig.firmware()
    except ToolError as error:
        raise AxesFileError(f"{where}: {error}") from None
    return rig


def _joint(
    name: str, kind: int, settings: Mapping[str, Any], axes: Sequence[Axis], where: str
) -> Axis | None:
    """Return the axis of a joint, or None. An axis that another key names is that one's."""
    wanted = [settings.get(name, name)]
    if name not in settings:
        if kind == reference.X_Y_Z and name in _ALSO:
            wanted.append(_ALSO[name])
        named = {str(settings[key]).lower() for key in _JOINTS if key in settings}
        wanted = [text for text in wanted if text not in named]
    axis = next((a for text in wanted for a in axes if a.name.lower() == text.lower()), None)
    if axis is None:
        if settings.get(name):
            raise AxesFileError(
                f'{where}: "{name}": expected the name of an axis '
                f"({', '.join(a.name for a in axes)}), found {settings[name]!r}"
            )
        return None
    if factor(axis.unit, _unit(name)) is None:
        raise AxesFileError(
            f"{where}: expected axis {axis.name} in a unit such as {_unit(name)}, found {axis.unit}"
        )
    return axis


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 80 else text[:80] + "…"
