"""All motors of the controller: their queues filled, their positions of one moment."""

from array import array

from framestep.base.clock import after
from framestep.base.native import const
from framestep.motors.axis import MOST_SEGMENTS, Axis
from framestep.motors.backlash import BACKLASH
from framestep.motors.feeder import ALL_BITS, coupled, neediest
from framestep.motors.positions import Positions
from framestep.motors.samples import ALARM, choose, make_samples, renumber
from framestep.pulse import stepper

AHEAD = const(11)  # segments to keep queued
LOW = const(5)  # the queue of a moving motor with fewer is filled in any pass
_PIECE = const(4)  # a pass cuts segments until this is used up: a segment counts one,
_CALL = const(2)  # and to begin with a motor takes as long as so many


class Axes:
    """All motors of the controller.

    The pins are behind the kernel: what it queues in a tick is pulsed BEHIND ticks later. So the
    positions reported come from samples taken some ticks ago: of pulses that have been made, all at
    the same time.
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
        self.samples = make_samples(self.count)  # each pass of the main loop begins with another
        self.reported = array(
            "i", [0] * self.count
        )  # where the loads are by the pulses made until then: see choose_sample()

    def __getitem__(self, motor):
        return self.axes[motor]

    def set_servos(self, rig):
        """Make servos of the motors that the rig file says are some. At the start."""
        for motor in range(self.count):
            servo = rig.motor(motor)["servo"]
            if servo:
                self[motor].set_ends(servo["low"], servo["high"])
                if servo["on_stop"] == "release":
                    self.released |= 1 << motor
        self.positions.set_servos(rig.servos)

    def set_speed(self, motor, velocity, acceleration):
        """As Motor.set_speed()."""
        self[motor].set_speed(velocity, acceleration)
        self.pending = True

    def apply_pending(self):
        """In each pass while `pending`, before anything else: settings come into force that have
        waited until their motor is at rest.

        Until then the motor counts as moving, so whatever begins by itself finds them in force.
        """
        self.pending = False
        for axis in self.axes:
            if not axis.apply_pending():
                self.pending = True

    def set_backlash(self, motor, steps):
        """As Axis.set_backlash()."""
        self[motor].set_backlash(steps)
        self.with_backlash = [axis.backlash for axis in self.axes if axis.backlash[BACKLASH]]

    def feed(self, urgent=False):
        """Fill the queue of the motor with the fewest segments, if it has fewer than AHEAD.

        If that was little work, do the next one as well. A pass of the main loop does only a piece
        of the work, so that requests are answered in between. But it may be the only pass for a
        long time, so it leaves no moving motor with fewer than LOW. urgent: fill only such ones.

        Returns whether there may be more to do.
        """
        state = self.kernel.state
        left = _PIECE
        more = True
        while True:
            found = neediest(state, LOW, stepper.RUN)
            if not found:
                if left <= 0:
                    break
                if not urgent:
                    found = neediest(state, AHEAD, 0)
                if not found:
                    more = False
                    break
            axis = self.axes[(found >> 5) - 1]
            tail = axis.block[stepper.WRITE_INDEX]
            axis.feed(min((found & 31) + AHEAD, MOST_SEGMENTS))
            left -= ((axis.block[stepper.WRITE_INDEX] - tail) & ALL_BITS) + _CALL
        for backlash in self.with_backlash:
            backlash.refresh()
        bits = stepper.awaiting_target(self.kernel.state)
        if not bits:
            return more
        motor = 0
        while not bits & 1:
            bits >>= 1
            motor += 1
        self.axes[motor].resume_target(self.hal)
        return True

    @property
    def filled(self):
        """Whether every queue has AHEAD segments, or all that there is to cut."""
        return neediest(self.kernel.state, AHEAD, 0) == 0

    def choose_sample(self):
        """Set `reported` to where the pulses made so far have taken the loads.

        Returns the tick (modulo 2^29) whose pulses were the last of them.
        """
        return choose(self.kernel.state, self.samples, self.reported)

    def alarm(self, tick):
        """Make sample() say so once this tick (modulo 2^29) is over; -1: no longer."""
        self.samples[ALARM] = tick

    def position_was_set(self, motor):
        """The position of a motor at rest has been set."""
        renumber(self.samples, motor, self.axes[motor].backlash)

    def moving_bits(self):
        """The motors that move, one bit each."""
        return stepper.moving(self.kernel.state)

    @property
    def moving(self):
        """Whether any motor moves."""
        return stepper.moving(self.kernel.state) != 0

    def release(self, bits):
        """Start the motors of these bits, all in the next tick, which is returned."""
        kernel = self.kernel
        bits = coupled(kernel.blocks[0], bits)
        irq = self.hal.irq_off()
        stepper.release(kernel.blocks[0], bits)
        tick = after(kernel.state[stepper.TICKS], 1)
        self.hal.irq_on(irq)
        return tick

    def discard(self, bits):
        """Drop what has been queued for the motors of these bits, which are at rest."""
        bits = coupled(self.kernel.blocks[0], bits)
        irq = self.hal.irq_off()
        stepper.discard(self.kernel.state, bits)
        self.hal.irq_on(irq)

    def stop(self, factor=1, spared=0, smooth=False):
        """Ramp all motors down but those of the bits `spared` and their partners; see
        Axis.stop()."""
        for i in range(self.count):
            axis = self.axes[i]
            if axis.moving and not axis.leader and not (spared >> i) & 1:
                axis.stop(self.hal, factor, smooth)
