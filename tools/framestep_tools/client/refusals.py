"""Explain a refusal: which motor, which frame, what would be needed, and which setting forbids it.

This asks the device for its settings by framestep's own messages. Refusals of other devices keep
the text of their code.
"""

from typing import Any

from framestep import texts
from framestep.motors.axis import FULL_SPEED
from framestep.motors.positions import SERVO
from framestep.moves.path.move_check import FASTEST_FPS
from framestep.moves.run_plan import LONGEST_ROLL
from framestep.moves.shoot import LONGEST_MS
from framestep.moves.upload.store import FARTHEST_FRAME
from framestep.protocol.messages import (
    CONDITION_CLOCK,
    CONDITION_DRIVER,
    CONDITION_ESTOP,
    CONDITION_RIG_FILE_INVALID,
    EXCEEDED_ACCELERATION,
    EXCEEDED_BOARD,
    EXCEEDED_LOWER,
    EXCEEDED_MEMORY,
    EXCEEDED_POSTROLL,
    EXCEEDED_PREROLL,
    EXCEEDED_UPPER,
    EXCEEDED_VELOCITY,
    SET_AT_LOWER,
    SET_AT_UPPER,
    SET_ENABLED,
    SET_FOLLOWS,
    SET_LOWER,
    SET_UPPER,
)

from ..payloads import (
    Ack,
    Exceeded,
    GetCondition,
    GetExceeded,
    Home,
    MotorJog,
    MotorMove,
    MotorResetPosition,
    MotorSetLimits,
    MotorSetSpeed,
    MotorStatus,
    Payload,
    RtGo,
    RtJogAll,
    RtPositionFrame,
    RtRunMove,
    RtShootFrame,
    RtShootFrame2,
    RtUploadMoveAxis,
    RtUploadMoveBegin,
    RtUploadMoveDmx,
    RtUploadMoveEnd,
    RtUploadMoveTriggers,
    SetVirtAimPoint,
    VirtGetPosition,
    VirtJog,
    VirtJogOnLine,
    VirtMove,
    VirtStop,
)
from .client import Client, ClientError, RequestRefused

_SHOTS = (RtShootFrame, RtShootFrame2)
_PLAY = (RtRunMove, RtPositionFrame, RtJogAll, RtGo, *_SHOTS)
_SECTIONS = (RtUploadMoveAxis, RtUploadMoveDmx, RtUploadMoveTriggers, RtUploadMoveEnd)
_VIRTUAL = (VirtMove, VirtStop, VirtJog, VirtJogOnLine, VirtGetPosition, SetVirtAimPoint)

_SPEED = "set in Dragonframe's axis set-up, or with --velocity and --acceleration"
_LIMITS = "set in Dragonframe's axis set-up, or in framestep console"
_STOPPED = (
    (
        CONDITION_RIG_FILE_INVALID,
        "the rig file has a mistake, see the REPL: nothing moves until it is corrected",
    ),
    (CONDITION_ESTOP, "the E-stop is held"),
    (CONDITION_CLOCK, "a program on the REPL changed the processor's clock: reset the board"),
    (CONDITION_DRIVER, "a driver does not work (the REPL says which and why)"),
)
_UNSENT = -(2**31)  # means a frame that was not sent (field note 5.3)
_NO_UPLOAD = "no move has been uploaded since the board's start: framestep upload FILE"


def explain(client: Client, error: RequestRefused) -> RequestRefused:
    """Return the same refusal, with an explanation from the device's settings as its text."""
    try:
        found = _why(client, error.request, error.code)
    except ClientError:  # it does not know this message, or is gone
        found = None
    if found:
        error.args = (f"refused: {found}",)
    return error


