"""Precision of the firmware's kinematics against double precision: `python -m
framestep_tools.bench.virtual_precision`.

It runs the firmware's own code here (its numbers are integers, the same on every runtime) and
compares it with virtual_reference over the whole reach of each rig: the motors' steps for poses of
VIRT_MOVE.
"""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from framestep.base.results import ERR_RANGE
from framestep.virtual_axes.kinematics.kinematics import Configuration
from framestep.virtual_axes.requests import read_configuration

from ..judge.virtual_reference import BOOM_SWING_TRACK, NAMES, Y_SWING_TRACK, Axis, Rig
from ..move.kinematics import MOTORS, Firmware, Refused, frame

BANDS = (60, 80, 88)  # degrees of boom and swing; the last is the end of an arm's reach

_HEAD = (Axis(4, 2000.0, 90.0), Axis(5, 2000.0), Axis(6, 2000.0))
_NODAL = (120.0, -80.0, 60.0)
_TABLE = tuple(round(2000 * k + 3 * k * k) for k in range(-60, 61))

# A track of 20 m and heights of 2 m at 1000 steps per millimetre, angles at 2000 steps per degree
RIGS = {
    "boom-swing-track": Rig(
        1, (Axis(1, 2000.0), Axis(2, 2000.0), Axis(3, 1000.0), *_HEAD), 1200.0, 300.0, _NODAL
    ),
    "the same, boom table": Rig(
        1,
        (Axis(1, 2000.0), Axis(2, 2000.0), Axis(3, 1000.0), *_HEAD),
        1200.0,
        300.0,
        _NODAL,
        _TABLE,
    ),
    "swing-pan": Rig(2, (Axis(1, 2000.0), Axis(4, 2000.0))),
    "Y-swing-track": Rig(
        3, (Axis(1, 1000.0), Axis(2, 2000.0), Axis(3, 1000.0), *_HEAD), 1200.0, 300.0, _NODAL
    ),
    "X-Y-Z": Rig(4, (Axis(1, 1000.0), Axis(2, 1000.0), Axis(3, 1000.0), *_HEAD), nodal=_NODAL),
}


def read(rig: Rig) -> Configuration:
    """Return what the firmware reads from a rig's VIRT_CONFIG."""
    found = Configuration()
    if not read_configuration(frame(rig.payload()), rig.kind, MOTORS, found):
        raise Refused(ERR_RANGE)
    return found


def joints(rig: Rig, count: int, limit: float, seed: int = 1) -> np.ndarray:
    """Return joints over a rig's whole reach: boom and swing up to ±limit degrees, the swing on
    either side of the column."""
    random = np.random.default_rng(seed)
    spans = {
        "TRACK": 20000,
        "X": 20000,
        "Z": 20000,
        "Y": 2000,
        "BOOM": min(limit, 59.9) if rig.table else limit,
        "SWING": limit,
        "PAN": 360,
        "TILT": 90,
        "ROLL": 180,
    }
    out = np.array([random.uniform(-spans[name], spans[name], count) for name in NAMES[rig.kind]]).T
    for i, name in enumerate(NAMES[rig.kind]):
        if name in ("TRACK", "X", "Z"):
            out[:, i] = np.abs(out[:, i])
        if name == "SWING":
            out[: count // 4, i] += 180
    return out


def cases(
    rig: Rig, count: int, limit: float, seed: int = 1
) -> list[tuple[dict[int, int], np.ndarray, np.ndarray]]:
    """Return present steps of the motors, a pose that VIRT_MOVE can request, and its steps."""
    found = []
    for near in joints(rig, count, limit, seed):
        stand = {
            axis.motor: int(step)
            for axis, step in zip(rig.axes, rig.steps(near).round(), strict=True)
        }
        near = rig.joints(list(stand.values()))
        pose = rig.forward(near).round(5)
        found.append((stand, pose, rig.steps(rig.inverse(pose, near))))
    return found


def errors(rig: Rig, count: int, limit: float, seed: int = 1) -> np.ndarray:
    """Return the firmware's motor steps minus the double-precision ones, one row per pose."""
    firmware = Firmware.of(rig)
    rows = []
    for stand, pose, wanted in cases(rig, count, limit, seed):
        firmware.locate(stand)
        firmware.inverse(pose)
        rows.append(firmware.steps()[: len(wanted)] - wanted)
    return np.abs(rows)


def main(count: Annotated[int, typer.Option(help="Poses per rig and band.")] = 5000) -> None:
    """Print the greatest error of each motor, in steps."""
    out = Table(title=f"Greatest error in steps over {count} poses each", title_justify="left")
    for heading in ("rig", "boom, swing to", *(f"axis {i + 1}" for i in range(6))):
        out.add_column(heading)
    for name, rig in RIGS.items():
        bands: Sequence[int] = (
            BANDS if rig.kind in (BOOM_SWING_TRACK, Y_SWING_TRACK) else BANDS[-1:]
        )
        for limit in bands:
            worst = errors(rig, count, limit).max(axis=0)
            out.add_row(
                name, f"±{limit}°" if len(bands) > 1 else "", *(f"{error:.4f}" for error in worst)
            )
    Console(width=120).print(out)


if __name__ == "__main__":
    typer.run(main)
