"""Answers to questions for status, positions and HI as soon as they have come, between two passes
and between the pieces of one; the first part of a STOP and a STOP_ALL; a GO; and sections of an
uploaded move, stored between two passes.

The port calls answer() also from within MicroPython's USB task. So this is a kernel: nothing can
end it, and it allocates nothing. It is one piece, because each call and each name takes as long as
a good part of it. It reads the same state as the handlers of controller.py, so it gives the same
answers (host_tests/end_to_end/hosts/test_at_once.py). What it could not answer without a change of
that state, and whatever comes after a request that waits, is left to the next pass. So are sections
that are refused, or that come while an operation goes on. A section that waits for a pass takes
three times as long, most of it in bytecode that leads to the kernels that store it.

A GO starts the motors at once if the plan of their start is complete and nothing has happened since
that a pass would have to look at. The next pass then goes on with the operation
(OperationRunner.adopt).
"""

from array import array

from framestep.base.clock import after, elapsed
from framestep.base.native import addressof, as_word, const, micropython, ptr8, ptr32
from framestep.base.results import OK
from framestep.hal import QUESTION
from framestep.io.lights import RAMPING
from framestep.io.safety import ACTIVE, CAUGHT
from framestep.motors.feeder import coupled
from framestep.motors.samples import choose
from framestep.moves.operation_runner import (
    ENDING,
    GONE,
    IDLE,
    LEAVING,
    PLANNED,
    POSITIONING,
    READY,
    RUNNING,
    fetch_positions,
)
from framestep.protocol import messages as m
from framestep.protocol.checksum import check_bytes, fletcher16
from framestep.protocol.frames import END, FILL, NEXT, TAKE
from framestep.pulse import stepper
from framestep.pulse.engine import MOTORS
from framestep.virtual_axes.move import SETTLING, TAKING_UP

_READER = const(0)  # addresses of the states of reader and writer
_WRITER = const(1)
_HEADER = const(2)  # of the tick
_LIGHTS = const(3)
HI_SIZE = const(4)  # bytes of the answer to HI that follows, without checksum; 0: not known yet
_HI = const(5)
_SMOOTH = const(5 + 16)  # motors with a jerk limit, a bit each
TRACED = const(5 + 16 + 1)  # 1: passes carry out sections and GO, so that repl/tracer.py sees them
_BITS = const(5 + 16 + 2)  # a bit for each motor
_WORDS = const(5 + 16 + 3)
_LOW = const(m.MSG_RT_UPLOAD_MOVE_AXIS & 0xFF)
_HIGH = const(m.MSG_RT_UPLOAD_MOVE_AXIS >> 8)  # of MSG_RT_GO, too
_GO = const(m.MSG_RT_GO & 0xFF)
_ACK = const(m.MSG_FLAG_ACK >> 8)
# Passes left out after one of them if sections are stored meanwhile, since a pass takes as long as
# storing one. Passes that store sections themselves take no less than three milliseconds.
_SKIPPED = const(2)
# Small sections come so fast that MicroPython's scheduler would never get to a pass. So after this
# many ticks without one, sections wait for it, and the host for them.
_WITHOUT_PASS = const(12)
_ANY_RATE = const(0x3FFFFFFF)
_LARGEST = const(4 * 16)
_ALL = const(256)
_THIRD_BYTE = const(MOTORS >> 4)  # 0 if MOTOR_STATUS' bits of all motors fit two bytes


def make_answers(controller):
    """Make the words of answer()."""
    words = array("i", [0] * _WORDS)
    words[_READER] = as_word(addressof(controller.reader._state))
    words[_WRITER] = as_word(addressof(controller.writer._state))
    words[_HEADER] = as_word(addressof(controller.header))
    words[_LIGHTS] = as_word(addressof(controller.io.lights.words))
    words[_BITS] = (1 << controller.axes.count) - 1
    for motor in range(controller.axes.count):
        if controller.axes[motor].own_jerk:
            words[_SMOOTH] |= 1 << motor
    return words


