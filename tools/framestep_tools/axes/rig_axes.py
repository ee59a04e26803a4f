"""Names and units of a rig's motors: commands read and write motors, positions and rates here."""

import errno
import math
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import typer

from ..errors import USAGE, ToolError
from .axes_file import MOTORS, AxesFileError, Axis, axes_of, axes_text, camera_of
from .units import UNITS, factor

FILE = Path("axes.toml")
STEPS = "steps"
_SIGNS = {"deg": "°", "units": ""}  # shown instead of a unit's name, without a blank
_WORDS = {"°": "deg", '"': "in", "'": "ft"}  # typed instead of a unit's name
_QUANTITY = re.compile(r"(?P<number>[+-]?(?:\d+\.?\d*|\.\d+))\s*(?P<unit>[^\d\s.].*)?")
_PER = {"s": r"/s", "s²": r"/s(?:²|2|\^2)"}
_DIGITS = "+-0123456789"
_MOTOR = re.compile(r"\bmotor (\d+)\b")


class AxesError(ToolError):
    """A motor, a position or a rate as typed is wrong. The text names the allowed ones."""

    status = USAGE


def user_file() -> Path:
    """Return the path of the user's axes.toml, for folders without one."""
    return Path(typer.get_app_dir("framestep")) / FILE


def find(given: Path | None = None) -> Path | None:
    """Return the given axes.toml, else the working directory's, else the user's, else None."""
    if given:
        return given
    return next((path for path in (FILE, user_file()) if exists(path)), None)


def exists(path: Path) -> bool:
    """Return whether there is such a file. Raises AxesFileError if its folder cannot be read."""
    try:
        path.stat()
    except FileNotFoundError:
        return False
    except OSError as error:
        if error.errno == errno.ENOTDIR:
            return False
        raise AxesFileError(
            f"cannot look for the axes {path}: {error.strerror or error}; "
            "name the file by --axes, or give this user access to the folder"
        ) from None
    return True


def load(given: Path | None = None, every_motor: bool = False) -> "Axes":
    """Read the axes.toml that `find` finds. Raises AxesFileError if it has a mistake."""
    path = find(given)
    return of_text(axes_text(path), path, every_motor) if path else Axes()


def of_text(text: str, path: str | os.PathLike[str], every_motor: bool = False) -> "Axes":
    """Return the axes in the text of a file, as `axes_of` reads it. path: for errors."""
    return Axes(axes_of(text, path, every_motor), path, camera_of(text, path))


