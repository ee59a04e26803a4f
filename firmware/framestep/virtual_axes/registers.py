"""Registers of virtual axes: the index of each number of `reals` in their one array('i').

The geometries, only one of which is configured at a time, share them with the line, the survey and
the moving point. There are only constants here: the build replaces each name by its number.
Positions are in the rig's units, angles in degrees, s along a line in either, velocities in s per
tick. The world has X = east-west, Y = north-south (up), Z = track (field note 9.4).
"""

from framestep.base.native import const

AXES = const(6)  # of a rig, and numbers of a pose

# ---------------------------------------------------------------- kinematics.py and the types

POSE = const(0)  # six: position of the nodal point, and the camera's angles (field note 9.1)
V_TRACK = const(0)
V_EW = const(2)
V_NS = const(4)
V_PAN = const(6)
V_TILT = const(8)
V_ROLL = const(10)

JOINT = const(12)  # six: the rig's axes, in the order of the type's name
JOINT_PAN = const(18)  # these three for every type except swing-pan
JOINT_TILT = const(20)
JOINT_ROLL = const(22)

HOME = const(24)  # six: the axes at VIRT_CONFIG; angles without whole turns, linear axes at 0
PER_UNIT = const(36)  # six: steps per unit of each axis
FIRST_POSE = const(48)  # six: the pose of VIRT_CONFIG, for which the host has given its own

LENGTH = const(60)
EXTENSION = const(62)
NODAL_RIGHT = const(64)  # from the wrist to the nodal point, in camera coordinates
NODAL_FORWARD = const(66)
NODAL_UP = const(68)
SAFE = const(70)  # least distance of an aim point, 0: any
AIM_X = const(72)
AIM_Y = const(74)
AIM_Z = const(76)

WRIST_EW = const(78)  # the point at which the camera's axes intersect
WRIST_NS = const(80)
WRIST_TRACK = const(82)
OFFSET = const(84)  # three: from there to the nodal point, in world coordinates
OFFSET_EW = const(84)
OFFSET_NS = const(86)
OFFSET_TRACK = const(88)
STEPS = const(90)  # six: steps of each motor since VIRT_CONFIG

ZERO = const(102)
ARGUMENTS = const(104)  # parameters and results of formulas
ARGUMENTS_END = const(108)

BOOM = const(12)  # axes of arms (arm.py)
SWING = const(14)
TRACK = const(16)
NARROW = const(108)  # 2^-5, the lowest cosine of an angle within reach
SIDE = const(110)  # 1, or -1 if the arm is behind the column
TURNS = const(112)  # degrees: 180 times the half turns of the swing
REACH = const(114)  # horizontal distance from the column to the wrist
BOOM_COSINE = const(116)
BEFORE = const(178)  # of swing-pan: vPan before the host's new count

DIRECTION_PAN = const(118)  # to the aim point (aim.py)
DIRECTION_TILT = const(120)
NEAR_PAN = const(122)  # the pan that selects the turn of that direction

SCRATCH = const(124)  # scratch of formulas
SCRATCH_END = const(144)
SPARE = const(124)  # for a number that is used at once, between two formulas

# ---------------------------------------------------------------- a line (line.py)

BASE = const(144)  # six: the pose, or the axes, at s = 0
DIRECTION = const(156)  # six: what s adds to it
# six, in no formula: the pose at the end of the last line, before rounding to steps
LAST_END = const(256)
PAN_OFFSET = const(180)  # pan and tilt minus the direction of the aim point
TILT_OFFSET = const(182)
AIMED_PAN = const(184)  # that direction at s = 0
AIMED_TILT = const(186)
TURN_PAN = const(188)  # what pan and tilt have yet to turn
TURN_TILT = const(190)

# ---------------------------------------------------------------- its survey (survey.py)

END = const(192)  # s at the end of the line; of a jog, at the end of its survey
MAX_V = const(194)  # greatest velocity of the point
MAX_A = const(196)  # greatest acceleration of the point
HALF_CELL = const(198)  # s in half a cell of level 0
SAMPLE = const(200)  # s of a sample of the line
SLOPE = const(202)  # greatest slope of a motor: steps per half cell
BEND = const(204)  # greatest change of the slope from one half cell to the next
THIRD = const(206)  # bound of a motor's third derivative
MOTOR_V = const(208)  # limits of a motor
MOTOR_A = const(210)
BEND_V2 = const(212)  # square of the velocity that bends allow
SHARE = const(214)  # part of the motors' limits that is used

# ---------------------------------------------------------------- the point (point.py, move.py)

S = const(216)  # s of the last knot planned
V = const(218)  # velocity of the point at the last knot planned
TICKS = const(220)  # from the knot before to it
LEFT = const(222)  # distance in which the point must be able to stop
TO_END = const(224)  # distance to the end of the line, or of its survey
NEXT_V = const(226)
S_BEFORE = const(228)  # of three knots that follow each other
S_HERE = const(230)
S_AFTER = const(232)
V_HERE = const(234)
BEFORE_RATE = const(236)  # a motor's velocity at a knot: factors of its steps before and after
AFTER_RATE = const(238)
PHASE_TICKS = const(240)
FROM_V = const(242)  # a motor's velocity at the beginning of a phase
TO_V = const(244)  # a motor's velocity at the end of a phase

# ---------------------------------------------------------------- jogs (lookahead.py, jogs.py)

CELL_END = const(246)  # s at the end of a cell
CELL_V = const(248)
CELL_A = const(250)
CELL_LENGTH = const(252)
EXIT_V2 = const(254)  # square of the velocity at the end of a cell
ENTRY_V2 = const(168)  # square of the velocity at its start
REACH_S = const(170)  # the farthest s that the point can reach until the next knot
FASTEST = const(172)  # of the motors in the first cell
BEFORE_A = const(174)  # acceleration of the cell before
GOAL = const(176)  # of a move
CAMERA_AXIS = const(268)  # three, in no formula: direction of an axis, as vTrack, vEW, vNS

REGISTERS = const(274)  # words of the array; formulas reach those below 256
