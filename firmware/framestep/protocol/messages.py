"""The protocol as the firmware, the tests and the host tools have it: its numbers and its
messages, as framestep.protocol.declared declares them.

m.MSG_MOTOR_JOG is a message's number, m.MotorJog.speed where its field begins in the payload,
m.MotorJog.SIZE how many bytes it has. On a board there are no classes: the build puts the numbers
where the names are used. Nothing here allocates when called.
"""

from framestep.protocol.declared import *  # noqa: F403
from framestep.protocol.declared import SIZES


def payload_fits(kind, length):
    """Whether a request of this type may have a payload of `length` bytes; False for an unknown
    type.

    A fixed layout may be longer than this version knows: handlers ignore the rest (field note 1.8).
    """
    sizes = SIZES.get(kind)
    if sizes is None or length < sizes[0]:
        return False
    return not sizes[1] or (length - sizes[0]) % sizes[1] == 0
