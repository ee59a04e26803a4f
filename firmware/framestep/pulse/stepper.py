"""Words of the step kernel: segments in, pulse commands out, once per millisecond for all motors.

The kernel's state is one block (the header) that leads to a block per motor. kernel.py makes it,
and tick.py works on it in the interrupt. This module defines its words, and the kernels that the
main loop uses on them.

Numbers. A tick is 1 ms. Velocity is the displacement of one tick in steps, Q9.22. Its change from
tick to tick ("acceleration") and the change of that ("jerk") are Q4.27. A segment is
`(ticks, place, velocity, acceleration, jerk)`. The place is the exact position at its start, whole
steps and a Q22 fraction, so rounding errors do not add up. Within a tick the pulses lie where the
profile crosses each whole step. Step k is made when the position *reaches* k, going up or down. So
a motor at rest on k has made exactly k steps, and a position that trembles between two steps makes
none. ("Reaches" has a small tolerance: a step at the very end of a tick must not be missing there
and appear as a second one in the next tick.)

Pulses. The engine executes 32-bit commands one after another on its own clock of `CYCLES` per tick.
pulse/engine.py describes them and has all constants that differ between engines.

Time. A tick's pulses come `AHEAD` cycles after the tick was due, almost `LEAD` ticks. So an
interrupt up to `LATEST` late moves no edge by more than some microseconds. If the engine has run
dry by then, because its last pulse came early in its tick, it gets a new wait (START).
"""

from framestep.base.clock import reached
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
RUNNING = const(10)  # 0 if nothing has moved for some ticks
AHEAD = const(11)  # cycles from when a tick is due to its first pulse
LATEST = const(12)  # greatest lateness that does no harm, microseconds
CUES = const(13)  # address of the ring of cues
CUE_READ_INDEX = const(14)  # cues given, modulo 2^29
CUE_WRITE_INDEX = const(15)  # cues put, modulo 2^29
# address of the register that raises a mask of output pins, or of the word of levels
OUT_SET = const(16)
OUT_CLEAR = const(17)  # address that lowers them
BEHIND = const(18)  # ticks from kernel to pins: LEAD, or more if ticks are done in batches
# Load since the last GetLoad: microseconds of ticks and of passes (without ticks), modulo 2^30, and
# the fewest milliseconds that a moving motor had queued (at most UNSTRAINED)
SPENT = const(19)
PASSES = const(20)
SHALLOWEST = const(21)
ASKED = const(22)  # when that was, in milliseconds modulo 2^29; -1: not since the start
# 1: the E-stop has been pressed. Until the main loop finds it released, no motor starts.
HELD = const(23)
# The tick by which the drivers that were switched on have woken up, modulo 2^29; -1: they have
AWAKE_AT = const(24)
# 0: no passes are to be left out; else their number and 1. For Hal.pass_callback()
SKIP = const(25)
SKIPPED_AT = const(26)  # tick of the first section stored since the last pass, modulo 2^29
HEADER_WORDS = const(27)

UNSTRAINED = const(1000)

# A cue is a change of output pins at a tick; a slot of the ring has three words
CUE_SLOTS = const(32)
CUE_WORDS = const(3)
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
CARRY = const(8)  # cycles from the last step's edge to the start of this tick
WORD = const(9)  # width and direction fields of a command, in place
DOWN = const(10)  # -1 when the last pulses went down, 0 up
FIFO = const(11)  # address that commands are written to, see engine.RING
RESERVE = const(12)  # cycles that a wait leaves before the next pulse
FIXED = const(13)  # cycles from one step to the next beyond its gap
SHORTEST = const(14)  # least cycles from one step to the next
SETUP = const(15)  # the same if the direction changes between them
QUEUE = const(16)  # address of the segment ring
READ_INDEX = const(17)  # segments taken, modulo 2^30
WRITE_INDEX = const(18)  # segments put, modulo 2^30
# Q22 steps per tick per tick: deceleration of the last stop; 0 once a new plan is made
# (queue_cut.cut)
DECEL = const(19)
BRAKE = const(20)  # Q22: deceleration if the queue runs dry in motion
WAIT = const(21)  # ticks until the last pulse is out
IDLE_AT = const(22)  # tick in which a motor not in RUN got its last command
FAULT = const(23)  # FAULT_ bits of this motor
HOLD = const(24)  # cycles of a wait between the last pulse and a change of direction; 0: none
# cycles of this tick in which the motor moves: fewer if it comes to rest within it
SPAN = const(25)
WHOLE_SPAN = const(26)  # cycles per tick
# PLAN_ bits: what remains to be planned; set by whoever fills the queue, unused by the tick
PLANNED = const(27)
# addresses of what the queue is filled from, see motors/axis.py; unused by the tick
WORK = const(28)
PHASES = const(29)
BACKLASH = const(30)  # address of the motor's Backlash, for motors/samples.py
# 1: a setting waits until the motor is at rest (Axis.set_speed). Until then the motor counts as
# moving, so that nothing begins before the setting is in force.
PENDING = const(31)
BLOCK_WORDS = const(32)

PLAN_SEGMENTS = const(1)  # segments remain to be queued
PLAN_TARGET = const(2)  # a target that must be met
# with PLAN_SEGMENTS: others move at the same times, so the queue must not run dry even at rest
PLAN_TIMED = const(4)

