"""The E-stop, limit switches and general inputs as a device sees them, as lines, as a table, or for
programs."""

from typing import Any, NamedTuple

from framestep.protocol.messages import CONDITION_ESTOP

from ..payloads import GetCondition, GetExceeded, GioIn
from .client import Client, RequestRefused


class Switches(NamedTuple):
    """`estop`: whether it is held; no message tells whether there is one. `limits`: for each set,
    whether its upper and its lower switch are active. None if the device does not report it."""

    estop: bool | None
    limits: list[tuple[bool, bool]] | None
    inputs: list[bool]


def ask(client: Client) -> Switches:
    """Ask a device for its inputs."""
    info = client.info or client.greet()
    levels = client.request(GioIn()).levels
    inputs = [bool(levels >> i & 1) for i in range(info.inputs)]
    try:
        estop = bool(client.request(GetCondition()).bits & CONDITION_ESTOP)
        exceeded = client.request(GetExceeded(1))
    except RequestRefused:
        return Switches(None, None, inputs)
    if exceeded.upper_active is None or exceeded.lower_active is None:
        return Switches(estop, None, inputs)
    sets = range(info.limit_sets)
    return Switches(
        estop,
        [
            (bool(exceeded.upper_active >> i & 1), bool(exceeded.lower_active >> i & 1))
            for i in sets
        ],
        inputs,
    )


def _rows(found: Switches) -> list[tuple[str, str]]:
    rows = []
    if found.estop is not None:
        rows.append(("E-stop", "held" if found.estop else "released, or there is none"))
    rows += [(f"input {i}", "on" if on else "off") for i, on in enumerate(found.inputs, 1)]
    for i, ends in enumerate(found.limits or [], 1):
        states = zip(("upper", "lower"), ends, strict=True)
        shown = ", ".join(f"{name} {'active' if on else 'clear'}" for name, on in states)
        rows.append((f"limit set {i}", shown))
    return rows


def lines(found: Switches) -> list[str]:
    """Return the inputs as lines of text."""
    shown = [f"{what}: {how}" for what, how in _rows(found)]
    return (
        shown
        if found.limits is not None
        else [*shown, "this device does not report its limit switches"]
    )


def table(found: Switches) -> Any:
    """Return the inputs as a table for a terminal."""
    from rich.table import Table

    shown = Table("switch", "state")
    for what, how in _rows(found):
        shown.add_row(what, how)
    return shown


def for_programs(found: Switches) -> dict[str, Any]:
    """Return the inputs as values for JSON."""
    limits = {str(i): [n for n, on in zip(("upper", "lower"), ends, strict=True) if on]
              for i, ends in enumerate(found.limits or [], 1)}  # fmt: skip
    estop = None if found.estop is None else "held" if found.estop else "released or none"
    return {"estop": estop, "inputs": {str(i): on for i, on in enumerate(found.inputs, 1)},
            "limits": limits if found.limits is not None else None}  # fmt: skip
