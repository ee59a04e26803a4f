"""`framestep home`: motors find their switches, as the rig file says."""

from typing import TYPE_CHECKING, Annotated

import typer

from .common import Url, moving

if TYPE_CHECKING:
    from ..client.client import Client


def home(
    motors: Annotated[
        list[int] | None,
        typer.Argument(
            metavar="[MOTOR]...",
            help="motor numbers; without any, all that have `home` in the rig file",
            min=1,
            max=32,
        ),
    ] = None,
    device: Url = None,
) -> None:
    """Home motors, one after the other.

    Each finds its switch, which defines its position.
    """
    from ..payloads import Home, MotorStatus

    with moving(device) as client:
        client.request(MotorStatus())
        client.events.clear()
        client.request(Home(bytes(motors or ())))
        chosen = motors or client.request(MotorStatus()).moving
        client.wait_idle(timeout_s=float("inf"))
        _tell(client, sorted(set(chosen)))


def _tell(client: "Client", motors: list[int]) -> None:
    """Print which motors are homed. Raises Stopped if any is not."""
    from framestep import texts
    from framestep.motors.positions import HOMED, HOMING

    from ..client import state
    from ..payloads import GetCondition, MotorGetPosition

    steps = client.request(MotorGetPosition()).steps
    trusts = client.request(GetCondition()).positions
    failed = []
    for motor in motors:
        trust = trusts[motor - 1]
        if trust.reason == HOMED:
            print(f"motor {motor}: {steps[motor - 1]}, homed")
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
        f"motor {motor} is not homed; its position is {why}"
        + "".join(f"; motor {other} is not homed" for other, _ in failed if other != motor)
    )
