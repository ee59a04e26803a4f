"""Which motor a column of a move is for: its heading says so."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ..axes.axes_file import MOTORS
from ..axes.rig_axes import Axes
from ..axes.units import without_unit
from ..text.text_file import MoveFileError, shown

_NUMBER = re.compile(r"(?:motor[ _]?)?(\d{1,9})(?:\.0*)?", re.IGNORECASE)
# what somebody may mean by a motor's number, and what does not count as one
_LIKE_NUMBER = re.compile(
    r"(?:m|motors?|axis|ax|channel|ch|no|nr)?[ _.:#-]*(\d{1,9})(?:\.0*)?[ .:]*", re.IGNORECASE
)


@dataclass(frozen=True)
class Columns:
    """The motor of each column, and the names of the motors.

    counted: says which motors the headings are that only count in their order; empty if none does
    """

    motors: list[int]
    names: dict[int, str]
    counted: str


def columns_of(headings: Sequence[str], axes: Axes, path: str) -> Columns:
    """Return the motors of columns with positions in steps.

    A heading that is an axis's name, a motor's number or `motor 2` decides. Others count in their
    order. Raises MoveFileError if two columns are for one motor, if axes.toml calls that motor
    otherwise, or if a heading such as `m2` or `#2` is not at its place.
    """
    motors, names, counted = [], {}, []
    heading_of: dict[int, str] = {}
    for place, heading in enumerate(headings, 1):
        where = f"{path}, column {shown([heading])}"
        name, unit = without_unit(heading)
        if unit not in ("", "steps"):
            raise MoveFileError(
                f"{where}: a move has steps, this is in {unit}: framestep import converts it"
            )
        motor = _motor(name, axes, where)
        axis = axes.axis(motor or place)
        if motor is None:
            motor = place
            like = _LIKE_NUMBER.fullmatch(name)
            if like and int(like[1]) != place:
                raise MoveFileError(
                    f"{where}: by its place it is motor {place}: write motor {place}, or "
                    f"motor {int(like[1])} if you mean that"
                )
            if axis:
                raise MoveFileError(
                    f"{where}: no axis has this name, and {axes.path} calls motor {place} "
                    f"{axis.name!r}: head the column by the name of an axis or by a motor's "
                    f"number, such as motor {place}"
                )
            counted.append(f"{heading or 'the column without a name'} is motor {place}")
        if motor in heading_of:
            raise MoveFileError(
                f"{where}: it is for motor {motor}, as is column {shown([heading_of[motor]])}"
            )
        heading_of[motor] = heading
        motors.append(motor)
        by_number = f"motor {motor}" if _NUMBER.fullmatch(name) else heading
        names[motor] = axis.name if axis else by_number
    ordered = dict(sorted(names.items()))
    return Columns(motors, ordered, ", ".join(counted))


def heading(motor: int, place: int, name: str) -> str:
    """Return what heads a motor's column, so that columns_of() reads this motor without axes.toml,
    too: its name, if that does not say otherwise."""
    number = _LIKE_NUMBER.fullmatch(name)
    if motor != place or without_unit(name) != (name, "") or (number and int(number[1]) != motor):
        return f"motor {motor}"
    return name


def _motor(name: str, axes: Axes, where: str) -> int | None:
    """Return the motor that a heading names, or None. Raises MoveFileError."""
    named = axes.named_motor(name)
    number = _NUMBER.fullmatch(name)
    if not number:
        return named
    motor = int(number[1])
    if not 1 <= motor <= MOTORS:
        raise MoveFileError(f"{where}: expected a motor from 1 to {MOTORS}")
    if named not in (None, motor):
        raise MoveFileError(
            f"{where}: {axes.path} has an axis of this name for motor {named}: "
            f"write motor {motor} or motor {named}"
        )
    return motor
