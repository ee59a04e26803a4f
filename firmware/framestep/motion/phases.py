"""Phases: the motion ahead of a motor, in stretches of one cubic each.

The duration of a phase is a real number of ticks and need not end on a tick. Kinds:

    RAMP    G2 and G3 given (half the acceleration, a sixth of the jerk); ends where they lead
    AIM     the cubic that reaches a given place at a given velocity when the phase ends
    ONWARD  the remainder of an AIM phase: a long one is cut into pieces, each aimed again

Time in ticks of 1 ms, position in steps. Nothing allocates.
"""

from array import array

from framestep.base.native import const, micropython, ptr32
from framestep.motion import reals
from framestep.motion.reals import combine, divide, double, put, split
from framestep.motion.segments import G1, G2, G3, coefficient, distance, velocity
from framestep.pulse.stepper import AT_PART, AT_STEP

# Words of a phase
KIND = const(0)
TARGET = const(1)  # AIM: the step
DURATION = const(2)
START = const(4)  # velocity at the start
SECOND = const(6)  # RAMP: G2. AIM: velocity at the end
THIRD = const(8)  # RAMP: G3. AIM: fraction of a step beyond TARGET (Q16), in the first word
PHASE_WORDS = const(10)
PHASES = const(16)  # in the ring of a motor, a power of 2
READ_INDEX = const(160)  # words behind the ring: index of the next phase to read, and to write
WRITE_INDEX = const(161)

RAMP = const(0)
AIM = const(1)
ONWARD = const(2)

RING_MASK = const(15)
_PIECE = const(256)  # ticks; rounding errs by less than a ten-thousandth of a step within them
_LONGEST = const(2048)  # of a long phase at a time, as the error grows with the cube of the ticks

# Words of a duration
WHOLE_TICKS = const(0)
REST = const(1)  # Q30 of a tick
DURATION_WORDS = const(2)

# Result of load(); 0: it took a part of the phase
_TOOK = const(1)
_TOOK_AIM = const(2)

# Registers of load(), in an array that it shares with the planner (ramps.py)
_T = const(0)
_V = const(2)
_C = const(4)
_S = const(6)
_X = const(8)
_Y = const(10)
_Z = const(12)
_W = const(14)
ZERO = const(16)
PLANNER = const(18)  # the planner's registers begin here

scratch = array("i", [0] * 68)


class Phases:
    """Ring of the phases that lie ahead of one motor."""

    def __init__(self):
        self.words = array("i", [0] * (PHASES * PHASE_WORDS + 2))

    def clear(self):
        """Drop all phases."""
        self.words[READ_INDEX] = self.words[WRITE_INDEX] = 0

    def count(self):
        """Return the number of phases ahead."""
        return (self.words[WRITE_INDEX] - self.words[READ_INDEX]) & RING_MASK

    def append(self, kind, duration, start, second, third, down):
        """Append a phase from registers of `scratch`. down: negate velocities and accelerations, as
        the phase was planned for the opposite direction."""
        words = self.words
        at = words[WRITE_INDEX] * PHASE_WORDS
        words[at + KIND] = kind
        reals.fetch(words, at + DURATION, scratch, duration)
        reals.fetch(words, at + START, scratch, start)
        reals.fetch(words, at + SECOND, scratch, second)
        reals.fetch(words, at + THIRD, scratch, third)
        if down:
            reals.negate(words, at + START, at + START)
            reals.negate(words, at + SECOND, at + SECOND)
            reals.negate(words, at + THIRD, at + THIRD)
        words[WRITE_INDEX] = (words[WRITE_INDEX] + 1) & RING_MASK

    def aim(self, duration, start, end, numbers, targets, i, part=0):
        """Append an AIM phase: registers of `numbers`, the step targets[i] and `part` of one more
        (Q16)."""
        put_aim(self.words, numbers, duration, start, end, targets, i, part)