class Axes:
    """The axes of a rig. A motor without an axis has only its number, and its unit is the step.

    Numbers of motors and plain numbers of steps are accepted for every motor.
    """

    def __init__(
        self,
        axes: Iterable[Axis] = (),
        path: str | os.PathLike[str] | None = None,
        camera: Any = None,
    ):
        """camera: [camera], as the file has it."""
        self.path = path
        self.camera = camera
        self._of = {axis.motor: axis for axis in axes}

    # ---- what is typed

    def motor(self, text: str) -> int:
        """Return the motor with this number or name. Raises AxesError."""
        if text.isdecimal():
            if 1 <= int(text) <= MOTORS:
                return int(text)
            raise AxesError(f"expected a motor from 1 to {MOTORS}, found {text}")
        motor = self.named_motor(text)
        if motor is None:
            raise AxesError(f"there is no axis {_short(text)}: {self._known()}")
        return motor

    def named_motor(self, text: str) -> int | None:
        """Return the motor of the axis with this name, or None. Capitals do not matter if only one
        axis has the name."""
        for same in (str, str.lower):
            found = [a.motor for a in self._of.values() if same(a.name) == same(text)]
            if len(found) == 1:
                return found[0]
        return None

    def steps(self, motor: int, text: str) -> int:
        """Return a position in steps: a whole number of steps, or a number with a unit.

        Raises AxesError, also for a position with a unit beyond the limits in axes.toml.
        """
        number, unit = self._quantity(motor, text, "a position")
        axis = self._of.get(motor)
        if not unit or not axis:
            return _in_32_bits(int(number), text)
        steps = axis.steps(float(number) * (factor(unit, axis.unit) or 1))
        if wrong := axis.beyond(steps):
            raise AxesError(f"{axis.name}: {wrong} ({self.path})")
        return _in_32_bits(steps, text)

    def hint(self, motor: int, text: str) -> str:
        """Return a sentence for a position without a unit of an axis that has one, else nothing."""
        axis = self._of.get(motor)
        number = text.strip()
        if not axis or _plain(axis) or not number.strip("+-0") or not number[-1].isdecimal():
            return ""
        if axis.unit == "units":
            return ""
        return f"{number} are steps; for {axis.unit} write {number}{axis.unit}"

    def limits(self, motor: int, lower: str, upper: str) -> tuple[int | None, int | None]:
        """Return the lowest and the highest step between two positions; empty: none.

        Raises AxesError.
        """
        ends = [self.steps(motor, text) if text else None for text in (lower, upper)]
        axis = self._of.get(motor)
        if axis and axis.invert and any(text.strip(_DIGITS) for text in (lower, upper)):
            ends.reverse()  # with a unit: steps count the other way
        return ends[0], ends[1]

    def distance(self, motor: int, text: str, most: int) -> int:
        """Return a distance from 1 to `most` steps, as `steps` reads it. Raises AxesError."""
        return self._amount(motor, text, "a distance", most)

    def rate(self, motor: int, text: str, per: str) -> int:
        """Return a velocity (per "s") or acceleration (per "s²") in steps, at least 1.

        "/s" or "/s²" after the unit may be left out. Raises AxesError.
        """
        what = "a velocity" if per == "s" else "an acceleration"
        return self._amount(motor, re.sub(_PER[per] + "$", "", text), what, 2**30 - 1)

    def _amount(self, motor: int, text: str, what: str, most: int) -> int:
        number, unit = self._quantity(motor, text, what)
        axis = self._of.get(motor)
        scale = (factor(unit, axis.unit) or 1) * axis.steps_per_unit if unit and axis else 1
        found = round(float(number) * scale)
        if not 1 <= found <= most:
            raise AxesError(f"expected {what} of 1 to {most} steps, found {_short(text)}")
        return found

    def _quantity(self, motor: int, text: str, what: str) -> tuple[str, str]:
        """Return number and unit; the unit is empty for whole steps. Raises AxesError."""
        match = _QUANTITY.fullmatch(text.strip())
        if match:
            number, unit = match["number"], (match["unit"] or "").strip()
            unit = _WORDS.get(unit, unit)
            whole = "." not in number
            if whole and unit in ("", STEPS):
                return number, ""
            if unit in self._units(motor):
                return number, unit
        raise AxesError(
            f"expected {what} of {self.name(motor)} in {self._allowed(motor)}, found {_short(text)}"
        )

    def _units(self, motor: int) -> list[str]:
        axis = self._of.get(motor)
        return [unit for unit in UNITS if axis and factor(unit, axis.unit) is not None]

    def _allowed(self, motor: int) -> str:
        units = [unit for unit in self._units(motor) if unit != STEPS]
        if not units:
            return "whole steps" + ("" if motor in self._of else f" ({self._no_axis()})")
        return f"whole steps, or with a unit ({', '.join(units)}) such as 12.5{units[0]}"

    def _no_axis(self) -> str:
        if self._of:
            return f"{self.path} has no axis for it"
        return f"no {FILE} is here or at {user_file()}"

    def _known(self) -> str:
        if not self._of:
            return f"{self._no_axis()}, so motors have numbers only"
        names = ", ".join(f"{axis.name} (motor {axis.motor})" for axis in self._of.values())
        return f"{self.path} has {names}; a motor's number is possible too"

    # ---- what is printed

    @property
    def list(self) -> list[Axis]:
        """Every axis, in the order of motors."""
        return [self._of[motor] for motor in sorted(self._of)]

    def axis(self, motor: int) -> Axis | None:
        """Return a motor's axis, or None."""
        return self._of.get(motor)

    def name(self, motor: int) -> str:
        """Return "pan", or "motor 3" for a motor without an axis."""
        axis = self._of.get(motor)
        return axis.name if axis else f"motor {motor}"

    def names(self, motors: Iterable[int]) -> str:
        """Return "pan, tilt", "motor 3" or "motors 3, 4"."""
        listed = list(motors)
        if any(motor in self._of for motor in listed):
            return ", ".join(map(self.name, listed))
        return f"motor{'s' * (len(listed) > 1)} {', '.join(map(str, listed))}"

    def named(self, text: str) -> str:
        """Replace motors' numbers in a sentence by their names."""
        return _MOTOR.sub(lambda found: self.name(int(found[1])), text)

    def position(self, motor: int, steps: int) -> str:
        """Return a position such as "12.4° (31000)", or "31000" without an axis."""
        shown = self.value(motor, steps)
        return f"{shown} ({steps})" if shown else str(steps)

    def value(self, motor: int, steps: int) -> str:
        """Return a position in its unit, such as "12.4°"; empty if the unit is the step."""
        axis = self._of.get(motor)
        return "" if not axis or _plain(axis) else _shown(axis, axis.position(steps))

    def length(self, motor: int, steps: int, per: str = "") -> str:
        """Return a distance, or a rate per "s" or "s²", such as "20°/s (5000 steps/s)"."""
        axis = self._of.get(motor)
        per = per and f"/{per}"
        if not axis or _plain(axis):
            return f"{steps} steps{per}"
        return f"{_shown(axis, steps / axis.steps_per_unit)}{per} ({steps} steps{per})"

    def for_programs(self, motor: int, steps: int) -> dict[str, str | float]:
        """Return name, unit and position of a motor with an axis, else nothing."""
        axis = self._of.get(motor)
        if not axis:
            return {}
        value = round(axis.position(steps), _decimals(axis))
        return {"axis": axis.name, "unit": axis.unit, "value": value}


def _plain(axis: Axis) -> bool:
    """Return whether positions of an axis are the motor's steps."""
    return axis.unit == STEPS and axis.position(1) == 1


def _shown(axis: Axis, value: float) -> str:
    decimals = _decimals(axis)
    text = f"{round(value, decimals) + 0.0:.{decimals}f}"  # + 0.0: no -0
    text = text.rstrip("0").rstrip(".") if decimals else text
    return text + _SIGNS.get(axis.unit, f" {axis.unit}")


def _decimals(axis: Axis) -> int:
    """Return the fewest decimals that show each step."""
    return max(0, math.ceil(math.log10(axis.steps_per_unit)))


def _in_32_bits(steps: int, text: str) -> int:
    if -(2**31) <= steps < 2**31:
        return steps
    raise AxesError(f"positions have to fit 32 bits signed, found {_short(text)}")


def _short(text: str) -> str:
    return repr(text if len(text) <= 40 else text[:40] + "…")
