"""Limit switches of both ends of an axis on one input (`"ends": "both"`).

Such a switch says that the motor is at an end, and the direction in which the motor was going says
which. From then on the switch stops only motion in that direction, until the motor has gone `reach`
steps back. A switch that is released and pressed again within them is still that of the same end;
one that is pressed beyond them is the other end's. One that is still pressed there is stuck. One
that is pressed while its motor is at rest may be at either end, as a hand may have pushed the
motor. Both stop both directions.

Loaded only if the rig file has such a set. Nothing allocates after construction.
"""

from array import array

from framestep.base.native import const, micropython, ptr32
from framestep.motion.reals import copy_word
from framestep.pulse.stepper import POSITION

# Sides
_LOWER = const(0)
_UPPER = const(1)
_UNKNOWN = const(2)
_STUCK = const(3)  # unknown, and it has not opened since it was hit
_REACH = const(400)  # of a motor without `home`


@micropython.viper
def _has_left(block: ptr32, places: ptr32, motor: int, side: int, reach: int) -> int:
    """Return 1 if the motor has gone `reach` steps from places[motor], away from that side."""
    gone = block[POSITION] - places[motor + 0]  # wraps
    if side:
        gone = 0 - gone  # wraps
    return 1 if gone >= reach else 0


class SharedSwitches:
    """Which limit pins count for each motor. safety: a Safety, whose table of pins it corrects."""

    def __init__(self, safety, rig, axes):
        self.safety = safety
        self.axes = axes
        self.pins = 0  # of such switches
        for limit, pair in zip(rig.limits, safety.sets):
            if limit["pin"] >= 0:
                self.pins |= pair[0]
        homes = [rig.motor(i)["home"] for i in range(axes.count)]
        # twice the distance after which a switch is surely open
        self.reaches = array("i", [2 * home["back_off"] if home else _REACH for home in homes])
        self.assigned = array("i", [0] * (2 * axes.count))  # pins: lower end, upper end
        self.sides = bytearray([_UNKNOWN] * axes.count)
        self.places = array("i", [0] * axes.count)  # where the switch was hit
        self.opened = 0  # motors whose switch has opened since, one bit each

    def counting(self, motor, upper):
        """Return the pins that count for one end of a motor. upper: 1 or 0."""
        pins = self.assigned[2 * motor + upper]
        side = self.sides[motor]
        return pins if side > _UPPER or side == upper else pins & ~self.pins

    def put(self, motor, upper):
        """The motor has hit its switch at this end."""
        self.sides[motor] = upper
        self.opened &= ~(1 << motor)
        self.hit_here(motor)
        self._count(motor)

    def forget(self, motor):
        """Let both ends of a motor count."""
        self.sides[motor] = _UNKNOWN
        self._count(motor)

    def hit_here(self, motor):
        """Count the motor's way from its present position, which has been set."""
        copy_word(self.places, motor, self.axes[motor].block, POSITION)

    def take(self, motor, upper, active):
        """Note that a motor has been stopped at one end. active: bits of pins."""
        side = self.sides[motor]
        hit = self.assigned[2 * motor + upper] & self.pins & active
        if hit and (side == _UNKNOWN or side == upper):
            self.put(motor, upper)

    def side(self, motor, pin):
        """Return the end at which this switch of a motor is: 1 the upper one, 0 the lower one, -1
        unknown, -2: it is a switch of one end."""
        if not pin & self.pins:
            return -2
        side = self.sides[motor]
        return side if side <= _UPPER else -1

    def poll(self):
        """Let both ends count for motors that have left theirs."""
        for motor in range(len(self.sides)):
            side = self.sides[motor]
            if side == _UNKNOWN:
                continue
            active = self.safety.is_active(self.pins & self._all(motor))
            axis = self.axes[motor]
            if not active:
                self.opened |= 1 << motor
                if side == _STUCK:
                    self.forget(motor)
                    continue
            elif self.opened & 1 << motor and not axis.moving:
                self.forget(motor)  # somebody may have pushed the motor to the other end
                continue
            if side != _STUCK and _has_left(
                axis.block, self.places, motor, side, self.reaches[motor]
            ):
                self.sides[motor] = _STUCK if active else _UNKNOWN
                self._count(motor)

    def _all(self, motor):
        return self.assigned[2 * motor + _LOWER] | self.assigned[2 * motor + _UPPER]

    def _count(self, motor):
        self.safety.count_pins(motor, 0)
        self.safety.count_pins(motor, 1)
