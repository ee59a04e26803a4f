"""The tick kernel: segments in, pulse commands out, once per millisecond for all motors.

One viper function over one state block (the header) that leads to a block per motor. It is the
whole interrupt handler on the board, and plain Python on CPython; it allocates nothing.

Numbers. A tick is 1 ms. Velocity is the displacement of one tick in steps, Q9.22; its change from
tick to tick ("acceleration") and the change of that ("jerk") are Q4.27. A segment is
`(ticks, pin, velocity, acceleration, jerk)`; `pin` is the exact position at its start, whole steps
and Q22 fraction, so that rounding never adds up. Within a tick the pulses lie where the profile
crosses each whole step: step k is made when the position *reaches* k, going up or down, so a motor
at rest on k has made exactly k steps and a position that trembles between two steps makes none.
("Reaches" means comes within a hair of: what lies on the end of a tick must not make none in one
tick and two in the next.)

Pulses. The engine (a PIO state machine, see hal/rp2.py, or its model in hal/host.py) takes 32-bit
commands from a FIFO and executes them one after another on its own clock of `CYCLES` per tick:

    direction:1 | pulses:9 | gap:18 | width:4      (bit 0 first)

With H = 4 + 32·(width + 1) cycles from a rising edge to the end of its pulse, a command of n
pulses puts its last rising edge 4 + n·(gap + 4 + H) cycles after the previous one; a command of 0
pulses waits gap + 9 cycles.

Time. A tick's pulses come `AHEAD` cycles after the tick was due: almost `LEAD` ticks, so that an
interrupt that comes late by up to `LATEST` moves no edge. A tick takes up to three commands, and
those of three ticks fit the eight words of a FIFO when the engine has fetched one of them; what
AHEAD is short of LEAD ticks is the time by which it is sure to have done so.
"""

from array import array

from framestep.native import addressof, as_word, const, micropython, ptr32

TICK_US = const(1000)
ONE = const(0x400000)  # one step in Q22
MAX_VELOCITY = const(500)  # steps per tick that the number format holds with room for a carry

# Header words
CLOCK = const(0)  # address of a free running microsecond counter
DUE = const(1)  # when the next tick is due, microseconds modulo 2^30
TICKS = const(2)  # ticks done, modulo 2^30
CYCLES = const(3)  # engine cycles per tick
CYCLES_PER_US = const(4)
LEAD = const(5)  # ticks of commands ahead of the pulses
FIRST = const(6)  # address of the first motor's block
WORST_LATE = const(7)  # greatest lateness seen while something moved, microseconds
FAULTS = const(8)  # FAULT_ bits of all motors together
SQUARE = const(9)  # 2^25 / CYCLES, to divide a square of cycles by CYCLES
RUNNING = const(10)  # 0 where nothing has moved for some ticks
AHEAD = const(11)  # cycles from when a tick is due to its first pulse
LATEST = const(12)  # microseconds of lateness that an engine survives
CUES = const(13)  # address of the ring of cues
CUE_TAKEN = const(14)  # cues given, modulo 2^30
CUE_PUT = const(15)  # cues put, modulo 2^30
OUT_SET = const(16)  # address that raises the output pins of a mask
OUT_CLEAR = const(17)  # address that lowers them
HEADER_WORDS = const(18)

# A cue is a change of output pins at a tick: tick, pins to raise, pins to lower, spare
CUE_SLOTS = const(32)

_SHORT_US = const(100)  # what AHEAD is short of LEAD ticks
_TICK_COST_US = const(80)  # from a late tick's first line to the last motor's first command
_HAIR = const(128)  # Q22: a step is made so much early, lest rounding put it into the next tick
_EARLY_US = const(50)  # before its time that a call is taken for the next tick, not for a replay

