"""The tick: the whole interrupt handler on the board, one viper function over the blocks of
stepper.py.

A module of its own because a frozen image runs it from RAM (see boot.py): from flash it takes twice
as long as soon as the main loop has pushed it out of the flash cache.
"""

from array import array

from framestep.base.clock import HALF, WIDE_HALF, WIDE_WRAP, WRAP, after, elapsed
from framestep.base.native import const, micropython, ptr32
from framestep.pulse.engine import (
    COMMAND_CYCLES,
    COMMANDS,
    DIRECTION,
    GAP,
    LONGEST_WAIT,
    PULSES,
    RING,
    WAIT_CYCLES,
)
from framestep.pulse.stepper import (
    ACCEL,
    AHEAD,
    BEHIND,
    BRAKE,
    CARRY,
    CLOCK,
    CUE_LOWERED,
    CUE_RAISED,
    CUE_READ_INDEX,
    CUE_SLOTS,
    CUE_TICK,
    CUE_WRITE_INDEX,
    CUES,
    CYCLES,
    CYCLES_PER_US,
    DECEL,
    DOWN,
    DRAIN,
    DUE,
    FAULT,
    FAULT_DRY,
    FAULT_LATE,
    FAULT_PIN,
    FAULTS,
    FIFO,
    FIRST,
    FIXED,
    FRACTION,
    IDLE,
    IDLE_AT,
    INVERT,
    JERK,
    LATEST,
    LEAD,
    LEFT,
    MODE,
    NEXT,
    ONE,
    OUT_CLEAR,
    OUT_SET,
    PLAN_TIMED,
    PLANNED,
    POSITION,
    QUEUE,
    READ_INDEX,
    RESERVE,
    RUN,
    RUNNING,
    SEG_ACCEL,
    SEG_FRACTION,
    SEG_JERK,
    SEG_SPAN,
    SEG_VELOCITY,
    SEG_WHOLE,
    SEGMENTS,
    SETUP,
    SHORTEST,
    SPAN,
    SQUARE,
    START,
    STOP,
    TICK_US,
    TICKS,
    VELOCITY,
    WAIT,
    WORD,
    WORST_LATE,
    WRITE_INDEX,
)

_HAIR = const(128)  # Q22: a step is made so much early, lest rounding put it into the next tick
_EARLY_US = const(50)  # before its time that a call is taken for the next tick, not for a replay
_BACK_US = const(24)  # that far twice is not _EARLY_US: a late call and the replay of one
_PULSE_BITS = const(GAP - PULSES)


