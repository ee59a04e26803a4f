"""How far the position of each motor can be trusted.

KNOWN   The host has set it since power-up (RESET_POSITION), or homing has, and every step since
        has been made with the driver on.
HELD    Probably right, but not confirmed: it was restored from the journal at power-up, or the
        driver has been off since, so that the motor may have been turned.
LOST    Wrong or unknown: nobody has set it since power-up, steps were not made, or power or
        firmware failed in motion. Soft limits still count from the number, so they do not protect.

Only RESET_POSITION and homing take a motor out of LOST. Each state has a reason, for people
(framestep.texts has the texts).
Nothing allocates after construction.
"""

from framestep.base.native import const

LOST = const(0)
HELD = const(1)
KNOWN = const(2)

# Reasons
UNSET = const(0)  # LOST: not set since power-up
STEPS = const(1)  # LOST: the engine has not made all steps
BROKEN_OFF = const(2)  # LOST: a power cut or a reset in motion
BEFORE = const(3)  # LOST: was lost already before the power cut
RESTORED = const(4)  # HELD: from the journal
DRIVER_OFF = const(5)  # HELD
SET = const(6)  # KNOWN
DRIVER = const(7)  # LOST: its driver has failed
UNPOWERED = const(8)  # LOST: the E-stop has cut its power in motion
HOMED = const(9)  # KNOWN: homing has found its switch
HOMING = const(10)  # LOST or, if it was known, HELD: homing has begun and is not done
NOT_FOUND = const(11)  # LOST: homing has not found its switch
NOT_OPENED = const(12)  # LOST: its home switch has not opened on the way back
SERVO = const(13)  # KNOWN: a servo goes where its pulses say


class Positions:
    """The states of all motors, from 0.

    `saved`: the journal (io/position_journal.py) has the present positions of all motors. Whoever
    is about to move a motor or to set its position calls about_to_change() first.
    """

    def __init__(self, count):
        self.count = count
        self.states = bytearray(count)  # LOST, UNSET
        self.reasons = bytearray(count)
        self.servos = 0  # bits of motors that are always known: pulses tell them where to be
        self.journal = None
        self.saved = False

    def put(self, motor, state, reason):
        """Set a motor's state, and the reason for it. A servo's stays as it is."""
        if (self.servos >> motor) & 1:
            return
        self.states[motor] = state
        self.reasons[motor] = reason

    def set_servos(self, bits):
        """The motors of these bits are servos."""
        for motor in range(self.count):
            if (bits >> motor) & 1:
                self.put(motor, KNOWN, SERVO)
        self.servos = bits

    def about_to_change(self):
        """A position is about to change: invalidate what the journal has."""
        if self.saved:
            self.saved = False
            self.journal.invalidate()

    def set_known(self, motor):
        """The host sets the position. To be called before the number changes."""
        self.about_to_change()
        self.put(motor, KNOWN, SET)

    def driver_off(self, motor):
        """The motor's driver has been switched off or has lost its power."""
        if self.states[motor] == KNOWN:
            self.put(motor, HELD, DRIVER_OFF)

    def set_lost(self, bits, reason):
        """The motors of these bits are no longer where their positions say."""
        self.about_to_change()
        for motor in range(self.count):
            if (bits >> motor) & 1:
                self.put(motor, LOST, reason)

    def power_cut(self, moving):
        """All motors have lost their power, those of the bits `moving` in motion."""
        self.set_lost(moving, UNPOWERED)
        for motor in range(self.count):
            self.driver_off(motor)
