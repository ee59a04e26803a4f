"""`make plots`: draw the virtual axes' rigs, docs/use/virtual-*.svg.

virtual_reference.py gives every line for the pose in POSES, with the signs and lengths that the
tests require of the firmware. On the left the rig from above, in the middle from the side, on the
right the camera with its angles and the nodal offset.
"""

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from ..building.board_files import ROOT
from ..errors import Command
from ..judge.virtual_reference import (
    BOOM_SWING_TRACK,
    SWING_PAN,
    X_Y_Z,
    Y_SWING_TRACK,
    Axis,
    Rig,
    looks,
    rotation,
)
from .plot_interpolation import _short

FOLDER = ROOT / "docs/use"
FILES = {
    BOOM_SWING_TRACK: "virtual-boom-swing-track.svg",
    SWING_PAN: "virtual-swing-pan.svg",
    Y_SWING_TRACK: "virtual-y-swing-track.svg",
    X_Y_Z: "virtual-x-y-z.svg",
}
TITLES = {
    BOOM_SWING_TRACK: "type 1, boom-swing-track",
    SWING_PAN: "type 2, swing-pan",
    Y_SWING_TRACK: "type 3, Y-swing-track",
    X_Y_Z: "type 4, X-Y-Z",
}
# Joints of the drawn pose
POSES = {
    BOOM_SWING_TRACK: (28.0, 35.0, 250.0, -15.0, 0.0, 0.0),
    SWING_PAN: (35.0, -15.0),
    Y_SWING_TRACK: (420.0, 35.0, 250.0, -15.0, 0.0, 0.0),
    X_Y_Z: (350.0, 420.0, -400.0, 20.0, 0.0, 0.0),
}
# COLUMN: distance of the drawn track below the boom's axis
LENGTH, EXTENSION, COLUMN = 800.0, 260.0, -420.0

_METAL = {"color": "0.25", "linewidth": 3.0, "solid_capstyle": "round"}
_THIN = {"color": "0.55", "linewidth": 0.8}
_VIRTUAL = "tab:blue"
_JOINT = "tab:orange"


def rig(kind: int) -> Rig:
    """Return the rig to draw, without nodal offset, which has its own drawing on the right."""
    axes = tuple(Axis(i + 1) for i in range(2 if kind == SWING_PAN else 6))
    return Rig(kind, axes, LENGTH, EXTENSION)


