"""Cutting queues off some ticks from now, so that a new plan can take over there.

Only the main loop puts segments into a queue, and only the tick takes them out. So interrupts are
off only while a cut is made, some microseconds for all motors. The state at the cut is computed
afterwards.
"""

from framestep.base.clock import HALF, WIDE_WRAP, elapsed
from framestep.base.native import const, micropython, ptr32
from framestep.motion import segments
from framestep.motion.segments import mirror
from framestep.motors.feeder import CUT, MIRRORED
from framestep.pulse import stepper as sw

EASY_TICKS = const(96)  # of ease(): time for eight plans and a collection of the heap
_STEEPEST_EASE = const(0x400000)  # Q22 steps per tick²: its products stay below 2^31

# Words of a motor's `work`, from CUT on: a state before the cut
_WHOLE = const(CUT)  # steps
_FRACTION = const(CUT + 1)  # Q22
_VELOCITY = const(CUT + 2)  # Q22
_ACCEL = const(CUT + 3)  # Q27
_JERK = const(CUT + 4)  # Q27
_TICKS = const(CUT + 5)  # from that state to the cut

# Words of a motor's `work`, from CUT on, as well: how slow() makes it go on
_HEAD = const(CUT)  # the first segment after that
_NEW_VELOCITY = const(CUT + 1)
_NEW_ACCEL = const(CUT + 2)
_NEW_JERK = const(CUT + 3)
# and where cut_at() has cut, as AT_ words
_STEP = const(CUT + 4)
_PART = const(CUT + 5)

_MIRRORED = const(MIRRORED)
_LONGEST_STOP = const(0x100000)  # ticks
_FARTHEST = const(320)  # ticks of a way to slow down on: n << 22 stays below 2^31
_GREATEST_CHANGE = const(0x10000000)  # of a velocity, Q22

# Results of cut() that are not ticks
TOO_SOON = const(-1)
UNEVEN = const(-2)


@micropython.viper
def queued(m: ptr32, bits: int, most: int) -> int:
    """Return for how many ticks, up to `most`, all motors of these bits have segments; 0 if one of
    them does not run its queue.

    m: the block of the motor of bit 0.
    """
    while bits:
        if bits & 1:
            ticks = 0
            if m[sw.MODE] == sw.RUN:
                head = m[sw.READ_INDEX]
                ticks = m[sw.LEFT]
                while head != m[sw.READ_INDEX]:  # a tick has just taken a segment
                    head = m[sw.READ_INDEX]
                    ticks = m[sw.LEFT]
                q = ptr32(m[sw.QUEUE])
                while ticks < most and head != m[sw.WRITE_INDEX]:
                    ticks += q[(head & (sw.SEGMENTS - 1)) << 3]
                    head = (head + 1) & WIDE_WRAP
            if ticks < most:
                most = ticks
        bits >>= 1
        if bits:
            a = m[sw.NEXT]
            m = ptr32(a)
    return most


