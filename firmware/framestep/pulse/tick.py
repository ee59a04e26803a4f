"""The tick: the whole interrupt handler on the board, one viper function over the blocks of
stepper.py.

A module of its own because a frozen image runs it from RAM (see boot.py): from flash it takes twice
as long as soon as the main loop has pushed it out of the flash cache.
"""

from array import array

from framestep.base.clock import HALF, WIDE_HALF, WIDE_WRAP, WRAP, after, elapsed
from framestep.base.native import const, micropython, ptr32
from framestep.pulse import engine
from framestep.pulse import stepper as sw

_HAIR = const(128)  # Q22: a step is made so much early, lest rounding put it into the next tick
_EARLY_US = const(50)  # before its time that a call is taken for the next tick, not for a replay
_BACK_US = const(24)  # that far twice is not _EARLY_US: a late call and the replay of one
_PULSE_BITS = const(engine.GAP - engine.PULSES)


class Header(array):
    """The header words, with the tick function as a method: the timer's callback gets the words
    as its first argument, and no attribute need be looked up in the interrupt."""

    # What the compiler makes of this: the first two variables live in registers, the others on
    # the stack; a comparison costs about 12 cycles where a test for zero costs 5. Hence the shape.
    @micropython.viper
    def tick(m: ptr32, _timer):
        h = m
        clock = ptr32(m[sw.CLOCK])
        now = clock[0]
        # After a hole in time the timer replays what it missed; only the clock tells what is due.
        late = (now - m[sw.DUE]) & WIDE_WRAP
        if late > m[sw.WORST_LATE]:
            if late >= WIDE_HALF:
                if (late + _EARLY_US) & WIDE_WRAP >= WIDE_HALF:
                    if m[sw.RUNNING]:
                        return
                    if (late + 2 * sw.TICK_US) & WIDE_WRAP < WIDE_HALF:
                        return
                late = 0  # a call before came late: this is the grid that the timer keeps
                m[sw.DUE] = now & WIDE_WRAP
            elif m[sw.RUNNING]:
                m[sw.WORST_LATE] = late
        if late >= m[sw.LATEST] - sw.TICK_US:
            # From LATEST on all engines have run dry and are at rest. A stop with BRAKE began where
            # the pulses ended; the ramp goes on as if it had gone on during the hole. The time lost
            # is not made up for. Before LATEST, only engines whose last pulse came early in its
            # tick have run dry: START has each of them looked at below.
            missed = 0
            if late >= m[sw.LATEST]:
                missed = (late - m[sw.LATEST]) // sw.TICK_US + 1 + m[sw.LEAD]
                late = late % sw.TICK_US  # the ticks missed are left out, the grid stays
                m[sw.DUE] = (now - late) & WIDE_WRAP
            a = m[sw.FIRST]
            while a:
                m = ptr32(a)
                a = m[sw.NEXT]
                if missed == 0:
                    if m[sw.MODE] & sw.START:
                        pass
                    elif m[sw.MODE] & (sw.RUN | sw.STOP):
                        m[sw.IDLE_AT] = h[sw.TICKS]
                        m[sw.MODE] = m[sw.MODE] | sw.START
                    continue
                m[sw.IDLE_AT] = (h[sw.TICKS] - 1000) & WRAP
                if m[sw.MODE] & sw.START:
                    m[sw.MODE] = sw.RUN | sw.START  # has yet to begin
                elif m[sw.MODE] & (sw.RUN | sw.STOP):
                    m[sw.FAULT] = m[sw.FAULT] | sw.FAULT_LATE
                    h[sw.FAULTS] = h[sw.FAULTS] | sw.FAULT_LATE
                    if m[sw.DECEL] < m[sw.BRAKE] or m[sw.MODE] & sw.RUN:
                        m[sw.DECEL] = m[sw.BRAKE]
                    d = m[sw.VELOCITY]
                    s = d >> 31
                    d = (d ^ s) - s
                    # by quotients, since DECEL * missed may not fit 32 bits
                    if d // m[sw.DECEL] < missed:
                        d = 0
                    else:
                        d = d - m[sw.DECEL] * missed
                    m[sw.VELOCITY] = (d ^ s) - s
                    # The pulses of the first tick are spread from its start on. With a part of a
                    # step made already they would be too fast; a stop has no need of it.
                    m[sw.FRACTION] = 0
                    m[sw.READ_INDEX] = m[sw.WRITE_INDEX]
                    m[sw.LEFT] = 0
                    m[sw.MODE] = sw.RUN | sw.STOP | sw.START  # the engine first, then a stop
                else:
                    m[sw.MODE] = sw.IDLE
            m = h
        if m[sw.RUNNING]:
            m[sw.RUNNING] = m[sw.RUNNING] - 1
        else:
            # Back to the timer's grid, if a hole has moved it. After a call that came late by
            # itself the next ones are not to be early for that.
            late = late >> 4
            if late > _BACK_US:
                late = _BACK_US
            m[sw.DUE] = m[sw.DUE] + late
        m[sw.DUE] = (m[sw.DUE] + sw.TICK_US) & WIDE_WRAP
        m[sw.TICKS] = after(m[sw.TICKS], 1)
        a = m[sw.CUE_WRITE_INDEX] - m[sw.CUE_READ_INDEX]
        while a:
            q = ptr32(m[sw.CUES])
            k = (m[sw.CUE_READ_INDEX] & (sw.CUE_SLOTS - 1)) << 2
            if elapsed(m[sw.TICKS], q[k + sw.CUE_TICK]) > HALF:
                break
            fifo = ptr32(m[sw.OUT_SET])
            if engine.RING:
                fifo[0] = (fifo[0] | q[k + sw.CUE_RAISED] | q[k + sw.CUE_LOWERED]) ^ q[
                    k + sw.CUE_LOWERED
                ]
            else:
                fifo[0] = q[k + sw.CUE_RAISED]
                fifo = ptr32(m[sw.OUT_CLEAR])
                fifo[0] = q[k + sw.CUE_LOWERED]
            m[sw.CUE_READ_INDEX] = (m[sw.CUE_READ_INDEX] + 1) & WRAP
            a = m[sw.CUE_WRITE_INDEX] - m[sw.CUE_READ_INDEX]
        cycles = m[sw.CYCLES]
        a = m[sw.FIRST]
        while a:
            m = ptr32(a)
            a = m[sw.NEXT]
            if m[sw.MODE]:
                h[sw.RUNNING] = 4
                alone = 0  # the first pulse gets a command by itself
                if m[sw.MODE] & sw.START:
                    m[sw.MODE] = m[sw.MODE] & (sw.RUN | sw.STOP)
                    clock = ptr32(h[sw.CLOCK])
                    passed = (clock[0] - h[sw.DUE] + sw.TICK_US) & WIDE_WRAP
                    wait = h[sw.AHEAD] - passed * h[sw.CYCLES_PER_US]
                    idle = elapsed(h[sw.TICKS] - 1, m[sw.IDLE_AT])
                    if (
                        idle < h[sw.LEAD]
                        and m[sw.CARRY] + idle * cycles - (m[sw.SHORTEST] >> 1) < wait
                    ):
                        # the engine has not run dry since
                        m[sw.CARRY] = m[sw.CARRY] + idle * cycles
                    else:
                        # Make the engine wait so that this tick's output begins AHEAD of the tick's
                        # own time, however late within it this line is reached.
                        fifo = ptr32(m[sw.FIFO])
                        word = m[sw.WORD]
                        wait = wait - m[sw.RESERVE] + m[sw.FIXED] - engine.COMMAND_CYCLES
                        while wait > engine.LONGEST_WAIT:
                            if engine.RING:
                                k = fifo[engine.COMMANDS]
                                fifo[engine.COMMANDS] = (k + 1) & WIDE_WRAP
                                fifo[k & (engine.COMMANDS - 1)] = word + (
                                    (engine.LONGEST_WAIT - engine.WAIT_CYCLES) << engine.GAP
                                )
                            else:
                                fifo[0] = word + (
                                    (engine.LONGEST_WAIT - engine.WAIT_CYCLES) << engine.GAP
                                )
                            wait = wait - engine.LONGEST_WAIT
                        if wait > engine.WAIT_CYCLES:
                            if engine.RING:
                                k = fifo[engine.COMMANDS]
                                fifo[engine.COMMANDS] = (k + 1) & WIDE_WRAP
                                fifo[k & (engine.COMMANDS - 1)] = word + (
                                    (wait - engine.WAIT_CYCLES) << engine.GAP
                                )
                            else:
                                fifo[0] = word + ((wait - engine.WAIT_CYCLES) << engine.GAP)
                        m[sw.CARRY] = m[sw.RESERVE]
                        if idle == 0:
                            alone = 1
                if m[sw.MODE] & sw.RUN:
                    if m[sw.LEFT]:
                        pass
                    else:
                        head = m[sw.READ_INDEX]
                        if head - m[sw.WRITE_INDEX]:
                            q = ptr32(m[sw.QUEUE])
                            k = (head & (sw.SEGMENTS - 1)) << 3
                            m[sw.READ_INDEX] = (head + 1) & WIDE_WRAP
                            gap = q[k + sw.SEG_WHOLE] - m[sw.POSITION]
                            d = (gap << 22) + q[k + sw.SEG_FRACTION]
                            # within two steps, so that the second line cannot overflow, and by an
                            # eighth, but for a motion that has turned within the last tick
                            if (gap + 2) >> 2 or (
                                (d - m[sw.FRACTION] + sw.ONE // 8) >> 20
                                and m[sw.SPAN] - cycles == 0
                            ):
                                m[sw.FAULT] = m[sw.FAULT] | sw.FAULT_PIN
                                h[sw.FAULTS] = h[sw.FAULTS] | sw.FAULT_PIN
                                m[sw.ACCEL] = 0
                                m[sw.JERK] = 0
                                m[sw.DECEL] = m[sw.BRAKE]
                                m[sw.SPAN] = cycles
                                m[sw.MODE] = sw.STOP
                                m[sw.LEFT] = 1
                            else:
                                m[sw.FRACTION] = d
                                m[sw.LEFT] = q[k]
                                m[sw.VELOCITY] = q[k + sw.SEG_VELOCITY]
                                m[sw.ACCEL] = q[k + sw.SEG_ACCEL]
                                m[sw.JERK] = q[k + sw.SEG_JERK]
                                m[sw.SPAN] = q[k + sw.SEG_SPAN]
                        else:
                            # The end, or with a velocity left or more to come a queue that was not
                            # filled in time
                            if m[sw.MODE] & sw.STOP:
                                pass
                            elif m[sw.VELOCITY] | (m[sw.PLANNED] & sw.PLAN_TIMED):
                                m[sw.FAULT] = m[sw.FAULT] | sw.FAULT_DRY
                                h[sw.FAULTS] = h[sw.FAULTS] | sw.FAULT_DRY
                                m[sw.DECEL] = m[sw.BRAKE]
                            m[sw.ACCEL] = 0
                            m[sw.JERK] = 0
                            m[sw.SPAN] = cycles
                            m[sw.MODE] = sw.STOP
                            m[sw.LEFT] = 1
                    m[sw.LEFT] = m[sw.LEFT] - 1
                    d = m[sw.VELOCITY]
                    acc = m[sw.ACCEL]
                    m[sw.ACCEL] = acc + m[sw.JERK]
                    acc = acc >> 5
                    m[sw.VELOCITY] = d + acc
                else:
                    # A stop needs no target: the steps made so far are where the motor stands.
                    m[sw.IDLE_AT] = h[sw.TICKS]
                    d = m[sw.VELOCITY]
                    acc = m[sw.DECEL]
                    if d > acc:
                        acc = 0 - acc
                    elif d + acc >= 0:
                        acc = 0 - d
                    d = d + acc
                    m[sw.VELOCITY] = d
                    if d:
                        pass
                    elif m[sw.MODE] & sw.STOP:
                        m[sw.FRACTION] = 0
                        m[sw.ACCEL] = 0
                        m[sw.JERK] = 0
                        m[sw.READ_INDEX] = m[sw.WRITE_INDEX]
                        m[sw.LEFT] = 0
                        m[sw.WAIT] = h[sw.BEHIND]
                        m[sw.MODE] = sw.DRAIN
                    else:
                        m[sw.WAIT] = m[sw.WAIT] - 1
                        if m[sw.WAIT] == 0:
                            m[sw.MODE] = sw.IDLE
                # Steps that fall into this tick. All that follows looks along the motion.
                rem = m[sw.FRACTION] + d
                s = rem >> 31
                if s:
                    rem = 0 - rem
                    d = 0 - d
                    acc = 0 - acc
                n = (rem + _HAIR) >> 22
                if n:
                    rem = rem - (n << 22)
                    least = m[sw.SHORTEST]
                    if s:
                        m[sw.FRACTION] = 0 - rem
                        m[sw.POSITION] = m[sw.POSITION] - n
                        if m[sw.DOWN]:
                            pass
                        else:
                            m[sw.DOWN] = s
                            m[sw.WORD] = (m[sw.WORD] & ~engine.DIRECTION) + m[sw.INVERT]
                            least = m[sw.SETUP]
                    else:
                        m[sw.FRACTION] = rem
                        m[sw.POSITION] = m[sw.POSITION] + n
                        if m[sw.DOWN]:
                            m[sw.DOWN] = 0
                            m[sw.WORD] = (m[sw.WORD] | engine.DIRECTION) - m[sw.INVERT]
                            least = m[sw.SETUP]
                    fifo = ptr32(m[sw.FIFO])
                    carry = m[sw.CARRY] - engine.COMMAND_CYCLES
                    bent = 0
                    back = 0  # whole steps from the pulse looked at to the last one of the tick
                    if acc:
                        if (acc ^ (acc >> 31)) > (d - sw.ONE // 2) >> 7:
                            bent = 1
                    # e: cycles from the start of the tick to the last crossing, were the velocity
                    # constant. bent: acceleration over velocity, Q10.
                    if n - 1:
                        step = (m[sw.SPAN] << 14) // (d >> 8)  # cycles per step
                        e = m[sw.SPAN] - ((rem >> 8) * step >> 14)
                        if bent:
                            bent = ((acc >> 12) * step >> 13) * h[sw.SQUARE] >> 12
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
                        elif m[sw.CARRY] - m[sw.RESERVE]:
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
                            e = (rem >> 8) * m[sw.SPAN] // ((d + 128) >> 8)
                        elif rem >= d:
                            e = m[sw.SPAN]
                        elif d >> 18:
                            e = (rem >> 6) * m[sw.SPAN] // ((d + 32) >> 6)
                        elif d >> 16:
                            e = (rem >> 4) * m[sw.SPAN] // ((d + 8) >> 4)
                        elif d >> 14:
                            e = (rem >> 2) * m[sw.SPAN] // ((d + 2) >> 2)
                        elif rem >> 31:
                            e = 0
                        else:
                            e = rem * m[sw.SPAN] // d
                        e = m[sw.SPAN] - e
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
                                if m[sw.SPAN] - cycles:
                                    bent = -2048  # at rest when the span ends
                                x = (e << 14) // m[sw.SPAN]
                                x = (x << 3) + (((e << 14) - x * m[sw.SPAN]) << 3) // m[sw.SPAN]
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
                                    e = ((root - k) >> 1) * (m[sw.SPAN] >> 2) // bent
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
                                ((((m[sw.SPAN] - x) >> 3) * (x >> 3) >> 13) * h[sw.SQUARE] >> 6)
                                * bent
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
                                    if engine.RING:
                                        k = fifo[engine.COMMANDS]
                                        fifo[engine.COMMANDS] = (k + 1) & WIDE_WRAP
                                        d = (
                                            ((period - m[sw.FIXED]) << _PULSE_BITS) + pulses
                                        ) << engine.PULSES
                                        fifo[k & (engine.COMMANDS - 1)] = d + m[sw.WORD]
                                    else:
                                        fifo[0] = (
                                            (((period - m[sw.FIXED]) << _PULSE_BITS) + pulses)
                                            << engine.PULSES
                                        ) + m[sw.WORD]
                                    carry = (0 - period) * pulses + carry - engine.COMMAND_CYCLES
                                    pulses = rest
                                    period += 1
                        else:
                            period = x
                            if pulses - 1:
                                period = ((pulses >> 1) + x) // pulses
                            if period < least:
                                period = least
                        if engine.RING:
                            k = fifo[engine.COMMANDS]
                            fifo[engine.COMMANDS] = (k + 1) & WIDE_WRAP
                            d = (((period - m[sw.FIXED]) << _PULSE_BITS) + pulses) << engine.PULSES
                            fifo[k & (engine.COMMANDS - 1)] = d + m[sw.WORD]
                        else:
                            fifo[0] = (
                                (((period - m[sw.FIXED]) << _PULSE_BITS) + pulses) << engine.PULSES
                            ) + m[sw.WORD]
                        if back:
                            carry = (0 - period) * pulses + carry - engine.COMMAND_CYCLES
                            n = back
                            back = extra
                            extra = 0
                            least = m[sw.SHORTEST]
                        else:
                            m[sw.CARRY] = (0 - period) * pulses + carry + cycles
                            break
                else:
                    if s:
                        rem = 0 - rem
                    m[sw.FRACTION] = rem
                    m[sw.CARRY] = m[sw.CARRY] + cycles
                    d = m[sw.CARRY] - m[sw.RESERVE]
                    if d > engine.WAIT_CYCLES:
                        fifo = ptr32(m[sw.FIFO])
                        if engine.RING:
                            k = fifo[engine.COMMANDS]
                            fifo[engine.COMMANDS] = (k + 1) & WIDE_WRAP
                            fifo[k & (engine.COMMANDS - 1)] = m[sw.WORD] + (
                                (d - engine.WAIT_CYCLES) << engine.GAP
                            )
                        else:
                            fifo[0] = m[sw.WORD] + ((d - engine.WAIT_CYCLES) << engine.GAP)
                        m[sw.CARRY] = m[sw.RESERVE]
