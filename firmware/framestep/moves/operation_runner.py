"""State machine of all real-time operations.

                 prepare()              all there        start()        queues filled
    IDLE --------------------> POSITIONING -------> READY ----> STARTING ----> RUNNING
     ^                              ^   |             |             |           |   |
     |                              |   | stop()      | stop()      | stop()    |   | its end
     |                              |   v             v             v           |   v
     |       RT_END, all at rest    |  ENDING <-----------------------+---------+  done?
     +------------------------------+---^                                           |
                                    +-------- another lap (a loop) -----------------+

An operation (operation.py; its kinds are run.py, shoot.py and jog.py) defines where the motors
begin and in which direction each starts, queues phases and cues, and decides whether another lap
follows. JOG_ALL has no GO and no RT_END: it begins like a further lap.

When POSITIONING ends, each motor's backlash has been taken up for the direction in which it sets
out (Axis.move_to), by a motion within the motor's limits. So no operation begins with a sudden jump
of a motor.

All this is in one file because each state depends on what the others leave behind.

Work that takes long for eight motors is done for one motor in each pass of the main loop, so that
requests are answered in between. The plan of STARTING is already made in READY, while all motors
are at rest, so that GO only has to release them. Between two laps this early plan is hidden
(`stepper.hide_planned`), so the motors count as at rest. A request that might invalidate it
discards it as a whole (discard_early_plan()), and it is made again once nothing moves.
"""

from framestep.base.clock import after, elapsed
from framestep.base.native import const, micropython
from framestep.base.results import ERR_GENERAL, ERR_MOVING, ERR_NOT_IN_POSITION, OK
from framestep.moves.frame_positions import (
    all_at,
    all_on_frame,
    find_positions,
    find_switch_ahead,
)
from framestep.moves.operation import Operation
from framestep.moves.path.move_check import MoveCheck
from framestep.moves.path.player import UploadPlayer
from framestep.moves.upload.store import READY as UPLOADED
from framestep.pulse import stepper

# States
IDLE = const(0)
# like IDLE, but motors have yet to start for the end frame: see return_to_frame()
LEAVING = const(1)
POSITIONING = const(2)
READY = const(3)
RUNNING = const(4)
ENDING = const(5)  # ramping down
STARTING = const(6)  # the first phases are planned, one motor after the other
GONE = const(7)  # answers.py has started the motors: see adopt()

# State of the early plan, in READY
_NOT_YET = const(0)  # make it once nothing moves
_BEGUN = const(1)
PLANNED = const(2)
_IDLE = const(3)  # it is not made: the motors are not where the operation begins

# ticks after the last change of a setting before a prepared operation is checked again
_QUIET = const(100)


@micropython.viper
def fetch_positions(store, bits: int, index: int, out):
    """out[motor] = the uploaded position at frame `index`, for each motor in `bits`."""
    motor = 0
    while bits:
        if bits & 1:
            store.positions(motor, index, 1, out, motor)
        bits >>= 1
        motor += 1


