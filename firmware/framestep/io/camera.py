"""Outputs to the camera: shutter, and meter, the half-pressed release (spec: MSG_GIO_CAM).

Nothing allocates after construction.
"""

from array import array

from framestep.clock import elapsed


class Camera:
    """The shutter and meter outputs. On a board without their pins nothing happens."""

    def __init__(self, hal, rig):
        self.hal = hal
        self.down = 0
        self._shutter_high = rig.shutter_on == "high"
        self._meter_high = rig.meter_on == "high"
        self._shutter_pin = self._pin("shutter", self._shutter_high)
        self._meter_pin = self._pin("meter", self._meter_high)
        self.pulsing = array("i", [0])  # 1 during a pulse
        self._begin = 0  # of the pulse, ms
        self._length = 0

    def _pin(self, key, high):
        pin = self.hal.board.get(key)
        return 0 if pin is None else self.hal.output(pin, 0 if high else 1)

    def pins(self, shutter_mask, meter_mask, shutter, meter):
        """The pins to drive high to switch the outputs whose mask is not 0.

        `down` are those to drive low.
        """
        high = 0
        low = 0
        if shutter_mask:
            if (shutter != 0) == self._shutter_high:
                high = self._shutter_pin
            else:
                low = self._shutter_pin
        if meter_mask:
            if (meter != 0) == self._meter_high:
                high |= self._meter_pin
            else:
                low |= self._meter_pin
        self.down = low
        return high

    def set(self, shutter, meter):
        """Switch both outputs at the same time. Ends a pulse."""
        self.pulsing[0] = 0
        high = self.pins(1, 1, shutter, meter)
        self.hal.drive(high, self.down)

    def pulse(self, now, ms):
        """Switch both outputs on for `ms` milliseconds from `now` (modulo 2^29); poll() ends it."""
        self.set(True, True)
        self._begin = now
        self._length = ms
        self.pulsing[0] = 1

    def poll(self, now):
        """End a pulse whose time is over. now: milliseconds modulo 2^29."""
        if self.pulsing[0] and elapsed(now, self._begin) >= self._length:
            self.set(False, False)

    def safe(self):
        """Switch both outputs off."""
        self.set(False, False)
