"""Judges a played move by the edges on the pins: was each motor at its uploaded position at each
frame's time?

A run is smooth or not, after the rig file's setting `smoothing`. Without it a motor in motion
reaches a frame's position at the frame's time. With it a motor reaches the position up to a step's
time before, and has not left it at the frame's time.

Time origin. A trace does not contain the time of the first frame, so it is found by vote. When a
motor passes through a frame's position p(N), the edge that reaches p(N) votes for (edge time −
frame time) as the time of frame 0. All edges of the run vote for the same moment; edges of
positioning moves, other laps or errors vote for scattered ones. The origin is the median of the
fullest window of `_VOTE_WINDOW_NS`, and is the same for all motors. In a smooth run the whole time
at p(N) votes; the origin is the middle of the time with the most votes, or where the edges fit the
ideal path best.

Frame times are rational: frame N is round(N · 10⁹ / fps_milli) µs after the run's first, which is
frame 0.

Requirements (each can fail alone, `Limits` has the figures):

    position   within ±20 µs of a frame's time, steps made = position uploaded
    time       in motion the edge that reaches the position comes within 20 µs of the frame's time;
               in a smooth run, at rest and where the motion turns, the motor has arrived by then,
               and does not leave before
    sum        all steps of the trace add up to the motor's reported position, if given
    holds      no edge between two frames with the same position
    reversals  no edge against the motion between two frames, except at a turn: there the path may
               pass the frame's position as far as a cubic with the mean slope does, 4/27 of that
               slope
    velocity   the two cubics fitted to the edges on either side of a frame have the same velocity
               there

If the ideal path is given (reference.py makes one), it decides the last two, and adds a third:

    reversals  no edge against the motion of the path, except for the step at which it comes to
               rest
    velocity   the fitted cubics have the path's velocity at the frame
    path       each edge lies where the path crosses that step: reported, and judged if there is a
               limit for it

With it the time error in motion is the lateness of the edge that reaches the position, also in a
smooth run.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..errors import ToolError
from .trace import Trace

_VOTE_WINDOW_NS = 200_000
_LEAST_VOTES = 3
_CUBIC_EDGES = 12  # fewer edges in a frame do not determine the velocity at its ends
_SEARCH_NS = 2_000_000  # search range for a position around its frame's time
_EVER_BEFORE, _EVER_AFTER = -(1 << 62), 1 << 62
_STENCIL_S = 1e-4  # step of the path's numerical derivatives
_FRAME_STENCIL_S = 1e-5  # the same at a frame, where the acceleration jumps


@dataclass(frozen=True)
class Limits:
    """Limits that a run must keep."""

    time_us: float = 20.0
    # alternatively the time for this part of a step, if that is longer
    time_steps: float = 0.0
    # allowed jump of velocity at a frame, or difference from the path's …
    velocity_steps_s: float = 10.0
    velocity_share: float = 0.02  # … and this share of the velocity there in addition
    path_us: float | None = None  # worst edge against the ideal path; None: only reported


@dataclass
class MotorVerdict:
    """Judgement of one motor. Arrays have an entry per frame, NaN if a figure has no meaning."""

    motor: int
    position_error: np.ndarray  # steps; at the best moment within the time limit
    time_error_us: np.ndarray  # signed: positive is late
    velocity_error: (
        np.ndarray
    )  # steps/s: the jump at the frame, or with a path the larger difference from it
    edge_times_s: np.ndarray  # edges of the run, seconds after the first frame
    edge_positions: np.ndarray  # position after each
    edge_error_us: np.ndarray  # against the ideal path; empty without one

    @property
    def worst_position(self) -> int:
        """Largest distance from the uploaded position at a frame, in steps."""
        return int(np.abs(self.position_error).max())

    @property
    def worst_time_us(self) -> float:
        """Largest time error at a frame, in µs; infinite if a position was never reached."""
        return float(np.nanmax(np.abs(self.time_error_us), initial=0.0))

    @property
    def worst_edge_us(self) -> float:
        """Largest distance of an edge from the path's crossing, in µs; 0 without a path."""
        return float(np.nanmax(np.abs(self.edge_error_us), initial=0.0))


