"""From knot to knot: the point that moves along a line, and the paths of the motors that follow it.

Every `span` ticks the point gets a new velocity, limited by its acceleration and by the distance
left. Knots lie on whole ticks, but for the one at which it comes to rest.

A step is made when a motor's path reaches it, so with a path through the places the motor would lag
by half a step on average. So the path runs half a step ahead in the direction of the motion. How
far ahead it is at the last knot is kept per motor (`advances`, Q16).
"""

from framestep.base.clock import HALF
from framestep.base.native import const, micropython, ptr32
from framestep.motion import reals
from framestep.motion.compute import compute
from framestep.motion.formula import formula
from framestep.motion.reals import combine, multiply, put
from framestep.virtual_axes import registers
from framestep.virtual_axes.line import HIGH, LOW
from framestep.virtual_axes.registers import END, LEFT, TICKS, TO_END, S, V

_SEVEN_EIGHTHS = const(0xE000)  # Q16: a path that stays within so much of a step makes no other

_TO_END = formula(registers, "TO_END = END - S")
_TICKS_TO_END = formula(registers, "TICKS = 2 * (TO_END / V)")  # at constant deceleration

_GO_ON = formula(registers, "NEXT_V = min(V + MAX_A * TICKS, max(V - MAX_A * TICKS, MAX_V))")
_SLOW_DOWN = formula(registers, "NEXT_V = V - MAX_A * TICKS")

# No faster than it can stop from at the end: (v + u)·ticks/2 + u²/2a = left, solved for u.
_STAY_ABLE_TO_STOP = formula(
    registers,
    """
    half = TICKS / 2
    u = (sqrt(half * half + (2 * LEFT - V * TICKS) / MAX_A) - half) * MAX_A
    assert u < NEXT_V
    NEXT_V = V / 2  # where cells of a jog in which it may slow down less follow each other
    assert u > ZERO
    NEXT_V = u
    """,
)
_MOVE_ON = formula(
    registers,
    """
    S = S + (V + NEXT_V) * TICKS / 2
    V = NEXT_V
    """,
)
_STOP_WITHIN_TICKS = formula(
    registers,
    """
    stop_ticks = V / MAX_A
    assert stop_ticks <= TICKS
    TICKS = stop_ticks
    S = S + V * TICKS / 2
    V = 0
    """,
)


def advance(r, survey, ahead, stopping):
    """S and V of the next knot, and TICKS to it. False: it cannot be told yet.

    ahead: the LookAhead of a jog, or None; stopping: it is to come to rest as soon as it may.
    """
    surveyed = not ahead or ahead.load_limits()
    compute(0, 0, r, _TO_END)
    if not ahead:
        reals.copy(r, LEFT, TO_END)
    span = survey.span
    if reals.sign(r, V):
        compute(0, 0, r, _TICKS_TO_END)
        ticks = reals.floor(r, TICKS, HALF)
        if ticks < span:
            if ahead and not ahead.closed:
                return False
            if ticks < 0:
                reals.put(r, TICKS, 1, 0)
            if not stopping or not compute(0, 0, r, _STOP_WITHIN_TICKS):
                reals.copy(r, S, END)
                reals.put(r, V, 0, 0)
            return True
        if ticks < 2 * span:
            span = ticks // 2 + 1
    elif reals.sign(r, TO_END) <= 0:
        if ahead and not ahead.closed:
            return False
        reals.put(r, TICKS, 1, 0)
        return True
    if not surveyed:
        return False
    reals.put(r, TICKS, span, 0)
    if stopping and compute(0, 0, r, _STOP_WITHIN_TICKS):
        return True
    compute(0, 0, r, _SLOW_DOWN if stopping else _GO_ON)
    compute(0, 0, r, _STAY_ABLE_TO_STOP)
    compute(0, 0, r, _MOVE_ON)
    return True


@micropython.viper
def velocity(r, to: int, rows, a: int, b: int, c: int, before: int, after: int, spare: int):
    """r[to] = (q(b) - q(a))·r[before] + (q(c) - q(b))·r[after], q being the place in a row."""
    q = ptr32(rows)
    put(r, to, ((q[b + 0] - q[a + 0]) << 16) + q[b + 1] - q[a + 1], -16)
    multiply(r, to, to, before)
    put(r, spare, ((q[c + 0] - q[b + 0]) << 16) + q[c + 1] - q[b + 1], -16)
    multiply(r, spare, spare, after)
    combine(r, to, to, spare, 0)


