"""From a file's times to frames.

Times in files are rounded: at 24 frames/s the second frame is at 0.041667 s, or at 0.04 s. A time
that is a frame's up to the file's last decimal is that frame's.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise

_NEVER_MORE = 0.5  # frames: then another frame is nearer
_KEPT = 0.25  # frames: a key farther from a frame is between frames, however rounded it is
_FLOAT = 1e-3  # frames: times that have been 32-bit floats

Frame = Callable[[float], float]


def last_decimal(texts: Iterable[str]) -> float:
    """Return the value of the last decimal in a file's times: 0.001 for 0.5 and 0.042."""
    return 10.0 ** -max(map(_decimals, set(texts)), default=0)


def _decimals(text: str) -> int:
    mantissa, _, exponent = text.strip().lower().partition("e")
    at = max(mantissa.rfind("."), mantissa.rfind(","))
    found = len(mantissa) - at - 1 if at >= 0 else 0
    try:
        return found - int(exponent or 0)
    except ValueError:
        return found


def to_frames(
    curves: Sequence[Sequence[float]], step: float, fps: float, from_zero: bool = True
) -> Frame:
    """Return a function from a file's place to a frame.

    curves: the places of each curve's keys or samples, increasing; step: value of their last
    decimal; fps: frames per unit of the places; from_zero: the first place is frame 0, else place 0
    is.
    """
    tolerance = min(max(step * fps * (1 + 1e-6), _FLOAT), _NEVER_MORE)
    origins = [0.0]
    if from_zero:
        begin = min(places[0] for places in curves)
        on_grid = round(begin * fps) / fps  # the first time is rounded as well
        origins = [begin, on_grid] if abs(begin - on_grid) * fps <= tolerance else [begin]
    for origin in origins:
        if all(_one_each_step(places, origin, fps, tolerance) for places in curves):
            return _near(origin, fps, tolerance)
    if all(_even(places, step) for places in curves):
        return _near(origins[0], fps, _FLOAT)
    origin = next((o for o in origins[1:] if abs(o - origins[0]) * fps <= _KEPT), origins[0])
    ends = {places[i] for places in curves for i in (0, -1)}
    kept = min(tolerance, _KEPT)
    for frame in (
        _near(origin, fps, kept, ends, tolerance),
        _near(origin, fps, _FLOAT, ends, tolerance),
        _near(origins[0], fps, _FLOAT),
    ):
        if all(_increasing(places, frame) for places in curves):
            return frame
    return _near(origins[0], fps, 0)


def _one_each_step(places: Sequence[float], origin: float, fps: float, tolerance: float) -> bool:
    """Return whether all are on frames, as many frames from one to the next."""
    frames = [(place - origin) * fps for place in places]
    nearest = [round(frame) for frame in frames]
    steps = {later - earlier for earlier, later in pairwise(nearest)}
    return (
        len(steps) <= 1
        and 0 not in steps
        and all(abs(frame - near) <= tolerance for frame, near in zip(frames, nearest, strict=True))
    )


def _even(places: Sequence[float], step: float) -> bool:
    """Return whether the times are as far apart to the last decimal, so that none is rounded."""
    units = [round(place / step) for place in places] if step else []
    return len(units) > 2 and len({later - earlier for earlier, later in pairwise(units)}) == 1


def _increasing(places: Sequence[float], frame: Frame) -> bool:
    return all(frame(earlier) < frame(later) for earlier, later in pairwise(places))


def _near(
    origin: float,
    fps: float,
    tolerance: float,
    ends: Iterable[float] = (),
    at_ends: float = 0.0,
) -> Frame:
    """Return the function that takes a place to the nearest frame if it is within the tolerance."""

    def frame(place: float) -> float:
        exact = (place - origin) * fps
        near = round(exact)
        within = at_ends if place in ends else tolerance
        return float(near) if abs(exact - near) <= within else exact

    return frame