@dataclass
class Verdict:
    """Judgement of a run: good if there is no complaint."""

    fps_milli: int
    frames: int
    origin_ns: int
    motors: list[MotorVerdict]
    complaints: list[str] = field(default_factory=list)

    @property
    def good(self) -> bool:
        """True if there is no complaint."""
        return not self.complaints

    @property
    def worst_position(self) -> int:
        """Worst position error of all motors, in steps."""
        return max(m.worst_position for m in self.motors)

    @property
    def worst_time_us(self) -> float:
        """Worst time error of all motors, in µs."""
        return max(m.worst_time_us for m in self.motors)

    def summary(self) -> str:
        """Return one line: frames, worst position error at a frame, worst frame time error."""
        return (
            f"{self.frames} frames, worst position error at a frame {self.worst_position} steps, "
            f"worst frame time error {self.worst_time_us:.1f} µs"
        )


class NoRun(ToolError):
    """The trace contains no run of this move."""


def frame_times_ns(count: int, fps_milli: int) -> np.ndarray:
    """Return the times of `count` frames after the first, round(N · 10⁹ / fps_milli) µs, in ns."""
    frames = np.arange(count, dtype=np.int64)
    return (frames * 2_000_000_000 + fps_milli) // (2 * fps_milli) * 1000


def judge(
    trace: Trace,
    positions: Mapping[int, Sequence[int] | np.ndarray],
    fps_milli: int,
    start: Mapping[int, int] | None = None,
    end: Mapping[int, int] | None = None,
    path: Callable[[int, np.ndarray], np.ndarray] | None = None,
    after_ns: int = 0,
    limits: Limits = Limits(),
    smooth: bool = True,
) -> Verdict:
    """Judge the edges of a run.

    positions   the uploaded steps of each motor at the run's frames, in the order of play (for a
                section or a backward run: that slice)
    start       each motor's position before the trace's first edge, 0 if not given
    end         the motor's reported position after the last edge
    path        path(motor, seconds): the ideal positions at times after the first frame
    after_ns    earliest time of the run
    smooth      setting `smoothing` of the rig file

    Raises NoRun if no motor passes through frames in time with the others.
    """
    frames = {motor: np.asarray(steps, np.int64) for motor, steps in positions.items()}
    counts = {len(steps) for steps in frames.values()}
    if len(counts) != 1:
        raise ValueError(
            f"every motor needs a position for each frame, found {sorted(counts)} frames"
        )
    start = start or {}
    times = frame_times_ns(counts.pop(), fps_milli)
    made = {motor: trace.positions(motor, start.get(motor, 0)) for motor in frames}
    origin = _origin(frames, made, start, times, after_ns, smooth)
    if path and smooth:
        origin = _fitted(origin, path, made, int(times[-1]))
    verdict = Verdict(fps_milli, len(times), origin, [])
    for motor, steps in frames.items():
        edges, after = made[motor]
        stands = start.get(motor, 0)
        one = _Motor(motor, steps, origin + times, edges, after, stands, limits, smooth)
        verdict.motors.append(one.judge(path, verdict.complaints))
        counted = stands + int(np.sum(trace.steps(motor)[1]))
        if end and end.get(motor, counted) != counted:
            verdict.complaints.append(
                f"motor {motor}: is at {counted} by its steps, but reports {end[motor]}"
            )
    strangers = [
        m
        for m in trace.motors
        if m not in frames and _moves(trace, m, origin, origin + int(times[-1]))
    ]
    verdict.complaints += [
        f"motor {m}: moved during the run without being in the upload" for m in strangers
    ]
    return verdict


def _moves(trace: Trace, motor: int, begin: int, end: int) -> bool:
    edges, _ = trace.steps(motor)
    return bool(np.any((edges >= begin) & (edges <= end)))


def _through(steps: np.ndarray) -> np.ndarray:
    """Return the direction in which a motor passes through each frame: +1, -1, or 0 at rest, at
    turns and at the two ends."""
    signs = np.sign(np.diff(steps))
    through = np.zeros(len(steps), np.int64)
    through[1:-1] = np.where(signs[:-1] == signs[1:], signs[1:], 0)
    return through


def _turns(steps: np.ndarray) -> np.ndarray:
    """Return True for each frame at which the motion turns, so its velocity is 0 only for a
    moment."""
    signs = np.sign(np.diff(steps))
    turns = np.zeros(len(steps), bool)
    turns[1:-1] = signs[:-1] * signs[1:] < 0
    return turns


