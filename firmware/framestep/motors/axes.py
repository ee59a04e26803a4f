"""All motors of the controller: their queues filled, their positions of one moment."""

from array import array

from framestep.motion import stepper
from framestep.motors.axis import MOST, Axis
from framestep.motors.feeder import neediest
from framestep.motors.positions import Positions
from framestep.native import const

AHEAD = const(11)  # segments to keep queued
LOW = const(5)  # with fewer a moving motor is filled up in any pass
_PIECE = const(4)  # segments cut in a pass, at least
_CALL = const(2)  # so many could have been cut in the time that it takes to begin with a motor

_ALL_BITS = const(0x3FFFFFFF)


class Axes:
    """All motors of the controller.

    The pins are behind the kernel: what it queues in a tick is pulsed `BEHIND` ticks later. So what is told of
    positions comes from samples taken some ticks ago: all of one moment, and of pulses that have been made.
    """

    def __init__(self, hal):
        self.hal = hal
        self.kernel = hal.kernel
        self.count = hal.kernel.motors
        self.positions = Positions(self.count)
        self.axes = [Axis(hal.kernel, i, self.positions) for i in range(self.count)]
        self.loose = []  # those with backlash
        self.samples = stepper.samples(self.count)  # each pass of the main loop begins with another
        self.told = array("i", [0] * self.count)  # where the loads are by the pulses made until then: see choose()

    def __getitem__(self, motor):
        return self.axes[motor]

    def set_backlash(self, motor, steps):
        """As Axis.set_backlash()."""
        self[motor].set_backlash(steps)
        self.loose = [axis for axis in self.axes if axis.backlash]

    def feed(self, urgent=False):
        """Fill the queue of the motor that has the fewest segments, if fewer than AHEAD; whether there was one.

        When that takes little, the next one's as well: in one pass of the main loop a piece of the work is done, so
        that requests are answered between. But a pass may be the only one between two long absences, so it leaves no
        motor that moves with fewer than LOW. urgent: no others.
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
            tail = axis.block[stepper.TAIL]
            axis.feed(min((found & 31) + AHEAD, MOST))
            left -= ((axis.block[stepper.TAIL] - tail) & _ALL_BITS) + _CALL
        for axis in self.loose:
            axis.refresh()
        bits = stepper.seeking(self.kernel.state)
        if not bits:
            return more
        motor = 0
        while not bits & 1:
            bits >>= 1
            motor += 1
        self.axes[motor].seek(self.hal)
        return True

    @property
    def filled(self):
        """Whether every queue has AHEAD segments, or all that there is to cut."""
        return neediest(self.kernel.state, AHEAD, 0) == 0

    def choose(self):
        """`told` = where the pulses made until now have taken the loads. The tick (modulo 2^29) whose pulses were the
        last of them."""
        return stepper.choose(self.kernel.state, self.samples, self.told)

    def alarm(self, tick):
        """Have stepper.sample() tell from when this tick (modulo 2^29) is over; -1: no longer."""
        self.samples[stepper.ALARM] = tick

    def renumbered(self, motor):
        """A motor at rest has been given another position."""
        stepper.renumber(self.samples, motor, self.axes[motor].place)

    def moving_bits(self):
        """One bit per motor that moves."""
        return stepper.moving(self.kernel.state)

    @property
    def moving(self):
        return stepper.moving(self.kernel.state) != 0

    def release(self, bits):
        """Start the motors of these bits in the next tick, all in the same. Interrupts are off."""
        for i in range(self.count):
            if bits >> i & 1:
                self.axes[i].release()

    def discard(self, bits):
        """Drop what has been prepared for the motors of these bits, which are at rest and not planned to move."""
        for i in range(self.count):
            if bits >> i & 1 and self.axes[i].partner:
                bits |= 2 << i
        irq = self.hal.irq_off()
        stepper.discard(self.kernel.state, bits)
        self.hal.irq_on(irq)

    def stop(self, factor=1, spared=0, smooth=False):
        """Ramp all motors down but those of the bits `spared`, and those that they lead; see Axis.stop."""
        for i in range(self.count):
            axis = self.axes[i]
            if axis.moving and not axis.leader and not spared >> i & 1:
                axis.stop(self.hal, factor, smooth)
