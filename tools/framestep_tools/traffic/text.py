"""Messages in words: the meaning of numbers that nobody knows by heart."""

from collections.abc import Callable
from typing import Any

from framestep import texts
from framestep.protocol import messages

from .. import payloads as p
from ..payloads import Ack, Payload

_FLAGS: dict[type[Payload], tuple[str, dict[int, str]]] = {
    p.MotorConfigure: (
        "flags",
        {
            messages.MOTOR_ENABLED: "on",
            messages.MOTOR_BLUR: "blur",
            messages.MOTOR_LIVE: "live",
            messages.MOTOR_COUPLE: "coupled",
            messages.MOTOR_COUPLE_REVERSED: "coupled in reverse",
        },
    ),
    p.RtRunMove: (
        "flags",
        {
            messages.RUN_PING_PONG: "ping-pong",
            messages.RUN_LOOP: "loop",
            messages.RUN_VIDEO: "camera at start and stop",
            messages.RUN_STILLS: "camera at each frame",
        },
    ),
    p.GioCam: (
        "flags",
        {messages.GIO_CAM_SHUTTER: "shutter", messages.GIO_CAM_METER: "meter"},
    ),
    p.DeviceInfo: (
        "capabilities",
        {
            messages.CAP_REALTIME: "real-time moves",
            messages.CAP_GO_MOTION: "go-motion",
            messages.CAP_GO_MOTION2: "go-motion with angles",
            messages.CAP_BOOM_SWING_TRACK: "boom-swing-track",
            messages.CAP_SWING_PAN: "swing-pan",
            messages.CAP_Y_SWING_TRACK: "Y-swing-track",
            messages.CAP_X_Y_Z: "X-Y-Z",
            messages.CAP_AIM_POINT: "aim point",
            messages.CAP_COUPLE: "coupled motors",
            messages.CAP_LOOP: "loops",
            messages.CAP_CAMERA: "camera",
        },
    ),
}
_STOPS = {
    messages.HARD_STOP_GENERAL: "the E-stop",
    messages.HARD_STOP_UPPER: "an upper limit switch",
    messages.HARD_STOP_LOWER: "a lower limit switch",
    messages.HARD_STOP_FAULT: "a fault in the firmware or a driver",
}


def _status(said: p.Status) -> str:
    if said.idle:
        return "nothing moves"
    what = [f"motor {motor}" for motor in said.moving]
    return f"{', '.join(what + ['lights'] * bool(said.dmx))} under way"


def _section(said: Any) -> str:
    index = said.start_index & ~p.LAST_SECTION & 0xFFFF_FFFF
    return f"from frame {index} of the move" + (
        ", the last of them" if said.start_index & p.LAST_SECTION else ""
    )


def _condition(said: p.Condition) -> str:
    trust = [
        f"motor {motor} {texts.trust(each.state, each.reason)}"
        for motor, each in enumerate(said.positions, 1)
    ]
    return "; ".join(texts.conditions(said.bits) + trust)


_WORDS: dict[type[Payload], Callable[[Any], str]] = {
    p.Status: _status,
    p.Moving: lambda said: "it moves" if said.moving else "it is there",
    p.HardStop: lambda said: "stopped by " + _STOPS.get(said.reason, "something unknown"),
    p.Positions: lambda said: f"at frame {said.move_time / 1000:g}" if said.move_time else "",
    p.Condition: _condition,
    p.Exceeded: lambda said: "; ".join(
        texts.exceeded(said.what, said.motor, said.frame, said.by, said.room or 0)
    ),
    p.RtRunMove: lambda said: f"{said.fps_milli / 1000:g} frames/s",
    p.RtJogAll: lambda said: f"{said.fps_milli / 1000:g} frames/s",
    p.MotorJog: lambda said: f"{said.speed / 100:g} % of its speed",
    p.RtUploadMoveAxis: _section,
    p.RtUploadMoveDmx: _section,
    p.RtEnd: lambda said: "the run or the shot is over",
}


def in_words(said: Payload | Ack) -> str:
    """Return the meaning of a message's fields; "" if they are clear by themselves."""
    if isinstance(said, Ack):
        return "" if said == Ack.OK else said.description
    found = [_WORDS[type(said)](said)] if type(said) in _WORDS else []
    if type(said) in _FLAGS:
        name, meanings = _FLAGS[type(said)]
        bits = getattr(said, name) or 0
        found += [", ".join(text for bit, text in meanings.items() if bits & bit)]
    return "; ".join(text for text in found if text)
