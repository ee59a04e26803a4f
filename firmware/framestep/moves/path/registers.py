"""Registers of operations on an uploaded move: indexes of real numbers in UploadPlayer.numbers.

Those from OWN to TOPS belong to the operation that is prepared or running. There are only constants
here: the build replaces each name by its number. Ticks of 1 ms; a frame's position in steps.
"""

from framestep.base.native import const

# ---------------------------------------------------------------- of all operations

THOUSAND = const(0)
ZERO = const(2)
X = const(4)  # scratch of any function
Y = const(6)
T = const(8)
SCALE = const(10)  # twelfths of a step per frame to steps per tick
SPEEDS = const(12)  # for each motor: velocity at the last frame queued
OWN = const(36)  # after twelve motors' velocities
# for each motor: top velocity at the time of the check, which no slope exceeds
TOPS = const(64)
SCRATCH = const(88)  # scratch of formulas
SCRATCH_END = const(102)

# ---------------------------------------------------------------- of a check (move_check.py)

FPS = const(102)  # frames per second
# limits of a motor, first per second, then from frame to frame
TOP_VELOCITY = const(104)
TOP_ACCELERATION = const(106)
TOP_CHANGE = const(108)  # of the kernel's numbers
TOP_PULSED = const(110)  # of the pulse engine
RAMP_RATE = const(112)  # acceleration of the rate, frames/s²
STEPS = const(114)  # what exceeded them: steps from frame to frame,
BENT = const(116)  # their change where the path bends,
GATHERED = const(118)  # and the additional change while the rate changes
FPS_SQUARED = const(120)  # of a rate that fits

REGISTERS = const(122)

# ---------------------------------------------------------------- of a JOG_ALL: frames and ticks

TOP = const(36)  # top velocity of the jog
TWICE = const(38)  # twice the acceleration, 8·10^-6 frames per tick²
RATE = const(40)  # velocity at the last frame queued
NEXT = const(42)  # and at the next one
SLOWEST = const(44)  # ticks of one frame from rest to rest: 2/sqrt(4·10^-6)
SINCE = const(46)  # fraction of a tick that belongs to `whole` (jog_phases.py)
FRAME_SCALE = const(48)
HERE = const(50)  # frames from a row's INDEX, and the velocity there
HERE_RATE = const(52)
DISTANCE = const(54)  # distance to go, frames
P = const(56)  # scratch
Q = const(58)
LIMIT = const(62)  # acceleration of a landing

# ---------------------------------------------------------------- of a run: ticks

FRAME_TICKS = const(36)  # of a frame
LONGER_FRAME_TICKS = const(38)  # of a frame that is a microsecond longer
ROLL_TICKS = const(40)  # of a motor's pre-roll or post-roll

# ---------------------------------------------------------------- of an exposure: ticks

WINDOW = const(36)  # from A to B
RAMP = const(38)  # of each of the two ramps
WAIT = const(40)  # from GO to the first ramp
OPENING = const(42)  # from angle 0 until the shutter opens