# Words of a motor's block
NEXT = const(0)  # address of the next motor's block, 0 after the last
MODE = const(1)
LEFT = const(2)  # ticks left in this segment
VELOCITY = const(3)  # Q22 steps in the next tick
ACCEL = const(4)  # Q27 steps per tick per tick
JERK = const(5)  # Q27
FRACTION = const(6)  # Q22: profile position minus steps made, within one step
POSITION = const(7)  # steps made (commanded to the engine)
CARRY = const(8)  # cycles from the last rising edge to the start of this tick
WORD = const(9)  # width and direction fields of a command, in place
DOWN = const(10)  # -1 when the last pulses went down, 0 up
FIFO = const(11)  # address the commands are written to
RESERVE = const(12)  # cycles that a waiting engine leaves for the next pulse
FIXED = const(13)  # 4 + H: cycles of a pulse period beyond its gap
SHORTEST = const(14)  # least cycles from a rising edge to the next
SETUP = const(15)  # least cycles from a change of direction to the rising edge
QUEUE = const(16)  # address of the segment ring
HEAD = const(17)  # segments taken, modulo 2^30
TAIL = const(18)  # segments put, modulo 2^30
DECEL = const(19)  # Q22 steps per tick per tick: how a stop slows down
BRAKE = const(20)  # Q22: the same for a queue that ran dry in motion
WAIT = const(21)  # ticks until the last pulse is out
IDLE_AT = const(22)  # tick in which the last command of a motor not in RUN was queued
FAULT = const(23)  # FAULT_ bits of this motor
INVERT = const(24)  # 1 swaps the level of the direction pin
SPAN = const(25)  # cycles of this tick in which the motor moves: fewer where it comes to rest within it
WHOLE_SPAN = const(26)  # cycles per tick
PLANNED = const(27)  # PLAN_ bits: what is to come yet, set by whoever fills the queue; nothing to the tick
BLOCK_WORDS = const(28)

PLAN_SEGMENTS = const(1)  # segments remain to be queued
PLAN_TARGET = const(2)  # a target that must be met

# Modes
IDLE = const(0)  # at rest; the segment queue may be filled
RUN = const(1)  # takes segments from the queue
STOP = const(2)  # slows down by DECEL, segments are dropped
DRAIN = const(4)  # at rest, the last pulses are still on their way out
START = const(8)  # with RUN: the engine may stand still and must be brought into step first; with
# RUN and DRAIN: the last pulses of the motion before are still on their way

# Faults
FAULT_DRY = const(1)  # the segment queue ran dry in motion
FAULT_LATE = const(2)  # the interrupt came so late that the engine ran dry
FAULT_PIN = const(4)  # a segment did not begin where the motor was