@micropython.viper
def cut(header: ptr32, m: ptr32, bits: int, ticks: int) -> int:
    """End the queues of these motors about `ticks` from now; start_cubic() continues from there.

    Return the ticks until then, at least `ticks`; 0 if the first motor is at rest; TOO_SOON, with
    nothing changed, if it comes to rest before; UNEVEN if the cuts are not at the same moment. m:
    the block of the motor of bit 0. While the header's HELD is set, a motor that slows down goes on
    doing so, and one at rest does not start. To be called with interrupts off; the new plan must be
    queued within that time.
    """
    held = header[sw.HELD]
    found = TOO_SOON
    while bits:
        if bits & 1:
            out = ptr32(m[sw.WORK])
            q = ptr32(m[sw.QUEUE])
            head = m[sw.READ_INDEX]
            done = m[sw.LEFT]
            k = -1  # the queued segment in which the cut lies
            left = ticks
            if m[sw.MODE] & sw.STOP:
                # Carry on with the same deceleration as a segment
                v = m[sw.VELOCITY]
                a = m[sw.DECEL]
                if v == 0 or held:
                    done = 0  # it comes to rest in the next tick, or has to
                elif v < 0:
                    done = (0 - v) // a
                else:
                    done = v // a
                    a = 0 - a
                if done >= ticks:
                    done = ticks
                    m[sw.LEFT] = ticks
                    m[sw.VELOCITY] = v + a
                    m[sw.ACCEL] = a << 5
                    m[sw.JERK] = 0
                    m[sw.MODE] = sw.RUN | (m[sw.MODE] & sw.START)
                    m[sw.READ_INDEX] = head = m[sw.WRITE_INDEX]
            elif m[sw.MODE] & sw.RUN == 0:
                done = left = 0
            elif done < ticks:
                while done < ticks and head != m[sw.WRITE_INDEX]:
                    k = (head & (sw.SEGMENTS - 1)) << 3
                    head = (head + 1) & WIDE_WRAP
                    done += q[k]
                if done >= ticks:
                    left = q[k] + ticks - done
                    q[k] = left
                    done = ticks
                    bridge = q[k + sw.SEG_BRIDGE]
                    while bridge and head != m[sw.WRITE_INDEX]:
                        # A bridge ends with the velocity at which the next segment begins. Between
                        # two bridges that is unknown, so go on to the end of the second.
                        k = (head & (sw.SEGMENTS - 1)) << 3
                        left = bridge = q[k + sw.SEG_BRIDGE]
                        done += bridge
                        head = (head + bridge) & WIDE_WRAP
            else:
                done = ticks
                m[sw.LEFT] = ticks
            if done < left:
                done = TOO_SOON
            else:
                m[sw.WRITE_INDEX] = head
                if held == 0:
                    m[sw.DECEL] = 0  # from here on a stop keeps release() from starting it
                out[_TICKS] = left
                if k < 0:
                    out[_WHOLE] = m[sw.POSITION]
                    out[_FRACTION] = m[sw.FRACTION]
                    out[_VELOCITY] = m[sw.VELOCITY]
                    out[_ACCEL] = m[sw.ACCEL]
                    out[_JERK] = m[sw.JERK]
                    if done == 0:
                        out[_FRACTION] = out[_VELOCITY] = out[_ACCEL] = out[_JERK] = 0
                else:
                    out[_WHOLE] = q[k + sw.SEG_WHOLE]
                    out[_FRACTION] = q[k + sw.SEG_FRACTION]
                    out[_VELOCITY] = q[k + sw.SEG_VELOCITY]
                    out[_ACCEL] = q[k + sw.SEG_ACCEL]
                    out[_JERK] = q[k + sw.SEG_JERK]
            if found == TOO_SOON:
                if done < 0:
                    return TOO_SOON
                found = done
            elif done - found:
                found = UNEVEN
        bits >>= 1
        if bits:
            a = m[sw.NEXT]
            m = ptr32(a)
    return found


@micropython.viper
def start_cubic(cubic: ptr32, work: ptr32):
    """Set a cubic to the state at which cut() has cut."""
    whole = work[_WHOLE]
    rem = work[_FRACTION]
    v = work[_VELOCITY]
    a = work[_ACCEL]
    j = work[_JERK]
    n = work[_TICKS]
    steps = 0
    while n:
        n -= 1
        rem = rem + v
        v = v + (a >> 5)
        a = a + j
        steps = steps + (rem >> 22)
        rem = rem - ((rem >> 22) << 22)
    steps = steps + (rem >> 22)
    rem = rem - ((rem >> 22) << 22)
    low = -0x40000000
    if whole < 0 and steps < 0 and whole - (low + low) + steps < 0:
        steps = low + low - whole  # rounding took it just past the end of the range
        rem = 0
    cubic[segments.WHOLE] = whole + steps
    cubic[segments.P] = rem >> 6
    cubic[segments.P + 1] = (rem & 63) << 24
    a = a - j  # the kernel has it for the next tick already
    # the kernel's velocity is the displacement of a tick, half the acceleration more
    v = v - (a >> 6)
    cubic[segments.G1] = v >> 6
    cubic[segments.G1 + 1] = (v & 63) << 24
    cubic[segments.G2] = a >> 12
    cubic[segments.G2 + 1] = (a & 0xFFF) << 18
    cubic[segments.G3] = 0
    cubic[segments.G3 + 1] = 0


