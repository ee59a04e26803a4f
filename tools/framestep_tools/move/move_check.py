"""`framestep check`: what a move asks of the motors, before anything moves.

The firmware itself decides whether a motor can do it: each motor's positions are uploaded to a
simulated board with the motor's settings, and a run is prepared there. Velocity and acceleration
come from the same path in floating point (reference.py).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from framestep.motors.rates import DEFAULT_ACCELERATION, DEFAULT_VELOCITY
from framestep.protocol.messages import SET_LOWER, SET_UPPER

from ..axes.rig_axes import Axes
from ..client.client import Client, RequestRefused
from ..client.refusals import explain
from ..client.state import too_steep
from ..judge.reference import Reference, shortest_roll_s, slopes
from ..payloads import GetExceeded, MotorResetPosition, MotorSetLimits, MotorSetSpeed, RtRunMove
from ..simulator.boards import LockstepPort, SimulatedBoard
from .move_file import Move
from .move_peaks import FRAMES, POST_ROLL, PRE_ROLL, Peak, Peaks, peaks
from .turns import jump_in, said_of

FITS, STEEP, REFUSED = "fits", "too steep", "refused"

NOT_REPORTED = ("strict_moves", "backlash", "pulse_us")  # settings that no message asks for
OF_RIG_FILE = (
    f"not considered, as a board does not report them: {', '.join(NOT_REPORTED)} of its rig file; "
    "framestep check --rig FILE takes them from there"
)

_WINDOW = 4
_REACHED = 0.01  # steps; a motor makes a step once the path is there
_UNIT = 9.5  # times the velocity that is set: millimetres for centimetres are ten times
_ROUNDED = 1e-3  # a ramp may be steeper by this part, because rest is on a whole step


@dataclass(frozen=True)
class Setting:
    """A motor's settings: steps/s, steps/s², soft limits in steps (None: none)."""

    velocity: int = DEFAULT_VELOCITY
    acceleration: int = DEFAULT_ACCELERATION
    lower: int | None = None
    upper: int | None = None


@dataclass(frozen=True)
class Device:
    """The board that will play the move: its rig file, its kind, its number of motors (None: as
    that kind) and of frames of eight motors (None: as a simulated one), the names of its motors."""

    rig: Mapping[str, Any]
    board: str = "pico"
    motors: int | None = None
    frames: int | None = None
    axes: Axes = field(default_factory=Axes)


@dataclass(frozen=True)
class MotorVerdict:
    """What the run asks of a motor.

    verdict: FITS; STEEP, played as uploaded although it needs more than the motor's acceleration;
    or REFUSED. reason: why it does not fit. turns: says where it jumps, by full turns or otherwise,
    or that its unit may be wrong.
    """

    motor: int
    name: str
    setting: Setting
    peaks: Peaks
    path: Reference
    verdict: str
    reason: str = ""
    turns: tuple[str, ...] = ()


@dataclass(frozen=True)
class MoveVerdict:
    """Verdict on a move. reason: why the whole is refused although each motor fits, else ""."""

    run: RtRunMove
    motors: list[MotorVerdict]
    reason: str = ""

    @property
    def refused(self) -> bool:
        """Whether the board would refuse it."""
        return bool(self.reason) or any(each.verdict == REFUSED for each in self.motors)

    @property
    def fits(self) -> bool:
        """Whether every motor can do everything."""
        return not self.reason and all(each.verdict == FITS for each in self.motors)

    def place(self, peak: Peak) -> tuple[str, float]:
        """Return PRE_ROLL, FRAMES or POST_ROLL, and the scene frame, of a peak."""
        run = self.run
        step = 1 if run.end_frame >= run.start_frame else -1
        frame = run.start_frame + step * peak.seconds * run.fps_milli / 1000
        last = abs(run.end_frame - run.start_frame)
        if peak.seconds < -1e-9:
            return PRE_ROLL, float(run.start_frame)
        if peak.seconds * run.fps_milli / 1000 > last + 1 + 1e-3:
            return POST_ROLL, float(run.end_frame)
        return FRAMES, round(frame, 2)


