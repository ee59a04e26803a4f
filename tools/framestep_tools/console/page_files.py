"""The files of the page, as a server sends them to a browser.

Numbers, payloads and texts of the protocol come from the modules of firmware and tools. They make
`protocol.js` and the rig file's schema each time.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

from framestep import texts
from framestep.motors.positions import DRIVER, HOMED
from framestep.protocol import messages
from framestep.rig import drivers, settings

from .. import paths, payloads
from ..axes.units import UNITS
from ..documents import rig_schema, rig_table
from ..errors import ToolError
from ..move.move_formats import FORMATS
from ..payloads import Ack, Payload, RtUploadMoveAxis, layout
from . import repl_scripts

PAGE = Path(__file__).with_name("page")
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".txt": "text/plain; charset=utf-8",
    ".json": "application/json; charset=utf-8",
    ".svg": "image/svg+xml",
}
_HEAD = "// Made by framestep_tools.console.page_files from the modules that the firmware uses.\n"
_HAS_NO_LAYOUT = "VirtConfig"  # each of its types has its own layout: page/virtual_config.js
_BYTES = [["bytes", "*B"]]


@cache
def files() -> dict[str, bytes]:
    """Return every file of the page by its path, such as `motors.js`."""
    found = {
        path.relative_to(PAGE).as_posix(): path.read_bytes()
        for path in sorted(PAGE.rglob("*"))
        if path.suffix in TYPES
    }
    for name, path in paths.terminal().items():
        found[name] = path.read_bytes()
    found["protocol.js"] = protocol_js().encode()
    found["rig.schema.json"] = rig_schema.text().encode()
    return found


def save(folder: Path) -> int:
    """Write the page into a folder for another web server. Return the number of files. Raises
    ToolError."""
    try:
        for name, content in files().items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    except OSError as error:
        raise ToolError(f"cannot write the page into {folder}: {error.strerror}") from None
    return len(files())


def protocol_js() -> str:
    """Return the module with numbers, payloads and texts."""
    parts = {
        "VERSION": paths.version(),
        "M": _numbers(),
        "LAST_SECTION": payloads.LAST_SECTION,
        "REQUESTS": {
            cls.__name__: {
                "type": cls.TYPE,
                "name": payloads.type_name(cls.TYPE),
                "fields": _BYTES if cls.__name__ == _HAS_NO_LAYOUT else _fields(cls),
            }
            for cls in payloads.REQUESTS.values()
        },
        "REPORTS": {
            str(type): {"name": cls.__name__, "fields": _fields(cls)}
            for type, cls in payloads.REPORTS.items()
        },
        "CODES": {str(code.value): [code.name, code.description] for code in Ack},
        "TRUST": {"states": _texts(texts.STATES), "reasons": _texts(texts.REASONS)},
        "HOMED": HOMED,
        "DRIVER_FAILED": DRIVER,
        "CONDITIONS": _texts(texts.CONDITIONS),
        "EXCEEDED": _texts(texts.EXCEEDED),
        "LIMITS_COUNT": texts.LIMITS_COUNT,
        "UNITS": list(UNITS),
        "FORMATS": {each.NAME: each.ENDINGS[0] for each in FORMATS.values()},
        "SCRIPTS": repl_scripts.FOR_THE_PAGE,
        "RIG_TASKS": {
            task: [key for key in keys if key.isidentifier()]
            for task, keys in rig_table.TASKS.items()
        },
        "DRIVER_NEEDS": {
            name: {
                key: [least, settings.MOTOR_SETTINGS[key][4]]
                for key, least in drivers.needs(name).items()
                if not isinstance(least, bool)
            }
            for name in drivers.TYPE_SETTINGS
        },
        "SECTION_POSITIONS": (messages.LARGEST_PAYLOAD - _bytes_before(RtUploadMoveAxis)) // 4,
    }
    return _HEAD + "".join(
        f"export const {name} = {json.dumps(value, ensure_ascii=False, indent=1)};\n"
        for name, value in parts.items()
    )


def _numbers() -> dict[str, int]:
    return {
        name: value
        for name, value in vars(messages).items()
        if name.isupper() and isinstance(value, int)
    }


def _fields(cls: type[Payload]) -> list[list[Any]]:
    """Return [name, code] of each field, as in payloads.layout().

    Repeated records have a list of fields instead of the code. A third item, true, marks a field
    that may be left out.
    """
    found: list[list[Any]] = []
    for name, code, optional in layout(cls):
        entry = [name, _fields(code) if isinstance(code, type) else code]
        found.append([*entry, True] if optional else entry)
    return found


def _texts(table: dict[int, str]) -> dict[str, str]:
    return {str(number): text for number, text in table.items()}


def _bytes_before(cls: type[Payload]) -> int:
    """Return the number of bytes before the repeated field."""
    return len(cls(1, 0, ()).pack())  # type: ignore[call-arg]
