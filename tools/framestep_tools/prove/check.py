"""Check whether anything keeps motors from being measured, before any of them moves."""

from collections.abc import Sequence

from framestep.protocol.messages import (
    SET_AT_LOWER,
    SET_AT_UPPER,
    SET_ENABLED,
    SET_FOLLOWS,
    SET_LOWER,
    SET_UPPER,
)

from ..client.client import Client, RequestRefused
from ..client.refusals import what_stops
from ..errors import ToolError
from ..payloads import GetExceeded, VirtGetPosition

# How far a motor goes from its position; it goes to and fro, so it stays close
ROOM_UP, ROOM_DOWN = 150_000, 12_000  # steps
_FORGET = "reset the board, which forgets what a host has set, and begin again"


def check(client: Client, motors: Sequence[int], positions: Sequence[int]) -> None:
    """Raise ToolError if one of these motors could not move as far as it has to. The text says what
    to do. positions: positions of motors 1, 2, …"""
    why = what_stops(client)
    if why:
        raise ToolError(f"{why}: correct that first, as nothing can be measured")
    if _aims(client):
        raise ToolError(f"the camera is aimed at a point, and motors move together: {_FORGET}")
    for motor in motors:
        settings = client.request(GetExceeded(motor))
        bits, at = settings.bits or 0, positions[motor - 1]
        if bits & SET_FOLLOWS:
            raise ToolError(f"motor {motor} is coupled to the one before it: {_FORGET}")
        if not bits & SET_ENABLED:
            raise ToolError(f"motor {motor} is switched off by the host: {_FORGET}")
        if bits & (SET_AT_UPPER | SET_AT_LOWER):
            raise ToolError(
                f"motor {motor} is at a limit switch: move it off, or if no switch is connected "
                "take `limits` out of the rig file (framestep rig edit)"
            )
        upper, lower = settings.upper, settings.lower
        if (bits & SET_UPPER and upper is not None and upper < at + ROOM_UP) or (
            bits & SET_LOWER and lower is not None and lower > at - ROOM_DOWN
        ):
            raise ToolError(
                f"the soft limits of motor {motor} leave it less than {ROOM_DOWN} steps down and "
                f"{ROOM_UP} up from its position: {_FORGET}"
            )


def _aims(client: Client) -> bool:
    """Return whether an aim point is on, so pan and tilt follow other motors."""
    try:
        return bool(client.request(VirtGetPosition()).aim_enabled)
    except RequestRefused:  # no virtual axes are configured
        return False