@micropython.viper
def keep_hi(words, frame):
    """Keep the answer to HI, once it cannot change any more. frame: one without an ID."""
    size = ptr8(frame)[8] + 10
    if size <= _LARGEST:
        ptr32(words)[HI_SIZE] = size
        to = ptr8(words)
        i = 0
        while i < size:
            to[4 * _HI + i] = ptr8(frame)[i + 0]
            i += 1


@micropython.viper
def _slow_down(controller, bits: int):
    """Let the motors that a STOP_ALL would stop slow down from the next tick on, as a limit switch
    does in its interrupt: a pass may carry the request out only milliseconds later. bits: for a
    STOP, of its motor; else of all.

    A virtual motion slows down on its line, a JOG_ALL along its path, a motor with a jerk limit
    within that.
    """
    words = ptr32(controller.answers)
    block = controller.safety.block
    operations = controller.operations
    operation = operations.operation
    state = int(operations.state)
    taken = int(operation.bits)
    move = controller.virtuals.move
    virtual = int(move.owned)
    spared = eased = words[_SMOOTH]
    if spared:  # a call takes 10 µs
        spared = eased = int(coupled(block, spared))
    if bits != words[_BITS]:
        bits = int(coupled(block, bits))
        if state > LEAVING and bits & taken:  # before, a STOP concerns one motor
            bits |= int(coupled(block, taken & (virtual ^ -1)))
    if int(controller.interlock.homing) & bits:
        bits |= int(controller.homing.sides())
    if state == RUNNING:
        eased &= taken ^ -1
        spared = eased if operation.at_once else spared | taken
    on_path = 0
    if state == RUNNING and not operation.at_once:
        on_path = taken & bits
    on_line = 0
    if virtual and int(move.state) != TAKING_UP and int(move.state) != SETTLING:
        spared |= virtual
        on_line = virtual & bits
    eased &= bits & (virtual ^ -1)
    if spared:
        bits &= int(coupled(block, spared)) ^ -1
    hal = controller.hal
    irq = hal.irq_off()
    stepper.halt(block, bits, _ANY_RATE, 1)
    hal.irq_on(irq)
    if on_path:
        operation.begin_stop()
    if on_line:
        move.begin_stop()
    if eased:
        controller.axes.begin_stop(eased)


@micropython.viper
def _may_acknowledge(controller) -> int:
    """Return whether an acknowledgement may go out now: nothing comes before it, and no bytes wait
    that came before its request."""
    if controller.operations.rt_end_due:  # it goes out first
        return 0
    if int(controller.openings) != int(controller.port.openings):
        return 0
    words = ptr32(controller.answers)
    state = ptr32(words[_READER])
    if state[NEXT] != state[FILL]:
        return 0
    state = ptr32(words[_WRITER])
    return 1 if state[TAKE] == state[END] else 0


@micropython.viper
def _acknowledge(controller, frames, at: int, place) -> int:
    """Write the acknowledgement OK of the request at frames[at], whose type has the high byte
    _HIGH. Return its size in bytes."""
    f = ptr8(frames)
    to = ptr8(place)
    i = 0
    while i < 8:
        to[i + 0] = f[at + i]
        i += 1
    to[7] = _HIGH | _ACK
    size = 4 if controller.rig.dword_acks else 2
    to[8] = size
    to[9] = 0
    to[10] = OK
    to[11] = 0
    to[12] = 0
    to[13] = 0
    size += m.HEADER_BYTES
    sums = int(check_bytes(int(fletcher16(place, 0, size))))
    to[size + 0] = sums & 0xFF
    to[size + 1] = sums >> 8
    return size + 2


