"""Virtual motions judged from the edges: straight, within a step of the exact inverse, within the motors' limits."""

import numpy as np

from framestep.protocol import messages as m
from framestep_tools.payloads import HardStop, VirtConfig
from framestep_tools.virtual_reference import Rig
from host_tests.end_to_end.session import Session, assert_within, simulated

SETTLED_S = 0.05


def configured(rig: Rig, velocity=20_000, acceleration=50_000, settings=None, motors=8) -> Session:
    """A session with this rig configured; its axes stand where it says."""
    session = simulated(settings, motors)
    for axis in rig.axes:
        if axis.motor:
            session.speed(axis.motor, velocity, acceleration)
    session.accept(VirtConfig.unpack(rig.payload()))
    session.forget()
    return session


def joints(rig, steps):
    """Joints for motor steps, an array of a row per moment or one row; of motors, in the order of their numbers."""
    return np.stack(
        [
            a.position + (steps[..., a.motor - 1] - a.step) / a.steps_per_unit
            if a.motor
            else 0 * steps[..., 0] + a.position
            for a in rig.axes
        ],
        axis=-1,
    )


def exact(rig, base, way, s, near):
    """The motors' steps for points of a line, by the inverse in double precision: a row per s."""
    rows = []
    for x in s:
        near = rig.inverse(base + x * way, near)
        rows.append(rig.steps(near))
    return np.array(rows)


class Track:
    """Where every motor of a session was at every millisecond, from the edges since `forget`."""

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
        """Each motor stays within its velocity and acceleration."""
        for times, signs in self.steps.values():
            if len(times) > 2:
                assert_within(times, signs, velocity, acceleration)


def worst_error(rig, track, base, way, length):
    """The greatest distance of any motor at any millisecond from the exact inverse of one and the same point of the
    line, in steps; and that point's s at every millisecond.

    The point is the one that makes the distance least: where along the line the rig should be by now is not asked.
    """
    numbers = [a.motor - 1 for a in rig.axes if a.motor]
    near = joints(rig, track.places[0])
    grid = np.linspace(0, length, 501)
    table = exact(rig, base, way, grid, near)
    columns = [i for i, a in enumerate(rig.axes) if a.motor]
    table = table[:, columns]
    at = np.zeros(len(track.times))
    for k, place in enumerate(track.places[:, numbers]):
        # the grid's best, then between its neighbours, where the motors are as good as linear
        best = np.abs(table - place).max(axis=1).argmin()
        low, high = max(best - 1, 0), min(best + 1, len(grid) - 1)
        fine = np.linspace(0, 1, 201)
        error = np.inf
        for a, b in ((low, best), (best, high)):
            between = table[a] + fine[:, None] * (table[b] - table[a])
            found = np.abs(between - place).max(axis=1)
            if found.min() < error:
                error, at[k] = found.min(), grid[a] + fine[found.argmin()] * (grid[b] - grid[a])
    true = exact(rig, base, way, np.clip(at, 0, length), near)[:, columns]
    return float(np.abs(true - track.places[:, numbers]).max()), at


def assert_straight(rig, session, before, way, length, within=1.0):
    """What has moved since `forget` has gone along a line of that length, each motor within a step of the inverse."""
    assert not session.events(HardStop)
    track = Track(session, before)
    base = rig.forward(joints(rig, track.places[0]))
    error, s = worst_error(rig, track, base, np.asarray(way, float), length)
    assert error <= within, f"{error:.3f} steps beside the line"
    return track, s


UNIT = {number: np.eye(6)[number - 1] for number in range(m.VIRT_MOTOR_TRACK, m.VIRT_MOTOR_ROLL + 1)}