def _near_motion(steps: np.ndarray) -> np.ndarray:
    """Return True for each frame with a step before or after it."""
    moves = np.diff(steps) != 0
    return np.append(moves, False) | np.append(False, moves)


def _votes(steps, edges, after, start, times, after_ns, smooth):
    """Yield arrays of times of frame 0, earliest and latest, with which a motor is right."""
    if smooth:
        places = np.append(start, after)
        begins = np.append(edges[0] - times[-1], edges)
        ends = np.append(edges, edges[-1] + times[-1])
        groups = [(_near_motion(steps), ends > after_ns)]
    else:
        places, begins, ends = after, edges, edges
        signs = np.diff(after, prepend=start)
        groups = [
            (_through(steps) == sign, (signs == sign) & (edges >= after_ns)) for sign in (1, -1)
        ]
    for frames, kept in groups:
        order = np.flatnonzero(kept)
        order = order[np.argsort(places[order], kind="stable")]
        first = np.searchsorted(places[order], steps[frames], side="left")
        end = np.searchsorted(places[order], steps[frames], side="right")
        for time, low, high in zip(times[frames], first, end, strict=True):
            there = order[low:high]
            yield np.stack((begins[there], ends[there])) - time


def _origin(frames, made, start, times, after_ns, smooth) -> int:
    votes: list[np.ndarray] = []
    for motor, steps in frames.items():
        edges, after = made[motor]
        if len(edges):
            votes += _votes(steps, edges, after, start.get(motor, 0), times, after_ns, smooth)
    begins, ends = np.sort(np.concatenate(votes, axis=1) if votes else np.zeros((2, 0), np.int64))
    if smooth:  # how many votes are valid at each beginning of one
        counts = np.arange(1, len(begins) + 1) - np.searchsorted(ends, begins, side="left")
    else:
        counts = np.searchsorted(begins, begins + _VOTE_WINDOW_NS, side="right")
        counts -= np.arange(len(begins))
    if counts.max(initial=0) < _LEAST_VOTES:
        raise NoRun(
            "no run of this move in the trace: at least "
            f"{_LEAST_VOTES} frames with a motor passing through are expected "
            f"in time with each other, found {int(counts.max(initial=0))}; "
            "check the frame rate, the start positions and the upload"
        )
    best = int(np.argmax(counts))
    if smooth:
        return int(begins[best] + ends[np.searchsorted(ends, begins[best])]) // 2
    return int(np.median(begins[best : best + counts[best]]))


def _fitted(origin, path, made, length) -> int:
    """Return the origin next to `origin` with which the edges of the run fit the path best."""
    for _ in range(2):
        found = []
        for motor, (edges, after) in made.items():
            run = slice(*np.searchsorted(edges, (origin, origin + length)))
            error_us, _ = _along(path, motor, (edges[run] - origin) * 1e-9, after[run])
            if not np.isnan(error_us).all():
                found.append(np.nanmedian(error_us))
        if found:
            origin += int(1000 * np.median(found))
    return origin


def _along(path, motor, seconds, after) -> tuple[np.ndarray, np.ndarray]:
    """Return each edge's lateness against the path's crossing of its position (µs), and the path's
    velocity. Within a step of rest: NaN and 0."""
    before, ideal, behind = (path(motor, seconds + h) for h in (-_STENCIL_S, 0.0, _STENCIL_S))
    velocity = (behind - before) / (2 * _STENCIL_S)
    acceleration = (behind - 2 * ideal + before) / _STENCIL_S**2
    # A step comes when the path reaches its position, up or down.
    moving = velocity**2 > 2 * np.abs(acceleration)
    with np.errstate(divide="ignore", invalid="ignore"):
        late = np.where(moving, (ideal - after) / velocity * 1e6, np.nan)
    return late, np.where(moving, velocity, 0)


