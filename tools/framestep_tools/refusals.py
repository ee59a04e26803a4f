"""Why a device refuses a request, in words: which motor, which frame, what would be needed and what
is set where.

The device is asked what it is set to (framestep's own messages); other devices' refusals keep the
words of their code.
"""

from framestep import texts
from framestep.protocol.messages import (
    CONDITION_DRIVER,
    CONDITION_ESTOP,
    CONDITION_RIG_FILE_INVALID,
    EXCEEDED_ACCELERATION,
    EXCEEDED_BOARD,
    EXCEEDED_LOWER,
    EXCEEDED_POSTROLL,
    EXCEEDED_PREROLL,
    EXCEEDED_UPPER,
    EXCEEDED_VELOCITY,
    SET_ENABLED,
    SET_FOLLOWS,
    SET_LOWER,
    SET_UPPER,
)

from .client import Client, ClientError, RequestRefused
from .payloads import (
    Ack,
    Exceeded,
    GetCondition,
    GetExceeded,
    MotorJog,
    MotorMove,
    MotorResetPosition,
    MotorSetSpeed,
    MotorStatus,
    Payload,
    RtGo,
    RtRunMove,
    RtUploadMoveBegin,
    RtUploadMoveEnd,
    VirtGetPosition,
    VirtMove,
    type_name,
)

_SPEED = (
    "set by SET_SPEED: Dragonframe's axis set-up, or framestep move … --velocity --acceleration"
)
_LIMITS = "set by SET_LIMITS: Dragonframe's axis set-up"
_STOPPED = (
    (
        CONDITION_RIG_FILE_INVALID,
        "the rig file has a mistake, which the REPL tells: nothing moves until it is right",
    ),
    (CONDITION_ESTOP, "the E-stop is held"),
    (CONDITION_DRIVER, "a driver does not work (the REPL tells which and why)"),
)


def explain(client: Client, error: RequestRefused) -> RequestRefused:
    """The same refusal, with what the device tells about it as its text."""
    try:
        found = _why(client, error.request, error.code)
    except ClientError:  # it does not tell, or has gone
        found = None
    if found:
        error.args = (f"{type_name(error.request.TYPE)} was refused: {found}",)
    return error


def _why(client: Client, request: Payload, code: Ack) -> str | None:
    info = client.info or client.greet()
    motor = getattr(request, "motor", None)
    if isinstance(motor, int) and motor > info.motors:
        return f"there is no motor {motor}, the device has motors 1 to {info.motors}"
    if isinstance(request, RtUploadMoveBegin) and code == Ack.ERR_RANGE:
        frames = request.end_frame - request.start_frame + 1
        return (
            f"{frames} frames are more than the {info.upload_frames} that fit, "
            "or their numbers go beyond ±1000000"
        )
    if code == Ack.ERR_MOVING:
        return _moving(client, motor)
    if code == Ack.ERR_GENERAL:
        return _general(client, request, motor)
    if isinstance(request, RtRunMove):
        return _run(client, request, code)
    if isinstance(motor, int):
        return _motor(client, request, code, client.request(GetExceeded(motor)))
    return None


def _moving(client: Client, motor: int | None) -> str:
    moving = client.request(MotorStatus()).moving
    if not moving:
        return "a run waits for GO or has not ended yet: framestep stop ends it"
    which = (
        f"motor {motor} moves" if motor in moving else f"motors {', '.join(map(str, moving))} move"
    )
    return f"{which}; wait, or framestep stop"


def _general(client: Client, request: Payload, motor: int | None) -> str | None:
    bits = client.request(GetCondition()).bits
    for bit, text in _STOPPED:
        if bits & bit:
            return text
    if isinstance(motor, int):
        told = client.request(GetExceeded(motor)).bits or 0
        if told & SET_FOLLOWS:
            return (
                f"motor {motor} does what motor {motor - 1} does (they are coupled): move that one"
            )
        if not told & SET_ENABLED:
            return (
                f"motor {motor} is switched off by MOTOR_CONFIGURE: enable its axis in Dragonframe"
            )
        return (
            f"motor {motor} is coupled to one that is switched off, "
            "or something else has taken a pin of it"
        )
    if isinstance(request, RtRunMove):
        return "no move has been uploaded since the board's start: framestep upload FILE"
    if isinstance(request, (VirtGetPosition, VirtMove)):
        return (
            "no virtual axes are configured: "
            "Dragonframe does that when a rig with such axes is set up"
        )
    if isinstance(request, RtUploadMoveEnd):
        return "no upload has begun"
    if isinstance(request, RtGo):
        return "no run waits"
    return None


