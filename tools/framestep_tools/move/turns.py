"""Full turns in an angle: programs count from -180 to 180 degrees and jump at the ends."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from ..axes.axes_file import Axis
from ..axes.units import factor
from .move_formats.recording import Curve

_TURN = 360.0
_JUMP = 10  # times as far as from any other frame to the next
_MOST = 2  # turns; a longer jump is no matter of turns
_BESIDE = 90.0  # degrees: what the axis may really turn from one frame to the next


class Turn(NamedTuple):
    """A jump by about `turns` full turns from value number `at` to the next, in degrees."""

    at: int
    turns: int
    jump: float


def turns_in(degrees: Sequence[float]) -> list[Turn]:
    """Return the jumps by full turns between neighbours."""
    found = []
    for i in range(len(degrees) - 1):
        jump = degrees[i + 1] - degrees[i]
        turns = round(jump / _TURN)
        if 1 <= abs(turns) <= _MOST and abs(jump - turns * _TURN) <= _BESIDE:
            found.append(Turn(i, turns, jump))
    return found


def unwrapped(curve: Curve, unit: str, nearest: float) -> tuple[Curve, list[float]]:
    """Return a curve without jumps by full turns, and the places after them.

    unit: of its values; without an angle there are no turns. nearest: samples or keyframes farther
    apart may be a turn that is meant.
    """
    scale = factor(unit, "deg")
    if scale is None:
        return curve, []
    places, by, off = [], [0.0], 0.0
    jumps = {turn.at: turn.turns for turn in turns_in([y * scale for y in curve.points])}
    for i, (place, following) in enumerate(pairwise(curve.known)):
        if i in jumps and following - place <= nearest:
            off -= jumps[i] * _TURN / scale
            places.append(following)
        by.append(off)
    return (curve.raised(by), places) if places else (curve, [])


def jump_in(steps: Sequence[int]) -> int | None:
    """Return the index before the only jump in positions that otherwise go on evenly, or None."""
    changes = [abs(b - a) for a, b in pairwise(steps)]
    if len(changes) < 3:
        return None
    at = max(range(len(changes)), key=changes.__getitem__)
    others = max(changes[:at] + changes[at + 1 :])
    return at if changes[at] > max(_JUMP * others, _JUMP) else None


def said_of(steps: Sequence[int], axis: Axis | None, start_frame: int) -> list[str]:
    """Return a sentence for each jump by full turns in a motor's positions; none if its axis does
    not turn."""
    scale = factor(axis.unit, "deg") if axis else None
    if axis is None or scale is None:
        return []
    degrees = [axis.position(step) * scale for step in steps]
    return [
        f"{axis.name} jumps by {turn.jump:.4g}° from frame {start_frame + turn.at} to "
        f"{start_frame + turn.at + 1}, "
        + ("a full turn" if abs(turn.turns) == 1 else f"{abs(turn.turns)} full turns")
        + ": its rotation has to go on beyond 180°, not to begin again"
        for turn in turns_in(degrees)
    ]
