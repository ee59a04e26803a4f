"""Units of axes and of files, and their conversion."""

import math

# {unit: (kind, size in the first unit of its kind)}
UNITS = {
    "mm": ("length", 1.0),
    "cm": ("length", 10.0),
    "m": ("length", 1000.0),
    "in": ("length", 25.4),
    "ft": ("length", 304.8),
    "deg": ("angle", 1.0),
    "rad": ("angle", 180 / math.pi),
    "steps": ("steps", 1.0),
    "units": ("anything", 1.0),
}


def factor(of: str, to: str) -> float | None:
    """Return the factor from unit `of` to unit `to`, or None if they are of different kinds."""
    kind, size = UNITS[of]
    other, into = UNITS[to]
    return size / into if kind == other else None