def _why(client: Client, request: Payload, code: Ack) -> str | None:
    if isinstance(request, Home) and code == Ack.ERR_UNSUPPORTED:
        return "no motor has `home` in the rig file (docs/use/homing.md), or the firmware is older"
    if code in (Ack.ERR_UNSUPPORTED, Ack.ERR_CHECKSUM):
        return None
    info = client.info or client.greet()
    if isinstance(request, _VIRTUAL):
        return _virtual(client, request, code)
    for motor in _motors(request):
        if not 1 <= motor <= info.motors:
            return f"there is no motor {motor}, the device has motors 1 to {info.motors}"
    if code == Ack.ERR_MOVING:
        return _moving(client, _motors(request))
    if isinstance(request, _SECTIONS):
        return _section(client, request, code)
    if isinstance(request, RtUploadMoveBegin):
        return _frames(request, info.upload_frames)
    if code == Ack.ERR_GENERAL:
        return _general(client, request)
    if isinstance(request, Home):
        return _home(client, request, code)
    if code in (Ack.ERR_HARD_UP, Ack.ERR_HARD_LOW):
        return _at_switch(client, _motors(request) or range(1, info.motors + 1), code)
    if isinstance(request, _PLAY):
        return _play(client, request, code)
    if _motors(request):
        return _motor(client, request, code, client.request(GetExceeded(_motors(request)[0])))
    return None


def _motors(request: Payload) -> list[int]:
    """List the motors that a request names."""
    motor = getattr(request, "motor", None)
    if isinstance(motor, int):
        return [motor]
    listed: Any = getattr(request, "motors", ())
    return [each if isinstance(each, int) else each.motor for each in listed]


def _moving(client: Client, named: list[int]) -> str:
    moving = client.request(MotorStatus()).moving
    if not moving:
        return "a run waits for GO or has not ended yet: framestep stop ends it"
    which = [motor for motor in moving if motor in named] or moving
    return f"{client.axes.names(which)} move{'s' * (len(which) == 1)}; wait, or framestep stop"


def what_stops(client: Client) -> str | None:
    """Say what keeps the device from moving anything, or None."""
    bits = client.request(GetCondition()).bits
    return next((text for bit, text in _STOPPED if bits & bit), None)


def _general(client: Client, request: Payload) -> str | None:
    stopped = what_stops(client)
    if stopped:
        return stopped
    if isinstance(request, RtGo):
        return "no run waits, or a motor of it has been switched off since"
    if isinstance(request, _PLAY):
        return _NO_UPLOAD
    for motor in _motors(request):
        bits = client.request(GetExceeded(motor)).bits or 0
        name = client.axes.name(motor)
        if bits & SET_FOLLOWS:
            leader = client.axes.name(motor - 1)
            return f"{name} does what {leader} does (they are coupled): move that one"
        if not bits & SET_ENABLED:
            return f"{name} is switched off by MOTOR_CONFIGURE: enable its axis in Dragonframe"
        return (
            f"{name} is coupled to one that is switched off, "
            "or something else has taken a pin of it"
        )
    return None


def _at_switch(client: Client, motors: Any, code: Ack) -> str | None:
    """Say which of these motors are at a limit switch, or None."""
    up = code == Ack.ERR_HARD_UP
    bit = SET_AT_UPPER if up else SET_AT_LOWER
    found = [m for m in motors if (client.request(GetExceeded(m)).bits or 0) & bit]
    if not found:
        return None
    both = SET_AT_UPPER | SET_AT_LOWER
    for motor in found:
        if (client.request(GetExceeded(motor)).bits or 0) & both == both:
            return (
                f"{client.axes.name(motor)} is at a limit switch, and nobody knows at which end: "
                "framestep home finds out, or move it off by hand"
            )
    where = "is at its" if len(found) == 1 else "are at their"
    return (
        f"{client.axes.names(found)} {where} {'upper' if up else 'lower'} limit switch, "
        f"and may move {'down' if up else 'up'} only"
    )


# ---- single motors


def _motor(client: Client, request: Payload, code: Ack, exceeded: Exceeded) -> str | None:
    motor, axes = exceeded.of or 0, client.axes
    name = axes.name(motor)
    if isinstance(request, (MotorMove, MotorJog)) and code in (Ack.ERR_SOFT_UP, Ack.ERR_SOFT_LOW):
        at = request.position if isinstance(request, MotorMove) else request.destination
        up = code == Ack.ERR_SOFT_UP
        if _is_servo(client, motor):
            return (
                f"{axes.position(motor, at)} is past the {'upper' if up else 'lower'} end of "
                f"{name}, a servo (servo.low and servo.high in the rig file), or past a soft limit"
            )
        limit = (exceeded.upper if up else exceeded.lower) or 0
        return (
            f"{axes.position(motor, at)} is past the {'upper' if up else 'lower'} soft limit of "
            f"{name}, {axes.position(motor, limit)} ({_LIMITS})"
        )
    if code != Ack.ERR_RANGE:
        return None
    if isinstance(request, MotorJog) and not 1 <= request.speed <= FULL_SPEED:
        return f"{name} jogs at a speed of 1 to {FULL_SPEED}, not {request.speed}"
    if isinstance(request, MotorSetSpeed):
        if not request.velocity or not request.acceleration:
            return f"{name} needs a velocity and an acceleration of at least 1"
        return (
            f"{name} cannot do {axes.length(motor, request.velocity, 's')} "
            "with the pulses of its rig file (pulse_us)"
        )
    if isinstance(request, MotorSetLimits):
        return _set_limits(client, request)
    if isinstance(request, MotorResetPosition):
        if _is_servo(client, motor):
            return f"{name} is a servo: its pulses say where it is, so its position cannot be set"
        return f"{axes.position(motor, request.position)} leaves no room for the backlash of {name}"
    return None


