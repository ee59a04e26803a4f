"""Judges virtual motions from the edges: straight, within a step of the exact inverse, within the
motors' limits."""

from dataclasses import replace

import numpy as np

from framestep.protocol import messages as m
from framestep_tools.judge.virtual_reference import Axis, Rig
from framestep_tools.payloads import HardStop, MotorResetPosition, VirtConfig, VirtGetPosition
from host_tests.end_to_end.session import Session, assert_within, simulated

XYZ = Rig(
    4, tuple(Axis(i + 1, 1000.0, p) for i, p in enumerate((10.0, -20.0, 300.0, 5.0, -3.0, 0.0)))
)
NODAL = Rig(4, XYZ.axes, nodal=(20.0, 35.5, -12.0))
ARM = (3.0, 10.0, 3100.0, -10.0, -3.0, 0.0)  # the pose's numbers at the beginning
STEPS = (250.0, 300.0, 80.0, 250.0, 250.0, 250.0)
BOOM = Rig(
    1,
    tuple(Axis(i + 1, n, p) for i, (n, p) in enumerate(zip(STEPS, ARM, strict=True))),
    length=857.7,
    extension=78.0,
)
BOOM_NODAL = replace(BOOM, nodal=(20.0, 35.5, -12.0))
# the same, raised by 3 degrees and swung out by 10 at its configuration
SWUNG = replace(
    BOOM,
    axes=tuple(
        replace(axis, step=step)
        for axis, step in zip(BOOM.axes, (750, 3000, 0, -2500, -750, 0), strict=True)
    ),
)
COLUMN = Rig(
    3, (Axis(1, 100.0, 30.0), *BOOM.axes[1:]), length=600.0, extension=-20.0,
    nodal=(0.0, 50.0, 10.0),
)  # fmt: skip
SWING_PAN = Rig(2, (Axis(3, 500.0), Axis(2, 100.0)))


def pose_of(p):
    return np.array([p.track, p.east_west, p.north_south, p.pan, p.tilt, p.roll]) / 100000


def pose(session):
    return pose_of(session.ask(VirtGetPosition()))


def configured(rig: Rig, velocity=20_000, acceleration=50_000, settings=None, motors=8) -> Session:
    """Return a session with this rig configured, its axes at their places."""
    session = simulated(settings, motors)
    for axis in rig.axes:
        if axis.motor:
            session.speed(axis.motor, velocity, acceleration)
            session.accept(MotorResetPosition(axis.motor, axis.step))
    session.accept(VirtConfig.unpack(rig.payload())).forget()
    return session


def joints(rig, steps):
    """Return the joints for motor steps, an array with a row per moment or one row; of motors, in
    the order of their numbers."""
    return np.stack(
        [
            h + (steps[..., a.motor - 1] - a.step) / a.steps_per_unit
            if a.motor
            else 0.0 * steps[..., 0]
            for a, h in zip(rig.axes, rig.home, strict=True)
        ],
        axis=-1,
    )


def exact(rig, base, way, s, near):
    """Return the motors' steps for points of a line, by the inverse in double precision, in
    rows."""
    rows = []
    for x in s:
        near = rig.inverse(base + x * way, near)
        rows.append(rig.steps(near))
    return np.array(rows)


class Track:
    """Where every motor of a session was at every millisecond, by the edges since `forget`."""

    def __init__(self, session, before, begin=None, end=None):
        self.steps = {n: session.steps(n) for n in before}
        moving = [t for t, _ in self.steps.values() if len(t)]
        self.begin = min(t[0] for t in moving) if begin is None else begin
        self.end = max(t[-1] for t in moving) if end is None else end
        self.times = np.arange(self.begin - 0.002, self.end + 0.003, 0.001)
        rows = []
        for n in sorted(before):
            times, signs = self.steps[n]
            place = before[n] + np.concatenate(([0], np.cumsum(signs)))
            rows.append(place[np.searchsorted(times, self.times, side="right")])
        self.places = np.stack(rows, axis=-1)

    def limits(self, velocity, acceleration):
        """Assert that each motor stays within its velocity and acceleration."""
        for times, signs in self.steps.values():
            if len(times) > 2:
                assert_within(times, signs, velocity, acceleration)


def worst_error(rig, track, base, way, length):
    """Return the greatest distance of any motor at any millisecond from the exact inverse of one
    point of the line, in steps; and that point's s at every millisecond.

    The point is the one with the least distance: this does not check where along the line the rig
    should be.
    """
    columns = [i for i, a in enumerate(rig.axes) if a.motor]
    numbers = [rig.axes[i].motor - 1 for i in columns]
    near = joints(rig, track.places[0])
    # first by the place of the camera; then once more close to it, where the motors are nearly
    # linear
    at = np.array(
        [(rig.forward(joints(rig, row)) - base) @ way / (way @ way) for row in track.places]
    )
    at = np.clip(at, 0, length)
    places = track.places[:, numbers]
    for _ in range(2):
        low, high = np.maximum(at - length * 1e-7, 0), np.minimum(at + length * 1e-7, length)
        here = exact(rig, base, way, low, near)[:, columns] - places
        slope = (exact(rig, base, way, high, near)[:, columns] - places - here) / (high - low)[
            :, None
        ]
        at = np.clip(low + _least(here, slope, -low, length - low), 0, length)
    return float(np.abs(exact(rig, base, way, at, near)[:, columns] - places).max()), at


def _least(here, slope, begin, end):
    """Return where between begin and end the greatest ||here + slope·x| of each row is least."""
    for _ in range(80):
        third = (end - begin) / 3
        left = np.abs(here + slope * (begin + third)[:, None]).max(axis=1)
        right = np.abs(here + slope * (end - third)[:, None]).max(axis=1)
        begin, end = (
            np.where(left > right, begin + third, begin),
            np.where(left > right, end, end - third),
        )
    return begin


def assert_straight(rig, session, before, way, length, within=1.0):
    """Assert that the motion since `forget` follows a line of that length, each motor within a step
    of the inverse."""
    assert not session.events(HardStop)
    track = Track(session, before)
    base = rig.forward(joints(rig, track.places[0]))
    error, s = worst_error(rig, track, base, np.asarray(way, float), length)
    assert error <= within, f"{error:.3f} steps beside the line"
    return track, s


UNIT = {
    number: np.eye(6)[number - 1] for number in range(m.VIRT_MOTOR_TRACK, m.VIRT_MOTOR_ROLL + 1)
}