@micropython.viper
def _go(controller, frames, at: int, place) -> int:
    """Carry out the GO at frames[at] and write its acknowledgement, as _carry_out() does.

    What Moves._may_go() checks was found OK before the plan was made, and a request that could have
    changed it since has discarded the plan. So only what changes without a request is looked at.
    """
    operations = controller.operations
    if int(operations.state) != READY or int(operations.early_plan) != PLANNED:
        return 0
    header = controller.header
    state = ptr32(header)
    words = ptr32(controller.safety.words)
    if words[ACTIVE] | words[CAUGHT] or state[stepper.AWAKE_AT] >= 0:
        return 0
    # So that it takes as long from each GO to the motion. Before the checks that take longer, which
    # then take no time of their own.
    hal = controller.hal
    if state[stepper.RUNNING] | state[stepper.CUE_READ_INDEX] - state[stepper.CUE_WRITE_INDEX] == 0:
        hal.align()
    if int(controller.interlock.homing) or int(_may_acknowledge(controller)) == 0:
        return 0
    drivers = controller.drivers
    if drivers and int(drivers.ready) + 1 != 1 << int(controller.axes.count):
        return 0
    if int(fletcher16(frames, at, QUESTION)):
        return 0
    stepper.restore_planned(header, int(operations.hidden))
    block = controller.safety.block
    bits = int(coupled(block, int(operations.operation.bits)))
    irq = hal.irq_off()
    stepper.release(block, bits)
    tick = after(state[stepper.TICKS], 1)
    hal.irq_on(irq)
    operations.gone_at = tick
    operations.state = GONE
    return int(_acknowledge(controller, frames, at, place))


@micropython.viper
def _carry_out(controller, frames, at: int, place) -> int:
    """Store the section, or carry out the GO, at frames[at], and write its acknowledgement. Return
    the size of that in bytes, or 0 if nothing has changed.

    controller: the Controller. frames[at:] has as many bytes as a frame of its length.
    """
    f = ptr8(frames)
    size = f[at + 8] | (f[at + 9] << 8)
    if f[at + 0] != 0x44 or f[at + 1] != 0x46 or f[at + 7] != _HIGH:
        return 0
    if ptr32(controller.answers)[TRACED]:
        return 0
    if f[at + 6] == _GO and size == 0:
        return int(_go(controller, frames, at, place))
    if f[at + 6] != _LOW:
        return 0
    if size > m.LARGEST_PAYLOAD or size < m.RtUploadMoveAxis.positions:
        return 0
    if int(controller.operations.state) != IDLE or int(_may_acknowledge(controller)) == 0:
        return 0
    state = ptr32(ptr32(controller.answers)[_HEADER])
    if state[stepper.SKIP]:
        if elapsed(state[stepper.TICKS], state[stepper.SKIPPED_AT]) > _WITHOUT_PASS:
            state[stepper.SKIP] = 1
            return 0
    if int(fletcher16(frames, at, size + QUESTION)):
        return 0
    motor = f[at + m.HEADER_BYTES + m.RtUploadMoveAxis.motor]
    i = at + m.HEADER_BYTES + m.RtUploadMoveAxis.start_index
    high = f[i + 3]
    size -= m.RtUploadMoveAxis.positions
    if motor == 0 or size & 3 or high & 0x40:
        return 0
    index = f[i + 0] | (f[i + 1] << 8) | (f[i + 2] << 16) | ((high & 0x7F) << 24)
    i = at + m.HEADER_BYTES + m.RtUploadMoveAxis.positions
    store = controller.moves.store
    if int(store.section(motor - 1, index, high & 0x80, frames, i, size >> 2)) != OK:
        return 0
    if state[stepper.SKIP] == 0:
        state[stepper.SKIP] = _SKIPPED + 1
        state[stepper.SKIPPED_AT] = state[stepper.TICKS]
    return int(_acknowledge(controller, frames, at, place))


