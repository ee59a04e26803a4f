"""Registers of operations on an uploaded move: indexes of real numbers in UploadPlayer.numbers.

There are only constants here: the build replaces each name by its number. Ticks of 1 ms; a frame's
position in steps.
"""

from framestep.base.native import const
from framestep.pulse.engine import MOTORS

# ---------------------------------------------------------------- of all operations

THOUSAND = const(0)
ZERO = const(2)
ARGUMENTS = const(4)  # parameters and results of formulas
ARGUMENTS_END = const(12)
FRAME_SPEED = const(12)  # a motor's velocity at a frame, before it is queued
SCALE = const(14)  # twelfths of a step per frame to steps per tick
SCRATCH = const(16)  # scratch of formulas
SCRATCH_END = const(30)

# ---------------------------------------------------------------- of a check (move_check.py)

FPS = const(30)  # frames per second
# limits of a motor, first per second, then from frame to frame
TOP_VELOCITY = const(32)
TOP_ACCELERATION = const(34)
TOP_CHANGE = const(36)  # of the kernel's numbers
TOP_PULSED = const(38)  # of the pulse engine
RAMP_RATE = const(40)  # acceleration of the rate, frames/s²
# what exceeded them
STEPS = const(42)  # steps from frame to frame
BENT = const(44)  # change of these where the path bends
GATHERED = const(46)  # additional change while the rate changes
FPS_SQUARED = const(48)  # of a rate that fits

# ---------------------------------------------------------------- of a JOG_ALL: frames and ticks

TOP = const(50)  # top velocity of the jog
TWICE = const(52)  # twice the acceleration, 8·10^-6 frames per tick²
RATE = const(54)  # velocity at the last frame queued
NEXT = const(56)  # velocity at the next frame
SLOWEST = const(58)  # ticks of one frame from rest to rest: 2/sqrt(4·10^-6)
SINCE = const(60)  # fraction of a tick that belongs to `whole` (jog_phases.py)
FRAME_SCALE = const(62)
HERE = const(64)  # frames from a row's INDEX
HERE_RATE = const(66)  # velocity at that place
DISTANCE = const(68)  # distance to go, frames
DURATION = const(70)  # ticks of the phase to the next frame
LIMIT = const(72)  # acceleration that a landing may have
GENTLEST = const(74)  # acceleration of a landing that the check has allowed
SQUARE = const(76)  # of RATE

# ---------------------------------------------------------------- of a run: ticks

FRAME_TICKS = const(78)  # of a frame
LONGER_FRAME_TICKS = const(80)  # of a frame that is a microsecond longer
ROLL_TICKS = const(82)  # of a motor's pre-roll or post-roll

# ---------------------------------------------------------------- of an exposure: ticks

WINDOW = const(84)  # from A to B
RAMP = const(86)  # of each of the two ramps
WAIT = const(88)  # from GO to the first ramp
OPENING = const(90)  # from angle 0 until the shutter opens

# ---------------------------------------------------------------- of each motor, one by one

SPEEDS = const(92)  # velocity at the last frame queued
TOPS = const(SPEEDS + 2 * MOTORS)  # top velocity at the time of the check, which no slope exceeds

REGISTERS = const(TOPS + 2 * MOTORS)
