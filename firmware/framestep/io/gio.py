"""General outputs and inputs: bit 0 is the first one (field note 8.3).

The HAL drives and reads all pins at once, as bits of a word; polarity is a mask over that word.
Nothing allocates after construction.
"""

from array import array

from framestep.base.clock import elapsed
from framestep.base.native import const, micropython, ptr32

DEBOUNCE_MS = const(20)  # field note 8.3

# Words of Outputs.words; its table of pin bits follows
_COUNT = const(0)
_ACTIVE_LOW_OUTPUTS = const(1)  # pins that are low while their output is on
_TO_LOWER = const(2)  # result of _pins(): pins to drive low
_PINS = const(3)

# Words of Inputs.words; its table of pin bits and the time of each pin's last change follow
STABLE = const(0)  # debounced levels of the pins
RAW = const(1)  # their last levels
ALL_INPUTS = const(2)  # every pin
_INPUTS = const(3)
_ACTIVE_LOW = const(4)  # pins that are low while their input is on
_INPUT_PINS = const(5)


@micropython.viper
def _pins(w: ptr32, mask: int, values: int) -> int:
    """Return the pins to drive high for the outputs of `mask`. w[_TO_LOWER] = pins to drive low."""
    n = w[_COUNT]
    high = 0
    low = 0
    i = 0
    while i < n:
        if (mask >> i) & 1:
            if (values >> i) & 1:
                high |= w[_PINS + i]
            else:
                low |= w[_PINS + i]
        i += 1
    swap = (high ^ low) & w[_ACTIVE_LOW_OUTPUTS]
    w[_TO_LOWER] = low ^ swap
    return high ^ swap


class Outputs:
    """Outputs 1 … count.

    settings: Rig.outputs. The pins come up at their safe level; "hold" means off.
    """

    def __init__(self, hal, settings):
        self.hal = hal
        self.count = len(settings)
        self.words = array("i", [0] * (_PINS + self.count))
        self.words[_COUNT] = self.count
        self.safe_mask = 0  # outputs that a fault sets to their safe level; others do not change
        self.safe_values = 0
        for i, output in enumerate(settings):
            on = 1 if output["on"] == "high" else 0
            lit = output["safe"] == "on"
            pin = hal.output(output["pin"], on if lit else 1 - on)
            self.words[_PINS + i] = pin
            if not on:
                self.words[_ACTIVE_LOW_OUTPUTS] |= pin
            if lit:
                self.safe_values |= 1 << i
            if output["safe"] != "hold":
                self.safe_mask |= 1 << i

    def pins(self, mask, values):
        """Return the pins to drive high to set the outputs of `mask` to the bits of `values`.

        `down` becomes the pins to drive low. Both are small integers. Bits beyond the last output
        are ignored.
        """
        return _pins(self.words, mask, values)

    @property
    def down(self):
        """After pins(): the pins to drive low."""
        return self.words[_TO_LOWER]

    def put(self, mask, values):
        """Set the outputs of `mask` to the bits of `values`, all at the same time."""
        high = _pins(self.words, mask, values)
        self.hal.drive(high, self.words[_TO_LOWER])

    def safe(self):
        """Set each output to its safe level, which is a setting of the rig file."""
        self.put(self.safe_mask, self.safe_values)


@micropython.viper
def _debounce(w: ptr32, levels: int, now: int) -> int:
    """Update with the levels of all pins. Return 1 if a debounced level has changed."""
    levels &= w[ALL_INPUTS]
    moved = levels ^ w[RAW]
    w[RAW] = levels
    differ = levels ^ w[STABLE]
    if differ | moved == 0:
        return 0
    n = w[_INPUTS]
    changed = 0
    i = 0
    while i < n:
        pin = w[_INPUT_PINS + i]
        if moved & pin:
            w[_INPUT_PINS + n + i] = now
        elif differ & pin:
            if elapsed(now, w[_INPUT_PINS + n + i]) >= DEBOUNCE_MS:
                w[STABLE] = w[STABLE] ^ pin
                changed = 1
        i += 1
    return changed


@micropython.viper
def _values(w: ptr32) -> int:
    """Return the inputs that are on, one bit each."""
    on = w[STABLE] ^ w[_ACTIVE_LOW]
    n = w[_INPUTS]
    values = 0
    i = 0
    while i < n:
        if on & w[_INPUT_PINS + i]:
            values |= 1 << i
        i += 1
    return values


class Inputs:
    """Inputs 1 … count, debounced: a level counts once it has lasted DEBOUNCE_MS.

    settings: Rig.inputs. Their levels at construction count at once.
    """

    def __init__(self, hal, settings):
        self.count = count = len(settings)
        self.words = words = array("i", [0] * (_INPUT_PINS + 2 * count))
        words[_INPUTS] = count
        for i, entry in enumerate(settings):
            pin = hal.input(entry["pin"], entry["pull"])
            words[_INPUT_PINS + i] = pin
            words[ALL_INPUTS] |= pin
            if entry["on"] == "low":
                words[_ACTIVE_LOW] |= pin
        words[RAW] = words[STABLE] = hal.levels() & words[ALL_INPUTS]

    def poll(self, now, levels):
        """Update with the levels of the pins. Return whether an input has changed.

        now: milliseconds modulo 2^29. levels: Hal.levels().
        """
        return _debounce(self.words, levels, now) != 0

    @property
    def values(self):
        """The inputs that are on, one bit each."""
        return _values(self.words)


class Gio:
    """The general outputs and inputs of a rig."""

    def __init__(self, hal, rig):
        self.outputs = Outputs(hal, rig.outputs)
        self.inputs = Inputs(hal, rig.inputs)
        self.put = self.outputs.put
        self.safe = self.outputs.safe
        self.poll = self.inputs.poll
