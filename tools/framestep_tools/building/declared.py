"""Messages of framestep.protocol.declared as a board has them: only numbers."""

import re

from framestep.protocol import declared
from framestep.protocol.declared import Payload, layout

_TABLES = ("SIZES", "KEEPS_PLAN")
_IMPORTS = re.compile(r"^from framestep\.protocol\.declared import .*$", re.MULTILINE)


def fields() -> dict[str, int]:
    """Return {"MotorJog.speed": 1, "MotorJog.SIZE": 7}: offsets of the messages' fields, and
    sizes."""
    return {
        f"{name}.{of}": getattr(cls, of)
        for name, cls in vars(declared).items()
        if isinstance(cls, type) and issubclass(cls, Payload) and hasattr(cls, "SIZE")
        for of in (*(field for field, _, _ in layout(cls)), "SIZE", "LEAST", "ENTRY")
    }


def messages_module(text: str) -> str:
    """Return the source of framestep.protocol.messages, with numbers and tables instead of imports
    from the declaration."""
    found = [
        f"{name} = const({value})"
        for name, value in vars(declared).items()
        if type(value) is int and not name.startswith("_")
    ]
    found += [f"{name} = {getattr(declared, name)!r}" for name in _TABLES]
    lines = iter(["; ".join(["from framestep.base.native import const", *found])])
    return _IMPORTS.sub(lambda _: next(lines, "pass"), text)
