"""Where in a request's payload its fields begin, bytes from the start.

A name is that of the message without MSG_ and RT_, and that of the field in
framestep_tools.payloads. The first field is at 0 and has no name here. Constants only: the build
puts the numbers where the names are used.
"""

from framestep.native import const

DMX_CHANNEL = const(1)
DMX_LEVELS = const(3)

MOTOR_MOVE_POSITION = const(1)
MOTOR_RESET_POSITION_POSITION = const(1)
MOTOR_JOG_SPEED = const(1)
MOTOR_JOG_DESTINATION = const(3)
MOTOR_CONFIGURE_FLAGS = const(1)
MOTOR_SET_SPEED_VELOCITY = const(1)
MOTOR_SET_SPEED_ACCELERATION = const(5)
MOTOR_SET_LIMITS_LOWER_ENABLE = const(1)
MOTOR_SET_LIMITS_LOWER = const(2)
MOTOR_SET_LIMITS_UPPER_ENABLE = const(6)
MOTOR_SET_LIMITS_UPPER = const(7)
MOTOR_SET_LIMITS_LIMIT_SET = const(11)

UPLOAD_MOVE_BEGIN_END_FRAME = const(4)
UPLOAD_MOVE_AXIS_START_INDEX = const(1)
UPLOAD_MOVE_AXIS_POSITIONS = const(5)
UPLOAD_MOVE_DMX_START_INDEX = const(2)
UPLOAD_MOVE_DMX_LEVELS = const(6)
UPLOAD_MOVE_TRIGGERS_TRIGGERS = const(4)
RUN_MOVE_START_FRAME = const(4)
RUN_MOVE_END_FRAME = const(8)
RUN_MOVE_PREROLL_MS = const(12)
RUN_MOVE_POSTROLL_MS = const(16)
RUN_MOVE_SYNC_DMX = const(20)
RUN_MOVE_BLOOP_OUTPUTS = const(21)
RUN_MOVE_BLOOP_CHANNEL = const(25)
RUN_MOVE_BLOOP_MS = const(27)
RUN_MOVE_FLAGS = const(29)
RUN_MOVE_OPEN_ANGLE = const(31)
RUN_MOVE_CLOSE_ANGLE = const(33)
SHOOT_FRAME_DIRECTION = const(4)
SHOOT_FRAME_EXPOSURE_MS = const(5)
SHOOT_FRAME_BLUR = const(9)
SHOOT_FRAME_MOTORS = const(11)
SHOOT_FRAME2_EXPOSURE_MS = const(4)
SHOOT_FRAME2_OPEN_ANGLE = const(8)
SHOOT_FRAME2_CLOSE_ANGLE = const(10)
SHOOT_FRAME2_MOTORS = const(12)
JOG_ALL_DESTINATION = const(4)

VIRT_MOVE_POSITION = const(1)
VIRT_JOG_SPEED = const(1)
VIRT_JOG_DESTINATION = const(3)
VIRT_JOG_ON_LINE_SPEED = const(1)
VIRT_AIM_POINT_X = const(1)