def _is_servo(client: Client, motor: int) -> bool:
    trusts = client.request(GetCondition()).positions
    return 1 <= motor <= len(trusts) and trusts[motor - 1].reason == SERVO


def _set_limits(client: Client, request: MotorSetLimits) -> str:
    both = request.lower_enable and request.upper_enable
    motor, axes = request.motor, client.axes
    if both and request.lower > request.upper:
        return (
            f"the lower limit of {axes.name(motor)}, {axes.position(motor, request.lower)}, "
            f"is above the upper one, {axes.position(motor, request.upper)}"
        )
    sets = client.info.limit_sets if client.info else 0
    there = f"has sets 1 to {sets}" if sets else "has none"
    return (
        f"{axes.name(motor)} cannot have limit switch set {request.limit_set & 0x7F}: "
        f"the rig file {there} (limits)"
    )


def _home(client: Client, request: Home, code: Ack) -> str | None:
    if code == Ack.ERR_RANGE:
        motors = _motors(request)
        which = ("one of " if len(motors) > 1 else "") + client.axes.names(motors)
        return f"the rig file has no `home` for {which} (docs/use/homing.md)"
    side = {Ack.ERR_SOFT_UP: "upper", Ack.ERR_SOFT_LOW: "lower"}.get(code)
    return side and (
        f"the position of a home switch is past the {side} soft limit of its motor ({_LIMITS}); "
        "soft limits count, as the position is known"
    )


# ---- uploads


def _frames(request: RtUploadMoveBegin, room: int) -> str:
    first, last = request.start_frame, request.end_frame
    if last < first:
        return f"the move would end at frame {last}, before it begins at {first}"
    if max(-first, last) > FARTHEST_FRAME:
        return f"frames have numbers from {-FARTHEST_FRAME} to {FARTHEST_FRAME}"
    return f"{last - first + 1} frames are more than the {room} that fit"


def _section(client: Client, request: Payload, code: Ack) -> str | None:
    if code == Ack.ERR_GENERAL:
        return "no upload has begun"
    if code != Ack.ERR_RANGE:
        return None
    exceeded = client.request(GetExceeded())
    if exceeded.what != EXCEEDED_MEMORY:
        return _outside(client, request)
    return (
        f"{_part(client, request)}: the board's memory is full; "
        f"this section needs {exceeded.by} bytes, {exceeded.room} are free: "
        "fewer frames, motors or channels, or calmer motion and light"
    )


def _part(client: Client, request: Payload) -> str:
    """Name the content of a request of an upload."""
    if isinstance(request, RtUploadMoveAxis):
        return f"the positions of {client.axes.name(request.motor)} from {_index(request)} on"
    if isinstance(request, RtUploadMoveDmx):
        return f"the levels of channel {request.channel} from {_index(request)} on"
    if isinstance(request, RtUploadMoveTriggers):
        return "triggers"
    return "the frames between those that were sent"


def _index(request: RtUploadMoveAxis | RtUploadMoveDmx) -> str:
    return f"the upload's frame {(request.start_index & 0x7FFF_FFFF) + 1}"


def _outside(client: Client, request: Payload) -> str | None:
    """Say what is wrong with a section that would have fitted into the memory."""
    if isinstance(request, RtUploadMoveAxis) and _UNSENT in request.positions:
        return f"{_part(client, request)} have one of {_UNSENT}, which no motor can take"
    if isinstance(request, RtUploadMoveDmx) and not 1 <= request.channel <= 512:
        return f"there is no channel {request.channel}, there are channels 1 to 512"
    if isinstance(request, (RtUploadMoveAxis, RtUploadMoveDmx)):
        return f"{_part(client, request)} begin past its last frame"
    return None


