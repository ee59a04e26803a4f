"""The protocol's messages as typed values: what a request says and what its reply holds.

Each class stands for one message type and lists its data section field by field, in the order of
the specification. Motor numbers count from 1.

    MotorMove(motor=1, position=-500).pack()        # b'\\x01\\x0c\\xfe\\xff\\xff'
    Status.unpack(b'\\x01\\x00\\x00\\x00\\x00').moving   # [1]

codec       how a class becomes bytes, and bytes a class
acks        response codes
device      what the device sends
general     requests about the device, motors, lights, inputs and outputs
realtime    uploads, real-time moves, go-motion
virtual     virtual axes
"""

from framestep.protocol import messages

# All classes of messages, so that one that is added is there
from .acks import *  # noqa: F403
from .codec import *  # noqa: F403
from .codec import Payload, Request
from .device import *  # noqa: F403
from .device import (
    Condition,
    DeviceInfo,
    Exceeded,
    HardStop,
    InputLevels,
    Moving,
    Positions,
    Status,
    VirtPositions,
)
from .general import *  # noqa: F403
from .realtime import *  # noqa: F403
from .realtime import RtEnd, RtGo
from .virtual import *  # noqa: F403
from .virtual import VirtAimPoint


def _table(*classes: type[Payload]) -> dict[int, type[Payload]]:
    return {cls.TYPE: cls for cls in classes}


REQUESTS: dict[int, type[Payload]] = _table(*Request.__subclasses__())
# What comes without the acknowledgement flag, asked for or not
REPORTS = _table(
    DeviceInfo,
    InputLevels,
    Status,
    Moving,
    Positions,
    HardStop,
    Condition,
    Exceeded,
    VirtPositions,
    VirtAimPoint,
    RtEnd,
    RtGo,
)
TYPE_NAMES = {
    value: name.removeprefix("MSG_")
    for name, value in vars(messages).items()
    if name.startswith("MSG_") and name != "MSG_FLAG_ACK"
}


def type_name(type: int) -> str:
    """The specification's name of a message type, without its MSG_."""
    return TYPE_NAMES.get(type, f"0x{type:04X}")
