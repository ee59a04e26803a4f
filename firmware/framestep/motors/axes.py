"""All motors of the controller: filling their queues, and their positions at one moment."""

from array import array

from framestep.base.clock import after, reached
from framestep.base.native import const, micropython
from framestep.motors.axis import MOST_SEGMENTS, UNLIMITED, Axis
from framestep.motors.backlash import BACKLASH
from framestep.motors.feeder import coupled, emptiest_queue
from framestep.motors.positions import Positions
from framestep.motors.queue_cut import queued
from framestep.motors.samples import ALARM, choose, make_samples, renumber
from framestep.pulse import stepper

AHEAD = const(11)  # segments to keep queued
LOW = const(5)  # the queue of a moving motor with fewer segments is filled in every pass
_PIECE = const(4)  # work of one pass, in segments
_CALL = const(2)  # work of beginning with a motor, in segments


class Axes:
    """All motors of the controller.

    The pins are behind the kernel: the pulses of a tick come BEHIND ticks later. So the
    reported positions come from samples taken some ticks ago, whose pulses have all been made.
    """

    def __init__(self, hal):
        self.hal = hal
        self.kernel = hal.kernel
        self.count = hal.kernel.motors
        self.positions = Positions(self.count)
        self.axes = [Axis(hal.kernel, i, self.positions) for i in range(self.count)]
        self.pending = False  # motors in motion have settings that wait: see apply_pending()
        self.with_backlash = []
        self.released = 0  # servos whose pulses end when something goes wrong, one bit each
        self.samples = make_samples(self.count)  # each pass of the main loop adds one
        self.reported = array(
            "i", [0] * self.count
        )  # positions of the loads by the pulses made so far: see choose_sample()

    def __getitem__(self, motor):
        return self.axes[motor]

    def set_servos(self, rig):
        """Set up the motors that are servos in the rig file. To be called at the start."""
        for motor in range(self.count):
            servo = rig.motor(motor)["servo"]
            if servo:
                self[motor].set_ends(servo["low"], servo["high"])
                if servo["on_stop"] == "release":
                    self.released |= 1 << motor
        self.positions.set_servos(rig.servos)

    def set_speed(self, motor, velocity, acceleration):
        """Set a motor's velocity and acceleration: see Axis.set_speed()."""
        self[motor].set_speed(velocity, acceleration)
        self.pending = True

    def apply_pending(self):
        """Apply settings that have waited until their motor is at rest. To be called in each pass
        while `pending`, before anything else.

        Until then the motor counts as moving, so whatever begins by itself finds them in force.
        """
        self.pending = False
        for axis in self.axes:
            if not axis.apply_pending():
                self.pending = True

    def set_backlash(self, motor, steps):
        """Set a motor's backlash: see Axis.set_backlash()."""
        self[motor].set_backlash(steps)
        self.with_backlash = [axis.backlash for axis in self.axes if axis.backlash[BACKLASH]]

    def feed(self, urgent=False):
        """Fill the queue of the motor with the fewest segments, if it has fewer than AHEAD.

        If that was little work, fill the next one as well. A pass of the main loop does only a
        piece of the work, so that requests are answered in between. But it may be the only pass for
        a long time, so it leaves no moving motor with fewer than LOW, and after its piece fills
        queues only so far. urgent: fill only such ones.

        Return whether there may be more to do.
        """
        state = self.kernel.state
        left = _PIECE
        more = True
        while True:
            low = found = emptiest_queue(state, LOW, stepper.RUN)
            if not found:
                if left <= 0:
                    break
                if not urgent:
                    found = emptiest_queue(state, AHEAD, 0)
                if not found:
                    more = False
                    break
            axis = self.axes[(found >> 5) - 1]
            if low and axis.block[stepper.MODE] == stepper.RUN:
                state[stepper.SHALLOWEST] = queued(axis.block, 1, state[stepper.SHALLOWEST])
            tail = axis.block[stepper.WRITE_INDEX]
            most = min((found & 31) + AHEAD, MOST_SEGMENTS) if left > 0 else LOW
            axis.feed(most, UNLIMITED, self.hal.port)
            # modulo, as a stop that comes meanwhile may cut the queue off (begin_stop)
            left -= ((axis.block[stepper.WRITE_INDEX] - tail) & 31) + _CALL
        for backlash in self.with_backlash:
            backlash.refresh()
        bits = stepper.awaiting_target(state)
        if not bits or stepper.waking(state):
            return more
        motor = 0
        while not bits & 1:
            bits >>= 1
            motor += 1
        self.axes[motor].resume_target(self.hal)
        return True

    @property
    def filled(self):
        """Whether every queue has AHEAD segments, or all segments of its phases, and all drivers
        are awake: motors may start."""
        state = self.kernel.state
        return emptiest_queue(state, AHEAD, 0) == 0 and not stepper.waking(state)

    def wake(self, ms):
        """Let no motor at rest start for so long, because drivers have been switched on."""
        state = self.kernel.state
        tick = after(state[stepper.TICKS], ms + 1)
        if not stepper.waking(state) or reached(tick, state[stepper.AWAKE_AT]):
            state[stepper.AWAKE_AT] = tick

    def choose_sample(self):
        """Set `reported` to the loads' positions after the pulses made so far.

        Return the tick (modulo 2^29) of the last of these pulses.
        """
        return choose(self.kernel.state, self.samples, self.reported)

    def alarm(self, tick):
        """Make sample() return 1 once this tick (modulo 2^29) is over; -1: no longer."""
        self.samples[ALARM] = tick

    def position_was_set(self, motor):
        """Correct the samples: the position of a motor at rest has been set."""
        renumber(self.samples, motor, self.axes[motor].backlash)

    def moving_bits(self):
        """Return one bit for each motor that moves."""
        return stepper.moving(self.kernel.state)

    @property
    def moving(self):
        """Whether any motor moves."""
        return stepper.moving(self.kernel.state) != 0

    def release(self, bits):
        """Start the motors of these bits, all in the next tick. Return that tick."""
        kernel = self.kernel
        bits = coupled(kernel.blocks[0], bits)
        irq = self.hal.irq_off()
        stepper.release(kernel.blocks[0], bits)
        tick = after(kernel.state[stepper.TICKS], 1)
        self.hal.irq_on(irq)
        return tick

    def discard(self, bits):
        """Drop the queued segments of these motors, which must be at rest."""
        bits = coupled(self.kernel.blocks[0], bits)
        irq = self.hal.irq_off()
        stepper.discard(self.kernel.state, bits)
        self.hal.irq_on(irq)

    @micropython.viper
    def begin_stop(self, bits: int):
        """Let these motors slow down within their jerk limits; see Axis.begin_stop()."""
        i = 0
        while bits:
            if bits & 1:
                axis = self.axes[i]
                if not axis.leader:
                    axis.begin_stop(self.hal)
            bits >>= 1
            i += 1

    def stop(self, factor=1, spared=0, smooth=False):
        """Ramp down all motors except those of the bits `spared` and their partners; see
        Axis.stop()."""
        for i in range(self.count):
            axis = self.axes[i]
            if axis.moving and not axis.leader and not (spared >> i) & 1:
                axis.stop(self.hal, factor, smooth)
