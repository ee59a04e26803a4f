"""General outputs and inputs: bit 0 is the first (field note 8.3).

Pins are bits of a word that the HAL drives and reads at once; polarity is a mask over them.
Nothing allocates after construction.
"""

from array import array

from framestep.clock import elapsed
from framestep.native import const, micropython, ptr32

DEBOUNCE_MS = const(20)  # field note 8.3

# Words of Outputs.words; its table of pin bits follows
_COUNT = const(0)
_LOW = const(1)  # pins that are low while their output is on
_DOWN = const(2)  # result of _pins: pins to drive low
_PINS = const(3)

# Words of Inputs.words; its table of pin bits and the time of each pin's last change follow
STABLE = const(0)  # debounced levels of the pins
RAW = const(1)  # levels seen last
ALL_INPUTS = const(2)  # every pin
_INPUTS = const(3)
_ACTIVE_LOW = const(4)  # pins that are low while their input is on
_INPUT_PINS = const(5)


@micropython.viper
def _pins(w: ptr32, mask: int, values: int) -> int:
    n = w[_COUNT]
    high = 0
    low = 0
    i = 0
    while i < n:
        if mask >> i & 1:
            if values >> i & 1:
                high |= w[_PINS + i]
            else:
                low |= w[_PINS + i]
        i += 1
    swap = (high ^ low) & w[_LOW]
    w[_DOWN] = low ^ swap
    return high ^ swap


class Outputs:
    """Outputs 1 … count. What they were set to is in the pins alone."""

    def __init__(self, hal, settings):
        """settings: Rig.outputs. The pins come up at their safe level; hold means off."""
        self.hal = hal
        self.count = len(settings)
        self.words = array("i", [0] * (_PINS + self.count))
        self.words[_COUNT] = self.count
        self.safe_mask = 0  # outputs that a fault puts to their safe level, the others stay as they are
        self.safe_values = 0
        for i, output in enumerate(settings):
            on = 1 if output["on"] == "high" else 0
            lit = output["safe"] == "on"
            pin = hal.output(output["pin"], on if lit else 1 - on)
            self.words[_PINS + i] = pin
            if not on:
                self.words[_LOW] |= pin
            if lit:
                self.safe_values |= 1 << i
            if output["safe"] != "hold":
                self.safe_mask |= 1 << i

    def pins(self, mask, values):
        """The pins to drive high so that the outputs of `mask` get the bits of `values`; `down`: those to drive low.

        Both fit a small integer; bits past the last output are ignored.
        """
        return _pins(self.words, mask, values)

    @property
    def down(self):
        """The pins to drive low, after pins()."""
        return self.words[_DOWN]

    def put(self, mask, values):
        """Set the outputs of `mask` to the bits of `values`, all in the same instant."""
        high = _pins(self.words, mask, values)
        self.hal.drive(high, self.words[_DOWN])

    def safe(self):
        """To the safe level, as the rig file has it for each output."""
        self.put(self.safe_mask, self.safe_values)


@micropython.viper
def _debounce(w: ptr32, levels: int, now: int) -> int:
    """Take in the levels of all pins; 1 where a debounced one has changed."""
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
    """Inputs 1 … count, debounced: a level counts once it has lasted DEBOUNCE_MS."""

    def __init__(self, hal, settings):
        """settings: Rig.inputs. The levels at this moment are taken as they are."""
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
        """Look at the pins; now: milliseconds modulo 2^29, levels: HAL.levels(). Whether an input has changed."""
        return _debounce(self.words, levels, now) != 0

    @property
    def values(self):
        """Which inputs are on, one bit each."""
        return _values(self.words)


class Gio:
    """The general outputs and inputs of a rig."""

    def __init__(self, hal, rig):
        self.outputs = Outputs(hal, rig.outputs)
        self.inputs = Inputs(hal, rig.inputs)
        self.put = self.outputs.put
        self.safe = self.outputs.safe
        self.poll = self.inputs.poll