@micropython.viper
def answer(controller, questions, at: int, place) -> int:
    """Write the answer to the question at questions[at], if it can be given at once. Return its
    size in bytes, or 0, also for a STOP.

    controller: the Controller. questions[at:] has as many bytes as a frame of its length.
    """
    f = ptr8(questions)
    if f[at + 7]:
        return int(_carry_out(controller, questions, at, place))
    to = ptr8(place)
    if f[at + 0] != 0x44 or f[at + 1] != 0x46 or f[at + 9]:
        return 0
    words = controller.answers
    w = ptr32(words)
    kind = f[at + 6]
    size = f[at + 8]
    stopped = -1  # the motor, from 1, or _ALL: whatever waits before that request
    if kind == m.MSG_MOTOR_STOP and size == 1:
        stopped = f[at + 10]
    elif kind == m.MSG_MOTOR_STOP_ALL and size & 3 == 0 and size <= 4:
        stopped = _ALL
    else:
        x = ptr32(w[_READER])
        if size or x[NEXT] != x[FILL]:
            return 0
    first = 0
    second = 0
    i = at
    size += at + QUESTION
    while i < size:
        first += f[i + 0]
        second += first
        i += 1
    if first % 255 | second % 255:
        return 0
    if stopped >= 0:
        size = w[_BITS]
        if stopped != _ALL:
            size &= 1 << (stopped - 1) if stopped and stopped <= MOTORS else 0
        if size:
            _slow_down(controller, size)
        return 0
    x = ptr32(w[_WRITER])
    if x[TAKE] != x[END]:
        return 0
    operations = controller.operations
    state = int(operations.state)
    if state == GONE and kind == m.MSG_MOTOR_GET_POSITION:  # whose time begins in adopt()
        return 0
    if state < READY and operations.rt_end_due:  # it goes out first
        return 0
    if int(controller.openings) != int(controller.port.openings):
        return 0
    moving = 0
    bit = 1
    a = ptr32(w[_HEADER])[stepper.FIRST]
    while a:
        x = ptr32(a)
        a = x[stepper.NEXT]
        if x[stepper.MODE] | x[stepper.PLANNED] | x[stepper.PENDING]:
            moving |= bit
        bit <<= 1
    if state == POSITIONING or state == ENDING:
        if moving & int(operations.operation.bits) == 0:
            return 0  # the next pass goes on to another state
    if kind == m.MSG_MOTOR_STATUS:
        moving |= int(controller.interlock.homing) | int(controller.virtuals.move.owned)
        if state >= RUNNING or state == LEAVING or operations.starts_by_itself:
            moving |= int(operations.operation.bits)
        x = ptr32(w[_LIGHTS])
        to[10] = moving & 0xFF
        to[11] = moving >> 8
        to[12] = 0
        if _THIRD_BYTE:
            to[12] = moving >> 16
        to[13] = 0
        to[14] = 1 if x[RAMPING] else 0
        size = 15
    elif kind == m.MSG_MOTOR_GET_POSITION:
        axes = controller.axes
        reported = axes.reported
        if state == RUNNING:
            operation = operations.operation
            if not operation.at_once:
                return 0
            tick = int(choose(controller.header, axes.samples, reported))
            operations.reported_frame = -1
            time = int(operation.play_head(tick, 0))
            index = int(operations.reported_frame)
            if index >= 0:
                fetch_positions(operations.store, int(operation.bits), index, reported)
        else:
            sent = int(operations.sent)
            if sent and moving & sent == 0:
                return 0  # they have come to rest on a frame
            choose(controller.header, axes.samples, reported)
            time = int(operations.move_time)
        out = ptr32(reported)
        to[10] = time & 0xFF
        to[11] = (time >> 8) & 0xFF
        to[12] = (time >> 16) & 0xFF
        to[13] = (time >> 24) & 0xFF
        row = 0
        size = 14
        while bit > 1:
            bit >>= 1
            load = out[row + 0]
            row += 1
            to[size + 0] = load & 0xFF
            to[size + 1] = (load >> 8) & 0xFF
            to[size + 2] = (load >> 16) & 0xFF
            to[size + 3] = (load >> 24) & 0xFF
            size += 4
    elif kind == m.MSG_HI and w[HI_SIZE]:
        size = w[HI_SIZE]
        hi = ptr8(words)
        i = 10
        while i < size:
            to[i + 0] = hi[4 * _HI + i]
            i += 1
    else:
        return 0
    i = 0
    while i < 8:
        to[i + 0] = f[at + i]
        i += 1
    to[8] = size - 10
    to[9] = 0
    first = 0
    second = 0
    i = 0
    while i < size:
        first += to[i + 0]
        second += first
        i += 1
    second = 255 - (first + second) % 255
    to[size + 0] = second
    to[size + 1] = 255 - (first + second) % 255
    return size + 2
