"""Numbers of the DMC v2 protocol that belong to no single message: frame format, response codes,
flags.

Sources: the specification (edition 2024-08-13), and the field notes where marked.
"""

from framestep.base import results
from framestep.base.native import const

# -- Frame: 'D' 'F', id DWORD, type WORD, length WORD, payload, two check bytes; little-endian
# (spec: Message Format)

MARKER = b"DF"
HEADER_BYTES = const(10)
FRAME_OVERHEAD = const(12)
LARGEST_FRAME = const(1048)  # field note 1.6, header and check bytes included
LARGEST_PAYLOAD = const(1036)
PROTOCOL_VERSION = const(2)

MSG_FLAG_ACK = const(0x8000)

# -- Response codes (spec: MSG_FLAG_ACK). base/results.py has the numbers that the core returns

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
CONDITION_WATCHDOG_RESET = const(0x04)  # the watchdog has restarted the board
CONDITION_DRIVER = const(0x08)  # a driver does not work, its motor does not move
CONDITION_POSITIONS_SAVED = const(0x10)  # the present positions are saved
CONDITION_POSITIONS_PENDING = const(0x20)  # they will be saved once the motors are at rest
CONDITION_POSITIONS_UNSAVABLE = const(0x40)  # they cannot be saved

# the last move exceeded a motor's limits: MSG_EXCEEDED
CONDITION_EXCEEDED = const(0x80)

CONDITION_OVERLAY = const(0x100)  # modules on the file system replace the image's
CONDITION_OVERLAY_LEFT_OUT = const(0x200)  # such modules are there, but the image's own run
CONDITION_LOAD = const(0x400)  # a tick or a queue came within a fifth of a fault
CONDITION_CLOCK = const(0x800)  # a program has changed the processor's clock, nothing moves

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
EXCEEDED_RATE = const(results.EXCEEDED_RATE)

# Settings of a motor in MSG_EXCEEDED
SET_LOWER = const(0x01)  # it has a lower soft limit
SET_UPPER = const(0x02)  # it has an upper soft limit
SET_ENABLED = const(0x04)  # it is enabled
SET_FOLLOWS = const(0x08)  # it follows another motor
SET_AT_UPPER = const(0x10)  # its upper limit switch is active
SET_AT_LOWER = const(0x20)  # its lower limit switch is active

LINE_X = const(0)
LINE_Y = const(1)
LINE_Z = const(2)
LINE_PAN = const(3)
LINE_TILT = const(4)
