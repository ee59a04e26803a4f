"""Hobby servos as motors: the motor's position becomes the width of a pulse, by machine.PWM.

The hardware makes the pulses, and takes a new width at the beginning of a period. Ticks are done
ahead of time. So positions wait for as many ticks as the chain may be ahead: the servo is a pulse
period late at most, and never early. If the firmware hangs the pulses go on and hold the servo.
"""

from array import array

from machine import PWM, Pin

from framestep.base.clock import WRAP, after, elapsed
from framestep.base.native import const
from framestep.pulse.stepper import POSITION, TICKS

_RING = const(64)  # ticks; more than any queue holds
_FULL = const(65536)  # a whole period in PWM's units
_MOST_STEPS = const(16383)  # times _FULL is below 2^30


class Servo:
    """The pulses of one motor. block: its words in the kernel; settings: of the rig file, see
    rig/servos.py; back: pulses get shorter toward higher positions. Allocates."""

    def __init__(self, block, settings, back):
        self._block = block
        rate = settings["rate_hz"]
        self.pwm = PWM(Pin(settings["pin"]), freq=rate, duty_u16=0)
        self._set = self.pwm.duty_u16
        self._low = settings["low"]
        self._steps = settings["high"] - settings["low"]
        shortest = int(settings["low_us"] * rate * _FULL / 1000000)
        longest = int(settings["high_us"] * rate * _FULL / 1000000)
        self._begin, self._span = (
            (longest, shortest - longest) if back else (shortest, longest - shortest)
        )
        self._coarser = 0
        while self._steps >> self._coarser > _MOST_STEPS:
            self._coarser += 1
        self.on = settings["at_start"] == "on"
        self._width = 0
        self._ring = array("i", [block[POSITION]] * _RING)

    def note(self, tick):
        """Note the position after a tick."""
        self._ring[tick & (_RING - 1)] = self._block[POSITION]

    def show(self, tick):
        """Show the position after an earlier tick, or nothing while it is off."""
        width = 0
        if self.on:
            steps = self._ring[tick & (_RING - 1)] - self._low
            steps = min(max(steps, 0), self._steps)
            width = self._begin + (steps >> self._coarser) * self._span // (
                self._steps >> self._coarser
            )
        if width != self._width:
            self._width = width
            self._set(width)


class Servos:
    """All servos of a rig. header: the tick's; late: ticks until words are played. Allocates."""

    def __init__(self, kernel, rig, late):
        self._header = kernel.state
        self._late = late
        self._noted = 0  # the last tick
        self._servos = {}
        for motor in range(kernel.motors):
            settings = rig.motor(motor)
            if settings["servo"]:
                self._servos[motor] = Servo(
                    kernel.blocks[motor], settings["servo"], settings["invert"]
                )
        self._all = tuple(self._servos.values())

    def serve(self):
        """Go on to the present tick. To be called in each pass, after the chain."""
        tick = self._header[TICKS]
        noted = self._noted
        if tick == noted:
            return
        if elapsed(tick, noted) > _RING:  # the rest is old
            noted = (tick - _RING) & WRAP
        while noted != tick:
            noted = after(noted, 1)
            for servo in self._all:
                servo.note(noted)
        self._noted = tick
        for servo in self._all:
            servo.show(tick - self._late)

    def enable(self, motor, on):
        """Begin or end the pulses of a motor. Return False if it has no servo."""
        servo = self._servos.get(motor)
        if servo is None:
            return False
        servo.on = on
        return True
