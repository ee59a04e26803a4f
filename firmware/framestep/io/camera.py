"""Outputs to the camera: shutter, and meter, the half-pressed release (spec: MSG_GIO_CAM).

Nothing allocates after construction.
"""


class Camera:
    """The shutter and meter outputs.

    `there`: the board has a pin for one at least. Without, set() and pins() do nothing.
    """

    def __init__(self, hal, rig):
        self.hal = hal
        self.down = 0
        self.delay_ms = rig.shutter_delay_ms
        self.hold_ms = rig.shutter_hold_ms
        self._shutter_high = rig.shutter_on == "high"
        self._meter_high = rig.meter_on == "high"
        self._shutter_pin = self._pin("shutter", self._shutter_high)
        self._meter_pin = self._pin("meter", self._meter_high)
        self.there = "shutter" in hal.board or "meter" in hal.board

    def _pin(self, key, high):
        pin = self.hal.board.get(key)
        return 0 if pin is None else self.hal.output(pin, 0 if high else 1)

    def pins(self, shutter_mask, meter_mask, shutter, meter):
        """Return the pins to drive high to switch the outputs whose mask is not 0.

        `down` becomes the pins to drive low.
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
        """Switch both outputs at the same time."""
        high = self.pins(1, 1, shutter, meter)
        self.hal.drive(high, self.down)

    def safe(self):
        """Switch both outputs off."""
        self.set(False, False)
