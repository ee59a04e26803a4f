"""Units of axes and of files, and what one is in another."""

import math

# {unit: what it measures, and how much of the first one of its kind it is}
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
    """What a number of `of` is multiplied by to be one of `to`; None where they measure different
    things."""
    kind, size = UNITS[of]
    other, into = UNITS[to]
    return size / into if kind == other else None