class Header(array):
    """The header words, with the tick function as a method: the timer's callback gets the words
    as its first argument, and no attribute need be looked up in the interrupt."""

    # What the compiler makes of this: the first two variables live in registers, the others on
    # the stack; a comparison costs about 12 cycles where a test for zero costs 5. Hence the shape.
    @micropython.viper
    def tick(m: ptr32, _timer):
        h = m
        clock = ptr32(m[CLOCK])
        now = clock[0]
        # After a hole in time the timer replays what it missed; only the clock tells what is due.
        late = (now - m[DUE]) & WIDE_WRAP
        if late > m[WORST_LATE]:
            if late >= WIDE_HALF:
                if (late + _EARLY_US) & WIDE_WRAP >= WIDE_HALF:
                    if m[RUNNING]:
                        return
                    if (late + 2 * TICK_US) & WIDE_WRAP < WIDE_HALF:
                        return
                late = 0  # a call before came late: this is the grid that the timer keeps
                m[DUE] = now & WIDE_WRAP
            elif m[RUNNING]:
                m[WORST_LATE] = late
        if late >= m[LATEST] - TICK_US:
            # From LATEST on all engines have run dry and are at rest. A stop with BRAKE began where
            # the pulses ended; the ramp goes on as if it had gone on during the hole. The time lost
            # is not made up for. Before LATEST, only engines whose last pulse came early in its
            # tick have run dry: START has each of them looked at below.
            missed = 0
            if late >= m[LATEST]:
                missed = (late - m[LATEST]) // TICK_US + 1 + m[LEAD]
                late = late % TICK_US  # the ticks missed are left out, the grid stays
                m[DUE] = (now - late) & WIDE_WRAP
            a = m[FIRST]
            while a:
                m = ptr32(a)
                a = m[NEXT]
                if missed == 0:
                    if m[MODE] & START:
                        pass
                    elif m[MODE] & (RUN | STOP):
                        m[IDLE_AT] = h[TICKS]
                        m[MODE] = m[MODE] | START
                    continue
                m[IDLE_AT] = (h[TICKS] - 1000) & WRAP
                if m[MODE] & START:
                    m[MODE] = RUN | START  # has yet to begin
                elif m[MODE] & (RUN | STOP):
                    m[FAULT] = m[FAULT] | FAULT_LATE
                    h[FAULTS] = h[FAULTS] | FAULT_LATE
                    if m[DECEL] < m[BRAKE] or m[MODE] & RUN:
                        m[DECEL] = m[BRAKE]
                    d = m[VELOCITY]
                    s = d >> 31
                    d = (d ^ s) - s
                    # by quotients, since DECEL * missed may not fit 32 bits
                    if d // m[DECEL] < missed:
                        d = 0
                    else:
                        d = d - m[DECEL] * missed
                    m[VELOCITY] = (d ^ s) - s
                    # The pulses of the first tick are spread from its start on. With a part of a
                    # step made already they would be too fast; a stop has no need of it.
                    m[FRACTION] = 0
                    m[READ_INDEX] = m[WRITE_INDEX]
                    m[LEFT] = 0
                    m[MODE] = RUN | STOP | START  # the engine first, then a stop
                else:
                    m[MODE] = IDLE
            m = h
        if m[RUNNING]:
            m[RUNNING] = m[RUNNING] - 1
        else:
            # Back to the timer's grid, if a hole has moved it. After a call that came late by
            # itself the next ones are not to be early for that.
            late = late >> 4
            if late > _BACK_US:
                late = _BACK_US
            m[DUE] = m[DUE] + late
        m[DUE] = (m[DUE] + TICK_US) & WIDE_WRAP
        m[TICKS] = after(m[TICKS], 1)
        a = m[CUE_WRITE_INDEX] - m[CUE_READ_INDEX]
        while a:
            q = ptr32(m[CUES])
            k = (m[CUE_READ_INDEX] & (CUE_SLOTS - 1)) << 2
            if elapsed(m[TICKS], q[k + CUE_TICK]) > HALF:
                break
            fifo = ptr32(m[OUT_SET])
            if RING:
                fifo[0] = (fifo[0] | q[k + CUE_RAISED] | q[k + CUE_LOWERED]) ^ q[k + CUE_LOWERED]
            else:
                fifo[0] = q[k + CUE_RAISED]
                fifo = ptr32(m[OUT_CLEAR])
                fifo[0] = q[k + CUE_LOWERED]
            m[CUE_READ_INDEX] = (m[CUE_READ_INDEX] + 1) & WRAP
            a = m[CUE_WRITE_INDEX] - m[CUE_READ_INDEX]
        cycles = m[CYCLES]
        a = m[FIRST]
        while a:
            m = ptr32(a)
            a = m[NEXT]
            if m[MODE]:
                h[RUNNING] = 4
                alone = 0  # the first pulse gets a command by itself
                if m[MODE] & START:
                    m[MODE] = m[MODE] & (RUN | STOP)
                    clock = ptr32(h[CLOCK])
                    passed = (clock[0] - h[DUE] + TICK_US) & WIDE_WRAP
                    wait = h[AHEAD] - passed * h[CYCLES_PER_US]
                    idle = elapsed(h[TICKS] - 1, m[IDLE_AT])
                    if idle < h[LEAD] and m[CARRY] + idle * cycles - (m[SHORTEST] >> 1) < wait:
                        # the engine has not run dry since
                        m[CARRY] = m[CARRY] + idle * cycles
                    else:
                        # Make the engine wait so that this tick's output begins AHEAD of the tick's
                        # own time, however late within it this line is reached.
                        fifo = ptr32(m[FIFO])
                        word = m[WORD]
                        wait = wait - m[RESERVE] + m[FIXED] - COMMAND_CYCLES
                        while wait > LONGEST_WAIT:
                            if RING:
                                k = fifo[COMMANDS]
                                fifo[COMMANDS] = (k + 1) & WIDE_WRAP
                                fifo[k & (COMMANDS - 1)] = word + (
                                    (LONGEST_WAIT - WAIT_CYCLES) << GAP
                                )
                            else:
                                fifo[0] = word + ((LONGEST_WAIT - WAIT_CYCLES) << GAP)
                            wait = wait - LONGEST_WAIT
                        if wait > WAIT_CYCLES:
                            if RING:
                                k = fifo[COMMANDS]
                                fifo[COMMANDS] = (k + 1) & WIDE_WRAP
                                fifo[k & (COMMANDS - 1)] = word + ((wait - WAIT_CYCLES) << GAP)
                            else:
                                fifo[0] = word + ((wait - WAIT_CYCLES) << GAP)
                        m[CARRY] = m[RESERVE]
                        if idle == 0:
                            alone = 1
                if m[MODE] & RUN:
                    if m[LEFT]:
                        pass
                    else:
                        head = m[READ_INDEX]
                        if head - m[WRITE_INDEX]:
                            q = ptr32(m[QUEUE])
                            k = (head & (SEGMENTS - 1)) << 3
                            m[READ_INDEX] = (head + 1) & WIDE_WRAP
                            gap = q[k + SEG_WHOLE] - m[POSITION]
                            d = (gap << 22) + q[k + SEG_FRACTION]
                            # within two steps, so that the second line cannot overflow, and by an
                            # eighth, but for a motion that has turned within the last tick
                            if (gap + 2) >> 2 or (
                                (d - m[FRACTION] + ONE // 8) >> 20 and m[SPAN] - cycles == 0
                            ):
                                m[FAULT] = m[FAULT] | FAULT_PIN
                                h[FAULTS] = h[FAULTS] | FAULT_PIN
                                m[ACCEL] = 0
                                m[JERK] = 0
                                m[DECEL] = m[BRAKE]
                                m[SPAN] = cycles
                                m[MODE] = STOP
                                m[LEFT] = 1
                            else:
                                m[FRACTION] = d
                                m[LEFT] = q[k]
                                m[VELOCITY] = q[k + SEG_VELOCITY]
                                m[ACCEL] = q[k + SEG_ACCEL]
                                m[JERK] = q[k + SEG_JERK]
                                m[SPAN] = q[k + SEG_SPAN]
                        else:
                            # The end, or with a velocity left or more to come a queue that was not
                            # filled in time
                            if m[MODE] & STOP:
                                pass
                            elif m[VELOCITY] | (m[PLANNED] & PLAN_TIMED):
                                m[FAULT] = m[FAULT] | FAULT_DRY
                                h[FAULTS] = h[FAULTS] | FAULT_DRY
                                m[DECEL] = m[BRAKE]
                            m[ACCEL] = 0
                            m[JERK] = 0
                            m[SPAN] = cycles
                            m[MODE] = STOP
                            m[LEFT] = 1
                    m[LEFT] = m[LEFT] - 1
                    d = m[VELOCITY]
                    acc = m[ACCEL]
                    m[ACCEL] = acc + m[JERK]
                    acc = acc >> 5
                    m[VELOCITY] = d + acc
                else:
                    # A stop needs no target: the steps made so far are where the motor stands.
                    m[IDLE_AT] = h[TICKS]
                    d = m[VELOCITY]
                    acc = m[DECEL]
                    if d > acc:
                        acc = 0 - acc
                    elif d + acc >= 0:
                        acc = 0 - d
                    d = d + acc
                    m[VELOCITY] = d
                    if d:
                        pass
                    elif m[MODE] & STOP:
                        m[FRACTION] = 0
                        m[ACCEL] = 0
                        m[JERK] = 0
                        m[READ_INDEX] = m[WRITE_INDEX]
                        m[LEFT] = 0
                        m[WAIT] = h[BEHIND]
                        m[MODE] = DRAIN
                    else:
                        m[WAIT] = m[WAIT] - 1
                        if m[WAIT] == 0:
                            m[MODE] = IDLE
                # Steps that fall into this tick. All that follows looks along the motion.
                rem = m[FRACTION] + d
                s = rem >> 31
                if s:
                    rem = 0 - rem
                    d = 0 - d
                    acc = 0 - acc
                n = (rem + _HAIR) >> 22
                if n:
                    rem = rem - (n << 22)
                    least = m[SHORTEST]
                    if s:
                        m[FRACTION] = 0 - rem
                        m[POSITION] = m[POSITION] - n
                        if m[DOWN]:
                            pass
                        else:
                            m[DOWN] = s
                            m[WORD] = (m[WORD] & ~DIRECTION) + m[INVERT]
                            least = m[SETUP]
                    else:
                        m[FRACTION] = rem
                        m[POSITION] = m[POSITION] + n
                        if m[DOWN]:
                            m[DOWN] = 0
                            m[WORD] = (m[WORD] | DIRECTION) - m[INVERT]
                            least = m[SETUP]
                    fifo = ptr32(m[FIFO])
                    carry = m[CARRY] - COMMAND_CYCLES
                    bent = 0
                    back = 0  # whole steps from the pulse looked at to the last one of the tick
                    if acc:
                        if (acc ^ (acc >> 31)) > (d - ONE // 2) >> 7:
                            bent = 1
                    # e: cycles from the start of the tick to the last crossing, were the velocity
                    # constant. bent: acceleration over velocity, Q10.
                    if n - 1:
                        step = (m[SPAN] << 14) // (d >> 8)  # cycles per step
                        e = m[SPAN] - ((rem >> 8) * step >> 14)
                        if bent:
                            bent = ((acc >> 12) * step >> 13) * h[SQUARE] >> 12
                            if (n - 2) >> 3:
                                pass
                            else:
                                back = n - (n >> 1)  # more commands follow the curve more closely
                                extra = 0
                                if n - 3:
                                    pass
                                elif carry > 0:
                                    extra = 1
                        if alone:
                            back = n - 1
                            extra = 0
                        elif n - 2:
                            pass
                        elif m[CARRY] - m[RESERVE]:
                            pass
                        else:
                            # no pulse in the tick before: the first is not as far from that as
                            # the second is from the first
                            back = 1
                            extra = 0
                    else:
                        if d < 64:
                            # a step owed from before, at rest or turning round
                            if rem >= d:
                                rem = 64
                            d = 64
                        if d >> 20:
                            e = (rem >> 8) * m[SPAN] // ((d + 128) >> 8)
                        elif rem >= d:
                            e = m[SPAN]
                        elif d >> 18:
                            e = (rem >> 6) * m[SPAN] // ((d + 32) >> 6)
                        elif d >> 16:
                            e = (rem >> 4) * m[SPAN] // ((d + 8) >> 4)
                        elif d >> 14:
                            e = (rem >> 2) * m[SPAN] // ((d + 2) >> 2)
                        elif rem >> 31:
                            e = 0
                        else:
                            e = rem * m[SPAN] // d
                        e = m[SPAN] - e
                        if bent:
                            bent = (acc << 5) // (d >> 5)
                            if (bent + 128) >> 8:
                                # Far from constant, next to a start, a turn or a rest. Exactly,
                                # with b = a/2d: b·x² + (1 - b)·x = x0; x0 in Q17, 1 - b and the
                                # root in Q13.
                                if bent > 4096:
                                    bent = 4096
                                elif bent < -4096:
                                    bent = -4096
                                if m[SPAN] - cycles:
                                    bent = -2048  # at rest when the span ends
                                x = (e << 14) // m[SPAN]
                                x = (x << 3) + (((e << 14) - x * m[SPAN]) << 3) // m[SPAN]
                                k = 8192 - (bent << 2)
                                x = k * k + bent * x
                                root = 0
                                bit = 1 << 28
                                while bit:
                                    if x >= root + bit:
                                        x = x - root - bit
                                        root = root + bit + bit
                                    root = root >> 1
                                    bit = bit >> 2
                                if k > 0:
                                    e = (e << 14) // (k + root)
                                else:
                                    e = ((root - k) >> 1) * (m[SPAN] >> 2) // bent
                                bent = 0
                    while True:
                        pulses = n
                        x = e
                        if back:
                            pulses = n - back
                            x = e - back * step
                        if bent:
                            # p(x) = d·x - a·x·(1 - x)/2 in a tick: x is reached a·x·(1 - x)/2d
                            # later
                            x = (
                                ((((m[SPAN] - x) >> 3) * (x >> 3) >> 13) * h[SQUARE] >> 6) * bent
                                >> 11
                            ) + x
                        x = x + carry  # cycles that the pulses have got
                        if pulses >> 6:
                            # One command would drift by up to half a cycle a pulse. Two make a bow
                            # instead; of its height about half is taken off.
                            period = x // pulses
                            if period < least:
                                period = least
                            else:
                                rest = (0 - period) * pulses + x
                                if pulses >> 7:
                                    if rest + rest > pulses:
                                        rest = rest + ((pulses - rest) >> 2)
                                        if rest >= pulses:
                                            rest = rest - pulses
                                            period += 1
                                    else:
                                        rest = rest + (rest >> 2)
                                if rest:
                                    pulses = pulses - rest
                                    if RING:
                                        k = fifo[COMMANDS]
                                        fifo[COMMANDS] = (k + 1) & WIDE_WRAP
                                        d = (
                                            ((period - m[FIXED]) << _PULSE_BITS) + pulses
                                        ) << PULSES
                                        fifo[k & (COMMANDS - 1)] = d + m[WORD]
                                    else:
                                        fifo[0] = (
                                            (((period - m[FIXED]) << _PULSE_BITS) + pulses)
                                            << PULSES
                                        ) + m[WORD]
                                    carry = (0 - period) * pulses + carry - COMMAND_CYCLES
                                    pulses = rest
                                    period += 1
                        else:
                            period = x
                            if pulses - 1:
                                period = ((pulses >> 1) + x) // pulses
                            if period < least:
                                period = least
                        if RING:
                            k = fifo[COMMANDS]
                            fifo[COMMANDS] = (k + 1) & WIDE_WRAP
                            d = (((period - m[FIXED]) << _PULSE_BITS) + pulses) << PULSES
                            fifo[k & (COMMANDS - 1)] = d + m[WORD]
                        else:
                            fifo[0] = (
                                (((period - m[FIXED]) << _PULSE_BITS) + pulses) << PULSES
                            ) + m[WORD]
                        if back:
                            carry = (0 - period) * pulses + carry - COMMAND_CYCLES
                            n = back
                            back = extra
                            extra = 0
                            least = m[SHORTEST]
                        else:
                            m[CARRY] = (0 - period) * pulses + carry + cycles
                            break
                else:
                    if s:
                        rem = 0 - rem
                    m[FRACTION] = rem
                    m[CARRY] = m[CARRY] + cycles
                    d = m[CARRY] - m[RESERVE]
                    if d > WAIT_CYCLES:
                        fifo = ptr32(m[FIFO])
                        if RING:
                            k = fifo[COMMANDS]
                            fifo[COMMANDS] = (k + 1) & WIDE_WRAP
                            fifo[k & (COMMANDS - 1)] = m[WORD] + ((d - WAIT_CYCLES) << GAP)
                        else:
                            fifo[0] = m[WORD] + ((d - WAIT_CYCLES) << GAP)
                        m[CARRY] = m[RESERVE]