# ---- operations that play the upload


def _play(client: Client, request: Payload, code: Ack) -> str | None:
    wrong = code == Ack.ERR_RANGE and _wrong_value(request)
    if wrong:
        return wrong
    if isinstance(request, RtPositionFrame):
        if code == Ack.ERR_RANGE:
            return f"frame {request.frame} is not in the upload"
        return None
    exceeded = client.request(GetExceeded())
    motor, frame, axes = exceeded.motor, exceeded.frame, client.axes
    rate = getattr(request, "fps_milli", None)
    rate = "" if rate is None else f" at {rate / 1000:g} frames/s"
    where = f"{axes.name(motor)} at frame {frame}"
    if exceeded.what == EXCEEDED_VELOCITY and exceeded.velocity is not None:
        return (
            f"{where} would need {axes.length(motor, exceeded.velocity + exceeded.by, 's')}{rate}, "
            f"its velocity is {axes.length(motor, exceeded.velocity, 's')} ({_SPEED})"
        )
    if (
        exceeded.what == EXCEEDED_ACCELERATION
        and exceeded.acceleration is not None
        and code == Ack.ERR_RANGE
        and not isinstance(request, _SHOTS)
    ):
        return (
            f"{where} would need "
            f"{axes.length(motor, exceeded.acceleration + exceeded.by, 's²')}{rate}, "
            f"its acceleration is {axes.length(motor, exceeded.acceleration, 's²')} ({_SPEED}), "
            "and strict_moves is set in the rig file"
        )
    if exceeded.what == EXCEEDED_BOARD:
        return (
            f"{where} would need a change of velocity that the board cannot make: "
            "fewer steps or fewer frames/s"
        )
    if exceeded.what == EXCEEDED_UPPER:
        return (
            f"{where} would be past its upper soft limit, "
            f"{_limit(client, exceeded, exceeded.upper, SET_UPPER)}"
        )
    if exceeded.what == EXCEEDED_LOWER:
        return (
            f"{where} would be past its lower soft limit, "
            f"{_limit(client, exceeded, exceeded.lower, SET_LOWER)}"
        )
    if exceeded.what in (EXCEEDED_PREROLL, EXCEEDED_POSTROLL):
        return _ramp(client, request, exceeded)
    if code == Ack.ERR_NOT_IN_POSITION:
        return (
            "the motors are not on a frame of the upload: send them to one"
            if isinstance(request, RtJogAll)
            else "the motors are not at its start: prepare it again"
        )
    if code == Ack.ERR_RANGE:
        return _where(request, rate)
    return axes.named("; ".join(texts.exceeded(exceeded.what, motor, frame, exceeded.by))) or None


def _wrong_value(request: Payload) -> str | None:
    """Name a value that no upload and no setting would make valid, or None."""
    fps = getattr(request, "fps_milli", None)
    if fps is not None and not 0 < fps <= FASTEST_FPS:
        return f"{fps / 1000:g} frames/s: expected more than 0, at most {FASTEST_FPS // 1000}"
    for name in ("preroll_ms", "postroll_ms"):
        if getattr(request, name, 0) > LONGEST_ROLL:
            roll = name.removesuffix("roll_ms")
            return f"the {roll}-roll has {LONGEST_ROLL // 1000} s at most"
    if isinstance(request, _SHOTS) and request.exposure_ms > LONGEST_MS:
        return f"an exposure of {request.exposure_ms} ms: {LONGEST_MS // 1000} s are the longest"
    if isinstance(request, RtShootFrame) and request.blur > 1000:
        return f"a blur of {request.blur}: expected 0 to 1000 (tenths of a percent)"
    if isinstance(request, RtShootFrame) and request.direction > 1:
        return f"direction {request.direction}: expected 0 (backward) or 1 (forward)"
    if isinstance(request, RtShootFrame2) and request.close_angle <= request.open_angle:
        return (
            f"the shutter would close at {request.close_angle} degrees, "
            f"before it opens at {request.open_angle}"
        )
    return None


