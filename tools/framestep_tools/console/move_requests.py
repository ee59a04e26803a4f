"""The page's requests about a move: the verdict of `framestep check`, the files of `framestep
export`."""

import base64
import json
from typing import Any

from ..axes import rig_axes
from ..errors import ToolError
from ..move.move_file import Move
from .axes_text import AxesText

_INT32 = range(-(2**31), 2**31)


class MoveWork:
    """Requests with a move as JSON: {"start": its first frame, "positions": steps by motor}.

    axes: the names and units of the motors, if the server has them. The methods block and raise
    ToolError.
    """

    def __init__(self, axes: AxesText | None):
        self._axes = axes

    def check_move(self, text: str) -> dict[str, Any]:
        """Return {"lines": the verdict as text, "fits", "refused"} for a run of the whole move.

        Further values of the JSON: fps; motors and frames as in HI; set: velocity, acceleration,
        lower and upper soft limit (null: none) of each motor.
        """
        from ..move import move_check
        from ..payloads import RtRunMove

        asked = _values(text)
        axes = self._rig()
        move = _move(asked, axes)
        fps = _fps(asked)
        counts = [asked.get(key) for key in ("motors", "frames")]
        if fps is None or not all(type(each) is int and 0 <= each in _INT32 for each in counts):
            raise ToolError("the page has asked for no move: fps, motors or frames are missing")
        try:
            run = RtRunMove(
                fps_milli=round(fps * 1000),
                start_frame=move.start_frame,
                end_frame=move.end_frame,
                preroll_ms=1000,
                postroll_ms=1000,
            )
            settings = {
                motor: move_check.Setting(**given)
                for motor, given in zip(move.positions, asked["set"], strict=True)
            }
            device = move_check.Device(
                {}, motors=min(asked["motors"], 32), frames=asked["frames"], axes=axes
            )
            for each in settings.values():
                rates, ends = (each.velocity, each.acceleration), (each.lower, each.upper)
                if not all(type(rate) is int and rate >= 1 for rate in rates):
                    raise ValueError("a velocity or an acceleration is below 1")
                if not all(end is None or type(end) is int for end in ends):
                    raise ValueError("a limit is no whole number")
        except (KeyError, TypeError, ValueError) as error:
            raise ToolError(f"the page has asked for no move: {error}") from None
        found = move_check.check(move, run, settings, device)
        return {
            "lines": [*move_check.lines(found, device.axes), move_check.OF_RIG_FILE],
            "fits": found.fits,
            "refused": found.refused,
        }

    def export_move(self, text: str) -> dict[str, Any]:
        """Return the file's {"text"}. Further values of the JSON: format, fps; pose: whether it is
        the camera's pose, not the axes."""
        from ..move.camera_rig import rig_of
        from ..move.move_conversion import to_pose_table, to_table
        from ..move.move_formats import FORMATS, WITH_RATE

        asked = _values(text)
        chosen = FORMATS.get(str(asked.get("format")))
        if chosen is None:
            raise ToolError(f"the format is one of {', '.join(FORMATS)}")
        if not self._axes or not self._text():
            raise ToolError(
                "there is no axes.toml, which names the axes in the file: save one under Names, "
                "units, or save the move as CSV in steps"
            )
        axes = rig_axes.load(self._axes.path, every_motor=True)
        move = _move(asked, rig_axes.Axes())
        if asked.get("pose") is True:
            rig = rig_of(axes)
            if rig is None:
                raise ToolError(
                    "there is no [camera] in axes.toml, which describes the rig of the camera: "
                    "see docs/use/virtual-axes.md"
                )
            table = to_pose_table(move, axes.list, rig, chosen.CAMERA)
        else:
            table = to_table(move, axes.list)
        fps = _fps(asked) if chosen.NAME in WITH_RATE else None
        return {"text": chosen.write(table, fps)}

    def read_move(self, text: str) -> dict[str, Any]:
        """Return the move in another program's file, as JSON like the one above, with names of the
        motors, fps (null: not known) and said: what a user should know.

        Values of the JSON: name of the file, its text, or else its data in base64, fps (null: it
        is not known).
        """
        from ..move.any_file import any_of
        from ..text.text_file import decoded

        asked = _values(text)
        name = asked.get("name")
        content = asked.get("text", asked.get("data"))
        if not isinstance(name, str) or not isinstance(content, str):
            raise ToolError("the page has sent no file")
        try:
            data = content.encode() if "text" in asked else base64.b64decode(content, validate=True)
        except ValueError:
            raise ToolError("the page has sent no file") from None
        axes = self._rig()
        read = decoded(data, f"cannot read {name}")
        move = any_of(read, name, axes, _fps(asked))
        return {
            "start": move.start_frame,
            "motors": list(move.positions),
            "names": list(move.names.values()),
            "positions": list(move.positions.values()),
            "fps": move.fps,
            "said": list(move.said),
        }

    def _rig(self) -> rig_axes.Axes:
        text = self._text()
        return rig_axes.of_text(text, "axes.toml") if text else rig_axes.Axes()

    def _text(self) -> str:
        return self._axes.read()["text"] if self._axes else ""


def _values(text: str) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ToolError(f"the page has sent no JSON: {error}") from None
    if not isinstance(found, dict):
        raise ToolError("the page has sent no JSON object")
    return found


def _fps(asked: dict[str, Any]) -> float | None:
    """Return the frames per second in a request, None for null. Raises ToolError for others."""
    from ..move.table import FASTEST, SLOWEST

    fps = asked.get("fps")
    if fps is None:
        return None
    if type(fps) not in (int, float) or not SLOWEST <= fps <= FASTEST:
        raise ToolError(f"expected frames per second from {SLOWEST:g} to {FASTEST:g}, found {fps}")
    return float(fps)


def _move(asked: dict[str, Any], axes: rig_axes.Axes) -> Move:
    """Return the move in a request. Raises ToolError if it is none."""
    start, columns = asked.get("start"), asked.get("positions")
    lists = isinstance(columns, list) and all(isinstance(each, list) for each in columns)
    if (
        not isinstance(start, int)
        or not lists
        or not columns
        or len({len(each) for each in columns}) != 1
        or not columns[0]
        or not all(type(step) is int and step in _INT32 for each in columns for step in each)
    ):
        raise ToolError("the page has sent no move: a first frame, and steps for each motor")
    names = {motor: axes.name(motor) for motor in range(1, len(columns) + 1)}
    return Move(start, names, dict(enumerate(columns, 1)))
