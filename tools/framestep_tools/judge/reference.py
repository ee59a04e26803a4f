"""The ideal motion of a run, for judging and drawing a played move.

The velocity at a frame, and how far beyond its position a smoothed run passes it, come from the
firmware (slope() in framestep.moves.path.path and .smoothing). Everything else is calculated here
independently in floating point: a cubic Hermite from frame to frame, the end frame's period, and
pre-roll and post-roll from and to rest on a whole step, as framestep/moves/run.py describes them.
It does not include backlash or the way back to the end frame.
"""

from array import array
from collections.abc import Mapping, Sequence

import numpy as np

from framestep.moves.path import path, smoothing

from .judge import frame_times_ns

_FAR = 2**30 - 1  # means no soft limit
_UNLIMITED = float("inf")
Limits = tuple[int | None, int | None]  # lower and upper soft limit, steps


def slopes(
    positions: Sequence[int] | np.ndarray,
    first: int,
    last: int,
    limits: Limits = (None, None),
    smooth: bool = True,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the velocity at each frame from index `first` to `last` (backward if that is less), in
    steps per played frame, and how far beyond its position the frame is passed, in steps.

    limits: the motor's soft limits; smooth: setting `smoothing` of the rig file.
    """
    step = 1 if last >= first else -1
    beside = path.BESIDE if smooth else 2
    window = array("i", [0] * (path.SMOOTH_WORDS if smooth else path.WINDOW_WORDS))
    bounds = array(
        "i",
        (far if limit is None else limit for limit, far in zip(limits, (-_FAR, _FAR), strict=True)),
    )
    bounds.append(0)
    found, beyond = [], []
    for index in range(first, last + step, step):
        reach = np.arange(-beside, beside + 1) * step
        around = np.clip(index + reach, 0, len(positions) - 1)
        for word, frame in enumerate(around):
            window[path.FRAMES + word] = int(positions[frame])
        before, after = (index, len(positions) - 1 - index)[::step]
        if smooth:
            slope = smoothing.slope(window, bounds, before, after)
            found.append(slope / 2 ** window[smoothing.BITS])
            beyond.append(window[path.PART] / 2**16)
        else:
            window[path.MOST] = path.MONOTONE
            found.append(path.slope(window, bounds, before, after))
            beyond.append(0.0)
    return np.array(found) / path.TWELFTHS, np.array(beyond)


class Reference:
    """Ideal position, velocity and acceleration of each motor in one lap of a run.

    positions       the whole upload: steps of each motor at every frame
    pre_ms, post_ms as in RUN_MOVE. Raises ValueError for 0 if a motor moves at its first or last
                    frame, because the device then chooses the roll
    first, last     indices of the frames played, the whole upload if not given
    limits          soft limits (lower, upper) of motors that have them, in steps
    velocities      the motors' velocity settings, steps/s, which they do not exceed at a frame
    accelerations   their settings, steps/s²: a ramp that would exceed them by beginning or ending
                    beside a whole step begins or ends on it
    smooth          setting `smoothing` of the rig file

    Times are seconds after the first frame played. Outside the rolls a motor is at rest.
    """

    def __init__(
        self,
        positions: Mapping[int, Sequence[int] | np.ndarray],
        fps_milli: int,
        pre_ms: float,
        post_ms: float,
        first: int = 0,
        last: int | None = None,
        limits: Mapping[int, Limits] | None = None,
        velocities: Mapping[int, int] | None = None,
        smooth: bool = True,
        accelerations: Mapping[int, int] | None = None,
    ):
        self.smooth = smooth
        self._pieces: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        for motor, steps in positions.items():
            end = len(steps) - 1 if last is None else last
            way = 1 if end >= first else -1
            frames = np.arange(first, end + way, way)
            p = np.asarray(steps, np.int64)[frames]
            v, beyond = slopes(steps, first, end, (limits or {}).get(motor, (None, None)), smooth)
            v *= fps_milli / 1000
            if velocities and motor in velocities:
                v = np.clip(v, -velocities[motor], velocities[motor])
            t = frame_times_ns(len(frames), fps_milli) * 1e-9
            if len(frames) == 1:
                v, beyond = np.zeros(1), np.zeros(1)
            for what, ms, velocity in (("pre", pre_ms, v[0]), ("post", post_ms, v[-1])):
                if not ms and velocity:
                    raise ValueError(
                        f"motor {motor} moves at the end of the section, "
                        f"a {what}-roll above 0 is needed"
                    )
            # field notes 6.2 and 6.11; the end frame lasts its period, rest is on a whole step
            begins = p[0] + np.floor((1 - v[0] * pre_ms / 1000) / 2)
            period = 10**9 // fps_milli * 1e-6
            lasts = p[-1] + np.floor(v[-1] * period + 1 / 2)
            ends = lasts + np.floor((1 + v[-1] * post_ms / 1000) / 2)
            p = p + beyond
            top = (velocities or {}).get(motor, _UNLIMITED)
            steepest = (accelerations or {}).get(motor, _UNLIMITED)
            if not _gentle(pre_ms / 1000, abs(v[0]), top, steepest):
                p[0] -= beyond[0]
            if _gentle(post_ms / 1000, abs(v[-1]), top, steepest):
                lasts += beyond[-1]
            t = np.append(t, frame_times_ns(len(frames) + 1, fps_milli)[-1] * 1e-9)
            p, v = np.append(p, lasts), np.append(v, v[-1])
            if pre_ms:
                t, p, v = np.append(-pre_ms / 1000, t), np.append(begins, p), np.append(0, v)
            if post_ms:
                t, p, v = np.append(t, t[-1] + post_ms / 1000), np.append(p, ends), np.append(v, 0)
            self._pieces[motor] = t, _cubics(t, p.astype(float), v)

    def __call__(self, motor: int, seconds: np.ndarray) -> np.ndarray:
        """Return the position in steps."""
        return self._value(motor, seconds, 0)

    def velocity(self, motor: int, seconds: np.ndarray) -> np.ndarray:
        """Steps per second."""
        return self._value(motor, seconds, 1)

    def acceleration(self, motor: int, seconds: np.ndarray) -> np.ndarray:
        """Return steps per second squared; at a frame, the acceleration after it."""
        return self._value(motor, seconds, 2)

    def pieces(self, motor: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the times of the knots, and the coefficients of the cubics, constant first: the
        rest before the first knot, from knot to knot, the rest after the last one."""
        return self._pieces[motor]

    def _value(self, motor: int, seconds: np.ndarray, derivative: int) -> np.ndarray:
        t, cubics = self._pieces[motor]
        seconds = np.asarray(seconds, float)
        # piece 0 is the rest before, len(t) the rest after
        at = np.searchsorted(t, seconds, side="right")
        x = seconds - t[np.maximum(at - 1, 0)]
        c = cubics[at].T
        if derivative == 0:
            return c[0] + x * (c[1] + x * (c[2] + x * c[3]))
        if derivative == 1:
            return c[1] + x * (2 * c[2] + x * 3 * c[3])
        return 2 * c[2] + x * 6 * c[3]


def shortest_roll_s(velocity: float, acceleration: float, smooth: bool = True) -> float:
    """Return the seconds of the shortest roll to or from a velocity (_SHORTEST_RAMP in
    framestep/moves/run_plan.py), 0 for none."""
    if not velocity:
        return 0.0
    way = velocity**2 / acceleration / 2
    room = min(max(way - 16, 0), 4.5 if smooth else 0)
    steps = np.ceil(way + room) if way >= 0.5 else way
    return max(float(2 * steps / abs(velocity)), 0.002)


def _gentle(seconds: float, velocity: float, top: float, acceleration: float) -> bool:
    """Return whether a ramp has room for a step and a half (_GENTLE_RAMP in moves/run.py)."""
    if not seconds:
        return False
    room = (seconds * acceleration - velocity) * seconds
    return room >= 9 and max(velocity, 4 * (top - velocity)) * seconds >= 9


def _cubics(t: np.ndarray, p: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the coefficients, constant first, of the rest before, the cubics from knot to knot,
    and the rest after."""
    span = np.diff(t)
    mean = np.diff(p) / span
    moving = np.column_stack(
        (
            p[:-1],
            v[:-1],
            (3 * mean - 2 * v[:-1] - v[1:]) / span,
            (v[:-1] + v[1:] - 2 * mean) / span**2,
        )
    )
    rests = np.zeros((2, 4))
    rests[:, 0] = p[0], p[-1]
    return np.vstack((rests[:1], moving, rests[1:]))
