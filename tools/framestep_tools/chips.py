"""The chips that boards have: boards/chips.json, which docs/internals/new-chip.md explains."""

import json
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

from . import paths
from .errors import ToolError

FILE = paths.BOARDS / "chips.json"


@dataclass(frozen=True)
class Chip:
    """An entry of the file; every one has all of these."""

    name: str  # as it is usually written
    hal: str  # its HAL is the folder framestep/hal/<hal>
    engine: str  # what makes the pulses: a key of board_files.ENGINES
    motors: int  # as many as the engine can step
    ports: int  # 2 if the protocol can have a port besides the REPL's
    pins: int  # board data and rig files may name 0 to one less
    clocks: list[int]  # MHz that the processor may run at
    upload_kb: int  # memory for an uploaded move in the simulator: more than the chip has for it
    uarts: list[dict[str, list[int]]]  # the pins that each UART can have as TX and RX
    processor: str  # as mpy-cross calls it
    uf2_family: str | None  # of an image; None: framestep's files go onto MicroPython's own program
    esp: dict[str, Any] | None  # of an ESP32: its name in esptool, its number in images, where in
    # flash a whole image begins
    plain_board: str  # the board that `framestep install` takes if none is named


@cache
def chips() -> dict[str, Chip]:
    """Return all chips by their key."""
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
    """Return a chip. Raises ToolError if there is none of this name."""
    if key not in chips():
        raise ToolError(f"no chip {key!r}: there are {', '.join(chips())}")
    return chips()[key]
