"""axes.toml: names, units and limits of a rig's motors.

    [[axis]]
    name = "pan"                  # heads its column in move.csv
    motor = 1
    steps_per_unit = 225
    unit = "deg"

docs/use/axes.md lists all keys.
"""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

from ..errors import ToolError
from ..text.numerals import GREATEST
from ..text.text_file import MoveFileError, read_text
from .units import UNITS, factor

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

MOTORS = 32
FEWEST, MOST = 1e-6, 1e9  # steps per unit


class AxesFileError(ToolError):
    """An axes.toml has a mistake or cannot be read. The text has the key, what was found and what
    is allowed."""


@dataclass(frozen=True)
class Axis:
    """One axis: its motor, and the conversion between a file's numbers and steps.

    name: in move.csv; in_file: in the other file
    motor: from 1
    steps_per_unit: from FEWEST to MOST, of `unit`
    zero: position of step 0, in `unit`
    limits: lowest and highest position, in `unit`
    invert: whether steps count down while the position rises
    file_unit: unit of the numbers in a file that does not name it
    hold: position, in `unit`, of an axis that the file does not have

    If the file lacks them, `read_axes` sets `in_file` to the name and `file_unit` to the unit.
    """

    name: str
    motor: int
    steps_per_unit: float
    unit: str = "units"
    in_file: str = ""
    zero: float = 0.0
    limits: tuple[float, float] | None = None
    invert: bool = False
    file_unit: str = ""
    hold: float | None = None

    def steps(self, position: float) -> int:
        """Return the step nearest to a position in `unit`."""
        return round((position - self.zero) * self._steps_per_unit)

    def position(self, steps: float) -> float:
        """Return the position of a step, in `unit`."""
        return steps / self._steps_per_unit + self.zero

    @property
    def _steps_per_unit(self) -> float:
        return -self.steps_per_unit if self.invert else self.steps_per_unit

    def beyond(self, steps: int) -> str:
        """Say that a step is beyond the limits; empty if it is not."""
        if not self.limits:
            return ""
        low, high = self.limits
        ends = sorted((self.steps(low), self.steps(high)))
        if ends[0] <= steps <= ends[1]:
            return ""
        return f"{self._at(steps)} is beyond its limits of {low:g} to {high:g} {self.unit}"

    def check(self, steps: int, frame: int) -> None:
        """Raise ToolError, with frame and axis, for a step beyond the limits or beyond 32 bits."""
        wrong = self.beyond(steps)
        if not wrong and not -(2**31) <= steps < 2**31:
            wrong = f"{self._at(steps)} is step {steps}, which does not fit 32 bits signed"
        if wrong:
            raise ToolError(f"frame {frame}, axis {self.name}: {wrong}")

    def _at(self, steps: int) -> str:
        return f"{self.position(steps):.10g} {self.unit}"


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= GREATEST


def _limits(value: Any) -> bool:
    return (
        isinstance(value, list)
        and len(value) == 2
        and all(_number(end) for end in value)
        and value[0] < value[1]
    )


def _unit(value: Any) -> bool:
    return isinstance(value, str) and value in UNITS


def _word(value: Any) -> bool:
    return isinstance(value, str) and value == value.strip() != "" and value.isprintable()


_UNITS_TEXT = "one of " + ", ".join(f'"{unit}"' for unit in UNITS)
# {key: allowed values, in words and as a check}
KEYS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "name": ("a text", _word),
    "motor": (
        f"a whole number from 1 to {MOTORS}",
        lambda value: type(value) is int and 1 <= value <= MOTORS,
    ),
    "steps_per_unit": (
        f"a number from {FEWEST:g} to {MOST:g}",
        lambda value: _number(value) and FEWEST <= value <= MOST,
    ),
    "unit": (_UNITS_TEXT, _unit),
    "in_file": (
        "a text, or a column's number",
        lambda value: _word(value) or (type(value) is int and 1 <= value <= 10**6),
    ),
    "zero": ("a number", _number),
    "limits": ("two numbers [lowest, highest]", _limits),
    "invert": ("true or false", lambda value: isinstance(value, bool)),
    "file_unit": (_UNITS_TEXT, _unit),
    "hold": ("a number", _number),
}
_NEEDED = [field.name for field in fields(Axis)][:3]


