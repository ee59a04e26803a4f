"""Make the JSON Schema of the rig file, for editors, from the table with which the board reads it
(framestep.rig).

python -m framestep_tools.documents.rig_schema          put it into docs/use/rig.schema.json
"""

import json
from typing import Any

from framestep.rig import homes, pendants, servos, settings

_TYPES = {
    str: "string",
    int: "integer",
    float: "number",
    bool: "boolean",
    list: "array",
    dict: "object",
}
_WITHIN: dict[str, dict[str, Any]] = {
    "motors": settings.MOTOR_SETTINGS,
    "driver": settings.DRIVER_SETTINGS,
    "home": homes.HOME_SETTINGS,
    "servo": servos.SERVO_SETTINGS,
    "pendant": pendants.PENDANT_SETTINGS,
    "outputs": settings.OUTPUT_SETTINGS,
    "inputs": settings.INPUT_SETTINGS,
    "limits": settings.LIMIT_SETTINGS,
}


def _object(settings: dict[str, Any]) -> dict[str, Any]:
    needed = [
        key
        for key, (kind, _, _, default, _, _) in settings.items()
        if default is None and kind in (int, str)
    ]
    found: dict[str, Any] = {
        "type": "object",
        "additionalProperties": False,
        "properties": {key: _property(key, *row) for key, row in settings.items()},
    }
    return {**found, "required": needed} if needed else found


def _property(
    key: str, kind: type, low: Any, high: Any, default: Any, unit: str, meaning: str
) -> dict[str, Any]:
    found: dict[str, Any] = {
        "type": _TYPES[kind],
        "description": f"{meaning} ({unit})" if unit else meaning,
    }
    if default is not None:
        found["default"] = default
    if isinstance(low, tuple):
        found["enum"] = list(low)
    elif kind in (int, float):
        found |= {"minimum": low, "maximum": high}
    elif kind is str:  # bytes of UTF-8 on the board, so at most as many characters
        found |= {"minLength": low, "maxLength": high}
    elif kind is list:
        found |= {"maxItems": high, "items": _object(_WITHIN[key])}
    elif kind is dict:
        found |= {k: v for k, v in _object(_WITHIN[key]).items() if k != "type"}
    return found


def schema() -> dict[str, Any]:
    """Return the schema of a whole file. Only `framestep rig check` knows a board's free pins."""
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "framestep's rig.json",
    }
    return {**head, **_object(settings.SETTINGS)}


def text() -> str:
    """Return the schema as text for its file."""
    return json.dumps(schema(), indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    from ..building.board_files import ROOT

    (ROOT / "docs/use/rig.schema.json").write_text(text(), encoding="utf-8")
