"""`framestep home`: motors find their switches, as the rig file says."""

from typing import TYPE_CHECKING, Annotated

import typer

from .common import AxesFile, Url, load_axes, moving

if TYPE_CHECKING:
    from ..client.client import Client


def home(
    motors: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[MOTOR]...",
            help="numbers, or names in axes.toml; none: all that have `home` in the rig file",
        ),
    ] = None,
    device: Url = None,
    axes: AxesFile = None,
) -> None:
    """Home motors, one after the other.

    Each finds its switch, which defines its position.
    """
    from ..payloads import Home, MotorStatus

    known = load_axes(axes)
    numbers = [known.motor(motor) for motor in motors or ()]
    with moving(device, known) as client:
        client.request(MotorStatus())
        client.events.clear()
        client.request(Home(bytes(numbers)))
        chosen = numbers or client.request(MotorStatus()).moving
        for motor in chosen:
            client.wait_idle(timeout_s=float("inf"), motor=motor)
        _report(client, sorted(set(chosen)))


def _report(client: "Client", motors: list[int]) -> None:
    """Print which motors are homed. Raises Stopped if any is not."""
    from framestep import texts
    from framestep.motors.positions import HOMED, HOMING

    from ..client import state
    from ..payloads import GetCondition, MotorGetPosition

    steps, axes = client.request(MotorGetPosition()).steps, client.axes
    trusts = client.request(GetCondition()).positions
    failed = []
    for motor in motors:
        trust = trusts[motor - 1]
        if trust.reason == HOMED:
            print(f"{axes.name(motor)}: {axes.position(motor, steps[motor - 1])}, homed")
        else:
            failed.append((motor, trust))
    if not failed:
        return
    # one has failed, others have not had their turn
    motor, trust = next((each for each in failed if each[1].reason != HOMING), failed[0])
    why = texts.trust(trust.state, trust.reason)
    if trust.reason == HOMING:
        why += f" ({state.why_stopped(client)})"
    raise state.Stopped(
        f"{axes.name(motor)} is not homed; its position is {why}"
        + "".join(f"; {axes.name(other)} is not homed" for other, _ in failed if other != motor)
    )
