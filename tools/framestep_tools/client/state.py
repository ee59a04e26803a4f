"""The state of a device, as lines, as a table, or for programs."""

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import Any, NamedTuple

from framestep import texts
from framestep.motors.positions import LOST
from framestep.protocol.messages import (
    CONDITION_EXCEEDED,
    EXCEEDED_ACCELERATION,
    HARD_STOP_FAULT,
    HARD_STOP_GENERAL,
    HARD_STOP_LOWER,
    HARD_STOP_UPPER,
)

from ..axes.rig_axes import Axes
from ..errors import REFUSED
from ..payloads import (
    Condition,
    DeviceInfo,
    Exceeded,
    GetCondition,
    GetExceeded,
    GetLoad,
    HardStop,
    Load,
    MotorGetPosition,
    MotorStatus,
)
from .client import Client, ClientError, RequestRefused
from .shared_port import ALL_MOTORS

_NOT_REPORTED = "this device does not report how far its positions can be trusted"
_STOPS = {
    HARD_STOP_GENERAL: "the E-stop was pressed",
    HARD_STOP_UPPER: "{} ran into its upper limit switch",
    HARD_STOP_LOWER: "{} ran into its lower limit switch",
    HARD_STOP_FAULT: (
        "a fault in the firmware or a driver (framestep status and the REPL say more)"
    ),
}


class Stopped(ClientError):
    """Motors have come to rest before they reached their target."""

    status = REFUSED


class State(NamedTuple):
    """`condition` and `load` are None if the device does not report them; `exceeded` is None if no
    limit was exceeded."""

    info: DeviceInfo
    moving: list[int]
    positions: list[int]
    condition: Condition | None
    exceeded: Exceeded | None
    load: Load | None
    axes: Axes


def ask(client: Client) -> State:
    """Ask a device for its state."""
    info = client.info or client.greet()
    moving = client.request(MotorStatus()).moving
    positions = list(client.request(MotorGetPosition()).steps)[: info.motors]
    condition: Condition | None = None
    exceeded: Exceeded | None = None
    try:
        condition = client.request(GetCondition())
        if condition.bits & CONDITION_EXCEEDED:
            exceeded = client.request(GetExceeded())
    except RequestRefused:
        pass
    return State(info, moving, positions, condition, exceeded, _load(client), client.axes)


def _load(client: Client) -> Load | None:
    try:
        return client.request(GetLoad())
    except RequestRefused:
        return None


def position(client: Client, motor: int) -> int:
    """Return a motor's position in steps. Raises ClientError if there is no such motor."""
    steps = client.request(MotorGetPosition()).steps
    if motor > len(steps):
        raise NoMotor(motor, len(steps))
    return int(steps[motor - 1])


class NoMotor(ClientError):
    """The device has fewer motors."""

    status = REFUSED

    def __init__(self, motor: int, count: int):
        super().__init__(f"there is no motor {motor}: the device has motors 1 to {count}")


def why_stopped(client: Client) -> str:
    """Say why motors have come to rest before they reached their target."""
    stop = client.take_event(HardStop)
    if stop:
        why = _STOPS.get(stop.reason, f"the device gives the reason {stop.reason}")
        return why.format(client.axes.name(stop.motor or 0))
    if client.stopped:
        return "another program stopped it"
    return "another program or a soft limit stopped it"


def is_stopped(client: Client, motors: Iterable[int] | None = None) -> bool:
    """Return whether something has stopped any of these motors, None for all, so that no jog may be
    repeated."""
    bits = ALL_MOTORS if motors is None else sum(1 << motor for motor in motors)
    stops = [event.message for event in client.events if isinstance(event.message, HardStop)]
    return bool(client.stopped & bits) or any(
        not stop.motor or bits >> stop.motor & 1 for stop in stops
    )


def too_steep(client: Client) -> str | None:
    """Say which motor exceeds its acceleration in the prepared move, which is played nevertheless.

    None if there is none, or if the device does not report it.
    """
    try:
        exceeded = client.request(GetExceeded())
    except ClientError:
        return None
    if exceeded.what != EXCEEDED_ACCELERATION:
        return None
    motor, axes, has = exceeded.motor, client.axes, exceeded.acceleration or 0
    return (
        f"{axes.name(motor)} at frame {exceeded.frame} would need "
        f"{axes.length(motor, has + exceeded.by, 's²')}, its acceleration is "
        f"{axes.length(motor, has, 's²')}: it is played as uploaded and may lose steps"
    )


