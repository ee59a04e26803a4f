"""Registers of operations on an uploaded move: indexes of real numbers in UploadPlayer.numbers.

There are only constants here: the build replaces each name by its number. Ticks of 1 ms; a frame's
position in steps.
"""

from framestep.base.native import const

# ---------------------------------------------------------------- of all operations

THOUSAND = const(0)
ZERO = const(2)
ARGUMENTS = const(4)  # parameters and results of formulas
ARGUMENTS_END = const(12)
FRAME_SPEED = const(12)  # a motor's velocity at a frame, before it is queued
SCALE = const(14)  # twelfths of a step per frame to steps per tick
SPEEDS = const(16)  # for each of twelve motors: velocity at the last frame queued
# for each motor: top velocity at the time of the check, which no slope exceeds
TOPS = const(68)
SCRATCH = const(92)  # scratch of formulas
SCRATCH_END = const(106)

# ---------------------------------------------------------------- of a check (move_check.py)

FPS = const(106)  # frames per second
# limits of a motor, first per second, then from frame to frame
TOP_VELOCITY = const(108)
TOP_ACCELERATION = const(110)
TOP_CHANGE = const(112)  # of the kernel's numbers
TOP_PULSED = const(114)  # of the pulse engine
RAMP_RATE = const(116)  # acceleration of the rate, frames/s²
# what exceeded them
STEPS = const(118)  # steps from frame to frame
BENT = const(120)  # change of these where the path bends
GATHERED = const(122)  # additional change while the rate changes
FPS_SQUARED = const(124)  # of a rate that fits

# ---------------------------------------------------------------- of a JOG_ALL: frames and ticks

TOP = const(40)  # top velocity of the jog
TWICE = const(42)  # twice the acceleration, 8·10^-6 frames per tick²
RATE = const(44)  # velocity at the last frame queued
NEXT = const(46)  # velocity at the next frame
SLOWEST = const(48)  # ticks of one frame from rest to rest: 2/sqrt(4·10^-6)
SINCE = const(50)  # fraction of a tick that belongs to `whole` (jog_phases.py)
FRAME_SCALE = const(52)
HERE = const(54)  # frames from a row's INDEX
HERE_RATE = const(56)  # velocity at that place
DISTANCE = const(58)  # distance to go, frames
DURATION = const(60)  # ticks of the phase to the next frame
LIMIT = const(62)  # acceleration that a landing may have
GENTLEST = const(64)  # acceleration of a landing that the check has allowed
SQUARE = const(66)  # of RATE

# ---------------------------------------------------------------- of a run: ticks

FRAME_TICKS = const(126)  # of a frame
LONGER_FRAME_TICKS = const(128)  # of a frame that is a microsecond longer
ROLL_TICKS = const(130)  # of a motor's pre-roll or post-roll

# ---------------------------------------------------------------- of an exposure: ticks

WINDOW = const(132)  # from A to B
RAMP = const(134)  # of each of the two ramps
WAIT = const(136)  # from GO to the first ramp
OPENING = const(138)  # from angle 0 until the shutter opens

REGISTERS = const(140)
