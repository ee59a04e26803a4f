"""The numbers of the DMC v2 protocol: types, codes, flags, sizes.

The board, the tests and the host tools all import them from here. Sources: the specification
(edition 2024-08-13), and the field notes where marked. Nothing here allocates when called.
"""

from framestep import results
from framestep.native import const

# -- Frame: 'D' 'F', id DWORD, type WORD, length WORD, payload, two check bytes; little-endian
# (spec: Message Format)

MARKER = b"DF"
HEADER_BYTES = const(10)
FRAME_OVERHEAD = const(12)
LARGEST_FRAME = const(1048)  # field note 1.6, header and check bytes included
LARGEST_PAYLOAD = const(1036)
PROTOCOL_VERSION = const(2)

MSG_FLAG_ACK = const(0x8000)

# -- Message types

MSG_HI = const(0x0001)
MSG_DMX = const(0x0020)
MSG_GIO_OUT = const(0x0021)
MSG_GIO_IN = const(0x0022)
MSG_GIO_CAM = const(0x0023)
MSG_MOTOR_STATUS = const(0x0030)
MSG_MOTOR_MOVE = const(0x0031)
MSG_MOTOR_STOP = const(0x0032)
MSG_MOTOR_STOP_ALL = const(0x0033)
MSG_MOTOR_GET_POSITION = const(0x0034)
MSG_MOTOR_RESET_POSITION = const(0x0035)
MSG_MOTOR_JOG = const(0x0036)
MSG_MOTOR_CONFIGURE = const(0x0037)
MSG_MOTOR_SET_SPEED = const(0x0038)
MSG_MOTOR_SET_LIMITS = const(0x0039)
MSG_MOTOR_HARD_STOP = const(0x003A)  # only sent, never asked
MSG_RT_UPLOAD_MOVE_BEGIN = const(0x0100)
MSG_RT_UPLOAD_MOVE_AXIS = const(0x0101)
MSG_RT_UPLOAD_MOVE_DMX = const(0x0102)
MSG_RT_UPLOAD_MOVE_END = const(0x0103)
MSG_RT_UPLOAD_MOVE_TRIGGERS = const(0x0104)
MSG_RT_POSITION_FRAME = const(0x0110)
MSG_RT_RUN_MOVE = const(0x0111)
MSG_RT_SHOOT_FRAME = const(0x0112)
MSG_RT_GO = const(0x0113)
MSG_RT_END = const(0x0114)  # only sent, never asked
MSG_RT_SHOOT_FRAME2 = const(0x0115)
MSG_RT_STOP_LOOP = const(0x0116)
MSG_RT_JOG_ALL = const(0x0120)
MSG_VIRT_CONFIG = const(0x0200)
MSG_VIRT_MOVE = const(0x0201)
MSG_VIRT_STOP = const(0x0202)
MSG_VIRT_JOG = const(0x0203)
MSG_VIRT_GET_POSITION = const(0x0205)
MSG_VIRT_JOG_ON_LINE = const(0x0206)
MSG_VIRT_AIM_POINT = const(0x0207)

# framestep's own, for its own commands; Dragonframe never sends them, and other devices answer
# ERR_UNSUPPORTED
MSG_CONDITION = const(0x4600)
MSG_EXCEEDED = const(0x4601)  # what the last move asked too much of (field note 5.5)
MSG_HOME = const(0x4602)  # homes motors (field note 4.9)

# -- Response codes (spec: MSG_FLAG_ACK); those that are results of the core have their numbers
# there

OK = const(results.OK)
ERR_CHECKSUM = const(0x0011)
ERR_MOVING = const(results.ERR_MOVING)
ERR_UNSUPPORTED = const(0x0013)
ERR_RANGE = const(results.ERR_RANGE)
ERR_GENERAL = const(results.ERR_GENERAL)
ERR_NOT_IN_POSITION = const(results.ERR_NOT_IN_POSITION)
ERR_PREROLL = const(results.ERR_PREROLL)
ERR_POSTROLL = const(results.ERR_POSTROLL)
ERR_AIM_COD = const(results.ERR_AIM_COD)
ERR_SOFT_UP = const(results.ERR_SOFT_UP)
ERR_SOFT_LOW = const(results.ERR_SOFT_LOW)
ERR_HARD_UP = const(results.ERR_HARD_UP)
ERR_HARD_LOW = const(results.ERR_HARD_LOW)

