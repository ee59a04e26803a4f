"""The state machine that every real-time operation goes through, whatever it plays.

                 take()                 all there         go()          queues filled
    IDLE --------------------> POSITIONING -------> READY ----> STARTING ----> RUNNING
     ^                              ^   |             |             |           |   |
     |                              |   | stop()      | stop()      | stop()    |   | its end
     |                              |   v             v             v           |   v
     |       RT_END, all at rest    |  ENDING <-----------------------+---------+  done?
     +------------------------------+---^                                           |
                                    +-------- another pass (a loop) ----------------+

An operation (run.py, shoot.py, jog.py) says where the motors begin and which way each of them goes from
there, queues phases and cues, and says whether another pass follows. JOG_ALL has no GO and no RT_END: it
begins as a further pass does.

When POSITIONING ends, each motor's play has been taken up for the way that it goes (Axis.travel), by a
motion within the motor's limits. So no operation begins with a jump in the motor's own position.

What takes long for eight motors is done for one of them in each pass of the main loop, so that requests are answered
between. What STARTING does is begun in READY already, while all motors stand: then GO only has to release them. Between
two passes nothing of it shows (`stepper.hold`): the motors are at rest. Whatever might make it untrue drops it as a
whole (`retract`), and it is begun anew.
"""

from framestep.clock import WRAP as _WRAP
from framestep.motion import stepper
from framestep.moves.follow import Follower
from framestep.moves.store import READY as UPLOADED
from framestep.native import const, micropython
from framestep.results import (
    ERR_GENERAL,
    ERR_HARD_LOW,
    ERR_HARD_UP,
    ERR_MOVING,
    ERR_NOT_IN_POSITION,
    ERR_RANGE,
    ERR_SOFT_LOW,
    ERR_SOFT_UP,
    OK,
)

# States
IDLE = const(0)
LEAVING = const(1)  # as IDLE, but motors have yet to set out for where they go from there: see set_out()
POSITIONING = const(2)
READY = const(3)
RUNNING = const(4)
ENDING = const(5)  # ramping down
STARTING = const(6)  # the first phases are planned, one motor after the other

# How far that is in READY
_NOT_YET = const(0)  # to be begun once nothing moves
_BEGUN = const(1)
_DONE = const(2)
_IDLE = const(3)  # not to be begun: the motors are not where the operation begins

_QUIET = const(100)  # ticks without a further change after which what is prepared is checked again


class Operation:
    """What a kind of play adds to the state machine."""

    tells_end = True  # RT_END follows

    def __init__(self, stage):
        self.stage = stage
        self.bits = 0  # motors that have a part in it

    def start(self):
        """A pass begins."""

    def lead(self, motor):
        """Queue a motor's first phases; it has been prepared, and stands where `begins` has it."""

    def feed(self):
        """Queue further phases, a frame's at most. Whether there were any."""
        return False

    def started(self, tick):
        """The first segment is taken in this tick."""

    def reached(self, ticks):
        """Whether a frame has been reached that is to be told; ticks: of the pulses now made. Asked in each pass from
        the tick on that `axes.alarm` was set to."""
        return False

    def play_head(self, tick, frame):
        """MOVE TIME when the pulses of a tick have been made, while it runs: thousandths of a scene frame.

        frame: that of the frame reached last instead. Where it is exactly a frame's, that one's index is put in
        `stage.exact`.
        """
        return self.stage.move_time

    def finished(self):
        """Whether everything has been queued and told; the motors may still be moving."""
        return True

    def again(self):
        """Whether another pass follows; if so the stage's `begins` and `ways` are those of that one."""
        return False

    def recheck(self, waiting):
        """Whether it may still be played, with what has been set since it was prepared: a code as its request has.

        waiting: for GO, so the motors have to stand where it would begin now; otherwise the next pass is meant.
        """
        return OK

    def heading(self, motor):
        """Which way a motor goes first: 1 up, -1 down, 0 not at all."""
        return 0

    def wanted(self):
        """Whether the pass that again() has announced is still to come, now that the motors are there."""
        return True

    def land(self, everything):
        """Asked to stop gently, if `everything` by a STOP_ALL. True where it does so on its own, by phases."""
        return False

    def landing(self):
        """Whether a STOP_ALL has made it come to rest in its own way: then the next one is not to be gentle."""
        return False

    def over(self):
        """It has ended, in whatever way; called once or more."""

    def leave(self):
        """It has come to its end, RT_END is due: send the motors on from there."""