@micropython.viper
def cut_at(m: ptr32, bits: int, tick: int, least: int) -> int:
    """Drop the segments from the one that begins with this tick on: of all these motors, or none.

    Return whether they were dropped: each motor must have such a segment, and the tick must be at
    least `least` ticks ahead. dropped() then finds where they began. To be called with interrupts
    off. m: the header.
    """
    ticks = elapsed(tick, m[sw.TICKS])
    if ticks < least or ticks >= HALF:
        return 0
    first = m[sw.FIRST]
    put = 0
    while put < 2:
        todo = bits
        a = first
        while todo:
            m = ptr32(a)
            a = m[sw.NEXT]
            if todo & 1:
                n = ticks - m[sw.LEFT]
                head = m[sw.READ_INDEX]
                q = ptr32(m[sw.QUEUE])
                while n > 0 and head != m[sw.WRITE_INDEX]:
                    n -= q[(head & (sw.SEGMENTS - 1)) << 3]
                    head = (head + 1) & WIDE_WRAP
                if n or head == m[sw.WRITE_INDEX] or m[sw.MODE] & (sw.RUN | sw.STOP) != sw.RUN:
                    return 0
                if put:
                    m[sw.WRITE_INDEX] = head
                    head = (head & (sw.SEGMENTS - 1)) << 3
                    w = ptr32(m[sw.WORK])
                    w[_STEP] = q[head + sw.SEG_WHOLE]
                    w[_PART] = q[head + sw.SEG_FRACTION] >> 6
            todo >>= 1
        put += 1
    return 1


@micropython.viper
def dropped(work: ptr32, at: ptr32):
    """at = where the first segment that cut_at() has dropped began, in AT_ words."""
    at[sw.AT_STEP] = work[_STEP]
    at[sw.AT_PART] = work[_PART]


@micropython.viper
def boundary(m: ptr32, bits: int, least: int) -> int:
    """Return in how many ticks, `least` or more, the first motor of these bits begins a segment
    that follows a phase, not a bridge, and is not the last one queued; 0 if there is none.

    m: the block of the motor of bit 0.
    """
    while bits & 1 == 0:
        bits >>= 1
        a = m[sw.NEXT]
        m = ptr32(a)
    head = m[sw.READ_INDEX]
    ticks = m[sw.LEFT]
    while head != m[sw.READ_INDEX]:  # a tick has just taken a segment
        head = m[sw.READ_INDEX]
        ticks = m[sw.LEFT]
    q = ptr32(m[sw.QUEUE])
    last = (m[sw.WRITE_INDEX] - 1) & WIDE_WRAP
    while (last - head) & WIDE_WRAP < sw.SEGMENTS and head != last:
        k = (head & (sw.SEGMENTS - 1)) << 3
        if ticks >= least and q[k + sw.SEG_BRIDGE] == 0:
            return ticks
        ticks += q[k]
        head = (head + 1) & WIDE_WRAP
    return 0