# Segment ring
SEGMENTS = const(16)
SEGMENT_WORDS = const(8)  # ticks, pin, pin fraction, velocity, acceleration, jerk, bridge, span
# A bridge is one tick with a change of phase in it: the displacement is exact, the rest a mean.
_WRAP = const(0x3FFFFFFF)
_HALF = const(0x1FFFFFFF)


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
        late = (now - m[DUE]) & _WRAP
        if late > m[WORST_LATE]:
            if late > _HALF:
                if (late + _EARLY_US) & _WRAP > _HALF:
                    if m[RUNNING]:
                        return
                    if (late + 2 * TICK_US) & _WRAP < _HALF:
                        return
                late = 0  # a call before came late: this is the grid that the timer keeps
                m[DUE] = now & _WRAP
            elif m[RUNNING]:
                m[WORST_LATE] = late
        if late >= m[LATEST]:
            # The engines have run dry and stand. A stop with BRAKE began where the pulses ended;
            # what of it fell into the hole is over. The time lost is not made up for.
            missed = (late - m[LATEST]) // TICK_US + 1 + m[LEAD]
            late = late % TICK_US  # the ticks missed are left out, the grid stays
            m[DUE] = (now - late) & _WRAP
            a = m[FIRST]
            while a:
                m = ptr32(a)
                a = m[NEXT]
                m[IDLE_AT] = (h[TICKS] - 1000) & _WRAP
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
                    m[HEAD] = m[TAIL]
                    m[LEFT] = 0
                    m[MODE] = RUN | STOP | START  # the engine first, then a stop
                else:
                    m[MODE] = IDLE
            m = h
        if m[RUNNING]:
            m[RUNNING] = m[RUNNING] - 1
        else:
            m[DUE] = m[DUE] + (late >> 4)  # back to the timer's grid, if a hole has moved it
        m[DUE] = (m[DUE] + TICK_US) & _WRAP
        m[TICKS] = (m[TICKS] + 1) & _WRAP
        a = m[CUE_PUT] - m[CUE_TAKEN]
        while a:
            q = ptr32(m[CUES])
            k = (m[CUE_TAKEN] & (CUE_SLOTS - 1)) << 2
            if (m[TICKS] - q[k + 0]) & _WRAP > _HALF:
                break
            fifo = ptr32(m[OUT_SET])
            fifo[0] = q[k + 1]
            fifo = ptr32(m[OUT_CLEAR])
            fifo[0] = q[k + 2]
            m[CUE_TAKEN] = (m[CUE_TAKEN] + 1) & _WRAP
            a = m[CUE_PUT] - m[CUE_TAKEN]
        cycles = m[CYCLES]
        a = m[FIRST]
        while a:
            m = ptr32(a)
            a = m[NEXT]
            if m[MODE]:
                h[RUNNING] = 4
                if m[MODE] & RUN:
                    if m[LEFT]:
                        pass
                    else:
                        if m[MODE] & START:
                            m[MODE] = m[MODE] & (RUN | STOP)
                            idle = (h[TICKS] - 1 - m[IDLE_AT]) & _WRAP
                            if idle < h[LEAD] and idle * TICK_US + late < h[LATEST]:
                                m[CARRY] = m[CARRY] + idle * cycles  # the engine has not run dry since
                            else:
                                # Make the engine wait so that this tick's output begins AHEAD of the
                                # tick's own time, however late within it this line is reached.
                                fifo = ptr32(m[FIFO])
                                word = m[WORD]
                                clock = ptr32(h[CLOCK])
                                passed = (clock[0] - h[DUE] + TICK_US) & _WRAP
                                wait = h[AHEAD] - passed * h[CYCLES_PER_US] - m[RESERVE] + m[FIXED] - 4
                                while wait > 200000:
                                    fifo[0] = word + (199991 << 10)
                                    wait = wait - 200000
                                if wait > 9:
                                    fifo[0] = word + ((wait - 9) << 10)
                                m[CARRY] = m[RESERVE]
                        head = m[HEAD]
                        if head - m[TAIL]:
                            q = ptr32(m[QUEUE])
                            k = (head & (SEGMENTS - 1)) << 3
                            m[HEAD] = (head + 1) & _WRAP
                            gap = q[k + 1] - m[POSITION]
                            d = (gap << 22) + q[k + 2]
                            # within a few steps, so that the second line cannot overflow, and by an eighth
                            if (gap + 2) >> 2 or (d - m[FRACTION] + ONE // 8) >> 20:
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
                                m[VELOCITY] = q[k + 3]
                                m[ACCEL] = q[k + 4]
                                m[JERK] = q[k + 5]
                                m[SPAN] = q[k + 7]
                        else:
                            # The end, or with a velocity left a queue that was not filled in time
                            if m[MODE] & STOP:
                                pass
                            elif m[VELOCITY]:
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
                        m[HEAD] = m[TAIL]
                        m[LEFT] = 0
                        m[WAIT] = h[LEAD]
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
                            m[WORD] = (m[WORD] & -2) + m[INVERT]
                            least = m[SETUP]
                    else:
                        m[FRACTION] = rem
                        m[POSITION] = m[POSITION] + n
                        if m[DOWN]:
                            m[DOWN] = 0
                            m[WORD] = (m[WORD] | 1) - m[INVERT]
                            least = m[SETUP]
                    fifo = ptr32(m[FIFO])
                    carry = m[CARRY] - 4
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
                                # Far from constant, next to a start, a turn or a rest. Exactly, with
                                # b = a/2d: b·x² + (1 - b)·x = x0; x0 in Q17, 1 - b and the root in Q13.
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
                            # p(x) = d·x - a·x·(1 - x)/2 in a tick: x is reached a·x·(1 - x)/2d later
                            x = (((((m[SPAN] - x) >> 3) * (x >> 3) >> 13) * h[SQUARE] >> 6) * bent >> 11) + x
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
                                    fifo[0] = ((((period - m[FIXED]) << 9) + pulses) << 1) + m[WORD]
                                    carry = (0 - period) * pulses + carry - 4
                                    pulses = rest
                                    period += 1
                        else:
                            period = x
                            if pulses - 1:
                                period = ((pulses >> 1) + x) // pulses
                            if period < least:
                                period = least
                        fifo[0] = ((((period - m[FIXED]) << 9) + pulses) << 1) + m[WORD]
                        if back:
                            carry = (0 - period) * pulses + carry - 4
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
                    if d > 9:
                        fifo = ptr32(m[FIFO])
                        fifo[0] = m[WORD] + ((d - 9) << 10)
                        m[CARRY] = m[RESERVE]


class StepKernel:
    """State blocks for `motors` motors and the tick function over them.

    cycles: engine cycles per tick, a multiple of 1000, at most 131000.
    clock: address of a microsecond counter (on CPython: of anything that can be indexed with 0).
    lead: ticks of commands queued ahead: two fill an eight-word FIFO.
    """

    def __init__(self, motors, cycles, clock, lead=2):
        self.motors = motors
        self.state = Header("i", [0] * HEADER_WORDS)
        self.tick = self.state.tick
        self.blocks = [array("i", [0] * BLOCK_WORDS) for _ in range(motors)]
        self.queues = [array("i", [0] * (SEGMENTS * SEGMENT_WORDS)) for _ in range(motors)]
        state = self.state
        state[CLOCK] = as_word(clock)
        state[CYCLES] = cycles
        state[CYCLES_PER_US] = cycles // TICK_US
        state[LEAD] = lead
        state[AHEAD] = lead * cycles - _SHORT_US * state[CYCLES_PER_US]
        state[SQUARE] = (1 << 25) // cycles
        following = 0
        for i in range(motors - 1, -1, -1):
            block = self.blocks[i]
            block[NEXT] = following
            following = as_word(addressof(block))
            block[QUEUE] = as_word(addressof(self.queues[i]))
            block[BRAKE] = block[DECEL] = ONE // 50
            block[IDLE_AT] = -1000
            block[SPAN] = block[WHOLE_SPAN] = cycles
        state[FIRST] = following
        self.cues = array("i", [0] * (4 * CUE_SLOTS))
        self._nowhere = array("i", [0])
        state[CUES] = as_word(addressof(self.cues))
        state[OUT_SET] = state[OUT_CLEAR] = as_word(addressof(self._nowhere))

    def outputs(self, set_address, clear_address):
        """Where cues go: registers that raise and lower the output pins of a mask."""
        self.state[OUT_SET] = as_word(set_address)
        self.state[OUT_CLEAR] = as_word(clear_address)

    def cue(self, tick, raised, lowered):
        """Change output pins in a tick (modulo 2^30), not before the cues put until now.

        raised, lowered: masks of pins, below 2^30. The pins change some microseconds after the
        tick is due. False where there is no room.
        """
        state = self.state
        if (state[CUE_PUT] - state[CUE_TAKEN]) & _WRAP >= CUE_SLOTS:
            return False
        k = (state[CUE_PUT] & (CUE_SLOTS - 1)) << 2
        cues = self.cues
        cues[k] = tick & _WRAP
        cues[k + 1] = raised
        cues[k + 2] = lowered
        state[CUE_PUT] = (state[CUE_PUT] + 1) & _WRAP
        return True

    def drop_cues(self):
        """Forget the cues that have not been given. Interrupts are off."""
        self.state[CUE_PUT] = self.state[CUE_TAKEN]

    def configure(self, motor, fifo, width, setup, invert):
        """Set a motor's pulse shape.

        fifo: address for its commands. width: 0 to 15, the pulse is 32·width + 34 cycles high.
        setup: cycles from a change of direction to the next rising edge, up to a quarter of a tick.
        invert: swap direction.
        """
        state = self.state
        block = self.blocks[motor]
        period = 4 + 4 + 32 * (width + 1)
        block[FIFO] = as_word(fifo)
        block[WORD] = ((width - 16 if width > 7 else width) << 28) + (0 if invert else 1)
        block[DOWN] = 0
        block[FIXED] = period
        block[SHORTEST] = 2 * (32 * width + 34)
        # the direction changes 7 cycles into the gap of the first pulse, when the last one has ended
        block[SETUP] = max(setup + period - 7, block[SHORTEST])
        block[RESERVE] = block[SETUP] + 16
        block[INVERT] = 1 if invert else 0
        reserve = max(b[RESERVE] for b in self.blocks)
        state[LATEST] = (state[AHEAD] - reserve) // state[CYCLES_PER_US] - _TICK_COST_US


@micropython.viper
def splice(m: ptr32, ticks: int, out: ptr32) -> int:
    """End a motor's queue about `ticks` from now and tell the state there, to plan on from it.

    out: whole steps, fraction (Q22), velocity (Q22), acceleration (Q27) at that moment. Returns the
    ticks until then; 0 where the motor is at rest. To be called with interrupts off; what is
    planned must be queued within that time.
    """
    whole = m[POSITION]
    rem = m[FRACTION]
    v = m[VELOCITY]
    a = m[ACCEL]
    j = m[JERK]
    left = m[LEFT]
    n = ticks
    if m[MODE] & STOP:
        # Carry on with the same deceleration as a segment
        a = m[DECEL]
        n = v // a
        if v < 0:
            n = (0 - v) // a
        else:
            a = 0 - a
        if n > ticks:
            n = ticks
        m[HEAD] = m[TAIL]
        m[LEFT] = n
        left = n
        v = v + a
        a = a << 5
        j = 0
        m[JERK] = 0
        if n:
            m[VELOCITY] = v
            m[ACCEL] = a
        else:
            # slower than one share of it: at rest, and on with whatever is queued
            v = 0
            a = 0
            rem = 0
            m[VELOCITY] = 0
            m[FRACTION] = 0
            m[ACCEL] = 0
        m[MODE] = RUN | (m[MODE] & START)
    elif m[MODE] & RUN:
        if left > n:
            left = n
            m[LEFT] = n
    else:
        n = 0
        rem = 0
        v = 0
        a = 0
    head = m[HEAD]
    done = 0
    bridge = 0
    while n:
        if left == 0:
            if head == m[TAIL]:
                break
            q = ptr32(m[QUEUE])
            k = (head & (SEGMENTS - 1)) << 3
            head = (head + 1) & _WRAP
            if q[k] > n:
                q[k] = n
            left = q[k]
            whole = q[k + 1]
            rem = q[k + 2]
            v = q[k + 3]
            a = q[k + 4]
            j = q[k + 5]
            bridge = q[k + 6]
        left -= 1
        n -= 1
        done += 1
        rem = rem + v
        v = v + (a >> 5)
        a = a + j
        whole = whole + (rem >> 22)
        rem = rem - ((rem >> 22) << 22)
    if bridge:
        if head == m[TAIL]:
            pass
        else:
            # the velocity at the end of a bridge is that at the start of what follows it
            q = ptr32(m[QUEUE])
            k = (head & (SEGMENTS - 1)) << 3
            whole = q[k + 1]
            rem = q[k + 2]
            v = q[k + 3]
            a = q[k + 4]
    m[TAIL] = head
    whole = whole + (rem >> 22)
    rem = rem - ((rem >> 22) << 22)
    out[0] = whole
    out[1] = rem
    out[2] = v
    out[3] = a
    return done


@micropython.viper
def trim(m: ptr32, ticks: int, put: int, out: ptr32) -> int:
    """Whether a segment in a motor's queue begins `ticks` from now: its place in out[0] and (Q16) out[1].

    put: drop it, and what follows it. To be called with interrupts off.
    """
    n = ticks - m[LEFT]
    head = m[HEAD]
    while n > 0 and head != m[TAIL]:
        q = ptr32(m[QUEUE])
        n -= q[(head & (SEGMENTS - 1)) << 3]
        head = (head + 1) & _WRAP
    if n or head == m[TAIL]:
        return 0
    q = ptr32(m[QUEUE])
    k = (head & (SEGMENTS - 1)) << 3
    out[0] = q[k + 1]
    out[1] = q[k + 2] >> 6
    if put:
        m[TAIL] = head
    return 1


@micropython.viper
def halt(m: ptr32, rate: int):
    """Make a motor slow down by `rate` (Q22 steps per tick²) from the next tick on.

    To be called with interrupts off. A motor that is slowing down already does it no slower.
    """
    if m[MODE] & START:
        m[MODE] = m[MODE] & DRAIN
        m[HEAD] = m[TAIL]
    elif m[MODE] & RUN:
        # the last displacement, not the next one: the stop takes its first share from that
        m[VELOCITY] = m[VELOCITY] - ((m[ACCEL] - m[JERK]) >> 5)
        m[SPAN] = m[WHOLE_SPAN]
        m[DECEL] = rate
        m[MODE] = STOP
    elif m[MODE] & STOP:
        if rate > m[DECEL]:
            m[DECEL] = rate
    else:
        m[HEAD] = m[TAIL]


@micropython.viper
def halt_motors(blocks, bits: int, factor: int, steepest: int):
    """Halt the motors of these bits, `factor` times as steeply as they brake, but by `steepest` (Q22) at most.

    To be called with interrupts off or from a hard interrupt, so that they begin in the same tick.
    """
    i = 0
    while bits:
        if bits & 1:
            block = blocks[i]
            rate = ptr32(block)[BRAKE] * factor
            if rate > steepest:
                rate = steepest
            halt(block, rate)
        bits >>= 1
        i += 1


@micropython.viper
def moving(m: ptr32) -> int:
    """One bit per motor that moves, or is planned to. m: the header."""
    bits = 0
    bit = 1
    a = m[FIRST]
    while a:
        m = ptr32(a)
        a = m[NEXT]
        if m[MODE] | m[PLANNED]:
            bits |= bit
        bit <<= 1
    return bits


@micropython.viper
def hungry(m: ptr32, least: int) -> int:
    """One bit per motor that has segments to come and fewer than `least` in its queue. m: the header."""
    bits = 0
    bit = 1
    a = m[FIRST]
    while a:
        m = ptr32(a)
        a = m[NEXT]
        if m[PLANNED] & PLAN_SEGMENTS:
            if (m[TAIL] - m[HEAD]) & _WRAP < least:
                bits |= bit
        bit <<= 1
    return bits
