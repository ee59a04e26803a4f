"""Numbers and messages of the protocol, for firmware, tests and host tools, as declared in
framestep.protocol.declared.

m.MSG_MOTOR_JOG is a message's number, m.MotorJog.speed the offset of a field in the payload,
m.MotorJog.SIZE the payload's length in bytes. On a board there are no classes: the build replaces
the names by the numbers. Nothing here allocates when called.
"""

from framestep.protocol.declared import *  # noqa: F403
from framestep.protocol.declared import SIZES


def payload_fits(kind, length):
    """Return whether a request of this type may have a payload of `length` bytes; False for an
    unknown type.

    A fixed layout may be longer than this version knows; handlers ignore the rest (field note 1.8).
    """
    sizes = SIZES.get(kind)
    if sizes is None or length < sizes[0]:
        return False
    return not sizes[1] or (length - sizes[0]) % sizes[1] == 0
