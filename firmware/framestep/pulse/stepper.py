"""The step kernel's words: segments in, pulse commands out, once per millisecond for all motors.

Its state is one block (the header) that leads to a block per motor. tick.py has the function that
works on it in the interrupt, kernel.py makes it; here are its words, and what else touches them.

Numbers. A tick is 1 ms. Velocity is the displacement of one tick in steps, Q9.22; its change from
tick to tick ("acceleration") and the change of that ("jerk") are Q4.27. A segment is
`(ticks, place, velocity, acceleration, jerk)`; the place is the exact position at its start, whole
steps and Q22 fraction, so that rounding never adds up. Within a tick the pulses lie where the
profile crosses each whole step: step k is made when the position *reaches* k, going up or down, so
a motor at rest on k has made exactly k steps and a position that trembles between two steps makes
none. ("Reaches" means comes within a hair of: what lies on the end of a tick must not make none in
one tick and two in the next.)

Pulses. The engine takes 32-bit commands and executes them one after another on its own clock of
`CYCLES` per tick; pulse/engine.py says what they look like and how long they take, and names all
that differs between engines.

Time. A tick's pulses come `AHEAD` cycles after the tick was due: almost `LEAD` ticks, so that an
interrupt that comes late by up to `LATEST` moves no edge by more than some microseconds: an engine
that has run dry by then, since its last pulse came early in its tick, gets a new wait (START).
"""

from framestep.base.native import const, micropython, ptr32

TICK_US = const(1000)
ONE = const(0x400000)  # one step in Q22
MAX_VELOCITY = const(500)  # steps per tick that the number format holds with room for a carry

# Header words
CLOCK = const(0)  # address of a free running microsecond counter
DUE = const(1)  # when the next tick is due, microseconds modulo 2^30
TICKS = const(2)  # ticks done, modulo 2^29 (clock.py)
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
CUE_READ_INDEX = const(14)  # cues given, modulo 2^29
CUE_WRITE_INDEX = const(15)  # cues put, modulo 2^29
# address that raises the output pins of a mask, or of the word of levels: see engine.RING
OUT_SET = const(16)
OUT_CLEAR = const(17)  # address that lowers them
BEHIND = const(18)  # ticks that the pins are behind: LEAD, or more where ticks are done in batches
HEADER_WORDS = const(19)

# A cue is a change of output pins at a tick; a slot of the ring has four words
CUE_SLOTS = const(32)
CUE_TICK = const(0)
CUE_RAISED = const(1)  # pins to raise
CUE_LOWERED = const(2)

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
FIFO = const(11)  # address the commands are written to, see engine.RING
RESERVE = const(12)  # cycles that a waiting engine leaves for the next pulse
FIXED = const(13)  # cycles of a pulse period beyond its gap
SHORTEST = const(14)  # least cycles from a rising edge to the next
SETUP = const(15)  # least cycles from a change of direction to the rising edge
QUEUE = const(16)  # address of the segment ring
READ_INDEX = const(17)  # segments taken, modulo 2^30
WRITE_INDEX = const(18)  # segments put, modulo 2^30
DECEL = const(19)  # Q22 steps per tick per tick: how a stop slows down
BRAKE = const(20)  # Q22: the same for a queue that ran dry in motion
WAIT = const(21)  # ticks until the last pulse is out
IDLE_AT = const(22)  # tick in which the last command of a motor not in RUN was queued
FAULT = const(23)  # FAULT_ bits of this motor
INVERT = const(24)  # engine.DIRECTION swaps the level of the direction pin
# cycles of this tick in which the motor moves: fewer where it comes to rest within it
SPAN = const(25)
WHOLE_SPAN = const(26)  # cycles per tick
# PLAN_ bits: what is to come yet, set by whoever fills the queue; nothing to the tick
PLANNED = const(27)
# addresses of what the queue is filled from, see motors/axis.py; nothing to the tick either
WORK = const(28)
PHASES = const(29)
BACKLASH = const(30)  # address of the motor's Backlash, for motors/samples.py
# 1: a setting waits until the motor is at rest (Motor.set_speed); until it is in force, the motor
# counts as moving, so that nothing begins before that
PENDING = const(31)
BLOCK_WORDS = const(32)

PLAN_SEGMENTS = const(1)  # segments remain to be queued
PLAN_TARGET = const(2)  # a target that must be met
# with PLAN_SEGMENTS: others move at the same times, so the queue must not run dry at rest either
PLAN_TIMED = const(4)

# What poll_flags() finds
FLAG_BUSY = const(1)  # a motor moves or is planned to
FLAG_FAULT = const(2)

# Modes
IDLE = const(0)  # at rest; the segment queue may be filled
RUN = const(1)  # takes segments from the queue
STOP = const(2)  # slows down by DECEL, segments are dropped
DRAIN = const(4)  # at rest, the last pulses are still on their way out
START = const(8)  # with RUN: the engine may stand still and must be brought into step first; with
# RUN and DRAIN: the last pulses of the motion before are still on their way

# Faults
FAULT_DRY = const(1)  # the segment queue ran dry in motion, or at rest within a timed one
FAULT_LATE = const(2)  # the interrupt came so late that the engine ran dry
FAULT_PIN = const(4)  # a segment did not begin where the motor was