def _where(request: Payload, rate: str) -> str:
    """Name the frames of a request that are not in the upload."""
    if isinstance(request, RtRunMove):
        return (
            f"frames {request.start_frame} to {request.end_frame}{rate} are not all in the upload"
        )
    if isinstance(request, RtJogAll):
        return f"frame {request.destination} is not in the upload"
    if isinstance(request, _SHOTS):
        return (
            f"frame {request.frame} is not in the upload, "
            f"or an exposure of {request.exposure_ms} ms is too long"
        )
    return "the prepared run does not fit the settings made since"


def _ramp(client: Client, request: Payload, exceeded: Exceeded) -> str:
    """Say what a motor would exceed before or after the frames."""
    pre = exceeded.what == EXCEEDED_PREROLL
    motor, bits, axes = exceeded.motor, exceeded.bits or 0, client.axes
    name = axes.name(motor)
    if exceeded.by and exceeded.acceleration is not None:
        needs = (
            f"{name} would need {axes.length(motor, exceeded.acceleration + exceeded.by, 's²')}, "
            f"its acceleration is {axes.length(motor, exceeded.acceleration, 's²')} ({_SPEED})"
        )
    else:
        limits = [axes.position(motor, exceeded.lower or 0)] * bool(bits & SET_LOWER)
        limits += [axes.position(motor, exceeded.upper or 0)] * bool(bits & SET_UPPER)
        past = f"pass its soft limit, {' or '.join(limits)} ({_LIMITS})"
        needs = f"{name} would {past if limits else 'leave the range of positions'}"
    if isinstance(request, RtShootFrame):
        when = f"second {'before' if pre else 'after'} the exposure"
        return f"in the {when} of frame {exceeded.frame} {needs}: expose longer, or move less"
    if isinstance(request, RtShootFrame2):
        return f"in the exposure of frame {exceeded.frame} {needs}: expose longer, or move less"
    roll = "pre-roll" if pre else "post-roll"
    time_ms = getattr(request, "preroll_ms" if pre else "postroll_ms", None)
    time = "" if time_ms is None else f" of {time_ms} ms"
    return (
        f"in its {roll}{time} {needs}: give it a {'longer' if exceeded.by else 'shorter'} one, "
        "or begin and end the move more slowly"
    )


def _limit(client: Client, exceeded: Exceeded, value: int | None, which: int) -> str:
    if not (exceeded.bits or 0) & which:
        return "which is the coupled motor's"
    return f"{client.axes.position(exceeded.motor, value or 0)} ({_LIMITS})"


# ---- virtual axes


def _virtual(client: Client, request: Payload, code: Ack) -> str | None:
    if code == Ack.ERR_GENERAL:
        stopped = None if isinstance(request, VirtGetPosition) else what_stops(client)
        if stopped:
            return stopped
        if client.code(VirtGetPosition()) == Ack.ERR_GENERAL:
            return (
                "no virtual axes are configured: "
                "Dragonframe does that when a rig with such axes is set up"
            )
        return "a motor of the rig is switched off by MOTOR_CONFIGURE, or coupled to another one"
    if code == Ack.ERR_MOVING:
        return _moving(client, [])
    if code in (Ack.ERR_HARD_UP, Ack.ERR_HARD_LOW):
        return _at_switch(client, range(1, (client.info or client.greet()).motors + 1), code)
    if code in (Ack.ERR_SOFT_UP, Ack.ERR_SOFT_LOW):
        return _past_limits(client, code)
    if code == Ack.ERR_RANGE and isinstance(request, VirtMove):
        return (
            f"the rig has no virtual axis {request.motor}, "
            "or its arm does not reach a point on the way"
        )
    return None


def _past_limits(client: Client, code: Ack) -> str:
    """Name the soft limits that a motor of the rig would pass."""
    up = code == Ack.ERR_SOFT_UP
    limits = []
    for motor in range(1, (client.info or client.greet()).motors + 1):
        exceeded = client.request(GetExceeded(motor))
        if (exceeded.bits or 0) & (SET_UPPER if up else SET_LOWER):
            limit = (exceeded.upper if up else exceeded.lower) or 0
            limits.append(f"{client.axes.name(motor)} {client.axes.position(motor, limit)}")
    which = "upper" if up else "lower"
    return f"a motor would pass its {which} soft limit ({', '.join(limits)}; {_LIMITS})"
