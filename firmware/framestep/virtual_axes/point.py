"""The point that moves along a line from knot to knot, and the paths of the motors that follow it.

Every `span` ticks the point gets a new velocity, limited by its acceleration and by the remaining
distance. Knots are on whole ticks, except the one at which it comes to rest.

A step is made when a motor's path reaches it. If the path went through the positions themselves,
the motor would lag by half a step on average. So the path runs half a step ahead in the direction
of the motion. `advances` has each motor's advance at the last knot, Q16.
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

_SEVEN_EIGHTHS = const(0xE000)  # Q16: a path that stays within this part of a step makes no step

_TO_END = formula(registers, "TO_END = END - S")
_TICKS_TO_END = formula(registers, "TICKS = 2 * (TO_END / V)")  # at constant deceleration

_GO_ON = formula(registers, "NEXT_V = min(V + MAX_A * TICKS, max(V - MAX_A * TICKS, MAX_V))")
_SLOW_DOWN = formula(registers, "NEXT_V = V - MAX_A * TICKS")

# Slow enough to be able to stop at the end: (v + u)·ticks/2 + u²/2a = left, solved for u.
_STAY_ABLE_TO_STOP = formula(
    registers,
    """
    half = TICKS / 2
    u = (sqrt(half * half + (2 * LEFT - V * TICKS) / MAX_A) - half) * MAX_A
    assert u < NEXT_V
    NEXT_V = V / 2  # where a jog enters a cell with a lower acceleration
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


def place_knot(r, survey, ahead, stopping):
    """Find S and V of the next knot, and TICKS to it. Return False if that is not yet possible.

    ahead: the LookAhead of a jog, or None; stopping: come to rest as soon as possible.
    """
    surveyed = True
    if ahead:
        surveyed = ahead.load_limits()
        ahead.port.glance()
    compute(r, _TO_END)
    if not ahead:
        reals.copy(r, LEFT, TO_END)
    span = survey.span
    if reals.sign(r, V):
        compute(r, _TICKS_TO_END)
        ticks = reals.floor(r, TICKS, HALF)
        if ticks < span:
            if ahead and not ahead.closed:
                return False
            if ticks < 0:
                reals.put(r, TICKS, 1, 0)
            if not stopping or not compute(r, _STOP_WITHIN_TICKS):
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
    if stopping and compute(r, _STOP_WITHIN_TICKS):
        return True
    compute(r, _SLOW_DOWN if stopping else _GO_ON)
    compute(r, _STAY_ABLE_TO_STOP)
    compute(r, _MOVE_ON)
    return True


@micropython.viper
def velocity(r, to: int, rows, a: int, b: int, c: int, before: int, after: int, spare: int):
    """r[to] = (q(b) - q(a))·r[before] + (q(c) - q(b))·r[after]; q: the positions in a row"""
    q = ptr32(rows)
    put(r, to, ((q[b + 0] - q[a + 0]) << 16) + q[b + 1] - q[a + 1], -16)
    multiply(r, to, to, before)
    put(r, spare, ((q[c + 0] - q[b + 0]) << 16) + q[c + 1] - q[b + 1], -16)
    multiply(r, spare, spare, after)
    combine(r, to, to, spare, 0)


@micropython.viper
def _lead(rows: ptr32, a: int, b: int) -> int:
    """Return eight times the distance from the position in rows[a] to the one in rows[b], Q16, at
    most a step."""
    d = ((rows[b + 0] - rows[a + 0]) << 16) + rows[b + 1] - rows[a + 1]
    if d > 0x2000:
        d = 0x2000
    elif d < -0x2000:
        d = -0x2000
    return d << 3


@micropython.viper
def next_step(out: ptr32, rows, a: int, b: int, c: int, advances, i: int, bounds) -> int:
    """Find where the path of the motor of axis i goes for the position in rows[b]. Set out[0] to
    the step, and return the fraction (Q16).

    rows[a], rows[c]: the positions before and after it. The advance (advances[i]) changes with
    eight times the distance between them. While the position does not change, the path does not
    either, so a motor that rests between two steps makes none. The path does not reach a step
    beyond a bound.
    """
    q = ptr32(rows)
    kept = ptr32(advances)
    bound = ptr32(bounds)
    whole = q[b + 0]
    part = q[b + 1]
    d = kept[i + 0] + int(_lead(rows, a, b))
    if d > 0x8000:
        d = 0x8000
    elif d < -0x8000:
        d = -0x8000
    ahead = int(_lead(rows, b, c))
    # no advance if the motor is about to turn
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
    """Set advances[i] for a path that is at the step at[j] and a part (Q16) of one more when the
    position is rows[k]."""
    advances[i] = ((at[j + 0] - rows[k + 0]) << 16) + part - rows[k + 1]


@micropython.viper
def nearest_step(
    out: ptr32, j: int, rows: ptr32, k: int, present: ptr32, motor: int, bounds, i: int
):
    """out[j] = the step nearest to the position in rows[k]; of two about as near the motor's.

    Not beyond a bound of axis i: a line may begin there, by rounding.
    """
    bound = ptr32(bounds)
    step = present[motor + 0]
    d = (rows[k + 0] >> 2) - (step >> 2)
    if d < 2 and d > -2:
        d = ((rows[k + 0] - step) << 16) + rows[k + 1]
    else:
        d = 0x9000
    if d >= 0x9000 or d <= -0x9000:
        step = rows[k + 0] + (rows[k + 1] >> 15)
    i = 4 * i
    if step > bound[i + HIGH]:
        step = bound[i + HIGH]
    if step < bound[i + LOW]:
        step = bound[i + LOW]
    out[j] = step


@micropython.viper
def last_step(out, part: int, rows, k: int, present, motor: int, up: int, bounds, i: int) -> int:
    """Find where a path that leads to out[0] and a part (Q16) has to end to come to rest. Set
    out[0] to the step, and return the fraction (Q16).

    The end is on the step nearest to the position in rows[k], within the bounds of axis i. up:
    whether the path leads upward. It ends next to that step, on the side from which it came, rather
    than turn back onto it.
    """
    nearest_step(out, 1, rows, k, present, motor, bounds, i)
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
