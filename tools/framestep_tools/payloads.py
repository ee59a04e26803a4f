"""The protocol's messages as typed values, from framestep.protocol.declared, and tables of them."""

from typing import Any

from framestep.protocol import declared

# Import all names, so that a new message is here too
from framestep.protocol.declared import *  # noqa: F403
from framestep.protocol.declared import Ack, Payload, Request, RtEnd, RtGo

# The high bit of START INDEX: these are the channel's last values, repeat the final one (spec:
# MSG_RT_UPLOAD_MOVE_AXIS)
LAST_SECTION = declared.LAST_SECTION << 16
# Requests by number, including messages that only a device sends
REQUESTS: dict[int, type[Request[Any]]] = {cls.TYPE: cls for cls in Request.__subclasses__()}
# Messages without the acknowledgement flag, whether requested or not
REPORTS: dict[int, type[Payload]] = {
    cls.TYPE: cls
    for cls in (*(each.REPLY for each in Request.__subclasses__()), declared.HardStop, RtEnd, RtGo)
    if cls is not Ack
}
TYPE_NAMES = {
    value: name.removeprefix("MSG_")
    for name, value in vars(declared).items()
    if name.startswith("MSG_") and name != "MSG_FLAG_ACK"
}


def type_name(type: int) -> str:
    """Return the specification's name of a message type, without MSG_."""
    return TYPE_NAMES.get(type, f"0x{type:04X}")