class _Motor:
    """Judgement of one motor. All times, also of frames, are in ns as in the trace."""

    def __init__(self, motor, steps, times, edges, after, start, limits: Limits, smooth: bool):
        self.motor, self.steps, self.times, self.limits = motor, steps, times, limits
        self.smooth = smooth
        self.edges, self.after, self.start = edges, after, start
        self.positions = np.concatenate(([start], after))  # positions[i]: position after i edges
        self.through = _through(steps)

    def judge(self, path, complaints: list[str]) -> MotorVerdict:
        limits = self.limits
        position, time_us = self._at_frames(path)
        run = slice(*np.searchsorted(self.edges, (self.times[0], self.times[-1] + 1)))
        seconds = (self.edges[run] - self.times[0]) * 1e-9
        if path:
            error_us, velocity = _along(path, self.motor, seconds, self.after[run])
            forward = velocity * np.diff(self.positions[run.start : run.stop + 1])
            wrong_velocity, fitted = self._velocity_errors(path)
        else:
            error_us = np.zeros(0)
            wrong_velocity, fitted = self._velocity_jumps()

        def complain(text: str) -> None:
            complaints.append(f"motor {self.motor}: {text}")

        wrong = np.flatnonzero(position)
        if len(wrong):
            worst = wrong[np.argmax(np.abs(position[wrong]))]
            complain(
                f"{len(wrong)} frames off their position, "
                f"the worst frame {worst} (from 0) by {position[worst]:+d} steps"
            )
        late = np.flatnonzero(np.abs(time_us) > self._allowed_us())
        if len(late):
            worst = late[np.argmax(np.abs(time_us[late]))]
            complain(
                f"{len(late)} frames off their time, "
                f"the worst frame {worst} (from 0) by {time_us[worst]:+.1f} µs, "
                f"allowed are {limits.time_us:g}"
            )
        held, against = self._between_frames()
        if path:
            against = int(np.count_nonzero(forward < 0))
        if held:
            complain(f"{held} steps while it should hold still")
        if against:
            complain(
                f"{against} steps against the motion "
                f"{'of the path' if path else 'between two frames'}"
            )
        allowed_velocity = limits.velocity_steps_s + limits.velocity_share * np.abs(fitted)
        jumps = np.flatnonzero(np.abs(wrong_velocity) > allowed_velocity)
        if len(jumps):
            worst = jumps[np.argmax(np.abs(wrong_velocity[jumps]))]
            complain(
                f"velocity {'is wrong' if path else 'jumps'} at {len(jumps)} frames, "
                f"the worst frame {worst} (from 0) by {wrong_velocity[worst]:+.0f} steps/s "
                f"at {fitted[worst]:.0f} steps/s"
            )
        if limits.path_us is not None and np.nanmax(np.abs(error_us), initial=0.0) > limits.path_us:
            complain(
                f"an edge is {np.nanmax(np.abs(error_us)):.1f} µs off the path, "
                f"allowed are {limits.path_us:g}"
            )
        return MotorVerdict(
            self.motor, position, time_us, wrong_velocity, seconds, self.after[run], error_us
        )

    def _allowed_us(self) -> np.ndarray:
        """Return the allowed time error at each frame, from the mean velocity around it."""
        allowed = np.full(len(self.times), self.limits.time_us)
        if self.limits.time_steps and len(self.steps) > 2:
            # steps per ns
            rate = np.abs(self.steps[2:] - self.steps[:-2]) / (self.times[2:] - self.times[:-2])
            with np.errstate(divide="ignore"):
                allowed[1:-1] = np.maximum(
                    allowed[1:-1], np.minimum(self.limits.time_steps / rate / 1000, 1e3)
                )
        return allowed

    def _position_at(self, times: np.ndarray) -> np.ndarray:
        return self.positions[np.searchsorted(self.edges, times, side="right")]

    def _end_in_motion(self) -> np.ndarray:
        """Return the first and the last frame, if a moving motor passes through them."""
        moving = np.zeros(len(self.steps), bool)
        for at, inside in ((0, 1), (-1, -2)):
            if len(self.steps) > 1 and self.steps[at] != self.steps[inside]:
                outside = 2 * self.times[at] - self.times[inside]
                moving[at] = self._position_at(outside) != self._position_at(self.times[at])
        return moving

    def _at_frames(self, path) -> tuple[np.ndarray, np.ndarray]:
        """Return the position error (steps) and the time error (µs) at each frame."""
        count = len(self.times)
        position, time_us = np.zeros(count, np.int64), np.full(count, np.nan)
        slack = (self._allowed_us() * 1000).astype(int)
        # the motor was at positions[i] from around[i] to around[i + 1]
        around = np.concatenate(([_EVER_BEFORE], self.edges, [_EVER_AFTER]))
        through = np.where(self._end_in_motion(), 1, self.through) != 0
        arrived = np.full(count, np.nan)
        for frame in range(count):
            at, wanted = int(self.times[frame]), self.steps[frame]
            low, high = np.searchsorted(
                self.edges, (at - slack[frame], at + slack[frame]), side="right"
            )
            seen = self.positions[low : high + 1] - wanted
            position[frame] = seen[np.argmin(np.abs(seen))]
            # intervals close to the frame in which the motor was at the wanted position
            low, high = np.searchsorted(
                self.edges, (at - _SEARCH_NS, at + _SEARCH_NS), side="right"
            )
            there = np.flatnonzero(self.positions[low : high + 1] == wanted) + low
            if not len(there):
                time_us[frame] = np.inf
                continue
            reached, left = around[there], around[there + 1]
            if through[frame] and not self.smooth:
                distance = reached - at
            else:
                distance = np.where(reached > at, reached - at, np.where(left <= at, left - at, 0))
            nearest = np.argmin(np.abs(distance))
            time_us[frame] = distance[nearest] / 1000
            arrived[frame] = reached[nearest]
        if path and self.smooth:
            seen = np.flatnonzero(through & ~np.isnan(arrived))
            seconds = (arrived[seen] - self.times[0]) * 1e-9
            late_us, _ = _along(path, self.motor, seconds, self.steps[seen])
            time_us[seen] = np.where(np.isnan(late_us), time_us[seen], late_us)
        return position, time_us

    def _between_frames(self) -> tuple[int, int]:
        """Count edges where nothing may move, and edges against the motion."""
        slack = int(self.limits.time_us * 1000)
        held = against = 0
        past = np.zeros(len(self.steps), np.int64)
        past[1:-1] = (
            np.ceil(4 / 27 * np.abs(self.steps[2:] - self.steps[:-2]) / 2)
            * _turns(self.steps)[1:-1]
        )
        for frame, travel in enumerate(np.diff(self.steps)):
            low, high = np.searchsorted(
                self.edges, (self.times[frame] + slack, self.times[frame + 1] - slack)
            )
            signs = np.diff(self.positions[low : high + 1])
            if travel == 0:
                held += len(signs)
            else:
                backward = int(np.count_nonzero(signs == -np.sign(travel)))
                against += max(0, backward - int(past[frame] + past[frame + 1]))
        return held, against

    def _velocities(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocity before and after each frame in steps/s, from its edges; NaN if there
        are too few."""
        count = len(self.times)
        starts, ends = np.full(count, np.nan), np.full(count, np.nan)
        for frame in range(count - 1):
            begin, end = self.times[frame], self.times[frame + 1]
            low, high = np.searchsorted(self.edges, (begin, end))
            if high - low < _CUBIC_EDGES:
                continue
            span = (end - begin) * 1e-9
            u = (self.edges[low:high] - begin) / (end - begin)
            cubic = np.polynomial.Polynomial.fit(
                u, self.after[low:high].astype(float), 3, domain=[0, 1]
            ).deriv()
            starts[frame], ends[frame] = cubic(0) / span, cubic(1) / span
        return np.concatenate(([np.nan], ends[:-1])), starts

    def _velocity_jumps(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocity after each frame minus the velocity before it, and their mean."""
        before, behind = self._velocities()
        return behind - before, (before + behind) / 2

    def _velocity_errors(self, path) -> tuple[np.ndarray, np.ndarray]:
        """Return the larger difference from the path's velocity before and after each frame, and
        the path's velocity."""
        seconds = (self.times - self.times[0]) * 1e-9
        ideal = path(self.motor, seconds + _FRAME_STENCIL_S) - path(
            self.motor, seconds - _FRAME_STENCIL_S
        )
        ideal = ideal / (2 * _FRAME_STENCIL_S)
        before, behind = (velocity - ideal for velocity in self._velocities())
        worse = np.nan_to_num(np.abs(before), nan=-1.0) > np.nan_to_num(np.abs(behind), nan=-1.0)
        return np.where(worse, before, behind), ideal
