"""Units of axes and of files, and their conversion."""

import math
import re

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
_WRITTEN = {
    "°": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad",
    "millimeters": "mm", "millimetres": "mm", "centimeters": "cm", "centimetres": "cm",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "inch": "in", "inches": "in",
    "feet": "ft", "step": "steps",
}  # fmt: skip
_BRACKETS = re.compile(r"(?P<name>.*\S)\s*[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]")


def unit_of(text: str) -> str:
    """Return the unit that a file writes in any usual way; empty if it is none."""
    word = text.strip().strip("[]()").strip().lower()
    return word if word in UNITS and word != "units" else _WRITTEN.get(word, "")


def without_unit(heading: str) -> tuple[str, str]:
    """Return name and unit of a heading such as "pan (deg)"; the unit is empty without one."""
    found = _BRACKETS.fullmatch(heading)
    unit = unit_of(found["unit"]) if found else ""
    return (found["name"], unit) if found and unit else (heading, "")


def factor(of: str, to: str) -> float | None:
    """Return the factor from unit `of` to unit `to`, or None if they are of different kinds."""
    kind, size = UNITS[of]
    other, into = UNITS[to]
    return size / into if kind == other else None
