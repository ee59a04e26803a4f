"""A hand wheel at the board, with buttons (setting `pendant`): jogs a motor by whole clicks.

The wheel's outputs A and B change four times for a click, in an order that tells the direction. An
interrupt counts these quarters. So an edge that comes back, from a contact that bounces or a
disturbed wire, cancels itself, and only four in a row are a click.

While the enable button is held, clicks move the target of the chosen motor. The target stays within
a quarter of a second's way of the motor, and what it can stop in; clicks beyond that are dropped.
So the motor stops soon after the wheel does, on a whole click. Clicks count for nothing while an
operation is prepared or runs, motors are homed or in a virtual motion, or something else moves this
one.

Loaded only if the rig file has a pendant. Nothing allocates after construction.
"""

from array import array

from framestep.base.clock import elapsed
from framestep.base.native import const, micropython, ptr32
from framestep.base.results import OK
from framestep.io.gio import Inputs
from framestep.motion import reals
from framestep.motors import bounds
from framestep.motors.axis import FULL_SPEED
from framestep.motors.backlash import TARGET

_APART_MS = const(24)  # from one new target of a moving motor to the next
_SHOWN_MS = const(4096)  # how long the LED shows the number of the motor that was chosen
_COLOUR = const(0x303000)

# Words of Wheel
_A = const(0)  # pins, bits of Hal.levels()
_B = const(1)
_PLACE = const(2)  # in the order of quarters, 0 … 3
_QUARTERS = const(3)  # since the clicks taken last

# Bits of the buttons
_ENABLE = const(1)
_AXIS = const(2)
_STEP = const(4)

# Words of Pendant
_TARGET = const(0)
_HERE = const(1)
_DELTA = const(2)


class Wheel:
    """Counts the clicks of a wheel with outputs at two pins."""

    def __init__(self, hal, a, b, pull):
        self.hal = hal
        self._levels = hal.levels
        self.words = words = array("i", [0] * 4)
        words[_A] = hal.input(a, pull)
        words[_B] = hal.input(b, pull)
        self.on_edge(None)
        self.rest()
        hal.watch(words[_A] | words[_B], self.on_edge)

    @micropython.viper
    def on_edge(self, _source):
        """Count a quarter of a click. Called in a hard interrupt."""
        levels = self._levels
        w = ptr32(self.words)
        found = int(levels())
        place = 0
        if found & w[_B]:
            place = 3
        if found & w[_A]:
            place = place ^ 1
        moved = (place - w[_PLACE]) & 3
        w[_PLACE] = place
        if moved == 1:
            w[_QUARTERS] = w[_QUARTERS] + 1
        elif moved == 3:
            w[_QUARTERS] = w[_QUARTERS] - 1

    def rest(self):
        """Forget what has been counted: the wheel rests between two clicks."""
        self.words[_QUARTERS] = 0

    def take(self):
        """Return the whole clicks since the last call; below 0: downward."""
        hal = self.hal
        irq = hal.irq_off()
        quarters = self.words[_QUARTERS]
        clicks = quarters >> 2 if quarters >= 0 else -(-quarters >> 2)
        self.words[_QUARTERS] = quarters - 4 * clicks
        hal.irq_on(irq)
        return clicks


class Pendant:
    """Moves motors by the wheel. settings: Rig.pendant. motion: a Motion."""

    def __init__(self, settings, motion, safety):
        self.axes = axes = motion.axes
        self.hal = hal = axes.hal
        self.interlock = motion.interlock
        self.safety = safety
        self.operations = motion.moves.operations
        self.virtuals = motion.virtuals
        self.click = settings["click"]
        self.motors = min(settings["motors"], axes.count)
        self.wheel = Wheel(hal, settings["a"], settings["b"], settings["pull"])
        pins = [(_ENABLE, settings["enable"]), (_AXIS, settings["axis"]), (_STEP, settings["step"])]
        pins = [(bit, pin) for bit, pin in pins if pin >= 0]
        self.inputs = Inputs(hal, [{"pin": pin, "on": "low", "pull": "up"} for _, pin in pins])
        self.buttons = bytes([bit for bit, _ in pins])  # of each input
        self.pressed = 0
        self.words = array("i", [0] * 3)
        self.motor = 0
        self.factor = 1
        self.going = False  # the motor goes to the target
        self.sent_at = 0  # ms
        self.chosen_at = -1  # ms; -1: that is long ago

    def poll(self, now):
        """Do one pass. now: milliseconds modulo 2^29."""
        self._read_buttons(now)
        axis = self.axes[self.motor]
        if self.going and not axis.moving:
            self.going = False
        if not self.pressed & _ENABLE or self.operations.busy or self.interlock.owned:
            self.wheel.rest()
            if self.going and not self.interlock.owned & 1 << self.motor:
                axis.stop(self.hal, 1, True)
            self.going = False
        elif not self.going or elapsed(now, self.sent_at) >= _APART_MS:
            clicks = self.wheel.take()
            if clicks:
                self.sent_at = now
                self._turn(axis, clicks)

    def _read_buttons(self, now):
        """Update the buttons; choose another motor or factor if one has been pressed."""
        if not self.inputs.poll(now, self.hal.levels()):
            return
        values = self.inputs.values
        pressed = 0
        for i in range(len(self.buttons)):
            if (values >> i) & 1:
                pressed |= self.buttons[i]
        fresh = pressed & ~self.pressed
        self.pressed = pressed
        if fresh & _STEP:
            self.factor = 1 if self.factor == 100 else 10 * self.factor
        if fresh & _AXIS and not self.going:
            self.motor = self.motor + 1 if self.motor + 1 < self.motors else 0
            self.wheel.rest()
            self.chosen_at = now

    def _turn(self, axis, clicks):
        """Move the target by whole clicks, and send the motor there."""
        motor = self.motor
        words = self.words
        if self.virtuals.moves_camera(motor) or self.interlock.may_move(motor) != OK:
            return
        if self.going and not reals.equal_words(axis.backlash, TARGET, words, _TARGET):
            self.going = False  # the host has sent it elsewhere
        if axis.moving and not self.going:
            return
        axis.position_to(words, _HERE)
        if not self.going:
            reals.copy_word(words, _TARGET, words, _HERE)
        velocity = axis.velocity
        # v / 4 + v² / 2a, in numbers that stay small
        room = velocity // 4 + (velocity >> 5) * (velocity >> 5) // (axis.acceleration // 512 + 1)
        down = 1 if clicks < 0 else 0
        for _ in range(-clicks if down else clicks):
            if not reals.add_words(words, _DELTA, words, _TARGET, words, _HERE, 1):
                return
            lead = words[_DELTA]
            if (-lead if down else lead) >= room:
                break
            words[_DELTA] = self.click * self.factor
            if not reals.add_words(words, _TARGET, words, _TARGET, words, _DELTA, down):
                break
        bounds.clamp(axis, words, _TARGET)
        if self.safety.limit_blocking(motor, words, _TARGET) != OK:
            return
        if self.going or not reals.equal_words(words, _TARGET, words, _HERE):
            self.interlock.stop_jogging(1 << motor)
            self.interlock.switch_on(1 << motor)
            axis.move_to(self.hal, words, _TARGET, FULL_SPEED)
            self.going = True

    def show(self, now, beat):
        """Show in one of 16 beats of the LED which motor has been chosen, as so many flashes.
        Return False if that is long ago."""
        if self.chosen_at < 0:
            return False
        if elapsed(now, self.chosen_at) >= _SHOWN_MS:
            self.chosen_at = -1
            return False
        self.hal.led(0 if beat & 1 or beat >> 1 > self.motor else _COLOUR)
        return True