def _motor(client: Client, request: Payload, code: Ack, told: Exceeded) -> str | None:
    motor, at = told.of, None
    if isinstance(request, (MotorMove, MotorJog)):
        at = request.position if isinstance(request, MotorMove) else request.destination
    if code == Ack.ERR_SOFT_UP:
        return f"{at} is past the upper soft limit of motor {motor}, {told.upper} ({_LIMITS})"
    if code == Ack.ERR_SOFT_LOW:
        return f"{at} is past the lower soft limit of motor {motor}, {told.lower} ({_LIMITS})"
    if code in (Ack.ERR_HARD_UP, Ack.ERR_HARD_LOW):
        end, way = ("upper", "down") if code == Ack.ERR_HARD_UP else ("lower", "up")
        return f"motor {motor} stands at its {end} limit switch: it may move {way} only"
    if code != Ack.ERR_RANGE:
        return None
    if isinstance(request, MotorSetSpeed):
        return (
            f"motor {motor} cannot do {request.velocity} steps/s "
            "with the pulses of its rig file (pulse_us)"
        )
    if isinstance(request, MotorResetPosition):
        return f"{request.position} leaves no room for the backlash of motor {motor}"
    return None


def _run(client: Client, request: RtRunMove, code: Ack) -> str | None:
    told = client.request(GetExceeded())
    motor, frame, fps = told.motor, told.frame, request.fps_milli / 1000
    where = f"motor {motor} at frame {frame}"
    if told.what == EXCEEDED_VELOCITY and told.velocity is not None:
        return (
            f"{where} would need {told.velocity + told.by} steps/s at {fps:g} frames/s, "
            f"its velocity is {told.velocity} steps/s ({_SPEED})"
        )
    if (
        told.what == EXCEEDED_ACCELERATION
        and told.acceleration is not None
        and code == Ack.ERR_RANGE
    ):
        return (
            f"{where} would need {told.acceleration + told.by} steps/s² at {fps:g} frames/s, "
            f"its acceleration is {told.acceleration} steps/s² ({_SPEED}), "
            "and strict_moves is set in the rig file"
        )
    if told.what == EXCEEDED_BOARD:
        return (
            f"{where} would need a change of velocity that the board cannot make: "
            "less steps or fewer frames/s"
        )
    if told.what == EXCEEDED_UPPER:
        return (
            f"{where} would be past its upper soft limit, "
            f"{_limit(told.upper, told.bits, SET_UPPER)}"
        )
    if told.what == EXCEEDED_LOWER:
        return (
            f"{where} would be past its lower soft limit, "
            f"{_limit(told.lower, told.bits, SET_LOWER)}"
        )
    if told.what in (EXCEEDED_PREROLL, EXCEEDED_POSTROLL):
        pre = told.what == EXCEEDED_PREROLL
        roll, time_ms = (
            ("pre-roll", request.preroll_ms) if pre else ("post-roll", request.postroll_ms)
        )
        limits = [str(told.lower)] * bool((told.bits or 0) & SET_LOWER) + [str(told.upper)] * bool(
            (told.bits or 0) & SET_UPPER
        )
        past = f" or pass a soft limit ({', '.join(limits)})" if limits else ""
        return (
            f"in its {roll} of {time_ms} ms motor {motor} would need "
            f"more than its {told.acceleration} steps/s²{past}: "
            "give it a longer or a shorter one, or begin and end the move more slowly"
        )
    if code == Ack.ERR_RANGE:
        return (
            f"frames {request.start_frame} to {request.end_frame} at {fps:g} frames/s "
            "are not all in the upload"
        )
    return "; ".join(texts.exceeded(told.what, motor, frame, told.by)) or None


def _limit(value: int | None, bits: int | None, which: int) -> str:
    return (
        f"{value} ({_LIMITS})"
        if (bits or 0) & which
        else "which is that of the motor coupled to it"
    )
