"""How far the position of each motor can be trusted.

KNOWN   The host has set it since power-up (RESET_POSITION), or homing has, and the driver has been
        on for every step since.
HELD    Probably right, but not confirmed: it was restored from the journal at power-up, or the
        driver has been off since, so somebody may have turned the motor.
LOST    Wrong or unknown: nobody has set it since power-up, steps were not made, or power or
        firmware failed in motion. Soft limits still refer to the number, so they do not protect.

Only RESET_POSITION and homing take a motor out of LOST. Each state has a reason, for people
(framestep.texts has the texts). Nothing allocates after construction.
"""

from framestep.base.native import const

LOST = const(0)
HELD = const(1)
KNOWN = const(2)

# Reasons
UNSET = const(0)  # LOST: not set since power-up
STEPS = const(1)  # LOST: the engine did not make all steps
BROKEN_OFF = const(2)  # LOST: a power cut or a reset in motion
BEFORE = const(3)  # LOST: it was lost before the power cut
RESTORED = const(4)  # HELD: from the journal
DRIVER_OFF = const(5)  # HELD
SET = const(6)  # KNOWN
DRIVER = const(7)  # LOST: its driver has failed
UNPOWERED = const(8)  # LOST: the E-stop cut its power in motion
HOMED = const(9)  # KNOWN: homing has found its switch
HOMING = const(10)  # LOST, or HELD if it was known: homing has begun and is not done
NOT_FOUND = const(11)  # LOST: homing has not found its switch
NOT_OPENED = const(12)  # LOST: its home switch did not open on the way back
NOT_SQUARE = const(14)  # LOST: the other side of its gantry has found its home switch, it has not
SERVO = const(13)  # KNOWN: a servo goes where its pulses direct it


class Positions:
    """The states of all motors, from 0.

    `saved`: the journal (io/position_journal.py) has the present positions of all motors. Call
    about_to_change() before a motor moves or its position is set.
    """

    def __init__(self, count):
        self.count = count
        self.states = bytearray(count)  # LOST, UNSET
        self.reasons = bytearray(count)
        self.servos = 0  # bits of motors that are always known: their pulses define the position
        self.journal = None
        self.saved = False

    def put(self, motor, state, reason):
        """Set a motor's state and its reason. A servo's state does not change."""
        if (self.servos >> motor) & 1:
            return
        self.states[motor] = state
        self.reasons[motor] = reason

    def set_servos(self, bits):
        """Mark the motors of these bits as servos."""
        for motor in range(self.count):
            if (bits >> motor) & 1:
                self.put(motor, KNOWN, SERVO)
        self.servos = bits

    def about_to_change(self):
        """Invalidate the journal, as a position is about to change."""
        if self.saved:
            self.saved = False
            self.journal.invalidate()

    def set_known(self, motor):
        """Mark a position as set by the host. Call it before the number changes."""
        self.about_to_change()
        self.put(motor, KNOWN, SET)

    def driver_off(self, motor):
        """Note that the motor's driver was switched off or lost its power."""
        if self.states[motor] == KNOWN:
            self.put(motor, HELD, DRIVER_OFF)

    def set_lost(self, bits, reason):
        """Note that these motors are no longer where their positions say."""
        self.about_to_change()
        for motor in range(self.count):
            if (bits >> motor) & 1:
                self.put(motor, LOST, reason)

    def power_cut(self, moving):
        """Note that all motors have lost their power; moving: bits of those that were in motion."""
        self.set_lost(moving, UNPOWERED)
        for motor in range(self.count):
            self.driver_off(motor)