@micropython.viper
def slow(m: ptr32, bits: int, tick: int, longest: int, finest: int) -> int:
    """Find how these motors can slow down at once and together, until the segments that begin with
    this tick, where a new plan can take over from cut_at().

    Each motor gets one cubic to where it would be at that tick, `more` later, and to its velocity
    there times 1 - 2·more/n, with n ticks in all. That is what the motors do if time passes ever
    more slowly for them: their paths, and so the line that they follow together, stay the same.
    The cubic ends with a tick: if `more` is not whole ticks, less than a tick beyond that place.

    Return `more` in 1/256 tick, a multiple of `finest`, as large as their accelerations (BRAKE)
    allow, and a stop in `longest` ticks; 0 if one of them is too steep for that already, or has no
    such segment. take_slow() puts it into force. m: the header.
    """
    ticks = elapsed(tick, m[sw.TICKS])
    if ticks > _FARTHEST:
        return 0
    first = m[sw.FIRST]
    todo = bits
    a = first
    while todo:
        m = ptr32(a)
        a = m[sw.NEXT]
        if todo & 1:
            n = ticks - m[sw.LEFT]
            head = m[sw.READ_INDEX]
            q = ptr32(m[sw.QUEUE])
            while n > 0 and head != m[sw.WRITE_INDEX]:
                n -= q[(head & (sw.SEGMENTS - 1)) << 3]
                head = (head + 1) & WIDE_WRAP
            if n or head == m[sw.WRITE_INDEX] or m[sw.MODE] != sw.RUN:
                return 0
            w = ptr32(m[sw.WORK])
            w[_HEAD] = head
            v = m[sw.VELOCITY]
            if v < 0:
                v = 0 - v
            v = v // m[sw.BRAKE]
            if v > longest:
                longest = v
        todo >>= 1
    if longest > _LONGEST_STOP:
        return 0
    longest += (longest >> 3) + 1  # the rest is for the curves of the paths
    # Time that slows down from full speed at a constant rate, to come to rest after `longest`
    # ticks, has lost `more` ticks after n if n² = 2·more·longest.
    n = ticks
    more = 0
    todo = 6
    while todo:
        more = (n * n << 7) // longest
        if 3 * more > ticks << 8:
            more = (ticks << 8) // 3
        n = ticks + (more + 255 >> 8)
        todo -= 1
    more &= 0 - finest
    while more:
        late = more + 255 >> 8
        beyond = (late << 8) - more
        n = ticks + late
        fits = 1
        todo = bits
        a = first
        while todo and fits:
            m = ptr32(a)
            a = m[sw.NEXT]
            if todo & 1:
                w = ptr32(m[sw.WORK])
                q = ptr32(m[sw.QUEUE])
                k = (w[_HEAD] & (sw.SEGMENTS - 1)) << 3
                # In Q22 per tick: the mean velocity u, how much more that is than the present
                # velocity, and how much more the last one is.
                d = q[k + sw.SEG_WHOLE] - m[sw.POSITION]
                u = d // n
                d = ((d - u * n) << 22) + q[k + sw.SEG_FRACTION] - m[sw.FRACTION]
                d += (q[k + sw.SEG_VELOCITY] >> 8) * beyond
                u = (u << 22) + d // n
                rise = u - m[sw.VELOCITY] + (m[sw.ACCEL] >> 6) - m[sw.JERK] // 96
                v = q[k + sw.SEG_VELOCITY] - (q[k + sw.SEG_ACCEL] >> 6) + q[k + sw.SEG_JERK] // 96
                d = v // n
                v = v - 2 * late * d - 2 * late * (v - d * n) // n - u
                v += (d >> 4) * beyond >> 3
                if (rise + _GREATEST_CHANGE) >> 29 or (v + _GREATEST_CHANGE) >> 29:
                    return 0
                # The cubic begins with the acceleration 2·(2·rise - v)/n, ends with 2·(2·v -
                # rise)/n, and has the jerk 6·(v - rise)/n².
                limit = (m[sw.BRAKE] >> 1) + 1
                d = rise + rise - v
                g = d // n
                e = (v + v - rise) // n
                if g > limit or g + limit < 0 or e > limit or e + limit < 0:
                    fits = 0
                else:
                    rest = d - g * n
                    e = v - rise
                    d = e // n
                    jerk = (192 * d + (192 * (e - d * n) + (n >> 1)) // n + (n >> 1)) // n
                    w[_NEW_VELOCITY] = u - rise + g + jerk // 192
                    # The kernel rounds the acceleration down from Q27 to Q22: add half a unit.
                    w[_NEW_ACCEL] = (g << 6) + (rest << 6) // n + jerk + 16
                    w[_NEW_JERK] = jerk
                    if w[_MIRRORED]:
                        todo &= -3  # its partner does the same
            todo >>= 1
        if fits:
            return more
        more = (more >> 2) & (0 - finest)
    return 0


@micropython.viper
def take_slow(m: ptr32, bits: int, ticks: int):
    """Let these motors go on as slow() has found, for `ticks` from now to their new plan.

    To be called with interrupts off, in the tick of slow() and after cut_at(). m: the header.
    """
    a = m[sw.FIRST]
    mirrored = 0
    v = 0
    acc = 0
    jerk = 0
    while bits:
        m = ptr32(a)
        a = m[sw.NEXT]
        if bits & 1:
            w = ptr32(m[sw.WORK])
            if mirrored:
                if mirrored - 1:
                    # as segments.mirror() has it
                    v = 0 - v
                    acc = 31 - acc
                    jerk = 0 - jerk
                mirrored = 0
            else:
                v = w[_NEW_VELOCITY]
                acc = w[_NEW_ACCEL]
                jerk = w[_NEW_JERK]
                mirrored = w[_MIRRORED]
            m[sw.VELOCITY] = v
            m[sw.ACCEL] = acc
            m[sw.JERK] = jerk
            m[sw.LEFT] = ticks
            m[sw.READ_INDEX] = w[_HEAD]
            m[sw.WRITE_INDEX] = w[_HEAD]
            m[sw.SPAN] = m[sw.WHOLE_SPAN]
            m[sw.PLANNED] = m[sw.PLANNED] & (-1 - sw.PLAN_SEGMENTS)  # feed no more of the old plan
        bits >>= 1


@micropython.viper
def ease(hal, m: ptr32, other, base, mirrored: int, jerk: int):
    """Let a motor slow down from the next tick on with this jerk (Q27 steps per tick³), for
    EASY_TICKS or more: a plan takes over from cut() before that.

    A motor that accelerates does so ever less, and then goes on as one at constant velocity: with
    less jerk if it would exceed its deceleration or come to rest. One that slows down already goes
    on as it is. m: the block of the motor; other: of the one coupled to it, if mirrored is 1, or 2
    in the opposite sense; base: see segments.mirror().
    """
    state = ptr32(hal.kernel.state)
    done = 0
    while done == 0:
        tick = state[sw.TICKS]
        v = m[sw.VELOCITY]
        acc = m[sw.ACCEL]
        d = m[sw.JERK]
        way = v
        last = (m[sw.BRAKE] << 5) // EASY_TICKS
        if m[sw.MODE] != sw.RUN or m[sw.BRAKE] > _STEEPEST_EASE:
            return
        if last > jerk:
            last = jerk
        if v < 0:
            way = 0 - v
            acc = 31 - acc
            d = 0 - d
        acc -= d  # the kernel has the jerk in it for the next tick already
        if acc < 0:
            return
        first = 0
        ticks = 0  # in which it accelerates ever less
        if acc >> 5:
            # not less jerk than in its plan: it would exceed its highest velocity
            n = 0 - d
            if n < jerk:
                n = jerk
            ticks = (acc + n - 1) // n
            first = acc // ticks
            if ticks < EASY_TICKS:
                way += (acc >> 5) * ticks >> 1
        # A plan can take its deceleration back before it rests.
        way = way // (EASY_TICKS * EASY_TICKS) << 5
        if last > way:
            last = way
        if ticks == 0:
            first = last
        if first == 0:
            return
        if v > 0:
            first = 0 - first
            last = 0 - last
        acc = m[sw.ACCEL]
        d = first - m[sw.JERK]
        v += d // 192
        acc += d
        at = m[sw.POSITION]
        rem = m[sw.FRACTION]
        then = v
        slope = acc
        if ticks < EASY_TICKS:
            # as the kernel does it
            n = ticks
            while n:
                n -= 1
                rem += then
                then += slope >> 5
                slope += first
                at += rem >> 22
                rem -= (rem >> 22) << 22
            d = last - first
        irq = hal.irq_off()
        if state[sw.TICKS] == tick:
            done = 1
            head = m[sw.WRITE_INDEX]
            m[sw.VELOCITY] = v
            m[sw.ACCEL] = acc
            m[sw.JERK] = first
            m[sw.LEFT] = ticks
            m[sw.SPAN] = m[sw.WHOLE_SPAN]
            m[sw.READ_INDEX] = head
            m[sw.PLANNED] = m[sw.PLANNED] & (-1 - sw.PLAN_SEGMENTS)  # no more of the old plan
            if ticks == 0 or ticks >= EASY_TICKS:
                m[sw.LEFT] = EASY_TICKS
            else:
                q = ptr32(m[sw.QUEUE])
                k = (head & (sw.SEGMENTS - 1)) << 3
                q[k + sw.SEG_TICKS] = EASY_TICKS
                q[k + sw.SEG_WHOLE] = at
                q[k + sw.SEG_FRACTION] = rem
                q[k + sw.SEG_VELOCITY] = then + d // 192
                q[k + sw.SEG_ACCEL] = slope + d
                q[k + sw.SEG_JERK] = last
                q[k + sw.SEG_BRIDGE] = 0
                q[k + sw.SEG_SPAN] = m[sw.WHOLE_SPAN]
                m[sw.WRITE_INDEX] = (head + 1) & WIDE_WRAP
            if mirrored:
                b = ptr32(other)
                b[sw.READ_INDEX] = b[sw.WRITE_INDEX]
                if m[sw.WRITE_INDEX] != head:
                    mirror(m, other, base, mirrored - 1)
                if mirrored - 1:
                    # as mirror() has it
                    v = 0 - v
                    acc = 31 - acc
                    first = 0 - first
                b[sw.VELOCITY] = v
                b[sw.ACCEL] = acc
                b[sw.JERK] = first
                b[sw.LEFT] = m[sw.LEFT]
                b[sw.SPAN] = b[sw.WHOLE_SPAN]
                b[sw.PLANNED] = b[sw.PLANNED] & (-1 - sw.PLAN_SEGMENTS)
        hal.irq_on(irq)