# -- Capabilities in HI

CAP_REALTIME = const(0x0001)
CAP_GO_MOTION = const(0x0002)
CAP_BOOM_SWING_TRACK = const(0x0004)
CAP_SWING_PAN = const(0x0008)
CAP_Y_SWING_TRACK = const(0x0010)
CAP_X_Y_Z = const(0x0020)
CAP_VIRTUALS = const(0x003C)  # field note 9.3: all four or none
CAP_AIM_POINT = const(0x0040)
CAP_GO_MOTION2 = const(0x0080)
CAP_COUPLE = const(0x0100)
CAP_LOOP = const(0x0200)
CAP_CAMERA = const(0x0400)

# -- Flags and enumerations inside payloads

GIO_CAM_SHUTTER = const(0x0001)
GIO_CAM_METER = const(0x0002)

MOTOR_ENABLED = const(0x01)
MOTOR_BLUR = const(0x02)
MOTOR_LIVE = const(0x08)  # this and below: field note 3.1
MOTOR_COUPLE = const(0x10)
MOTOR_COUPLE_REVERSED = const(0x20)

HW_SET_SWAP = const(0x80)  # field note 3.3: high and low limit inputs swapped
HW_SET_MASK = const(0x7F)

HARD_STOP_GENERAL = const(0)
HARD_STOP_UPPER = const(1)
HARD_STOP_LOWER = const(2)
HARD_STOP_FAULT = const(100)

# in the high half of START INDEX: the final value repeats to the end of the range
LAST_SECTION = const(0x8000)

RUN_PING_PONG = const(0x01)
RUN_LOOP = const(0x02)
RUN_VIDEO = const(0x10)
RUN_STILLS = const(0x20)
# a RUN_MOVE of at least these lengths, in bytes, has FLAGS, and the angles as well
RUN_FLAGS_BYTES = const(31)
RUN_ANGLES_BYTES = const(35)

VIRT_NONE = const(0)
VIRT_BOOM_SWING_TRACK = const(1)
VIRT_SWING_PAN = const(2)
VIRT_Y_SWING_TRACK = const(3)
VIRT_X_Y_Z = const(4)

VIRT_MOTOR_TRACK = const(1)  # virtual motors: field note 9.1
VIRT_MOTOR_EW = const(2)
VIRT_MOTOR_NS = const(3)
VIRT_MOTOR_PAN = const(4)
VIRT_MOTOR_TILT = const(5)
VIRT_MOTOR_ROLL = const(6)

CONDITION_RIG_FILE_INVALID = const(0x01)  # the rig file has a mistake, nothing moves
CONDITION_ESTOP = const(0x02)  # the E-stop is held
CONDITION_WATCHDOG_RESET = const(0x04)  # the watchdog has started the board
CONDITION_DRIVER = const(0x08)  # a driver does not work, its motor does not move
CONDITION_POSITIONS_SAVED = const(0x10)  # positions are remembered as they are now
CONDITION_POSITIONS_PENDING = const(0x20)  # they will be once the motors stand
CONDITION_POSITIONS_UNSAVABLE = const(0x40)  # they should be, but cannot

# the last move asked a motor for more than it is set to: MSG_EXCEEDED
CONDITION_EXCEEDED = const(0x80)

CONDITION_OVERLAY = const(0x100)  # modules on the file system replace the image's
CONDITION_OVERLAY_LEFT_OUT = const(0x200)  # such modules are there, but the image's own run

EXCEEDED_NOTHING = const(results.EXCEEDED_NOTHING)
EXCEEDED_VELOCITY = const(results.EXCEEDED_VELOCITY)
EXCEEDED_ACCELERATION = const(results.EXCEEDED_ACCELERATION)
EXCEEDED_BOARD = const(results.EXCEEDED_BOARD)
EXCEEDED_SLOWED = const(results.EXCEEDED_SLOWED)
EXCEEDED_UPPER = const(results.EXCEEDED_UPPER)
EXCEEDED_LOWER = const(results.EXCEEDED_LOWER)
EXCEEDED_PREROLL = const(results.EXCEEDED_PREROLL)
EXCEEDED_POSTROLL = const(results.EXCEEDED_POSTROLL)
EXCEEDED_MEMORY = const(results.EXCEEDED_MEMORY)

