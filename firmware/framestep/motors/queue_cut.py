"""Cutting queues off some ticks from now, so that a new plan can take over there.

Only the main loop puts segments into a queue, and only the tick takes them out. So interrupts are
off only while a cut is made, some microseconds for all motors. The state at the cut is computed
afterwards.
"""

from framestep.base.clock import HALF, WIDE_WRAP, elapsed
from framestep.base.native import const, micropython, ptr32
from framestep.motion import segments
from framestep.motors.feeder import CUT
from framestep.pulse import stepper as sw

# Words of a motor's `work`, from CUT on: a state before the cut
_WHOLE = const(CUT)  # steps
_FRACTION = const(CUT + 1)  # Q22
_VELOCITY = const(CUT + 2)  # Q22
_ACCEL = const(CUT + 3)  # Q27
_JERK = const(CUT + 4)  # Q27
_TICKS = const(CUT + 5)  # from that state to the cut

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
    while n:
        n -= 1
        rem = rem + v
        v = v + (a >> 5)
        a = a + j
        whole = whole + (rem >> 22)
        rem = rem - ((rem >> 22) << 22)
    cubic[segments.WHOLE] = whole + (rem >> 22)
    rem = rem - ((rem >> 22) << 22)
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
            todo >>= 1
        put += 1
    return 1


@micropython.viper
def dropped(m: ptr32, at: ptr32):
    """at = where the first segment that cut_at() has dropped began, in AT_ words. m: the block."""
    q = ptr32(m[sw.QUEUE])
    k = (m[sw.WRITE_INDEX] & (sw.SEGMENTS - 1)) << 3
    at[sw.AT_STEP] = q[k + sw.SEG_WHOLE]
    at[sw.AT_PART] = q[k + sw.SEG_FRACTION] >> 6