class _View:
    """An axes object that looks at the world from one side. across, up: one of X, Y, Z, with
    signs."""

    def __init__(self, axes: Any, title: str, across: tuple[int, int], up: tuple[int, int]):
        self.axes = axes
        self._across, self._up = across, up
        axes.set_title(title, fontsize=9)
        axes.set_aspect("equal")
        axes.axis("off")

    def flat(self, point: Any) -> tuple[float, float]:
        """Return a world point's place on the paper."""
        return self._across[1] * point[self._across[0]], self._up[1] * point[self._up[0]]

    def line(self, a: Any, b: Any, **style: Any) -> None:
        """Draw a line between two points of the world."""
        (x, y), (u, v) = self.flat(a), self.flat(b)
        self.axes.plot([x, u], [y, v], **style)

    def arrow(
        self, a: Any, b: Any, colour: str, text: str = "", shift: tuple[float, float] = (0, 0)
    ) -> None:
        """Draw an arrow from a to b, with a text at its head."""
        (x, y), (u, v) = self.flat(a), self.flat(b)
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
        self.axes.annotate("", (u, v), (x, y), arrowprops=style)
        if text:
            self.text((u + shift[0], v + shift[1]), text, colour)

    def text(
        self, at: tuple[float, float], text: str, colour: str = "black", **options: Any
    ) -> None:
        """Draw a text at a place of the paper."""
        self.axes.text(*at, text, color=colour, fontsize=8, ha="center", va="center", **options)

    def arc(
        self, centre: Any, radius: float, begin: float, end: float, colour: str, text: str
    ) -> None:
        """Draw an arc with an arrow head at its end. Angles are degrees on the paper,
        counter-clockwise from the right."""
        x, y = self.flat(centre)
        angles = np.radians(np.linspace(begin, end, 30))
        points = np.column_stack((x + radius * np.cos(angles), y + radius * np.sin(angles)))
        self.axes.plot(*points[:-1].T, color=colour, linewidth=1.2)
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
        self.axes.annotate("", points[-1], points[-3], arrowprops=style)
        middle = np.radians((begin + end) / 2)
        self.text(
            (x + 1.22 * radius * np.cos(middle), y + 1.22 * radius * np.sin(middle)), text, colour
        )

    def sweep(self, point: Callable[[float], Any], colour: str) -> None:
        """Draw an arrow along point(t), t from 0 to a right angle."""
        points = np.array([self.flat(point(t)) for t in np.linspace(0, np.pi / 2, 20)])
        self.axes.plot(*points[:-1].T, color=colour, linewidth=1.2)
        style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
        self.axes.annotate("", points[-1], points[-3], arrowprops=style)

    def measure(self, a: Any, b: Any, text: str, aside: tuple[float, float]) -> None:
        """Draw a length between two points, with its text next to the middle."""
        (x, y), (u, v) = self.flat(a), self.flat(b)
        style = {"arrowstyle": "<->", "color": "0.4", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
        dx, dy = aside
        self.axes.annotate("", (u + dx, v + dy), (x + dx, y + dy), arrowprops=style)
        self.text(((x + u) / 2 + 2.1 * dx, (y + v) / 2 + 2.1 * dy), text, "0.3")

    def camera(self, place: Any, pan: float, tilt: float) -> None:
        """Draw a camera and its direction of view."""
        forward = looks(pan, tilt)
        side = rotation(pan, tilt, 0)[:, 0]  # direction to the camera's right
        right = np.array([side[0], side[2], -side[1]])
        up = np.cross(right, forward)
        broad = right if abs(right[self._across[0]]) + abs(right[self._up[0]]) > 0.5 else up
        corners = [place + 90 * broad, place - 90 * broad, place - 170 * forward - 90 * broad]
        corners += [place - 170 * forward + 90 * broad, place + 90 * broad]
        self.axes.fill(
            *np.array([self.flat(c) for c in corners]).T, color="0.8", ec="0.25", lw=1, zorder=3
        )
        self.axes.plot(*self.flat(place), "o", color=_VIRTUAL, markersize=5, zorder=4)
        self.line(place, place + 420 * forward, color=_VIRTUAL, linewidth=1, linestyle="--")


def _world(pose: Any) -> np.ndarray:
    return np.array([pose[1], pose[2], pose[0]])


def _compass(view: _View, at: Any, directions: dict[str, Any]) -> None:
    """Draw the world's axes."""
    for text, way in directions.items():
        end = np.array(at, float) + 330 * np.array(way, float)
        x, y = view.flat(np.array(way, float))
        view.arrow(at, end, "black", text, (150 * x, 75 * y))


def _above(axes: Any, kind: int) -> None:
    view = _View(axes, "from above", (0, 1), (2, -1))
    drawn, joints = rig(kind), POSES[kind]
    pose = drawn.forward(joints)
    if kind == X_Y_Z:
        place = _world(pose)
        view.line([-700, 0, place[2]], [900, 0, place[2]], **_METAL)
        view.line([place[0], 0, 500], [place[0], 0, -900], **_THIN)
        view.arrow([0, 0, place[2]], place, _JOINT, "X", (-120, 60))
        view.arrow([place[0], 0, 0], place, _JOINT, "Z < 0", (-150, -170))
        view.line([-200, 0, 0], [700, 0, 0], **_THIN, linestyle=":")
        view.line([0, 0, 300], [0, 0, -700], **_THIN, linestyle=":")
        view.text((-130, -60), "0", "0.4")
    else:
        track = joints[2] if kind != SWING_PAN else 0.0
        swing = joints[0] if kind == SWING_PAN else joints[1]
        reach = (
            LENGTH + EXTENSION
            if kind != BOOM_SWING_TRACK
            else LENGTH * np.cos(np.radians(joints[0])) + EXTENSION
        )
        sine, cosine = np.sin(np.radians(swing)), np.cos(np.radians(swing))
        column = np.array([0.0, 0.0, track])
        place = column + reach * np.array([sine, 0.0, -cosine])
        if kind != SWING_PAN:
            np.testing.assert_allclose(place[[0, 2]], _world(pose)[[0, 2]])
            view.line([0, 0, 500], [0, 0, -1150], color="0.7", linewidth=5, solid_capstyle="butt")
            view.line([-250, 0, 0], [150, 0, 0], **_THIN, linestyle=":")
            view.text((-330, 0), "0", "0.4")
            view.arrow([-170, 0, 0], [-170, 0, track], _JOINT, "track", (-170, 40))
        else:
            view.line(column, column + [0, 0, -900], **_THIN, linestyle=":")
        view.line(column, place, **_METAL)
        view.axes.plot(*view.flat(column), "o", color="0.25", markersize=9)
        if kind != SWING_PAN:
            end = column + (reach - EXTENSION) * np.array([sine, 0.0, -cosine])
            view.axes.plot(*view.flat(end), "o", color="0.25", markersize=5)
            view.measure(column, place, "reach", (85 * cosine, -85 * sine))
            view.arrow([0, 0, place[2]], place, _VIRTUAL, "vEW", (-280, 60))
            view.line([150, 0, 0], [820, 0, 0], **_THIN, linestyle=":")
            view.arrow([780, 0, 0], [780, 0, place[2]], _VIRTUAL, "vTrack < 0", (0, 60))
        view.arc(column, 520, 90, 90 - swing, _JOINT, "+swing")
    pan = pose[3]
    view.line(place, place + [0, 0, -400], **_THIN, linestyle=":")
    view.camera(place, pan, 0)
    view.arc(place, 330, 90, 90 + pan, _VIRTUAL, "+vPan")
    if kind == SWING_PAN:
        view.text(
            (650, -150),
            "vPan = pan + swing\nno lengths are known:\nvTrack = vEW = vNS = 0",
            _VIRTUAL,
        )
    elif kind != X_Y_Z:
        view.text((650, -420), "vTrack = track − reach·cos(swing)\nvPan = pan + swing", _VIRTUAL)
    _compass(view, [-800, 0, -300], {"EW +X": (1, 0, 0), "track +Z": (0, 0, 1)})
    view.arrow([-800, 0, -300], [-800, 0, -750], "0.5", "forward,\nto the set (−Z)", (0, 90))
    axes.set_xlim(-1100, 1250)
    axes.set_ylim(-620, 1180)


def _side(axes: Any, kind: int) -> None:
    view = _View(axes, "from the right side", (2, -1), (1, 1))
    drawn, joints = rig(kind), np.array(POSES[kind])
    if kind == SWING_PAN:
        axes.axis("off")
        column, place = np.array([0.0, 0.0, 0.0]), np.array([0.0, 0.0, -(LENGTH + EXTENSION)])
        view.line(column + [0, COLUMN, 0], column, **_METAL)
        view.line(column, place, **_METAL)
        view.camera(place, 0, 0)
        view.text((700, -150), "the arm is level; its length does not matter", "0.3")
    elif kind == X_Y_Z:
        place = _world(drawn.forward(joints))
        place[0] = 0
        view.line([0, COLUMN, place[2]], [0, 900, place[2]], **_METAL)
        view.line([0, 0, 500], [0, 0, -900], **_THIN, linestyle=":")
        view.text((-420, -70), "0", "0.4")
        view.arrow([0, 0, place[2]], place, _JOINT, "Y", (-70, -230))
        view.camera(place, 0, 0)
        view.text(
            (1000, -200),
            "vEW = X   vNS = Y   vTrack = Z\nvPan, vTilt, vRoll = PAN, TILT, ROLL",
            _VIRTUAL,
        )
    else:
        # the arm swung to the front, so its lengths are true
        flat = joints.copy()
        flat[1] = flat[3] = 0
        place = _world(drawn.forward(flat))
        column = np.array([0.0, 0.0, flat[2]])
        view.line(
            [0, COLUMN, 500], [0, COLUMN, -1150], color="0.7", linewidth=5, solid_capstyle="butt"
        )
        elbow = place + [0, 0, EXTENSION]
        if kind == BOOM_SWING_TRACK:
            top = column
            view.line(top, top + [0, 0, -900], **_THIN, linestyle=":")
            view.arc(top, 480, 0, flat[0], _JOINT, "+boom")
            view.measure(top, elbow, "LENGTH", (-60, 100))
            view.text(
                (620, -230), "reach = LENGTH·cos(boom) + EXT\nvNS = LENGTH·sin(boom)", _VIRTUAL
            )
        else:
            top = column + [0, flat[0], 0]
            view.line(column, column + [0, 0, -1100], **_THIN, linestyle=":")
            view.arrow(column + [0, 0, -140], top + [0, 0, -140], _JOINT, "Y", (60, -70))
            view.measure(top, elbow, "LENGTH", (0, 90))
            view.text((620, -230), "reach = LENGTH + EXT\nvNS = Y", _VIRTUAL)
        view.line([0, COLUMN, column[2]], top, **_METAL)
        view.line(top, elbow, **_METAL)
        view.line(elbow, place, **_METAL)
        view.axes.plot(*view.flat(elbow), "o", color="0.25", markersize=5)
        view.measure(elbow, place, "EXT", (0, 150))
        view.camera(place, 0, 0)
        view.arrow(
            place * [0, 0, 1] + [0, 0, -200], place + [0, 0, -200], _VIRTUAL, "vNS", (110, -110)
        )
    _compass(view, [0, 700, 500], {"NS +Y": (0, 1, 0)})
    view.arrow([0, 700, 500], [0, 700, 50], "0.5", "forward (−Z)", (60, 60))
    axes.set_xlim(-800, 1450)
    axes.set_ylim(-560, 1180)


def _head(axes: Any, kind: int) -> None:
    """Draw the camera from its side, with the nodal offset and the signs of its angles."""
    if kind == SWING_PAN:  # it has neither
        axes.axis("off")
        return
    view = _View(axes, "the camera", (0, 1), (1, 1))

    def slanted(right: float, forward: float, up: float) -> np.ndarray:
        """Return a place on the paper: x to the lower right, y to the right, z up."""
        return np.array([0.42 * right + forward, up - 0.32 * right, 0.0])

    centre = slanted(0, 0, 0)
    for text, way, shift in (
        ("x, right", (430, 0, 0), (-110, 0)),
        ("y, forward", (0, 580, 0), (60, -45)),
        ("z, up", (0, 0, 430), (0, 45)),
    ):
        view.arrow(centre, slanted(*way), "0.5", text, shift)
    nodal = (200, 330, 170)
    corners = [(0, 0, 0), (nodal[0], 0, 0), (nodal[0], nodal[1], 0), nodal]
    for a, b, text, shift in zip(
        corners, corners[1:], ("X", "Y", "Z"), ((-45, -10), (0, -45), (40, 0)), strict=False
    ):
        view.line(slanted(*a), slanted(*b), color="0.3", linewidth=1.4)
        x, y, _ = (slanted(*a) + slanted(*b)) / 2
        view.text((x + shift[0], y + shift[1]), text, "0.3")
    view.arrow(
        centre, slanted(*nodal), "tab:green", "nodal point:\nthe pose is its place", (-130, 75)
    )
    view.axes.plot(*view.flat(centre), "o", color="0.25", markersize=8)
    view.text((-190, -60), "where pan, tilt\nand roll meet", "0.25")
    view.sweep(lambda t: slanted(120 * np.cos(t), 120 * np.sin(t), 330), _VIRTUAL)
    view.text((-170, 330), "+pan: from x\ntoward y, left", _VIRTUAL)
    view.sweep(lambda t: slanted(440, 100 * np.cos(t), 100 * np.sin(t)), _VIRTUAL)
    view.text((330, -250), "+tilt: from y toward z, up", _VIRTUAL)
    view.sweep(lambda t: slanted(120 * np.sin(t), 450, 120 * np.cos(t)), _VIRTUAL)
    view.text((690, 120), "+roll: from z\ntoward x", _VIRTUAL)
    view.text((130, -320), "Rz(pan)·Rx(tilt)·Ry(roll)", _VIRTUAL)
    axes.set_xlim(-350, 850)
    axes.set_ylim(-360, 500)


def draw(kind: int, out: str | os.PathLike[str]) -> None:
    """Draw a type as SVG. The same source makes the same file, byte for byte."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    with plt.rc_context({"svg.hashsalt": "framestep", "svg.fonttype": "none", "font.size": 9}):
        figure, (above, side, head) = plt.subplots(
            1, 3, figsize=(13, 4.2), width_ratios=(1.2, 1.2, 1.0)
        )
        figure.suptitle(TITLES[kind])
        _above(above, kind)
        _side(side, kind)
        _head(head, kind)
        figure.text(0.01, 0.02, "orange: the rig's own axes", color=_JOINT, fontsize=8)
        blue = "blue: virtual axes"
        if kind != SWING_PAN:
            blue += ", from the formulas' zero; the host counts from its pose in VIRT_CONFIG"
        figure.text(0.16, 0.02, blue, color=_VIRTUAL, fontsize=8)
        figure.tight_layout()
        drawn = io.StringIO()
        figure.savefig(drawn, format="svg", metadata={"Date": None})
        plt.close(figure)
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    Path(out).write_text(_short(drawn.getvalue()))


app = Command("plot_virtuals")


@app.command()
def main(folder: Annotated[Path, typer.Option(help="where to", metavar="FOLDER")] = FOLDER) -> int:
    """Draw the rigs of the virtual axes."""
    for kind, name in FILES.items():
        draw(kind, folder / name)
        print(f"{folder / name}: {(folder / name).stat().st_size // 1000} kB")
    return 0


if __name__ == "__main__":
    app()
