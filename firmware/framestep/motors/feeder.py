"""Cutting of a motor's phases into segments, which the tick takes from its queue.

`work` of an axis records how much of its phases has been queued. Nothing allocates.
"""

from framestep.base.native import const, micropython, ptr32
from framestep.motion import phases, segments
from framestep.motion.phases import load
from framestep.motion.segments import bridge, cut, knot, mark, meet, mirror, settle, shift, snap
from framestep.pulse import stepper

# Words of `work`
LEFT = const(0)  # ticks of the cubic's phase still to be queued
PART = const(1)  # Q30 of a tick: what remains of the phase after them
AIMED = const(2)  # the phase under way ends on the step in `knot`
MARKED = const(3)  # `state` has the start of the tick that is still open
MORE = const(4)  # further phases will be appended: do not come to rest
MIRRORED = const(5)  # a partner does the same: 1; in the opposite sense: 2
CUT = const(6)  # result of queue_cut.cut(), six words
WORK_WORDS = const(12)

# Entries of `parts` of an axis, for feed()
WORK = const(0)
CUBIC = const(1)
BLOCK = const(2)
STATE = const(3)
WHOLE = const(4)
KNOT = const(5)
PHASES = const(6)
SCRATCH = const(7)

ALL_BITS = const(0x3FFFFFFF)
_PHASE_MASK = const(phases.PHASES - 1)


@micropython.viper
def feed(parts, other, base, most: int, enough: int, port):
    """Cut phases until `most` segments are queued, or `enough` ticks more than before; `most`
    segments in all, whatever becomes of them meanwhile.

    parts: of the Axis. other: the block of a coupled motor, or None; base: see segments.mirror().
    port: one that may answer a question between two segments, or None.

    As a rule a phase ends within a tick. That tick is a segment of its own: it begins with the old
    phase and ends with the new one, or with the one after that. At the end of the last phase the
    motor comes to rest.
    """
    work = parts[WORK]
    cubic = parts[CUBIC]
    block = parts[BLOCK]
    state = parts[STATE]
    whole = parts[WHOLE]
    words = parts[PHASES]
    w = ptr32(work)
    b = ptr32(block)
    out = ptr32(whole)
    p = ptr32(words)
    mirrored = w[MIRRORED]
    begin = b[stepper.WRITE_INDEX]
    while (
        b[stepper.PLANNED] & stepper.PLAN_SEGMENTS
        and enough > 0
        and (b[stepper.WRITE_INDEX] - b[stepper.READ_INDEX]) & ALL_BITS < most
        # A stop that waits for a pass empties the queue at each glance.
        and (b[stepper.WRITE_INDEX] - begin) & ALL_BITS < most
    ):
        if port:
            port.glance()
        n = w[LEFT]
        if n:
            if n > segments.LONGEST:
                n = segments.LONGEST
            cut(cubic, block, n)
            shift(cubic, n << 24, 6, 0)
            if n == w[LEFT] and w[PART] == 0 and w[AIMED]:
                snap(cubic, parts[KNOT])  # the segment itself ends on the step
                meet(cubic, block, n)
            elif n > segments.EXACT:
                meet(cubic, block, n)
            if mirrored:
                mirror(block, other, base, mirrored - 1)
            w[LEFT] = w[LEFT] - n
            enough -= n
            continue
        if w[MORE] and p[phases.READ_INDEX] == p[phases.WRITE_INDEX]:
            return
        part = w[PART]
        if part:
            if w[MARKED] == 0:
                mark(state, cubic)
            w[MARKED] = 0
            shift(cubic, part, 0, 0)
        while True:
            if w[AIMED]:
                snap(cubic, parts[KNOT])
                if part:
                    knot(state, parts[KNOT], part)
            if p[phases.READ_INDEX] == p[phases.WRITE_INDEX]:
                settle(cubic)
                if part:
                    bridge(state, cubic, block, part)
                    if mirrored:
                        mirror(block, other, base, mirrored - 1)
                cut(cubic, block, 1)
                if mirrored:
                    mirror(block, other, base, mirrored - 1)
                w[PART] = 0
                w[AIMED] = 0
                b[stepper.PLANNED] = b[stepper.PLANNED] & (
                    -1 - stepper.PLAN_SEGMENTS - stepper.PLAN_TIMED
                )
                break
            took = int(
                load(
                    words,
                    p[phases.READ_INDEX] * phases.PHASE_WORDS,
                    cubic,
                    whole,
                    parts[KNOT],
                    parts[SCRATCH],
                )
            )
            if took:
                p[phases.READ_INDEX] = (p[phases.READ_INDEX] + 1) & _PHASE_MASK
            w[AIMED] = took >> 1
            if part == 0:
                w[LEFT] = out[phases.WHOLE_TICKS]
                w[PART] = out[phases.REST]
                break
            rest = ALL_BITS - part + 1  # of the tick, below 2^30
            # A phase that ends exactly with the tick is finished before the next one begins: an AIM
            # phase may miss its step by rounding, and is snapped onto it in this tick's segment.
            if out[phases.WHOLE_TICKS] or out[phases.REST] > rest:
                shift(cubic, rest, 0, 0)
                bridge(state, cubic, block, part)
                if mirrored:
                    mirror(block, other, base, mirrored - 1)
                w[LEFT] = out[phases.WHOLE_TICKS]
                w[PART] = out[phases.REST] - rest
                if w[PART] < 0:
                    w[LEFT] = out[phases.WHOLE_TICKS] - 1
                    w[PART] = w[PART] + ALL_BITS + 1
                break
            shift(cubic, out[phases.REST], 0, 0)
            part += out[phases.REST]
            if part > ALL_BITS:
                # The phase ends with the tick; 2^30 would be an object on the heap.
                part = ALL_BITS
            if w[MORE] and p[phases.READ_INDEX] == p[phases.WRITE_INDEX]:
                # The next phase is not there yet: keep the tick open.
                shift(cubic, part, 0, 1)
                w[PART] = part
                w[MARKED] = 1
                return


@micropython.viper
def emptiest_queue(m: ptr32, least: int, modes: int) -> int:
    """Find the motor whose queue has to be filled next: the one with the fewest segments.

    Return 32 times the motor's number, from 1, plus its count of segments; 0 for none. Only motors
    with fewer than `least` (up to 16) and with more to cut count. m: the header. modes: only motors
    in one of these modes (bits of MODE); 0: any.
    """
    found = 0
    motor = 0
    a = m[stepper.FIRST]
    while a:
        m = ptr32(a)
        a = m[stepper.NEXT]
        motor += 32
        if m[stepper.PLANNED] & stepper.PLAN_SEGMENTS:
            n = (m[stepper.WRITE_INDEX] - m[stepper.READ_INDEX]) & ALL_BITS
            if modes and m[stepper.MODE] & modes == 0:
                n = least
            if n < least:
                w = ptr32(m[stepper.WORK])
                p = ptr32(m[stepper.PHASES])
                if w[LEFT] or w[MORE] == 0 or p[phases.READ_INDEX] != p[phases.WRITE_INDEX]:
                    least = n
                    found = motor + n
    return found


@micropython.viper
def coupled(m: ptr32, bits: int) -> int:
    """Return these bits and the bits of the coupled motors. m: the block of the motor of bit 0."""
    pair = 3
    while bits:
        if ptr32(m[stepper.WORK])[MIRRORED] and bits & pair:
            bits |= pair
        pair <<= 1
        a = m[stepper.NEXT]
        if a == 0:
            break
        m = ptr32(a)
    return bits
