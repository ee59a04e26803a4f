"""Every message of the DMC v2 protocol, declared once: number, name, fields in the order of the
specification, and meaning. Motor numbers count from 1.

    MotorMove(motor=1, position=-500).pack()           # b'\\x01\\x0c\\xfe\\xff\\xff'
    Status.unpack(b'\\x01\\x00\\x00\\x00\\x00').moving  # [1]
    MotorMove.position                                 # 1: its offset

payload     base classes of messages
codes       numbers that belong to no single message
acks        response codes as a class
device      messages from the device
general     requests about the device, motors, lights, inputs and outputs
realtime    uploads, real-time moves, go-motion
virtual     virtual axes

For the host. A board has only the numbers: framestep.protocol.messages.
"""

from .acks import *  # noqa: F403
from .codes import *  # noqa: F403
from .device import *  # noqa: F403
from .general import *  # noqa: F403
from .payload import *  # noqa: F403
from .payload import Request
from .realtime import *  # noqa: F403
from .virtual import *  # noqa: F403

_ASKED = sorted(
    (cls for cls in Request.__subclasses__() if not cls.ONLY_SENT), key=lambda cls: cls.TYPE
)

# Payload bytes of requests: the shortest form, and each further entry (0: a fixed layout). These
# are all types that a host may send; others are unknown (field note 1.7).
SIZES = {cls.TYPE: (cls.LEAST, cls.ENTRY) for cls in _ASKED}

# Requests that do not discard the plan of a run that waits for GO, and do not send off motors that
# have yet to return to a frame after a run
KEEPS_PLAN = tuple(cls.TYPE for cls in _ASKED if cls.KEEPS_PLAN)