def read_axes(path: str | os.PathLike[str], every_motor: bool = False) -> list[Axis]:
    """Read the axes, in the order of their motors.

    every_motor: each motor from 1 on needs an axis. Raises AxesFileError, with the key and what is
    allowed, if the file is missing or not as described in docs/use/axes.md.
    """
    return axes_of(axes_text(path), path, every_motor)


def axes_text(path: str | os.PathLike[str]) -> str:
    """Return the text of an axes.toml. Raises AxesFileError."""
    try:
        text, said = read_text(path, "the axes")
    except MoveFileError as error:
        raise AxesFileError(str(error)) from None
    if said:
        raise AxesFileError(f"{path}: not valid TOML, which is UTF-8: save it as UTF-8")
    return text


def axes_of(text: str, path: str | os.PathLike[str], every_motor: bool = False) -> list[Axis]:
    """Return the axes in the text of a file, as `read_axes` does. path: for errors."""
    content = _content(text, path)
    found = content.get("axis", [])
    if not isinstance(found, list) or not found or not all(isinstance(a, dict) for a in found):
        raise AxesFileError(f"{path}: expected an [[axis]] for each motor, found none")
    axes = [_axis(settings, f"{path}, axis {i}") for i, settings in enumerate(found, 1)]
    axes.sort(key=lambda axis: axis.motor)
    keys: list[tuple[str, list[Any]]] = [
        ("motor", [axis.motor for axis in axes]),
        ("name", [axis.name for axis in axes]),
        ("in_file", [axis.in_file for axis in axes if axis.hold is None]),
    ]
    for what, values in keys:
        for value in values:
            if values.count(value) > 1:
                raise AxesFileError(f'{path}: "{what}": {value!r} occurs twice')
    for number, axis in enumerate(axes, 1):
        if every_motor and axis.motor != number:
            raise AxesFileError(
                f"{path}: there is no axis for motor {number}, but one for motor {axis.motor}; "
                'a move has a column for each motor from 1 on; a motor at rest has "hold"'
            )
    return axes


def camera_of(text: str, path: str | os.PathLike[str]) -> Any:
    """Return [camera] in the text of a file, which camera_rig.py reads, or None."""
    return _content(text, path).get("camera")


def toml_value(written: str) -> Any:
    """Return the value that TOML has in this text. Raises ValueError."""
    return tomllib.loads(f"value = {written}")["value"]


def _content(text: str, path: str | os.PathLike[str]) -> dict[str, Any]:
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise AxesFileError(f"{path}: not valid TOML: {error}") from None
    for key in content:
        if key not in ("axis", "camera"):
            raise AxesFileError(
                f'{path}: expected only [[axis]] and [camera] at the top, found "{key}"'
            )
    return content


def _axis(settings: dict[str, Any], where: str) -> Axis:
    if "name" in settings and _word(settings["name"]):
        where += f" ({settings['name']})"
    for key, value in settings.items():
        if key not in KEYS:
            raise AxesFileError(f'{where}: no key "{key}"; there are {", ".join(KEYS)}')
        allowed, right = KEYS[key]
        if not right(value):
            raise AxesFileError(f'{where}: "{key}": expected {allowed}, found {value!r}')
    for key in _NEEDED:
        if key not in settings:
            raise AxesFileError(f'{where}: "{key}" is missing: {KEYS[key][0]}')
    unit = settings.get("unit", "units")
    file_unit = settings.get("file_unit", unit)
    if factor(file_unit, unit) is None:
        raise AxesFileError(f'{where}: "file_unit": {file_unit} cannot be converted to {unit}')
    defaults = {"in_file": settings["name"], "file_unit": unit}
    if type(settings.get("in_file")) is int:
        settings = {**settings, "in_file": f"column {settings['in_file']}"}
    if "limits" in settings:
        settings = {**settings, "limits": tuple(settings["limits"])}
    return Axis(**{**defaults, **settings})