@micropython.viper
def _positions(store, bits: int, index: int, out):
    """out[motor] = the uploaded position at frame `index`, for the motors of these bits."""
    motor = 0
    while bits:
        if bits & 1:
            store.positions(motor, index, 1, out, motor)
        bits >>= 1
        motor += 1


class Stage:
    """Runs one operation at a time."""

    def __init__(self, axes, store, safety):
        self.axes = axes
        self.store = store
        self.safety = safety
        self.follower = Follower(axes, store)
        self.state = IDLE
        self.operation = Operation(self)
        self.begins = None  # where the motors of the operation begin, by motor
        self.ways = None  # which way they go from there: 1 up, -1 down, 0 not at all
        self.waiting = 0  # bits of motors still to be sent there, or to get their first phases
        self.early = _NOT_YET
        self.held = 0  # bits of motors that have more to come than has been queued early
        self.changed = False  # something has been set that the operation has to keep: see change()
        self.changed_at = 0  # and when, ticks
        self.move_time = 0  # thousandths of a scene frame, where no operation runs
        self.exact = -1  # index of the frame of which the positions told are
        self.bound = 0  # bits of motors that have been sent to a frame, and that one
        self.bound_to = 0
        self.ended = False  # RT_END is due
        self.unattended = False  # the next pass starts without a GO
        self.forsaken = False  # whoever asked for the operation has gone

    # ---------------------------------------------------------------- what the controller asks

    @property
    def busy(self):
        """An operation is being prepared, waits or runs."""
        return self.state != IDLE

    @property
    def running(self):
        """An operation has begun and not yet ended."""
        return self.state >= RUNNING or self.unattended

    @property
    def engaged(self):
        """Bits of the motors that an operation under way holds, whether they move or pause between two passes."""
        state = self.state
        return self.operation.bits if state >= RUNNING or state == LEAVING or self.unattended else 0

    @property
    def playing(self):
        """Bits of the motors that move by an operation's phases, or stop after them, and not to where it begins."""
        return self.operation.bits if self.state >= RUNNING else 0

    def takes(self, motor):
        """Whether the motor has a part in the operation."""
        return self.operation.bits >> motor & 1

    def go_to_frame(self, frame, places, among=-1):
        """Send all motors to a frame (scene number; spec: MSG_RT_POSITION_FRAME), or those of the bits `among`. A code.

        places: an array of a word per motor to work with. Nothing moves unless it is OK.
        """
        code = self._find(frame, places, among)
        if code == OK:
            self.drop()
            self._travel(self.bound, places)
            self._arrive()
        return code

    def set_out(self, frame, places, among):
        """As go_to_frame() after the end of an operation, but one motor in each pass, all before the next request that
        concerns motors: set_off()."""
        if self._find(frame, places, among) == OK:
            self.begins = places
            self.ways = None
            self.waiting = self.bound
            self.state = LEAVING

    def set_off(self):
        """LEAVING: send those motors now that still wait."""
        while self.waiting:
            self._attend()
        self.state = IDLE

    def _find(self, frame, places, among):
        """Where the motors go to be at a frame, in `places`, and which, in `bound`. A code as go_to_frame()."""
        store = self.store
        if store.state != UPLOADED:
            return ERR_GENERAL
        if frame < store.start or frame > store.end:
            return ERR_RANGE
        axes = self.axes
        bits = self.follower.motors() & among
        for motor in range(axes.count):
            if bits >> motor & 1:
                store.position(motor, frame - store.start, places, motor)
                side = axes[motor].outside(places, motor)
                if side:
                    return ERR_SOFT_UP if side > 0 else ERR_SOFT_LOW
        code = self.barred(bits, places)
        if code == OK:
            self.bound = bits
            self.bound_to = frame
        return code

    def _arrive(self):
        """Where the motors sent to a frame have come to rest, MOVE TIME is that frame, if they are there."""
        bits = self.bound
        if bits and not self.waiting and self.axes.moving_bits() & bits == 0:
            self.bound = 0
            store = self.store
            place = self.follower.place
            if store.state != UPLOADED or not store.start <= self.bound_to <= store.end:
                return
            for motor in range(self.axes.count):
                if bits >> motor & 1 and store.has(motor):
                    store.position(motor, self.bound_to - store.start, place, 0)
                    if not self.axes[motor].stands_on(place, 0):
                        return
            self.move_time = self.bound_to * 1000

    def tell(self, frame):
        """MOVE TIME to be told, with the positions in `axes.told`. frame: that of the frame reached last."""
        tick = self.axes.choose()
        if self.state == RUNNING:
            self.exact = -1
            time = self.operation.play_head(tick, frame)
            if self.exact >= 0:
                _positions(self.store, self.operation.bits, self.exact, self.axes.told)
            return time
        self._arrive()
        return self.move_time

    def barred(self, bits, places):
        """OK, or why one of these motors may not go to places[motor]: it would have to go on into a limit switch."""
        for motor in range(self.axes.count):
            if bits >> motor & 1:
                code = self.safety.bars(motor, places, motor)
                if code != OK:
                    return code
        return OK

    def take(self, operation, begins, ways, frame):
        """Prepare an operation: its motors go to where it begins. frame: the scene's, for reports.

        begins: where, by motor. ways: which way each goes from there, 1 up, -1 down, 0 unknown or not at all.
        """
        self.operation = operation
        self.begins = begins
        self.ways = ways
        self.bound = 0
        self.changed = False
        self._travel(operation.bits, begins, ways)
        self.move_time = frame * 1000
        self.state = POSITIONING
        self.unattended = False
        self.forsaken = False
        self.ended = False

    def may_go(self):
        """OK where an operation waits and every motor stands where it begins; otherwise why not."""
        state = self.state
        if state != READY:
            if state == POSITIONING and not self.unattended:
                return ERR_NOT_IN_POSITION
            return ERR_MOVING if self.running else ERR_GENERAL
        if self.operation.bits & self.follower.excluded:
            return ERR_GENERAL  # a motor has been disabled or put under live control meanwhile
        code = self._recheck(True)
        if code == OK:
            code = self._switches()
        if code == OK and not self._there():
            code = ERR_NOT_IN_POSITION
        return code

    def change(self):
        """A speed, a limit, a motor or its position has been set: before what is prepared begins, and before the next
        pass of a loop, it is checked again (field note 6.12)."""
        if self.state != IDLE:
            self.changed = True
            self.changed_at = self.axes.kernel.state[stepper.TICKS]

    def _recheck(self, waiting):
        if not self.changed:
            return OK
        for motor in range(self.axes.count):
            self.axes[motor].calm()
        code = self.operation.recheck(waiting)
        if code == OK:
            self.changed = False
        return code

    def _switches(self):
        """OK, or why a motor may not set out: it stands in a limit switch, and would go on into it."""
        if self.safety.active:
            for motor in range(self.axes.count):
                if self.operation.bits >> motor & 1:
                    ends = self.safety.ends(motor)
                    way = self.operation.heading(motor) if ends else 0
                    if way > 0 and ends & 1:
                        return ERR_HARD_UP
                    if way < 0 and ends & 2:
                        return ERR_HARD_LOW
        return OK

    def go(self):
        """Start the operation that waits; may_go() has said OK."""
        self.unattended = False
        if self.state == READY and (self.early == _BEGUN or self.early == _DONE):
            stepper.unhold(self.axes.kernel.state, self.held)
            self.state = STARTING
        else:
            self.perform(self.operation)

    def approach(self, operation, begins, ways):
        """Start an operation without a GO, as soon as its motors are where it begins; see take()."""
        self.operation = operation
        self.begins = begins
        self.ways = ways
        self.bound = 0
        self.waiting = operation.bits
        self.unattended = True
        self.forsaken = False
        self.state = POSITIONING

    def perform(self, operation):
        """Start an operation from where the motors are."""
        self.operation = operation
        self.state = STARTING
        self.waiting = operation.bits
        operation.start()

    def _release(self):
        """All motors start in the same tick."""
        self.state = RUNNING
        axes = self.axes
        kernel = axes.kernel.state
        irq = axes.hal.irq_off()
        tick = (kernel[stepper.TICKS] + 1) & _WRAP
        axes.release(self.operation.bits)
        axes.hal.irq_on(irq)
        # the pulses come LEAD ticks after the tick that queues them
        self.operation.started((tick + kernel[stepper.LEAD]) & _WRAP)

    @property
    def landing(self):
        """A STOP_ALL has been answered by coming to rest on a frame, and that goes on (field note 6.10)."""
        return self.state == RUNNING and self.operation.landing()

    def stop(self, factor=1, land=False, everything=False, smooth=False, spared=0):
        """Ramp down whatever this moves; RT_END follows once all stand.

        land: an operation that can may come to rest in its own way, on a frame. Returns the bits of
        the motors that do, and are not to be stopped otherwise. everything: by a STOP_ALL. smooth, or
        land: motors on their way to where it begins keep their jerk limits. (In a run they do not: the
        path has none, and it may end at a soft limit.) spared: bits of motors that a virtual motion
        has, which it took while the operation waited: they are for that to stop.
        """
        if self.state == LEAVING:
            self.waiting = 0
            self.state = IDLE  # the motors that have set out are stopped as any others
        if self.state == IDLE:
            return 0
        self.operation.bits &= ~spared
        if land and self.state == RUNNING and self.operation.land(everything):
            return self.operation.bits
        self.move_time = self.tell(False)
        smooth = (smooth or land) and self.state != RUNNING
        for motor in range(self.axes.count):
            if self.operation.bits >> motor & 1:
                self.axes[motor].stop(self.axes.hal, factor, smooth)
        self.operation.over()
        self.unattended = False
        self.waiting = 0
        self.state = ENDING
        return 0

    def leave(self, smooth, spared):
        """The host has gone: as stop(), but the next host is not told of an end that it knows nothing of."""
        self.stop(1, False, False, smooth, spared)
        self.drop()
        self.forsaken = True
        self.ended = False

    def retract(self):
        """In READY: drop what has been planned early, since it may no longer hold."""
        if self.early == _BEGUN or self.early == _DONE:
            self.axes.discard(self.operation.bits)
            self.waiting = self.held = 0
        self.early = _NOT_YET

    def drop(self):
        """Forget an operation that is prepared but has not begun."""
        if self.state == READY:
            self.retract()
        if self.state == READY or self.state == POSITIONING:
            self.state = IDLE
            self.unattended = False

    def reached(self):
        """While it runs, in each pass with an alarm: whether a frame has been reached that is to be told."""
        return self.operation.reached(self.axes.kernel.state[stepper.TICKS])

    def poll(self):
        """Every few milliseconds: plan ahead, and go on where something has ended.

        Whether it has planned, and so there may be more to plan at once.
        """
        state = self.state
        if state == IDLE:
            return False
        if state == READY:
            return self._plan_early()
        if state == RUNNING:
            operation = self.operation
            if operation.feed():
                return True
            if operation.finished() and not self.moving():
                if operation.again() and self._recheck(False) == OK:
                    self.approach(operation, self.begins, self.ways)
                    return True
                self._close()
            return False
        if self.waiting:
            self._attend()
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
        if self.moving():
            return False
        if state == ENDING:
            self._end()
        elif self.unattended:
            if self.operation.wanted():
                if not self.changed:
                    self.go()
                    return True
                if self._recheck(False) == OK:
                    self.approach(self.operation, self.begins, self.ways)  # which may be elsewhere now
                    return True
            self._close()
        else:
            self.early = _NOT_YET
            self.state = READY
            return True
        return False

    # ---------------------------------------------------------------- within

    def moving(self):
        """Whether a motor of the operation moves."""
        return self.axes.moving_bits() & self.operation.bits != 0

    def _there(self):
        for motor in range(self.axes.count):
            if self.operation.bits >> motor & 1 and not self.axes[motor].stands_on(
                self.begins, motor, self.ways[motor]
            ):
                return False
        return True

    def _plan_early(self):
        """In READY: a piece of what STARTING would do. Whether there may be more."""
        axes = self.axes
        if self.early == _NOT_YET:
            if axes.moving:
                return False
            if self.changed and (axes.kernel.state[stepper.TICKS] - self.changed_at) & _WRAP < _QUIET:
                return False
            if self.may_go() != OK:
                self.early = _IDLE
                return False
            self.early = _BEGUN
            self.held = 0
            self.waiting = self.operation.bits
            self.operation.start()
        elif self.early != _BEGUN:
            return False
        stepper.unhold(axes.kernel.state, self.held)
        if self.waiting:
            self._attend()
        elif not self.operation.feed() and not axes.feed():
            self.early = _DONE
        self.held = stepper.hold(axes.kernel.state)
        return self.early == _BEGUN

    def _attend(self):
        """See to the next of the motors that wait."""
        motor = 0
        while not self.waiting >> motor & 1:
            motor += 1
        self.waiting ^= 1 << motor
        if self.state == STARTING or self.state == READY:
            self.follower.begin(motor)
            self.operation.lead(motor)
        else:
            self._send(motor, self.begins, self.ways)

    def _travel(self, bits, places, ways=None):
        for motor in range(self.axes.count):
            if bits >> motor & 1:
                self._send(motor, places, ways)

    def _send(self, motor, places, ways):
        self.axes[motor].travel(self.axes.hal, places, motor, 10000, ways[motor] if ways else 0)

    def _close(self):
        """The operation has come to its end by itself."""
        self.operation.over()
        self._end()
        self.operation.leave()

    def _end(self):
        self.state = IDLE
        self.unattended = False
        if self.operation.tells_end and not self.forsaken:
            self.ended = True