SET_LOWER = const(0x01)  # of MSG_EXCEEDED, what is set for a motor: a lower soft limit,
SET_UPPER = const(0x02)  # an upper one;
SET_ENABLED = const(0x04)  # it is enabled;
SET_FOLLOWS = const(0x08)  # it follows another one;
SET_AT_UPPER = const(0x10)  # its upper limit switch is active,
SET_AT_LOWER = const(0x20)  # its lower one

LINE_X = const(0)
LINE_Y = const(1)
LINE_Z = const(2)
LINE_PAN = const(3)
LINE_TILT = const(4)

HI_NAME_BYTES = const(32)  # of MSG_HI's answer (field note 2)

# -- Payload bytes of requests (field note 2): the shortest form, and each further entry (0: a fixed
#    layout). All that a host may send: a type that is not here is unknown (field note 1.7).

REQUESTS = {
    MSG_HI: (0, 0),
    MSG_DMX: (3, 1),
    MSG_GIO_OUT: (4, 0),
    MSG_GIO_IN: (0, 0),
    MSG_GIO_CAM: (4, 0),
    MSG_MOTOR_STATUS: (0, 0),
    MSG_MOTOR_MOVE: (5, 0),
    MSG_MOTOR_STOP: (1, 0),
    MSG_MOTOR_STOP_ALL: (0, 0),  # or 4, with flags
    MSG_MOTOR_GET_POSITION: (0, 0),
    MSG_MOTOR_RESET_POSITION: (5, 0),
    MSG_MOTOR_JOG: (7, 0),
    MSG_MOTOR_CONFIGURE: (2, 0),
    MSG_MOTOR_SET_SPEED: (9, 0),
    MSG_MOTOR_SET_LIMITS: (12, 0),
    MSG_RT_UPLOAD_MOVE_BEGIN: (8, 0),
    MSG_RT_UPLOAD_MOVE_AXIS: (5, 4),
    MSG_RT_UPLOAD_MOVE_DMX: (6, 1),
    MSG_RT_UPLOAD_MOVE_END: (0, 0),
    MSG_RT_UPLOAD_MOVE_TRIGGERS: (4, 8),
    MSG_RT_POSITION_FRAME: (4, 0),
    MSG_RT_RUN_MOVE: (29, 0),  # see RUN_FLAGS_BYTES and RUN_ANGLES_BYTES
    MSG_RT_SHOOT_FRAME: (11, 9),
    MSG_RT_GO: (0, 0),
    MSG_RT_SHOOT_FRAME2: (12, 9),
    MSG_RT_STOP_LOOP: (0, 0),
    MSG_RT_JOG_ALL: (8, 0),
    MSG_VIRT_CONFIG: (1, 1),  # each TYPE has lengths of its own
    MSG_VIRT_MOVE: (5, 0),
    MSG_VIRT_STOP: (1, 0),
    MSG_VIRT_JOG: (7, 0),
    MSG_VIRT_GET_POSITION: (0, 0),
    MSG_VIRT_JOG_ON_LINE: (3, 0),
    MSG_VIRT_AIM_POINT: (13, 0),
    MSG_CONDITION: (0, 0),
    MSG_EXCEEDED: (0, 0),
    MSG_HOME: (0, 1),
}


def known(kind):
    """Whether a host may send this message type (field note 1.7)."""
    return kind in REQUESTS


def payload_fits(kind, length):
    """Whether a request of this type may have a payload of `length` bytes; False for an unknown
    type.

    A fixed layout may be longer than this version knows: handlers ignore the rest (field note 1.8).
    """
    sizes = REQUESTS.get(kind)
    if sizes is None or length < sizes[0]:
        return False
    return not sizes[1] or (length - sizes[0]) % sizes[1] == 0
