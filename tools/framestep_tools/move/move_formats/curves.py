"""Curves over frames or seconds: samples, and keyframes with the handles of Bézier curves."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

from ...text.text_file import MoveFileError

_SAME = 1e-6  # as a part of the distance between samples: seconds are rounded in files
_CLOSE = 1e-12  # tolerance of the curve's parameter, as a part of a Bézier segment's width
_ITERATIONS = 60  # enough halvings to reach _CLOSE

Point = tuple[float, float]


@dataclass(frozen=True)
class Samples:
    """Values at increasing places, joined by cubics. The slope at each sample is that of the
    parabola through it and its neighbours."""

    places: list[float]
    values: list[float]

    @property
    def first(self) -> float:
        """Place of the first sample."""
        return self.places[0]

    @property
    def last(self) -> float:
        """Place of the last sample."""
        return self.places[-1]

    @property
    def known(self) -> list[float]:
        """Places of the samples."""
        return self.places

    @property
    def points(self) -> list[float]:
        """Values of the samples."""
        return self.values

    def raised(self, by: Sequence[float]) -> "Samples":
        """Return the samples with another amount added to each."""
        return Samples(self.places, [y + more for y, more in zip(self.values, by, strict=True)])

    def moved(self, place: Callable[[float], float]) -> "Samples":
        """Return the same samples at other places."""
        return Samples([place(x) for x in self.places], self.values)

    def at(self, x: float) -> float:
        """Return the value at a place; beyond the ends, the value of the end sample."""
        i = bisect_right(self.places, x) - 1
        if i < 0:
            return self.values[0]
        if i == len(self.places) - 1 or x == self.places[i]:
            return self.values[i]
        width = self.places[i + 1] - self.places[i]
        t = (x - self.places[i]) / width
        if min(t, 1 - t) < _SAME:
            return self.values[i + round(t)]
        rise = self.values[i + 1] - self.values[i]
        here, there = self.slope(i) * width, self.slope(i + 1) * width
        return self.values[i] + t * (
            here + t * (3 * rise - 2 * here - there + t * (here + there - 2 * rise))
        )

    def slope(self, i: int) -> float:
        """Return the slope at sample `i`; at an end sample, the slope toward its neighbour."""
        if len(self.places) == 1:
            return 0.0
        if i == 0:
            return self._rise(0)
        if i == len(self.places) - 1:
            return self._rise(i - 1)
        before = self.places[i] - self.places[i - 1]
        after = self.places[i + 1] - self.places[i]
        return (self._rise(i - 1) * after + self._rise(i) * before) / (before + after)

    def _rise(self, i: int) -> float:
        return (self.values[i + 1] - self.values[i]) / (self.places[i + 1] - self.places[i])


class Piece(Protocol):
    """Values between two keyframes."""

    def at(self, x: float) -> float:
        """Return the value at a place between the keyframes."""
        ...

    def between(self, start: float, end: float) -> "Piece":
        """Return the same values between keyframes at other places."""
        ...

    def raised(self, start: float, end: float) -> "Piece":
        """Return the values with these amounts added at the keyframes."""
        ...


@dataclass(frozen=True)
class Hold:
    """The same value from keyframe to keyframe."""

    value: float

    def at(self, x: float) -> float:
        """Return the value, anywhere between the keyframes."""
        return self.value

    def between(self, start: float, end: float) -> "Hold":
        """Return the same."""
        return self

    def raised(self, start: float, end: float) -> "Hold":
        """Return the value with the amount at the first keyframe added."""
        return Hold(self.value + start)


@dataclass(frozen=True)
class Unreadable:
    """Values that cannot be read. That does no harm if no frame lies between the keyframes."""

    why: str

    def at(self, x: float) -> float:
        """Raise MoveFileError with the reason."""
        raise MoveFileError(self.why)

    def between(self, start: float, end: float) -> "Unreadable":
        """Return the same."""
        return self

    def raised(self, start: float, end: float) -> "Unreadable":
        """Return the same."""
        return self


class Segment(NamedTuple):
    """A cubic Bézier curve between two keyframes. Its handles stay between them, so there is one
    value at each place."""

    start: Point
    handle: Point
    other_handle: Point
    end: Point

    def at(self, x: float) -> float:
        """Return the value at a place between the keyframes."""
        return _bezier(1, self, self._parameter(x))

    def between(self, start: float, end: float) -> "Segment":
        """Return the curve stretched to other places of its keyframes."""
        if (start, end) == (self.start[0], self.end[0]):
            return self
        begin, scale = self.start[0], (end - start) / (self.end[0] - self.start[0])
        points = (self.start, self.handle, self.other_handle, self.end)
        return Segment(*((start + (x - begin) * scale, y) for x, y in points))

    def raised(self, start: float, end: float) -> "Segment":
        """Return the curve with these amounts added to each end and its handle."""
        return Segment(
            (self.start[0], self.start[1] + start),
            (self.handle[0], self.handle[1] + start),
            (self.other_handle[0], self.other_handle[1] + end),
            (self.end[0], self.end[1] + end),
        )

    def _parameter(self, x: float) -> float:
        low, high = 0.0, 1.0
        width = self.end[0] - self.start[0]
        t = (x - self.start[0]) / width
        for _ in range(_ITERATIONS):
            off = _bezier(0, self, t) - x
            if abs(off) <= _CLOSE * width:
                break
            if off > 0:
                high = t
            else:
                low = t
            slope = _bezier_slope(0, self, t)
            t = t - off / slope if slope > 0 else low
            if not low < t < high:  # Newton's step has left the interval
                t = (low + high) / 2
        return t


@dataclass(frozen=True)
class Keyframes:
    """Keyframes at increasing places, and the pieces between them."""

    keys: list[Point]
    pieces: Sequence[Piece]

    @property
    def first(self) -> float:
        """Place of the first keyframe."""
        return self.keys[0][0]

    @property
    def last(self) -> float:
        """Place of the last keyframe."""
        return self.keys[-1][0]

    @cached_property
    def known(self) -> list[float]:
        """Places of the keyframes."""
        return [x for x, _ in self.keys]

    @property
    def points(self) -> list[float]:
        """Values of the keyframes."""
        return [y for _, y in self.keys]

    def raised(self, by: Sequence[float]) -> "Keyframes":
        """Return the keyframes with another amount added to each."""
        keys = [(x, y + more) for (x, y), more in zip(self.keys, by, strict=True)]
        return Keyframes(
            keys, [piece.raised(by[i], by[i + 1]) for i, piece in enumerate(self.pieces)]
        )

    def moved(self, place: Callable[[float], float]) -> "Keyframes":
        """Return the same values with the keyframes at other places."""
        keys = [(place(x), y) for x, y in self.keys]
        pieces = [piece.between(keys[i][0], keys[i + 1][0]) for i, piece in enumerate(self.pieces)]
        return Keyframes(keys, pieces)

    def at(self, x: float) -> float:
        """Return the value at a place; beyond the ends, the value of the end keyframe."""
        i = bisect_right(self.known, x) - 1
        if i < 0:
            return self.keys[0][1]
        if i == len(self.keys) - 1 or x == self.keys[i][0]:
            return self.keys[i][1]
        return self.pieces[i].at(x)


def within(handle: Point, key: Point, other: float) -> Point:
    """Return a keyframe's handle, shortened if it reaches past the neighbour at `other`."""
    reach = handle[0] - key[0]
    if abs(reach) <= abs(other - key[0]):
        return handle
    part = (other - key[0]) / reach
    return other, key[1] + part * (handle[1] - key[1])


def _bezier(axis: int, s: Segment, t: float) -> float:
    u = 1 - t
    return (
        u * u * u * s.start[axis]
        + 3 * u * u * t * s.handle[axis]
        + 3 * u * t * t * s.other_handle[axis]
        + t * t * t * s.end[axis]
    )


def _bezier_slope(axis: int, s: Segment, t: float) -> float:
    u = 1 - t
    return 3 * (
        u * u * (s.handle[axis] - s.start[axis])
        + 2 * u * t * (s.other_handle[axis] - s.handle[axis])
        + t * t * (s.end[axis] - s.other_handle[axis])
    )
