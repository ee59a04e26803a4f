"""The registers of virtual axes: where in their one array('i') each number of `reals` stands.

The geometries share them, as one is configured at a time, with the line, the survey and the point
that moves. Constants only: the build puts the numbers where the names are used. Places are in the
rig's units, angles in degrees, s along a line in either, velocities in s per tick. The world has
X = east-west, Y = north-south (up), Z = track (field note 9.4).
"""

from framestep.base.native import const

AXES = const(6)  # of a rig, and numbers of a pose

# ---------------------------------------------------------------- kinematics.py and the types

POSE = const(0)  # six: where the nodal point is, and the camera's angles (field note 9.1)
V_TRACK = const(0)
V_EW = const(2)
V_NS = const(4)
V_PAN = const(6)
V_TILT = const(8)
V_ROLL = const(10)

JOINT = const(12)  # six: the rig's axes, in the order of the type's name
JOINT_PAN = const(18)  # these three of every type but swing-pan
JOINT_TILT = const(20)
JOINT_ROLL = const(22)

HOME = const(24)  # six: the axes at VIRT_CONFIG; angles without whole turns, straight axes at 0
PER_UNIT = const(36)  # six: their steps per unit
FIRST_POSE = const(48)  # six: the pose for which the host has given its own at VIRT_CONFIG

LENGTH = const(60)
EXTENSION = const(62)
NODAL_RIGHT = const(64)  # from where the camera's axes meet to the nodal point, as it looks
NODAL_FORWARD = const(66)
NODAL_UP = const(68)
SAFE = const(70)  # distance that an aim point keeps, 0 for none
AIM_X = const(72)
AIM_Y = const(74)
AIM_Z = const(76)

WRIST_EW = const(78)  # the point in which the camera's axes meet
WRIST_NS = const(80)
WRIST_TRACK = const(82)
OFFSET = const(84)  # three: from there to the nodal point, in the world
OFFSET_EW = const(84)
OFFSET_NS = const(86)
OFFSET_TRACK = const(88)
STEPS = const(90)  # six: how far each motor is from where it stood at VIRT_CONFIG

ZERO = const(102)
X = const(104)  # for whatever a function needs
Y = const(106)

BOOM = const(12)  # axes of arms (arm.py)
SWING = const(14)
TRACK = const(16)
NARROW = const(108)  # 2^-5, the least cosine of an angle that counts as within reach
SIDE = const(110)  # 1, or -1 with the arm behind the column
TURNS = const(112)  # degrees: 180 times the half turns of the swing
REACH = const(114)  # level, from the column to the wrist
BOOM_COSINE = const(116)
BEFORE = const(108)  # of swing-pan: vPan before the host counted anew

DIRECTION_PAN = const(118)  # to the aim point (aim.py)
DIRECTION_TILT = const(120)
NEAR_PAN = const(122)  # on whose turn that pan is to be

SCRATCH = const(124)  # what formulas need on the way
SCRATCH_END = const(144)
# ---------------------------------------------------------------- a line (line.py)

BASE = const(144)  # six: the pose, or the axes, at s = 0
DIRECTION = const(156)  # six: what s adds to it
LAST_END = const(168)  # six: the pose in which the last line has ended, before rounding to steps
PAN_OFFSET = const(180)  # pan and tilt less the direction of the aim point
TILT_OFFSET = const(182)
AIMED_PAN = const(184)  # that direction at s = 0
AIMED_TILT = const(186)
TURN_PAN = const(188)  # what pan and tilt are still to turn to be aimed
TURN_TILT = const(190)

# ---------------------------------------------------------------- its survey (survey.py)

END = const(192)  # s at which the line ends; of a jog, up to which it has been surveyed
MAX_V = const(194)  # the greatest velocity of the point
MAX_A = const(196)  # and its greatest acceleration
HALF_CELL = const(198)  # s in half a cell of level 0
SAMPLE = const(200)  # s of a sample of the line
SLOPE = const(202)  # of a motor, its greatest: steps per half cell
BEND = const(204)  # and the greatest change of that from one half cell to the next
THIRD = const(206)  # of a motor, a bound of the third derivative
MOTOR_V = const(208)  # limits of a motor
MOTOR_A = const(210)
BEND_V2 = const(212)  # square of the velocity that bends leave
SHARE = const(214)  # of what the motors can do

# ---------------------------------------------------------------- the point (point.py, move.py)

S = const(216)  # where the knot planned last lies
V = const(218)  # and the point's velocity there
TICKS = const(220)  # from the knot before to it
LEFT = const(222)  # distance to where the point has to stand if it goes on as it may
TO_END = const(224)  # distance to the end of the line, or of what is surveyed
NEXT_V = const(226)
S_BEFORE = const(228)  # of three knots that follow each other
S_HERE = const(230)
S_AFTER = const(232)
V_HERE = const(234)
BEFORE_RATE = const(236)  # by these the steps before and after a knot make the velocity there
AFTER_RATE = const(238)
PHASE_TICKS = const(240)
FROM_V = const(242)  # velocities of a motor at either end of a phase
TO_V = const(244)

# ---------------------------------------------------------------- jogs (lookahead.py, jogs.py)

CELL_END = const(246)  # s there
CELL_V = const(248)
CELL_A = const(250)
CELL_LENGTH = const(252)
EXIT_V2 = const(254)  # squares of the velocities at the end of a cell, and at its start
ENTRY_V2 = const(202)
REACH_S = const(204)  # as far as the point can come until the next knot
FASTEST = const(206)  # of the motors in the first cell
GOAL = const(246)  # of a move
CAMERA_AXIS = const(246)  # three: its direction, as vTrack, vEW, vNS

REGISTERS = const(256)  # words of the array