# Result of poll_flags()
FLAG_BUSY = const(1)  # a motor moves or is planned to
FLAG_FAULT = const(2)

# Modes
IDLE = const(0)  # at rest; the segment queue may be filled
RUN = const(1)  # takes segments from the queue
STOP = const(2)  # slows down by DECEL; its segments are dropped
DRAIN = const(4)  # at rest, but the last pulses are still on their way out
# with RUN: the engine may be idle and must be synchronized first; with RUN and DRAIN: the last
# pulses of the previous motion are still on their way out
START = const(8)

# Faults
FAULT_DRY = const(1)  # the segment queue ran dry in motion, or at rest within a timed motion
FAULT_LATE = const(2)  # the interrupt came so late that the engine ran dry
FAULT_PIN = const(4)  # a segment did not begin where the motor was

# Segment ring
SEGMENTS = const(16)

# Words of a segment
SEG_TICKS = const(0)
SEG_WHOLE = const(1)  # position at its start, whole steps
SEG_FRACTION = const(2)  # position at its start, Q22 of one more step
SEG_VELOCITY = const(3)  # Q22
SEG_ACCEL = const(4)  # Q27
SEG_JERK = const(5)  # Q27
# 1: a tick in which the phase changes: its displacement is exact, the other numbers are means
SEG_BRIDGE = const(6)
SEG_SPAN = const(7)  # cycles of each tick in which the motor moves
SEGMENT_WORDS = const(8)

# Words of a place: a position with a fraction
AT_STEP = const(0)
AT_PART = const(1)  # Q16 of one more step
AT_WORDS = const(2)


@micropython.viper
def halt(m: ptr32, bits: int, rate: int, factor: int):
    """Make the motors of these bits slow down from the next tick on, by `rate` (Q22 steps per
    tick²). With a factor: by that many times BRAKE, but at most by `rate`.

    m: the block of the motor of bit 0. To be called with interrupts off or from a hard interrupt,
    so that all begin in the same tick. A motor that is slowing down already never gets a lower
    deceleration. A plan in the making does not start: see release().
    """
    while bits:
        if bits & 1:
            d = rate
            if factor:
                d = m[BRAKE] * factor
                if d > rate:
                    d = rate
            if m[MODE] & STOP == 0 or d > m[DECEL]:
                m[DECEL] = d
            if m[MODE] & START:
                m[MODE] = m[MODE] & DRAIN
                m[READ_INDEX] = m[WRITE_INDEX]
            elif m[MODE] & RUN:
                # back to the last displacement: the stop subtracts its first share from that one
                m[VELOCITY] = m[VELOCITY] - ((m[ACCEL] - m[JERK]) >> 5)
                if m[SPAN] - m[WHOLE_SPAN]:
                    # It comes to rest or turns within this tick. What takes it onto the nearest
                    # step is no velocity.
                    m[VELOCITY] = 0
                    m[SPAN] = m[WHOLE_SPAN]
                m[MODE] = STOP
            elif m[MODE] & STOP == 0:
                m[READ_INDEX] = m[WRITE_INDEX]
        bits >>= 1
        if bits:
            a = m[NEXT]
            m = ptr32(a)


@micropython.viper
def release(m: ptr32, bits: int):
    """Let the motors of these bits start on their queues at the next tick.

    m: the block of the motor of bit 0. To be called with interrupts off. A motor that has been
    stopped since its plan began stays at rest: its queue may lack the plan's beginning.
    """
    while bits:
        if bits & 1 and m[MODE] & (RUN | STOP) == 0 and m[DECEL] == 0:
            m[MODE] = m[MODE] | RUN | START
        bits >>= 1
        if bits:
            a = m[NEXT]
            m = ptr32(a)


@micropython.viper
def moving(m: ptr32) -> int:
    """Return one bit per motor that moves, or is planned to. m: the header."""
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
    """Hide the plans of timed motions, so that their motors count as at rest. Return these motors'
    bits. m: the header."""
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
    """Drop the queued segments of these motors, which must be at rest. To be called with interrupts
    off. m: the header."""
    a = m[FIRST]
    while bits:
        m = ptr32(a)
        a = m[NEXT]
        if bits & 1:
            m[WRITE_INDEX] = m[READ_INDEX]
        bits >>= 1


@micropython.viper
def restore_planned(m: ptr32, bits: int):
    """Restore the plans that hide_planned() hid; bits: its result. m: the header."""
    a = m[FIRST]
    while bits:
        m = ptr32(a)
        a = m[NEXT]
        if bits & 1:
            m[PLANNED] = PLAN_SEGMENTS | PLAN_TIMED
        bits >>= 1


@micropython.viper
def poll_flags(m: ptr32) -> int:
    """Return FLAG_ bits for what the main loop has to look after. m: the header."""
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
def waking(m: ptr32) -> int:
    """Return 1 while a driver that was switched on wakes up: no motor may begin to move then. m:
    the header."""
    at = m[AWAKE_AT]
    if at < 0:
        return 0
    if reached(m[TICKS], at):
        m[AWAKE_AT] = -1
        return 0
    return 1


@micropython.viper
def awaiting_target(m: ptr32) -> int:
    """Return one bit per motor that has stopped with a target still to be met. m: the header.

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