# Segment ring
SEGMENTS = const(16)

# Words of a segment
SEG_TICKS = const(0)
SEG_WHOLE = const(1)  # where it begins: whole steps
SEG_FRACTION = const(2)  # and Q22 of a step
SEG_VELOCITY = const(3)  # Q22
SEG_ACCEL = const(4)  # Q27
SEG_JERK = const(5)  # Q27
# 1: one tick with a change of phase in it: the displacement is exact, the rest a mean
SEG_BRIDGE = const(6)
SEG_SPAN = const(7)  # cycles of each tick in which the motor moves
SEGMENT_WORDS = const(8)

# Words of a place in a queue
AT_STEP = const(0)
AT_PART = const(1)  # Q16 of one more
AT_WORDS = const(2)


@micropython.viper
def halt(m: ptr32, bits: int, rate: int, factor: int):
    """Make the motors of these bits slow down from the next tick on, by `rate` (Q22 steps per
    tick²), or with a factor by that many times BRAKE, `rate` at most.

    m: the block of the motor of bit 0. To be called with interrupts off or from a hard interrupt,
    so that they begin in the same tick. A motor that is slowing down already does it no slower.
    """
    while bits:
        if bits & 1:
            d = rate
            if factor:
                d = m[BRAKE] * factor
                if d > rate:
                    d = rate
            if m[MODE] & START:
                m[MODE] = m[MODE] & DRAIN
                m[READ_INDEX] = m[WRITE_INDEX]
            elif m[MODE] & RUN:
                # the last displacement, not the next one: the stop takes its first share from that
                m[VELOCITY] = m[VELOCITY] - ((m[ACCEL] - m[JERK]) >> 5)
                m[SPAN] = m[WHOLE_SPAN]
                m[DECEL] = d
                m[MODE] = STOP
            elif m[MODE] & STOP:
                if d > m[DECEL]:
                    m[DECEL] = d
            else:
                m[READ_INDEX] = m[WRITE_INDEX]
        bits >>= 1
        if bits:
            a = m[NEXT]
            m = ptr32(a)


@micropython.viper
def release(m: ptr32, bits: int):
    """Let the motors of these bits take their queues from the next tick on.

    m: the block of the motor of bit 0. To be called with interrupts off.
    """
    while bits:
        if bits & 1 and m[MODE] & (RUN | STOP) == 0:
            m[MODE] = m[MODE] | RUN | START
        bits >>= 1
        if bits:
            a = m[NEXT]
            m = ptr32(a)


@micropython.viper
def moving(m: ptr32) -> int:
    """One bit per motor that moves, or is planned to. m: the header."""
    bits = 0
    bit = 1
    a = m[FIRST]
    while a:
        m = ptr32(a)
        a = m[NEXT]
        if m[MODE] | m[PLANNED] | m[PENDING]:
            bits |= bit
        bit <<= 1
    return bits


@micropython.viper
def hide_planned(m: ptr32) -> int:
    """Take timed motions out of what is planned, so that their motors count as at rest; their bits.
    m: the header."""
    bits = 0
    bit = 1
    a = m[FIRST]
    while a:
        m = ptr32(a)
        a = m[NEXT]
        if m[PLANNED] & PLAN_TIMED:
            m[PLANNED] = 0
            bits |= bit
        bit <<= 1
    return bits


@micropython.viper
def discard(m: ptr32, bits: int):
    """Drop what is queued for motors of these bits, which are at rest. With interrupts off. m: the
    header."""
    a = m[FIRST]
    while bits:
        m = ptr32(a)
        a = m[NEXT]
        if bits & 1:
            m[WRITE_INDEX] = m[READ_INDEX]
        bits >>= 1


@micropython.viper
def restore_planned(m: ptr32, bits: int):
    """Plan on where hide_planned() has given these bits. m: the header."""
    a = m[FIRST]
    while bits:
        m = ptr32(a)
        a = m[NEXT]
        if bits & 1:
            m[PLANNED] = PLAN_SEGMENTS | PLAN_TIMED
        bits >>= 1


@micropython.viper
def poll_flags(m: ptr32) -> int:
    """What the main loop is to look after, FLAG_ bits. m: the header."""
    bits = FLAG_BUSY if m[RUNNING] else 0
    if m[FAULTS]:
        bits |= FLAG_FAULT
    a = m[FIRST]
    while a:
        m = ptr32(a)
        a = m[NEXT]
        if m[MODE] | m[PLANNED] | m[PENDING]:
            bits |= FLAG_BUSY
    return bits


@micropython.viper
def awaiting_target(m: ptr32) -> int:
    """One bit per motor that has come to rest with a target still to be met. m: the header.

    Its last pulses may still be on their way out.
    """
    bits = 0
    bit = 1
    a = m[FIRST]
    while a:
        m = ptr32(a)
        a = m[NEXT]
        if m[MODE] & (RUN | STOP):
            pass
        elif m[PLANNED] == PLAN_TARGET and m[PENDING] == 0:
            bits |= bit
        bit <<= 1
    return bits
