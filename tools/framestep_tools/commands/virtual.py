"""`framestep virtual`: show and move the virtual axes."""

from enum import Enum
from typing import Annotated

import typer

from .common import AxesFile, Json, Url, load_axes, moving, put, say_json

_FARTHEST = (2**31 - 1) / 100_000  # field note 9.1


class VirtualAxisName(str, Enum):
    """Virtual axes 1 to 6 (field note 9.1)."""

    TRACK = "track"
    EW = "ew"
    NS = "ns"
    PAN = "pan"
    TILT = "tilt"
    ROLL = "roll"


def virtual(
    axis: Annotated[
        VirtualAxisName | None, typer.Argument(help="the axis to move", show_default=False)
    ] = None,
    position: Annotated[
        float | None,
        typer.Argument(help="units or degrees", show_default=False, min=-_FARTHEST, max=_FARTHEST),
    ] = None,
    device: Url = None,
    json: Json = False,
    axes: AxesFile = None,
) -> None:
    """Show the positions of the virtual axes, or move one of them.

    Dragonframe or the console has to configure them first.
    """
    from ..client import state
    from ..payloads import VirtGetPosition, VirtMove

    if axis is not None and position is None:
        raise typer.BadParameter("an axis needs a position as well")
    with moving(device, load_axes(axes)) as client:
        client.events.clear()
        if axis is not None and position is not None:
            number = list(VirtualAxisName).index(axis) + 1
            client.request(VirtMove(number, round(position * 100_000)))
            client.wait_idle(timeout_s=float("inf"))
            if state.is_stopped(client):
                raise state.Stopped(f"{axis.value} stopped on its way: {state.why_stopped(client)}")
        found = client.request(VirtGetPosition())
    values = found.track, found.east_west, found.north_south, found.pan, found.tilt, found.roll
    places = {
        name.value: value / 100_000 for name, value in zip(VirtualAxisName, values, strict=True)
    }
    aim = (
        [(value or 0) / 1000 for value in (found.aim_x, found.aim_y, found.aim_z)]
        if found.aim_enabled
        else None
    )
    if json:
        say_json({**places, "aim": aim})
        return
    for name, value in places.items():
        print(f"{name}: {value:.3f}")
    if aim:
        print("aim point:", *(f"{value:g}" for value in aim))


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, virtual)
