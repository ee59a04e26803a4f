"""How a format writes a camera: names of its columns, order of its rotations, directions of its
axes.

A pose is that of virtual axes (field note 9.4): x to the right, y up, z back, in millimetres; pan
to the left, tilt up, roll clockwise, in degrees. The camera at rest looks along -z.
"""

from dataclasses import dataclass, replace

import numpy as np

Vectors = np.ndarray  # a row per frame

_AHEAD = 1000.0  # millimetres to the point that a camera looks at


@dataclass(frozen=True)
class Camera:
    """Names and directions of a format's camera.

    position: names of its three lengths; rotations: names of its angles, each with the axis that it
    turns about, in the order in which they are carried out; a minus before the axis: the other way
    target: names of a point that the camera looks at, before the rotations
    right, up, back: the file's axes in these directions, such as "-y"; own: whether its camera has
    the same three axes, not x to the right, y up and z back
    level: its angles are roll, tilt and pan, whatever is up; fixed: it does not depend on the user
    """

    position: tuple[str, str, str]
    rotations: tuple[tuple[str, str], ...]
    target: tuple[str, str, str] | None = None
    right: str = "x"
    up: str = "y"
    back: str = "z"
    own: bool = False
    level: bool = False
    fixed: bool = False

    @property
    def names(self) -> list[str]:
        """Names of all columns."""
        return [*self.position, *(self.target or ()), *(name for name, _ in self.rotations)]

    def changed(self, order: str | None, up: str | None) -> "Camera":
        """Return it with another order of its three rotations, such as "XYZ": about x first; and
        with y or z up in the file."""
        if self.fixed:
            return self
        changed = self
        if order and not self.level:
            turns = {axis[-1].upper(): (name, axis) for name, axis in self.rotations}
            chosen = tuple(turns[letter] for letter in order if letter in turns)
            changed = replace(changed, rotations=chosen)
        if up == "z":
            changed = replace(changed, right="x", up="z", back="-y")
        return changed

    @property
    def is_direct(self) -> bool:
        """Whether its angles are roll, tilt and pan, one after the other."""
        return self.level or (
            self.target is None
            and (self.right, self.up, self.back) == ("x", "y", "z")
            and [axis[-1] for _, axis in self.rotations] == ["z", "x", "y"]
        )

    @property
    def world(self) -> np.ndarray:
        """Matrix from the file's axes to x, y, z."""
        return np.array([_axis(each) for each in (self.right, self.up, self.back)])

    def places(self, position: Vectors) -> Vectors:
        """Return x, y, z of positions in the file."""
        return position @ self.world.T

    def in_file(self, places: Vectors) -> Vectors:
        """Return positions in the file of x, y, z."""
        return places @ self.world

    def angles(self, position: Vectors, target: Vectors | None, rotations: Vectors) -> Vectors:
        """Return pan, tilt, roll of the file's numbers; angles in degrees."""
        signs = [-1.0 if axis[0] == "-" else 1.0 for _, axis in self.rotations]
        turned = rotations * signs
        if self.is_direct:
            return turned[:, [2, 1, 0]] * (1.0, 1.0, -1.0)
        matrix = np.broadcast_to(np.eye(3), (len(turned), 3, 3))
        for i, (_, axis) in enumerate(self.rotations):
            matrix = about(axis[-1], turned[:, i]) @ matrix
        if self.own:
            matrix = self.world @ matrix @ self.world.T
        elif target is None:
            matrix = self.world @ matrix
        if target is not None:
            ahead = self.places(target) - self.places(position)
            level = np.hypot(ahead[:, 0], ahead[:, 2])
            pan = np.degrees(np.arctan2(-ahead[:, 0], -ahead[:, 2]))
            tilt = np.degrees(np.arctan2(ahead[:, 1], level))
            matrix = about("y", pan) @ about("x", tilt) @ matrix
        return going_on(pan_tilt_roll(matrix))

    def written(self, places: Vectors, angles: Vectors) -> dict[str, Vectors]:
        """Return the columns for x, y, z and pan, tilt, roll by their names: the opposite. The last
        rotation comes first, as pan before tilt and in BVH."""
        columns = dict(zip(self.position, self.in_file(places).T, strict=True))
        if self.is_direct:
            values = angles[:, [2, 1, 0]] * (-1.0, 1.0, 1.0)
        else:
            matrix = of_angles(angles)
            if self.target:
                ahead = places + matrix @ np.array([0.0, 0.0, -_AHEAD])
                columns |= dict(zip(self.target, self.in_file(ahead).T, strict=True))
                values = -angles[:, 2:]
            else:
                matrix = self.world.T @ matrix @ (self.world if self.own else np.eye(3))
                axes = "".join(axis[-1] for _, axis in self.rotations[:3])
                values = going_on(turns_of(matrix, axes))
        for i in reversed(range(len(self.rotations[:3]))):
            name, axis = self.rotations[i]
            columns[name] = values[:, i] * (-1.0 if axis[0] == "-" else 1.0)
        return columns


# What a file without a convention of its own has
OWN = Camera(("x", "y", "z"), (("roll", "-z"), ("tilt", "x"), ("pan", "y")), level=True)
SCENE = replace(OWN, fixed=True)  # of formats that say what is up
ALIASES = {
    "x": ("x", "ew", "vew"), "y": ("y", "ns", "vns"), "z": ("z", "track", "vtrack"),
    "pan": ("pan", "vpan"), "tilt": ("tilt", "vtilt"), "roll": ("roll", "vroll"),
}  # fmt: skip


def _axis(text: str) -> np.ndarray:
    return np.eye(3)["xyz".index(text[-1])] * (-1.0 if text[0] == "-" else 1.0)


def about(axis: str, degrees: Vectors) -> np.ndarray:
    """Return the matrices of rotations about x, y or z."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    out = np.zeros((len(degrees), 3, 3))
    out[:, i, i] = 1.0
    out[:, j, j] = out[:, k, k] = cosine
    out[:, k, j], out[:, j, k] = sine, -sine
    return out


def of_angles(angles: Vectors) -> np.ndarray:
    """Return the matrices of pan, tilt, roll: from the camera's axes to the world's."""
    return about("y", angles[:, 0]) @ about("x", angles[:, 1]) @ about("z", -angles[:, 2])


def pan_tilt_roll(matrix: np.ndarray) -> Vectors:
    """Return pan, tilt, roll of matrices from the camera's axes to the world's."""
    return turns_of(matrix, "zxy")[:, [2, 1, 0]] * (1.0, 1.0, -1.0)


def turns_of(matrix: np.ndarray, axes: str) -> Vectors:
    """Return the angles of rotations about these three axes, one after the other, that together
    are the matrices."""
    i, j, k = ("xyz".index(axis) for axis in axes)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    level = np.hypot(matrix[:, k, j], matrix[:, k, k])
    middle = np.arctan2(-sign * matrix[:, k, i], level)
    first = np.arctan2(sign * matrix[:, k, j], matrix[:, k, k])
    last = np.arctan2(sign * matrix[:, j, i], matrix[:, i, i])
    return np.degrees(np.stack([first, middle, last], axis=1))


def going_on(degrees: Vectors) -> Vectors:
    """Return angles without jumps by full turns."""
    return np.unwrap(degrees, period=360.0, axis=0)
