"""The chips that boards have: boards/chips.json, which docs/internals/new-chip.md explains."""

import json
from dataclasses import dataclass, fields
from functools import cache

from . import paths
from .errors import ToolError

FILE = paths.BOARDS / "chips.json"


@dataclass(frozen=True)
class Chip:
    """An entry of the file; every one has all of these."""

    name: str  # as people write it
    hal: str  # its HAL is the folder framestep/hal/<hal>
    engine: str  # what makes the pulses: a key of files.ENGINES
    motors: int  # that the engine can step
    pins: int  # numbers from 0 on that a board's data and a rig file may name
    uarts: list[dict[str, list[int]]]  # the pins that each UART can have as TX and RX
    processor: str  # as mpy-cross calls it
    uf2_family: str
    plain_board: str  # the board that `framestep install` takes if none is named


@cache
def chips() -> dict[str, Chip]:
    """All of them by their key."""
    entries = json.loads(FILE.read_text())
    names = {field.name for field in fields(Chip)}
    for key, entry in entries.items():
        if missing := sorted(names - entry.keys()):
            raise ToolError(
                f"{FILE.name}: {key} needs {', '.join(missing)}; see docs/internals/new-chip.md"
            )
        if unknown := sorted(entry.keys() - names):
            raise ToolError(f"{FILE.name}: {key} has {', '.join(unknown)}, which means nothing")
    return {key: Chip(**entry) for key, entry in entries.items()}


def chip(key: str) -> Chip:
    """ToolError if there is no such chip."""
    if key not in chips():
        raise ToolError(f"no chip {key!r}: there are {', '.join(chips())}")
    return chips()[key]
