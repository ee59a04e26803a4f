"""The tick: the whole interrupt handler on the board, one viper function over the blocks of
stepper.py.

It has its own module because a frozen image runs it from RAM (see boot.py): from flash it takes
twice as long when the main loop has pushed it out of the flash cache.
"""

from array import array

from framestep.base.clock import HALF, WIDE_HALF, WIDE_WRAP, WRAP, after, elapsed
from framestep.base.native import const, micropython, ptr32
from framestep.pulse import engine
from framestep.pulse import stepper as sw
from framestep.pulse.engine import pause, put

# Q22: a step this close to its place counts as made, so that rounding does not put it into the next
# tick
_STEP_TOLERANCE = const(128)
_EARLY_US = const(50)  # a call this early is for the next tick; an earlier one is a replay
_BACK_US = const(24)  # twice this, from a late call and its replay, is less than _EARLY_US
_PULSE_BITS = const(engine.GAP - engine.PULSES)


class Header(array):
    """The header words, with the tick function as a method: so the timer's callback gets the words
    as its first argument, and the interrupt looks up no attribute."""

    # Written for a compiler that keeps few variables in registers: on an ESP32 the first two, in an
    # image those used most. A test for zero takes less than a comparison.
    @micropython.viper
    def tick(m: ptr32, _timer):
        h = m
        clock = ptr32(m[sw.CLOCK])
        now = clock[0]
        # After a pause the timer replays the calls it missed; only the clock shows what is due.
        late = (now - m[sw.DUE]) & WIDE_WRAP
        if late > m[sw.WORST_LATE]:
            if late >= WIDE_HALF:
                if (late + _EARLY_US) & WIDE_WRAP >= WIDE_HALF:
                    if m[sw.RUNNING]:
                        return
                    if (late + 2 * sw.TICK_US) & WIDE_WRAP < WIDE_HALF:
                        return
                late = 0  # an earlier call was late: this one is on the timer's grid
                m[sw.DUE] = now & WIDE_WRAP
            elif m[sw.RUNNING]:
                m[sw.WORST_LATE] = late
        if late >= m[sw.LATEST] - sw.TICK_US:
            # From LATEST on all engines have run dry and are at rest. Each motor stops with BRAKE,
            # from where its pulses ended, on a ramp as if it had continued during the pause. The
            # lost time is not made up for. Before LATEST, only engines whose last pulse came early
            # in its tick have run dry: because of START each engine is checked below.
            missed = 0
            if late >= m[sw.LATEST]:
                missed = (late - m[sw.LATEST]) // sw.TICK_US + 1 + m[sw.LEAD]
                late = late % sw.TICK_US  # skip the missed ticks, keep the grid
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
                    m[sw.MODE] = sw.RUN | sw.START  # it has not begun
                elif m[sw.MODE] & (sw.RUN | sw.STOP):
                    m[sw.FAULT] = m[sw.FAULT] | sw.FAULT_LATE
                    h[sw.FAULTS] = h[sw.FAULTS] | sw.FAULT_LATE
                    if m[sw.DECEL] < m[sw.BRAKE] or m[sw.MODE] & sw.RUN:
                        m[sw.DECEL] = m[sw.BRAKE]
                    d = m[sw.VELOCITY]
                    s = d >> 31
                    d = (d ^ s) - s
                    # compare quotients, because DECEL * missed may exceed 32 bits
                    if d // m[sw.DECEL] < missed:
                        d = 0
                    else:
                        d = d - m[sw.DECEL] * missed
                    m[sw.VELOCITY] = (d ^ s) - s
                    # The pulses of the first tick are spread from its start. If part of a step were
                    # already made, they would be too fast; a stop does not need that part.
                    m[sw.FRACTION] = 0
                    m[sw.READ_INDEX] = m[sw.WRITE_INDEX]
                    m[sw.LEFT] = 0
                    m[sw.MODE] = sw.RUN | sw.STOP | sw.START  # synchronize, then stop
                else:
                    m[sw.MODE] = sw.IDLE
            m = h
        if m[sw.RUNNING]:
            m[sw.RUNNING] = m[sw.RUNNING] - 1
        else:
            # Return to the timer's grid, in case a pause has moved DUE. Slowly, so that after a
            # single late call the next ones do not count as early.
            late = late >> 4
            if late > _BACK_US:
                late = _BACK_US
            m[sw.DUE] = m[sw.DUE] + late
        m[sw.DUE] = (m[sw.DUE] + sw.TICK_US) & WIDE_WRAP
        m[sw.TICKS] = after(m[sw.TICKS], 1)
        a = m[sw.CUE_WRITE_INDEX] - m[sw.CUE_READ_INDEX]
        while a:
            q = ptr32(m[sw.CUES])
            k = (m[sw.CUE_READ_INDEX] & (sw.CUE_SLOTS - 1)) * sw.CUE_WORDS
            if elapsed(m[sw.TICKS], q[k + sw.CUE_TICK]) > HALF:
                break
            fifo = ptr32(m[sw.OUT_SET])
            if engine.OUTPUTS_IN_WORD:
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
                alone = 0  # 1: the first pulse gets its own command
                if m[sw.MODE] & sw.START:
                    m[sw.MODE] = m[sw.MODE] & (sw.RUN | sw.STOP)
                    clock = ptr32(h[sw.CLOCK])
                    passed = (clock[0] - h[sw.DUE] + sw.TICK_US) & WIDE_WRAP
                    wait = h[sw.AHEAD] - passed * h[sw.CYCLES_PER_US]
                    idle = elapsed(h[sw.TICKS] - 1, m[sw.IDLE_AT])
                    if idle < h[sw.LEAD] and m[sw.CARRY] + idle * cycles - m[sw.FIXED] < wait:
                        # the engine has not run dry
                        m[sw.CARRY] = m[sw.CARRY] + idle * cycles
                    else:
                        # Make the engine wait so that this tick's output begins AHEAD of the tick's
                        # own time, however late the code gets here.
                        fifo = ptr32(m[sw.FIFO])
                        word = m[sw.WORD]
                        wait = wait - m[sw.RESERVE] + m[sw.FIXED] - engine.COMMAND_CYCLES
                        while wait > engine.LONGEST_WAIT:
                            put(fifo, word + pause(engine.LONGEST_WAIT))
                            wait = wait - engine.LONGEST_WAIT
                        if wait > engine.WAIT_CYCLES:
                            put(fifo, word + pause(wait))
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
                            d = (gap << 22) + q[k + sw.SEG_FRACTION]  # wraps
                            # Compares whole steps first, so that the next line cannot overflow. The
                            # tolerance is an eighth step, except after a tick of less than a full
                            # span, in which the motion turned.
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
                            # The end; or, if there is still a velocity or more is planned, a queue
                            # that was not filled in time
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
                    # A stop needs no target: the motor's position is the steps made so far.
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
                # Steps within this tick. From here on signs are relative to the motion.
                rem = m[sw.FRACTION] + d
                s = rem >> 31
                if s:
                    rem = 0 - rem
                    d = 0 - d
                    acc = 0 - acc
                n = (rem + _STEP_TOLERANCE) >> 22
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
                            if m[sw.HOLD]:
                                fifo = ptr32(m[sw.FIFO])
                                put(fifo, m[sw.WORD] + pause(m[sw.HOLD]))
                                m[sw.CARRY] = m[sw.CARRY] - m[sw.HOLD]
                            m[sw.WORD] = m[sw.WORD] ^ engine.DIRECTION
                            least = m[sw.SETUP]
                    else:
                        m[sw.FRACTION] = rem
                        m[sw.POSITION] = m[sw.POSITION] + n
                        if m[sw.DOWN]:
                            m[sw.DOWN] = 0
                            if m[sw.HOLD]:
                                fifo = ptr32(m[sw.FIFO])
                                put(fifo, m[sw.WORD] + pause(m[sw.HOLD]))
                                m[sw.CARRY] = m[sw.CARRY] - m[sw.HOLD]
                            m[sw.WORD] = m[sw.WORD] ^ engine.DIRECTION
                            least = m[sw.SETUP]
                    fifo = ptr32(m[sw.FIFO])
                    carry = m[sw.CARRY] - engine.COMMAND_CYCLES
                    bent = 0
                    back = 0  # whole steps from this command's last pulse to the tick's last one
                    extra = 0  # the same for the next command
                    if acc:
                        if (acc ^ (acc >> 31)) > (d - sw.ONE // 2) >> 7:
                            bent = 1
                    # e: cycles from the tick's start to the last crossing, at constant velocity.
                    # bent: acceleration over velocity, Q10.
                    if n - 1:
                        step = (m[sw.SPAN] << 14) // (d >> 8)  # cycles per step
                        e = m[sw.SPAN] - ((rem >> 8) * step >> 14)
                        if bent:
                            bent = ((acc >> 12) * step >> 13) * h[sw.SQUARE] >> 12
                            if (n + 2) >> 4:
                                pass
                            else:
                                back = n - (n >> 1)  # more commands follow the curve more closely
                                if engine.SINGLES:
                                    if n <= engine.SINGLES:
                                        back = n - 1
                                        extra = n - 2
                                elif n - 3:
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
                            # there was no pulse in the tick before, so the two pulses of this tick
                            # have different distances
                            back = 1
                    else:
                        if d < 64:
                            # a step left over from before, at rest or at a turn
                            if rem >= d:
                                rem = 64
                            d = 64
                        if rem >> 31:
                            e = 0  # it counts as made: at the end of the tick, not beyond
                        elif d >> 20:
                            e = (rem >> 8) * m[sw.SPAN] // ((d + 128) >> 8)
                        elif rem >= d:
                            e = m[sw.SPAN]
                        elif d >> 18:
                            e = (rem >> 6) * m[sw.SPAN] // ((d + 32) >> 6)
                        elif d >> 16:
                            e = (rem >> 4) * m[sw.SPAN] // ((d + 8) >> 4)
                        elif d >> 14:
                            e = (rem >> 2) * m[sw.SPAN] // ((d + 2) >> 2)
                        else:
                            e = rem * m[sw.SPAN] // d
                        e = m[sw.SPAN] - e
                        if bent:
                            bent = (acc << 5) // (d >> 5)
                    while True:
                        pulses = n
                        x = e
                        if back:
                            pulses = n - back
                            x = e - back * step
                        if bent:
                            if (bent + 128) >> 8:
                                # Far from constant, near a start, a turn or rest: solve exactly,
                                # with b = a/2d: b·x² + (1 - b)·x = x0; x0 in Q17, 1 - b and the
                                # root in Q13.
                                if bent > 4096:
                                    bent = 4096
                                elif bent < -4096:
                                    bent = -4096
                                if m[sw.SPAN] - cycles:
                                    bent = -2048  # at rest when the span ends
                                d = x
                                x = (d << 14) // m[sw.SPAN]
                                x = (x << 3) + (((d << 14) - x * m[sw.SPAN]) << 3) // m[sw.SPAN]
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
                                    x = (d << 14) // (k + root)
                                else:
                                    x = ((root - k) >> 1) * (m[sw.SPAN] >> 2) // bent
                            else:
                                # p(x) = d·x - a·x·(1 - x)/2 in a tick: x is reached
                                # a·x·(1 - x)/2d later
                                k = ((m[sw.SPAN] - x) >> 3) * (x >> 3)
                                if back:
                                    if pulses - 1:
                                        # Pulses at equal distances stray from the curve by up to
                                        # its arc, all to one side. With this command's last one
                                        # two thirds of that to the other side, none strays further.
                                        d = pulses * step * 13 >> 8
                                        k += d * d
                                x = (((k >> 13) * h[sw.SQUARE] >> 6) * bent >> 11) + x
                        x = x + carry  # cycles available for the pulses
                        if pulses >> 6:
                            # One command would drift by up to half a cycle per pulse. Two commands
                            # make an arc instead; about half of its height is removed.
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
                                    put(
                                        fifo,
                                        (
                                            (((period - m[sw.FIXED]) << _PULSE_BITS) + pulses)
                                            << engine.PULSES
                                        )
                                        + m[sw.WORD],
                                    )
                                    carry = (0 - period) * pulses + carry - engine.COMMAND_CYCLES
                                    pulses = rest
                                    period += 1
                        else:
                            period = x
                            if pulses - 1:
                                period = ((pulses >> 1) + x) // pulses
                            if period < least:
                                period = least
                        put(
                            fifo,
                            ((((period - m[sw.FIXED]) << _PULSE_BITS) + pulses) << engine.PULSES)
                            + m[sw.WORD],
                        )
                        if back:
                            carry = (0 - period) * pulses + carry - engine.COMMAND_CYCLES
                            n = back
                            back = extra
                            extra -= 1
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
                        put(fifo, m[sw.WORD] + pause(d))
                        m[sw.CARRY] = m[sw.RESERVE]
        h[sw.SPENT] = (clock[0] - now + h[sw.SPENT]) & WIDE_WRAP