def check(
    move: Move, run: RtRunMove, settings: Mapping[int, Setting], device: Device
) -> MoveVerdict:
    """Judge a run of a move. run: the request for the board; settings: by motor."""
    motors = []
    for motor, steps in move.positions.items():
        setting = settings.get(motor, Setting())
        verdict, reason = _ask(replace(move, positions={motor: steps}), run, settings, device)
        path = _path(move, motor, run, setting, device.rig.get("smoothing", True))
        turns = said_of(steps, device.axes.axis(motor), move.start_frame)
        if verdict != FITS and not turns:
            turns = _what_it_is(move, motor, run, setting, device.axes)
        motors.append(
            MotorVerdict(
                motor,
                move.names[motor],
                setting,
                peaks(path, motor),
                path,
                verdict,
                reason,
                tuple(turns),
            )
        )
    whole = MoveVerdict(run, motors)
    if not whole.refused and len(motors) > 1:
        verdict, reason = _ask(move, run, settings, device)
        if verdict == REFUSED:
            return replace(whole, reason=reason)
    return whole


def _what_it_is(move: Move, motor: int, run: RtRunMove, setting: Setting, axes: Axes) -> list[str]:
    """Say that positions which a motor cannot follow have a jump, or perhaps another unit."""
    steps = move.positions[motor]
    at = jump_in(steps)
    if at is not None:
        frame = move.start_frame + at
        length = axes.length(motor, abs(steps[at + 1] - steps[at]))
        return [
            f"it jumps by {length} from frame {frame} to {frame + 1}, and moves evenly elsewhere"
        ]
    fastest = max((abs(b - a) for a, b in pairwise(steps)), default=0) * run.fps_milli / 1000
    if fastest > _UNIT * setting.velocity:
        times = fastest / setting.velocity
        return [f"it needs {times:.0f} times its velocity: is the unit of the file right?"]
    return []


def _ask(
    move: Move, run: RtRunMove, settings: Mapping[int, Setting], device: Device
) -> tuple[str, str]:
    """Return verdict and reason for these motors, from a separate simulated board."""
    with _board(device) as board, Client(LockstepPort(board)) as client:
        client.greet()
        client.axes = device.axes
        try:
            for motor, steps in move.positions.items():
                setting = settings.get(motor, Setting())
                # places it at its first frame, inside its limits
                client.request(
                    MotorResetPosition(motor, int(steps[run.start_frame - move.start_frame]))
                )
                client.request(MotorSetSpeed(motor, setting.velocity, setting.acceleration))
                client.request(
                    MotorSetLimits(
                        motor,
                        int(setting.lower is not None), setting.lower or 0,
                        int(setting.upper is not None), setting.upper or 0,
                        0,
                    )
                )  # fmt: skip
            client.upload_move(move.start_frame, move.end_frame, move.positions, _WINDOW)
            client.request(run)
            steep = too_steep(client)
        except RequestRefused as error:
            return REFUSED, _reason_of(str(explain(client, error)))
    return (STEEP, steep) if steep else (FITS, "")


def _reason_of(refusal: str) -> str:
    """Return the reason of a refusal."""
    return refusal.removeprefix("refused: ")


def _board(device: Device) -> SimulatedBoard:
    room = 0
    if device.frames is not None:
        with SimulatedBoard(device.rig, device.motors, device.board) as board:
            room = board.upload_bytes_for(device.frames)
    board = SimulatedBoard(device.rig, device.motors, device.board, room)
    board.wire_switches()
    board.run_until(board.slice_ns * 50)  # time to read the switches
    return board


def _path(move: Move, motor: int, run: RtRunMove, setting: Setting, smooth: bool) -> Reference:
    """Return the ideal path of a motor in this run."""
    steps = move.positions[motor]
    first, last = run.start_frame - move.start_frame, run.end_frame - move.start_frame
    limits = (setting.lower, setting.upper)
    velocity, _ = slopes(steps, first, last, limits, smooth)
    ends = velocity[[0, -1]] * run.fps_milli / 1000
    if first == last:
        ends = ends * 0
    pre_ms, post_ms = (
        ms or 1000 * shortest_roll_s(float(v), setting.acceleration, smooth)
        for ms, v in zip((run.preroll_ms, run.postroll_ms), ends, strict=True)
    )
    # A move that is too fast for that is refused, but shown as it would have to be played.
    fastest = np.abs(np.diff(steps)).max(initial=0) * run.fps_milli / 1000
    velocities = {motor: setting.velocity} if fastest <= setting.velocity else None
    return Reference(
        {motor: steps},
        run.fps_milli,
        pre_ms,
        post_ms,
        first,
        last,
        {motor: limits},
        velocities,
        smooth,
        {motor: setting.acceleration},
    )


