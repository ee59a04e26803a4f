"""The judge of velocity, acceleration and jerk, for tests, fuzzer and conformance kit.

Over spans of equal length the first difference of a motor's positions is at most its velocity times
the span, the second difference its acceleration times the square, the third its jerk times the
cube. `Tolerance` says what is allowed beyond that; the named ones below say for whom.
"""

from typing import Any, NamedTuple

import numpy as np

VELOCITY, ACCELERATION, JERK = 1, 2, 3  # the order of the difference


class Tolerance(NamedTuple):
    """share: of the limit, for times that are rounded; steps: of the difference."""

    share: float
    steps: float


class Tolerances(NamedTuple):
    """early_s: by how much two steps may be closer together than the velocity says. Without a
    velocity this alone counts."""

    acceleration: Tolerance
    velocity: Tolerance | None = None
    jerk: Tolerance | None = None
    early_s: float = 0.0

    def most(self, order: int, limit: Any, span_s: Any) -> Any:
        """Return the greatest difference of this order, in steps. limit: steps/s, steps/s² or
        steps/s³, a number or an array."""
        tolerance = (self.velocity, self.acceleration, self.jerk)[order - 1]
        assert tolerance
        return limit * (tolerance.share * span_s**order) + tolerance.steps


# Edges at the ends of windows: a velocity between whole steps is known to two steps per window.
EDGES = Tolerances(Tolerance(1.01, 2), early_s=5e-6)
# Edges of any session, at each millisecond and over any span: whole steps, each off by less than
# one, and 0.05 for rounding.
SESSION = Tolerances(Tolerance(1.02, 4.05), Tolerance(1.003, 2.02), Tolerance(1.02, 8.05), 8e-6)
# Its path may be a step beside its line (field note 9.5).
VIRTUAL_SESSION = SESSION._replace(acceleration=Tolerance(1.02, 7.05))
# Positions of the pulse engine at each tick, with fractions. Segments meet within some
# ten-thousandths of a step: where they do, a tick may be that much longer.
PLAN = Tolerances(Tolerance(1.01, 5e-4), Tolerance(1.0001, 2.5e-4))
# Near rest it may be more: a stop ends with a whole tick, and a motion that turns in that tick is
# half a tick's change ahead.
PLAN_NEAR_REST = PLAN._replace(acceleration=Tolerance(1.5, 4e-3))
# Positions that a host asks for: two of them are rounded, and each belongs to any moment between
# its question and its answer.
REPORTS = Tolerances(Tolerance(1.12, 2.5), Tolerance(1.04, 2.5))


class Beyond(NamedTuple):
    """The first difference that is greater than allowed."""

    first: int  # the index of its first position
    found: float
    allowed: float


def beyond(positions: np.ndarray, order: int, width: int, most: Any) -> Beyond | None:
    """Compare the differences between positions `width` apart with the greatest allowed, a number
    or one for each difference."""
    for _ in range(order):
        positions = positions[width:] - positions[:-width]
    found = np.abs(positions)
    over = found > most
    if not over.any():
        return None
    first = int(np.argmax(over))
    return Beyond(first, found[first].item(), float(np.broadcast_to(most, found.shape)[first]))


def too_close(times: np.ndarray, least: float, signs: np.ndarray | None = None) -> int | None:
    """Return the index of the earlier one of the two closest steps, if they are closer than this.
    With signs, only two steps in the same direction count."""
    apart = np.diff(times)
    if signs is not None:
        apart = np.where(signs[1:] == signs[:-1], apart, np.inf)
    closest = int(apart.argmin()) if len(apart) else 0
    return closest if len(apart) and apart[closest] < least else None
