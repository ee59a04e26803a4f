"""Hobby servos as motors: the motor's position becomes the width of a pulse.

A servo has a motor's words in the kernel and its place in the pulse engine, but no step pin: its
only pin takes the place of a stepper's direction pin. The tick's commands go nowhere. Instead a
timer calls pulse() each millisecond. Once in a period it gives the engine three commands without
steps: raise the direction and wait, wait for the second half, lower it. So the engine's cycles
define the width, however late the timer is, and if the firmware hangs there are no more pulses.

The width corresponds to the position to which the tick's commands lead. A stepper on the same path
is there by the end of the pulse, or up to two milliseconds later. The width has a resolution of
1/64 of a step, and stays within the rig file's range.

For engines that take commands by a register (engine.RING 0). Nothing allocates after construction.
"""

from array import array

from framestep.base.native import addressof, as_word, const, micropython, ptr32
from framestep.pulse.engine import DIRECTION, GAP, WAIT_CYCLES
from framestep.pulse.stepper import FRACTION, POSITION

_FINE = const(12)  # fraction bits of a step's cycles
_FINER = const(14)  # bits below those, needed for up to 60 000 steps
_PART = const(6)  # fraction bits of a step that are used

# Words: the number of servos, and for each of them
_SERVO = const(1)
_BLOCK = const(0)  # address of the motor's words
_FIFO = const(1)  # address of its commands
_EVERY = const(2)  # ms from pulse to pulse
_LEFT = const(3)  # ms until the next one
_ON = const(4)  # 0: no pulses
_LOW = const(5)  # lowest position
_STEPS = const(6)  # from there to the highest position
_SLOPE = const(7)  # cycles of a step, with _FINE fraction bits
_REST = const(8)  # the next _FINER bits of that
_MOST = const(9)  # cycles from the shortest pulse to the longest, with _FINE fraction bits
_BEGIN = const(10)  # cycles at the lowest position
_BACK = const(11)  # 1: pulses get shorter toward higher positions
_WORDS = const(12)


class Servos(array):
    """The words of all servos, with pulse() as a method, like pulse.tick.Header with its tick."""

    @micropython.viper
    def pulse(w: ptr32, _timer):
        """Begin the pulses that are due. To be called every millisecond."""
        at = _SERVO
        servos = w[0]
        while servos:
            w[at + _LEFT] = w[at + _LEFT] - 1
            if w[at + _LEFT] == 0:
                w[at + _LEFT] = w[at + _EVERY]
                if w[at + _ON]:
                    block = ptr32(w[at + _BLOCK])
                    steps = block[POSITION] - w[at + _LOW]
                    if steps < 0:
                        steps = 0
                    if steps > w[at + _STEPS]:
                        steps = w[at + _STEPS]
                    part = (block[FRACTION] >> (22 - _PART)) * w[at + _SLOPE]
                    cycles = steps * w[at + _SLOPE] + (part >> _PART)
                    cycles += (steps * w[at + _REST]) >> _FINER
                    if cycles < 0:
                        cycles = 0
                    if cycles > w[at + _MOST]:
                        cycles = w[at + _MOST]
                    cycles = (cycles + (1 << (_FINE - 1))) >> _FINE
                    if w[at + _BACK]:
                        cycles = 0 - cycles
                    cycles = cycles + w[at + _BEGIN]
                    half = cycles >> 1
                    fifo = ptr32(w[at + _FIFO])
                    fifo[0] = ((half - WAIT_CYCLES) << GAP) + DIRECTION
                    fifo[0] = ((cycles - half - WAIT_CYCLES) << GAP) + DIRECTION
                    fifo[0] = 0
            at += _WORDS
            servos -= 1

    def enable(self, motor, on):
        """Begin or end the pulses of a motor. Return False if it has no servo."""
        at = self.places.get(motor)  # type: ignore[attr-defined]
        if at is None:
            return False
        self[at + _ON] = 1 if on else 0
        return True


def make_servos(kernel, settings, fifos, cycles_per_us):
    """Make the Servos of a rig. Call it after the kernel's motors have been configured.

    settings: of each motor, as from Rig.motor(). fifos: addresses to which the engine's commands
    for each motor are written. Allocates.
    """
    motors = [i for i in range(kernel.motors) if settings[i]["servo"]]
    servos = Servos("i", [0] * (_SERVO + _WORDS * len(motors)))
    servos.places = {}  # type: ignore[attr-defined]
    # takes the commands of the tick
    servos.nowhere = array("i", [0])  # type: ignore[attr-defined]
    servos[0] = len(motors)
    at = _SERVO
    for i in motors:
        servo = settings[i]["servo"]
        kernel.configure(i, addressof(servos.nowhere), 0, 0, False)  # type: ignore[attr-defined]
        back = settings[i]["invert"]
        shortest = int(servo["low_us"] * cycles_per_us)
        longest = int(servo["high_us"] * cycles_per_us)
        servos.places[i] = at  # type: ignore[attr-defined]
        servos[at + _BLOCK] = as_word(addressof(kernel.blocks[i]))
        servos[at + _FIFO] = as_word(fifos[i])
        servos[at + _EVERY] = 1000 // servo["rate_hz"]
        servos[at + _LEFT] = 1 + i  # not all at once
        servos[at + _ON] = 1 if servo["at_start"] == "on" else 0
        servos[at + _LOW] = servo["low"]
        servos[at + _STEPS] = servo["high"] - servo["low"]
        servos[at + _MOST] = (longest - shortest) << _FINE
        servos[at + _SLOPE], rest = divmod(servos[at + _MOST], servos[at + _STEPS])
        servos[at + _REST] = (rest << _FINER) // servos[at + _STEPS]
        servos[at + _BEGIN] = longest if back else shortest
        servos[at + _BACK] = 1 if back else 0
        at += _WORDS
    return servos