class OperationRunner:
    """Runs one operation at a time.

    announce: Interlock.prepare, called with the bits of motors before they are sent somewhere.
    strict: setting `strict_moves`.
    """

    def __init__(self, axes, store, safety, announce=None, strict=False):
        self.axes = axes
        self.store = store
        self.safety = safety
        self.player = UploadPlayer(axes, store)
        self.move_check = MoveCheck(self.player, strict)
        self.exceeded = self.move_check.exceeded  # the limit that the last move exceeded
        self.state = IDLE
        self.announce = announce
        self.operation = Operation(self)
        self.start_positions = None  # for each motor: where the operation begins
        # for each motor: direction in which it starts, 1 up, -1 down, 0 unknown or not at all
        self.directions = None
        self.remaining = 0  # bits of motors yet to be sent there, or to get first phases
        self.unseen = 0  # in LEAVING: bits of those for which it is not yet known whether they may
        self.early_plan = _NOT_YET
        self.hidden = 0  # bits of motors that need more queued than the early plan has
        self.gone_at = 0  # in GONE: the tick in which the motors start, modulo 2^29
        # a setting that concerns the operation has changed: see settings_changed()
        self.changed = False
        self.changed_at = 0  # tick of that
        self.move_time = 0  # MOVE TIME while no operation runs, thousandths of a scene frame
        # index of the frame whose positions are reported, -1: report those of the pins
        self.reported_frame = -1
        self.sent = 0  # bits of motors sent to the frame `sent_frame`
        self.sent_frame = 0
        self.rt_end_due = False
        self.starts_by_itself = False  # the next lap starts without a GO
        self.host_gone = False  # the host that requested the operation

    # ---------------------------------------------------------------- for the controller

    @property
    def busy(self):
        """Whether an operation is prepared, waits or runs."""
        return self.state != IDLE

    @property
    def running(self):
        """Whether an operation has begun and has not ended."""
        return self.state >= RUNNING or self.starts_by_itself

    @property
    def bits(self):
        """Bits of the motors of the operation that is prepared, waits or runs."""
        return self.operation.bits if self.state != IDLE else 0

    @property
    def owned(self):
        """Bits of the motors of a running operation, whether they move or pause between two
        laps."""
        state = self.state
        return (
            self.operation.bits
            if state >= RUNNING or state == LEAVING or self.starts_by_itself
            else 0
        )

    @property
    def on_path(self):
        """Bits of the motors that follow phases, or stop from them, but not on their way there."""
        return self.operation.bits if self.state >= RUNNING else 0

    def send_to_frame(self, frame, positions, among=-1):
        """Move motors, of the bits `among`, to a scene frame (spec: MSG_RT_POSITION_FRAME).

        positions: scratch, an array('i') with a word for each motor. Return a code; nothing moves
        unless it is OK.
        """
        code = self._note_target(frame, positions, among)
        if code == OK:
            self.drop_prepared()
            self._send_all(self.sent, positions)
            self._note_arrival()
        return code

    def return_to_frame(self, frame, positions, among):
        """Move motors to a frame after an operation: like send_to_frame(), but each pass looks at
        one motor, and then sends one.

        The next request that concerns motors sends the rest at once: send_waiting().
        """
        self.sent_frame = frame
        self.start_positions = positions
        self.directions = None
        self.remaining = self.unseen = among
        self.state = LEAVING

    def _look_ahead(self):
        """In LEAVING: find where the next motor goes. If one may not, all stay."""
        bit = self.unseen & -self.unseen
        self.unseen ^= bit
        code = find_positions(self.player, self.safety, self.sent_frame, bit, self.start_positions)
        if code != OK:
            self.remaining = self.unseen = 0
        elif not self.unseen:
            self.remaining &= self.player.motors()
            self.sent = self.remaining

    def send_waiting(self):
        """In LEAVING: send the motors that still wait at once."""
        while self.unseen:
            self._look_ahead()
        while self.remaining:
            self._next_motor()
        self.state = IDLE

    def _note_target(self, frame, positions, among):
        """Note to which frame the motors go; like send_to_frame()."""
        code = find_positions(self.player, self.safety, frame, among, positions)
        if code == OK:
            self.sent = self.player.motors() & among
            self.sent_frame = frame
        return code

    def _note_arrival(self):
        """Set MOVE TIME to the frame if the motors sent there have come to rest on it."""
        bits = self.sent
        if bits and not self.remaining and self.axes.moving_bits() & bits == 0:
            self.sent = 0
            store = self.store
            if store.state != UPLOADED or not store.start <= self.sent_frame <= store.end:
                return
            if all_on_frame(self.player, bits, self.sent_frame - store.start):
                self.move_time = self.sent_frame * 1000

    def sample_move_time(self, frame):
        """Return MOVE TIME to report together with the positions in `axes.reported`.

        frame: report the frame reached last.
        """
        if self.state != RUNNING:
            self._note_arrival()  # before the sample: they may come to rest after it
        tick = self.axes.choose_sample()
        if self.state == RUNNING:
            self.reported_frame = -1
            time = self.operation.play_head(tick, frame)
            if self.reported_frame >= 0:
                self.axes.hal.port.look_for_stop()
                fetch_positions(
                    self.store, self.operation.bits, self.reported_frame, self.axes.reported
                )
                self.axes.hal.port.look_for_stop()
            return time
        return self.move_time

    def prepare(self, operation, begins, directions, frame):
        """Prepare an operation: move its motors to where it begins.

        frame: scene frame to report as MOVE TIME. begins: positions by motor. directions: in which
        each motor starts, 1 up, -1 down, 0 unknown or not at all.
        """
        self.operation = operation
        self.start_positions = begins
        self.directions = directions
        self.sent = 0
        self.changed = False
        self._send_all(operation.bits, begins, directions)
        self.move_time = frame * 1000
        self.state = POSITIONING
        self.starts_by_itself = False
        self.host_gone = False
        self.rt_end_due = False

    def may_go(self, virtual=0):
        """Return OK if an operation waits and all motors are where it begins; else the reason.

        virtual: bits of motors in a virtual motion, which are about to leave.
        """
        state = self.state
        if state != READY:
            if state == POSITIONING and not self.starts_by_itself:
                return ERR_NOT_IN_POSITION
            return ERR_MOVING if self.running else ERR_GENERAL
        if self.operation.bits & self.player.excluded:
            return ERR_GENERAL  # a motor has since been disabled or put under live control
        code = self._recheck(True)
        if code == OK:
            code = find_switch_ahead(self.player, self.safety, self.operation)
        bits = self.operation.bits
        if code == OK and (
            bits & virtual or not all_at(self.axes, bits, self.start_positions, self.directions)
        ):
            code = ERR_NOT_IN_POSITION
        return code

    def settings_changed(self):
        """Note that a speed, a limit, a motor's flags or its position has been set (field note
        6.12).

        A prepared operation is checked again before it begins, a loop before its next lap.
        """
        if self.state != IDLE:
            self.changed = True
            self.changed_at = self.axes.kernel.state[stepper.TICKS]

    def _recheck(self, waiting):
        if not self.changed:
            return OK
        code = self.operation.recheck(waiting)
        if code == OK:
            self.changed = False
        return code

    def start(self):
        """Start the waiting operation, after may_go() has returned OK."""
        self.starts_by_itself = False
        if self.state == READY and (self.early_plan == _BEGUN or self.early_plan == PLANNED):
            stepper.restore_planned(self.axes.kernel.state, self.hidden)
            self.state = STARTING
            if self.early_plan == PLANNED and not stepper.waking(self.axes.kernel.state):
                self._release()  # what else is due in this pass could make it a tick later
        else:
            self._start_from_here(self.operation)

    def approach(self, operation, begins, directions):
        """Start an operation without a GO as soon as its motors are where it begins.

        The parameters are those of prepare().
        """
        self.operation = operation
        self.start_positions = begins
        self.directions = directions
        self.sent = 0
        self.remaining = operation.bits
        self.starts_by_itself = True
        self.host_gone = False
        self.state = POSITIONING

    def _start_from_here(self, operation):
        """Start an operation from where the motors are."""
        self.operation = operation
        self.state = STARTING
        self.remaining = operation.bits
        operation.begin_lap()

    def _release(self):
        """Release all motors, so that they start in the same tick."""
        self.gone_at = self.axes.release(self.operation.bits)
        self.adopt()

    def adopt(self):
        """In GONE, in the next pass: go on with the operation whose motors start, or have started,
        in the tick `gone_at`."""
        self.state = RUNNING
        # the pulses come LEAD ticks after the tick that queues them
        self.operation.started(after(self.gone_at, self.axes.kernel.state[stepper.LEAD]))

    @property
    def stopping_on_frame(self):
        """Whether it is still coming to rest on a frame after a STOP_ALL (field note 6.10)."""
        return self.state == RUNNING and self.operation.stopping_on_frame()

    def stop(self, factor=1, land=False, everything=False, smooth=False, spared=0):
        """Stop the operation's motors by ramps; RT_END follows once all are at rest.

        factor: of the deceleration. land: an operation that can do so may come to rest on a frame
        instead. Return the bits of these motors, which nobody else may stop then, or 0. everything:
        for a STOP_ALL. smooth, or land: motors on their way to the start keep their jerk limits.
        (In a run they do not: the path has no jerk limit, and it may end at a soft limit.) spared:
        bits of motors that a virtual motion took while the operation waited, and that it will stop.
        """
        if self.state == GONE:
            self.adopt()
        if self.state == LEAVING:
            self.remaining = self.unseen = 0
            self.state = IDLE  # the motors that have started are stopped like any others
        if self.state == IDLE:
            return 0
        self.operation.bits &= ~spared
        if land and self.state == RUNNING and self.operation.stop_on_frame(everything):
            return self.operation.bits
        self.move_time = self.sample_move_time(False)
        running = self.state == RUNNING
        smooth = (smooth or land) and not running
        for motor in range(self.axes.count):
            if (self.operation.bits >> motor) & 1:
                self.axes[motor].stop(self.axes.hal, factor, smooth, running)
        self.operation.ended()
        self.starts_by_itself = False
        self.remaining = 0
        self.state = ENDING
        return 0

    def host_lost(self, smooth, spared):
        """Stop after the host has gone: like stop(), but without RT_END, which would mean nothing
        to the next host."""
        self.stop(1, False, False, smooth, spared)
        self.drop_prepared()
        self.host_gone = True
        self.rt_end_due = False

    def discard_early_plan(self):
        """In READY: discard the early plan, as it may no longer be right."""
        if self.early_plan == _BEGUN or self.early_plan == PLANNED:
            self.axes.discard(self.operation.bits)
            self.remaining = self.hidden = 0
        self.early_plan = _NOT_YET

    def drop_prepared(self):
        """Drop an operation that is prepared but has not begun."""
        if self.state == READY:
            self.discard_early_plan()
        if self.state == READY or self.state == POSITIONING:
            self.state = IDLE
            self.starts_by_itself = False

    def end_reported(self):
        """Note that RT_END, which was due, is being reported."""
        self.rt_end_due = False

    def reached(self):
        """Return whether a frame to be reported has been reached; in each pass with an alarm."""
        return self.operation.frame_reached(self.axes.kernel.state[stepper.TICKS])

    def poll(self):
        """Plan ahead, and go on to the next state. To be called every few milliseconds.

        Return whether it has planned, so that there may be more to plan at once.
        """
        state = self.state
        if state == IDLE:
            return False
        if state == READY:
            return self._plan_early()
        if state == GONE:
            self.adopt()
            return True
        if state == RUNNING:
            operation = self.operation
            if operation.feed():
                return True
            if operation.finished() and not self.moving():
                if operation.next_lap() and self._recheck(False) == OK:
                    self.approach(operation, self.start_positions, self.directions)
                    return True
                self._close()
            return False
        if self.unseen:
            self._look_ahead()
            return True
        if self.remaining:
            self._next_motor()
            return True
        if state == LEAVING:
            self.state = IDLE
            return False
        if state == STARTING:
            if self.operation.feed():
                return True
            if self.axes.filled:
                self._release()
            return False
        if self.moving() or state == POSITIONING and stepper.waking(self.axes.kernel.state):
            return False
        if state == ENDING:
            self._end()
        elif self.starts_by_itself:
            if self.operation.still_wanted():
                if not self.changed:
                    self.start()
                    return True
                if self._recheck(False) == OK:
                    # the beginning may be elsewhere now
                    self.approach(self.operation, self.start_positions, self.directions)
                    return True
            self._close()
        else:
            self.early_plan = _NOT_YET
            self.state = READY
            return True
        return False

    # ---------------------------------------------------------------- internal

    def moving(self):
        """Return whether a motor of the operation moves."""
        return self.axes.moving_bits() & self.operation.bits != 0

    def _plan_early(self):
        """In READY: do a piece of the planning of STARTING. Return whether there may be more."""
        axes = self.axes
        if self.early_plan == _NOT_YET:
            if axes.moving:
                return False
            if self.changed and elapsed(axes.kernel.state[stepper.TICKS], self.changed_at) < _QUIET:
                return False
            if self.may_go() != OK:
                self.early_plan = _IDLE
                return False
            self.early_plan = _BEGUN
            self.hidden = 0
            self.remaining = self.operation.bits
            self.operation.begin_lap()
        elif self.early_plan != _BEGUN:
            return False
        stepper.restore_planned(axes.kernel.state, self.hidden)
        if self.remaining:
            self._next_motor()
        elif not self.operation.feed() and not axes.feed():
            self.early_plan = PLANNED
        self.hidden = stepper.hide_planned(axes.kernel.state)
        return self.early_plan == _BEGUN

    def _next_motor(self):
        """Send the next waiting motor, or plan its first phases."""
        motor = 0
        while not (self.remaining >> motor) & 1:
            motor += 1
        self.remaining ^= 1 << motor
        if self.state == STARTING or self.state == READY:
            self.player.prepare_motor(motor)
            self.operation.queue_first_phases(motor)
        else:
            self._send(motor, self.start_positions, self.directions)

    def _send_all(self, bits, positions, directions=None):
        self.axes.hal.port.look_for_stop()
        if self.announce:
            self.announce(bits)
        for motor in range(self.axes.count):
            if (bits >> motor) & 1:
                self._send(motor, positions, directions)

    def _send(self, motor, positions, directions):
        self.axes[motor].move_to(
            self.axes.hal, positions, motor, 10000, directions[motor] if directions else 0
        )

    def _close(self):
        """End an operation that has run to its end."""
        self.operation.ended()
        self._end()
        self.operation.leave_end()

    def _end(self):
        self.state = IDLE
        self.starts_by_itself = False
        if self.operation.sends_rt_end and not self.host_gone:
            self.rt_end_due = True
