"""Full turns in an angle: programs count from -180 to 180 degrees and jump at the ends."""

from collections.abc import Sequence
from typing import NamedTuple

from .axes_file import Axis
from .move_formats.units import factor

_TURN = 360.0
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
        if turns and abs(jump - turns * _TURN) <= _BESIDE:
            found.append(Turn(i, turns, jump))
    return found


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