# ---- settings


def settings_of(client: Client, motors: list[int]) -> dict[int, Setting]:
    """Read a device's settings of motors, without motors that it does not have. Raises
    RequestRefused if it does not report them."""
    there = (client.info or client.greet()).motors
    found = {}
    for motor in motors:
        if motor > there:
            continue
        reported = client.request(GetExceeded(motor))
        bits = reported.bits or 0
        found[motor] = Setting(
            reported.velocity or DEFAULT_VELOCITY,
            reported.acceleration or DEFAULT_ACCELERATION,
            reported.lower if bits & SET_LOWER else None,
            reported.upper if bits & SET_UPPER else None,
        )
    return found


# ---- output


def lines(found: MoveVerdict, axes: Axes) -> list[str]:
    """Return the verdict as text, a few lines per motor."""
    said = []
    for each in found.motors:
        top, limits, motor = each.peaks, each.setting, each.motor

        def peak(top: Peak, per: str, motor: int = motor) -> str:
            return axes.length(motor, round(top.value), per) + _place(found, top)

        def limit(steps: int | None, motor: int = motor) -> str:
            return "none" if steps is None else axes.position(motor, steps)

        title = f"motor {motor}" + ("" if each.name == f"motor {motor}" else f", {each.name}")
        said += [
            f"{title}: {each.verdict}"
            + (f": {_of_it(each.reason, axes.name(motor))}" if each.reason else ""),
            *(f"  {turn}" for turn in each.turns),
            f"  velocity      {peak(top.velocity, 's')}" + _setting(top.velocity, limits.velocity),
            f"  acceleration  {peak(top.acceleration, 's²')}"
            + _setting(top.acceleration, limits.acceleration),
            f"  jerk          {peak(top.jerk, 's³')}",
            f"  positions     {axes.position(motor, math.ceil(top.lowest.value - _REACHED))} to "
            f"{axes.position(motor, math.floor(top.highest.value + _REACHED))}, "
            + (
                "no soft limits"
                if limits.lower is None and limits.upper is None
                else f"soft limits {limit(limits.lower)} and {limit(limits.upper)}"
            ),
        ]
    if found.reason:
        said.append(f"the move as a whole: refused: {found.reason}")
    return said


def _of_it(reason: str, name: str) -> str:
    """Remove the motor's name from the beginning of a reason."""
    rest = reason.removeprefix(f"{name} ")
    return reason if rest == reason else rest.replace("would", "it would", 1)


def _place(found: MoveVerdict, peak: Peak) -> str:
    if round(peak.value) == 0:
        return ""
    part, frame = found.place(peak)
    return f" at frame {frame:g}" if part == FRAMES else f" in the {part}"


def _setting(peak: Peak, setting: int) -> str:
    return f", set {setting}" + ("; above it" if peak.value > setting * (1 + _ROUNDED) else "")


def for_programs(found: MoveVerdict) -> dict[str, Any]:
    """Return the verdict as values for JSON."""

    def as_values(peak: Peak) -> dict[str, Any]:
        part, frame = found.place(peak)
        return {"value": round(peak.value, 3), "frame": frame, "part": part}

    return {
        "fps": found.run.fps_milli / 1000,
        "frames": [found.run.start_frame, found.run.end_frame],
        "fits": found.fits,
        "refused": found.refused,
        "reason": found.reason or None,
        "motors": [
            {
                "motor": each.motor,
                "name": each.name,
                "verdict": each.verdict,
                "reason": each.reason or None,
                "turns": list(each.turns),
                "set": vars(each.setting),
                **{name: as_values(peak) for name, peak in each.peaks._asdict().items()},
            }
            for each in found.motors
        ],
    }