@micropython.viper
def put_aim(
    words: ptr32, r: ptr32, duration: int, start: int, end: int, targets, i: int, part: int
):
    """Append an AIM phase to the words of a Phases; see Phases.aim()."""
    at = words[WRITE_INDEX] * PHASE_WORDS
    words[WRITE_INDEX] = (words[WRITE_INDEX] + 1) & RING_MASK
    words[at + KIND] = AIM
    words[at + DURATION] = r[duration + 0]
    words[at + DURATION + 1] = r[duration + 1]
    words[at + START] = r[start + 0]
    words[at + START + 1] = r[start + 1]
    words[at + SECOND] = r[end + 0]
    words[at + SECOND + 1] = r[end + 1]
    words[at + TARGET] = ptr32(targets)[i + 0]
    words[at + THIRD] = part


@micropython.viper
def load(words, at: int, cubic, whole, knot, r) -> int:
    """Take the phase at words[at]: set the cubic's coefficients, not its position.

    whole: becomes its duration (WHOLE_TICKS, REST). knot: becomes the place where an AIM phase ends
    (AT_STEP, AT_PART). r: `scratch`. Returns _TOOK, _TOOK_AIM, or 0 if a part of the phase remains.
    """
    w = ptr32(words)
    out = ptr32(whole)
    kind = w[at + KIND]
    split(words, at + DURATION, whole)
    if kind == ONWARD:
        velocity(words, at + START, cubic, G1)
    else:
        coefficient(cubic, G1, words, at + START)
    if kind == RAMP:
        coefficient(cubic, G2, words, at + SECOND)
        coefficient(cubic, G3, words, at + THIRD)
        return _TOOK
    ptr32(knot)[AT_STEP] = w[at + TARGET]
    ptr32(knot)[AT_PART] = w[at + THIRD]
    # Cubic Hermite: G2 = (3·mean - 2·start - end)/T, G3 = (start + end - 2·mean)/T². Not written as
    # a formula: this runs for each motor and frame, and these functions are in RAM.
    s = ptr32(r)
    s[_T] = w[at + DURATION]
    s[_T + 1] = w[at + DURATION + 1]
    s[_V] = w[at + START]
    s[_V + 1] = w[at + START + 1]
    s[_C] = w[at + SECOND]
    s[_C + 1] = w[at + SECOND + 1]
    if out[WHOLE_TICKS] == 0:
        # Too short to bend; the phase that follows corrects where it ends.
        combine(r, _X, _C, _V, 1)
        divide(r, _X, _X, _T)
        double(r, _X, _X, -1)
        coefficient(cubic, G2, r, _X)
        coefficient(cubic, G3, r, ZERO)
        return _TOOK_AIM
    distance(r, _S, words, at + TARGET, cubic)
    if w[at + THIRD]:
        put(r, _X, w[at + THIRD], -16)
        combine(r, _S, _S, _X, 0)
    divide(r, _W, _S, _T)
    combine(r, _X, _W, _V, 1)  # mean - start
    combine(r, _Y, _W, _C, 1)  # mean - end
    combine(r, _Z, _X, _Y, 0)
    combine(r, _X, _X, _Z, 0)
    divide(r, _X, _X, _T)
    coefficient(cubic, G2, r, _X)
    s[_Z] = 0 - s[_Z]
    divide(r, _Z, _Z, _T)
    divide(r, _Z, _Z, _T)
    coefficient(cubic, G3, r, _Z)
    if out[WHOLE_TICKS] <= _PIECE:
        return _TOOK_AIM
    out[WHOLE_TICKS] = out[WHOLE_TICKS] >> 1
    if out[WHOLE_TICKS] > _LONGEST:
        out[WHOLE_TICKS] = _LONGEST
    out[REST] = 0
    put(r, _X, out[WHOLE_TICKS], 0)
    combine(r, _T, _T, _X, 1)
    w[at + DURATION] = s[_T]
    w[at + DURATION + 1] = s[_T + 1]
    w[at + KIND] = ONWARD
    return 0