def _trust(state: State) -> list[str]:
    if not state.condition:
        return [""] * len(state.positions)
    found = [texts.trust(each.state, each.reason) for each in state.condition.positions]
    return found + [""] * (len(state.positions) - len(found))


def _heading(info: DeviceInfo) -> str:
    return (
        f"{info.name}, firmware {info.major}.{info.minor}.{info.revision}: {info.motors} motors, "
        f"{info.dmx_channels} DMX channels, {info.outputs} outputs, {info.inputs} inputs, "
        f"{info.upload_frames} frames"
    )


def _conditions(state: State) -> list[str]:
    """List sentences about the device as a whole."""
    if state.condition is None:
        return [_NOT_REPORTED]
    found = texts.conditions(state.condition.bits)
    if state.exceeded:
        found += texts.exceeded(
            state.exceeded.what,
            state.exceeded.motor,
            state.exceeded.frame,
            state.exceeded.by,
            state.exceeded.room or 0,
        )
    if any(each.state == LOST for each in state.condition.positions):
        found.append(f"{texts.LIMITS_COUNT} (framestep zero)")
    if state.load and state.load.interrupt_us:
        found += texts.load(*vars(state.load).values())
    return [state.axes.named(text) for text in found]


def lines(state: State) -> list[str]:
    """Return the state as lines of text. Neighbouring motors that are alike and have no name share
    a line."""
    found, motor = [_heading(state.info)], 1
    for (name, rest), alike in groupby(_motors(state)):
        last = motor + len(list(alike)) - 1
        found.append(f"{name or _numbers(motor, last)} {rest}")
        motor = last + 1
    return found + _conditions(state)


def _motors(state: State) -> Iterator[tuple[str, str]]:
    """Yield each motor's name in axes.toml, "" without one, and what is said of it."""
    for motor, (steps, trust) in enumerate(zip(state.positions, _trust(state), strict=True), 1):
        yield (
            state.axes.name(motor) if state.axes.axis(motor) else "",
            f"{state.axes.position(motor, steps)}"
            f"{', moving' if motor in state.moving else ''}{trust and f', {trust}'}",
        )


def _numbers(first: int, last: int) -> str:
    return f"motor {first}:" if first == last else f"motors {first} to {last}:"


def table(state: State) -> Any:
    """Return the state as a table for a terminal."""
    from rich.console import Group
    from rich.table import Table

    known = any(state.axes.axis(motor) for motor in range(1, len(state.positions) + 1))
    shown = Table("motor", *["axis"] * known)
    for title, width in [("position", 11)] * known + [("steps", 11)]:
        shown.add_column(title, justify="right", min_width=width)
    shown.add_column("", min_width=6)
    shown.add_column("trust")
    for motor, (steps, trust) in enumerate(zip(state.positions, _trust(state), strict=True), 1):
        axis = state.axes.axis(motor)
        named = [axis.name if axis else "", state.axes.value(motor, steps)] if known else []
        moving = "moving" if motor in state.moving else ""
        shown.add_row(str(motor), *named, str(steps), moving, trust)
    return Group(_heading(state.info), shown, *_conditions(state))


def for_programs(state: State) -> dict[str, Any]:
    """Return the state as values for JSON."""
    motors = []
    for motor, steps in enumerate(state.positions, 1):
        entry: dict[str, Any] = {"motor": motor, "position": steps, "moving": motor in state.moving}
        entry |= state.axes.for_programs(motor, steps)
        if state.condition and motor <= len(state.condition.positions):
            trust = state.condition.positions[motor - 1]
            entry["trust"] = texts.STATES.get(trust.state, str(trust.state))
            entry["reason"] = texts.REASONS.get(trust.reason, str(trust.reason))
        motors.append(entry)
    info = state.info
    return {
        "name": info.name,
        "firmware": f"{info.major}.{info.minor}.{info.revision}",
        "motors": motors,
        "dmx_channels": info.dmx_channels,
        "outputs": info.outputs,
        "inputs": info.inputs,
        "limit_sets": info.limit_sets,
        "upload_frames": info.upload_frames,
        "capabilities": info.capabilities,
        "conditions": texts.conditions(state.condition.bits) if state.condition else None,
        "exceeded": vars(state.exceeded) if state.exceeded else None,
        "load": vars(state.load) if state.load else None,
    }