@micropython.viper
def _way(rows: ptr32, a: int, b: int) -> int:
    """The way from the place in rows[a] to that in rows[b], eightfold, in Q16: up to a step."""
    d = ((rows[b + 0] - rows[a + 0]) << 16) + rows[b + 1] - rows[a + 1]
    if d > 0x2000:
        d = 0x2000
    elif d < -0x2000:
        d = -0x2000
    return d << 3


@micropython.viper
def next_step(out: ptr32, rows, a: int, b: int, c: int, advances, i: int, bounds) -> int:
    """Where the path of a motor, of axis i, leads to for the place in rows[b]: out[0], fraction
    (Q16).

    rows[a], rows[c]: the places before and after it. The advance (advances[i]) follows the distance
    between them, eightfold: where a place does not change the path does not either, so a motor that
    stands, between two steps by what the line asks for, makes none. A step past its bounds is not
    reached.
    """
    q = ptr32(rows)
    kept = ptr32(advances)
    bound = ptr32(bounds)
    whole = q[b + 0]
    part = q[b + 1]
    d = kept[i + 0] + int(_way(rows, a, b))
    if d > 0x8000:
        d = 0x8000
    elif d < -0x8000:
        d = -0x8000
    ahead = int(_way(rows, b, c))
    # none where it is about to turn
    if d > 0 and ahead < 0:
        d += ahead
        if d < 0:
            d = 0
    elif d < 0 and ahead > 0:
        d += ahead
        if d > 0:
            d = 0
    kept[i] = d
    part += d
    whole += part >> 16
    part = part & 0xFFFF
    i = 4 * i
    d = bound[i + HIGH]
    if whole > d or (whole == d and part > _SEVEN_EIGHTHS):
        whole = d
        part = _SEVEN_EIGHTHS
    d = bound[i + LOW]
    if whole < d and (whole < d - 1 or part < 0x10000 - _SEVEN_EIGHTHS):
        whole = d - 1
        part = 0x10000 - _SEVEN_EIGHTHS
    out[0] = whole
    return part


@micropython.viper
def set_advance(advances: ptr32, i: int, at: ptr32, j: int, part: int, rows: ptr32, k: int):
    """advances[i] of a path at the step at[j] and a part (Q16) of one more, for the place in
    rows[k]."""
    advances[i] = ((at[j + 0] - rows[k + 0]) << 16) + part - rows[k + 1]


@micropython.viper
def nearest_step(out: ptr32, j: int, rows: ptr32, k: int, present: ptr32, motor: int):
    """out[j] = the step nearest to the place in rows[k]; of two about as near that of the motor."""
    step = present[motor + 0]
    out[j] = step
    d = (rows[k + 0] >> 2) - (step >> 2)
    if d < 2 and d > -2:
        d = ((rows[k + 0] - step) << 16) + rows[k + 1]
        if d < 0x9000 and d > -0x9000:
            return
    out[j] = rows[k + 0] + (rows[k + 1] >> 15)


@micropython.viper
def last_step(out, part: int, rows, k: int, present, motor: int, up: int) -> int:
    """Where a path to out[0] and a part (Q16) has to end to come to rest: out[0], and Q16 of one
    more.

    That is on the step nearest to the place in rows[k]. up: whether the path leads upward. It ends
    beside that step, as it has come, rather than turn back onto it.
    """
    nearest_step(out, 1, rows, k, present, motor)
    at = ptr32(out)
    d = ((at[0] - at[1]) << 16) + part
    if up:
        if d < 0:
            d = 0
        elif d > _SEVEN_EIGHTHS:
            d = _SEVEN_EIGHTHS
    elif d > 0:
        d = 0
    elif d < 0 - _SEVEN_EIGHTHS:
        d = 0 - _SEVEN_EIGHTHS
    at[0] = at[1] + (d >> 16)
    return d & 0xFFFF
