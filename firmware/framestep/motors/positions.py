"""How far the position of each motor can be trusted.

KNOWN   The host has set it since power-up (RESET_POSITION), and every step since has been made with the driver on.
HELD    Nothing speaks against it, but nobody has confirmed it either: it was restored from memory at power-up, or the
        driver has been switched off since, when the motor may have been turned.
LOST    The number does not tell where the motor is: nobody has set it since power-up, steps were not made, or the power
        or the firmware went in the middle of a motion. Soft limits still count from the number, so they do not protect.

Only RESET_POSITION takes a motor out of LOST. Each state has a reason, for people (framestep.words says it in words).
Nothing allocates after construction.
"""

from framestep.native import const

LOST = const(0)
HELD = const(1)
KNOWN = const(2)

# Reasons
UNSET = const(0)  # LOST: not set since power-up
STEPS = const(1)  # LOST: the engine has not made them
BROKEN_OFF = const(2)  # LOST: power or reset came in motion
BEFORE = const(3)  # LOST: so already when the power went
RESTORED = const(4)  # HELD
DRIVER_OFF = const(5)  # HELD
SET = const(6)  # KNOWN
DRIVER = const(7)  # LOST: its driver has failed
UNPOWERED = const(8)  # LOST: the E-stop has cut its power in motion


class Positions:
    """The states of all motors, from 0.

    `settled`: what a memory keeps is true of all motors now (io/memory.py). Whoever is about to move one or to give it
    another number calls touch() before.
    """

    def __init__(self, count):
        self.count = count
        self.states = bytearray(count)  # LOST, UNSET
        self.reasons = bytearray(count)
        self.memory = None
        self.settled = False

    def put(self, motor, state, reason):
        self.states[motor] = state
        self.reasons[motor] = reason

    def touch(self):
        """The positions are about to change: what is remembered is no longer true."""
        if self.settled:
            self.settled = False
            self.memory.spoil()

    def know(self, motor):
        """The host says where it is. To be called before the number changes."""
        self.touch()
        self.put(motor, KNOWN, SET)

    def release(self, motor):
        """Its driver is switched off, or has lost its power."""
        if self.states[motor] == KNOWN:
            self.put(motor, HELD, DRIVER_OFF)

    def lose(self, bits, reason):
        """The motors of these bits are no longer where their numbers say."""
        self.touch()
        for motor in range(self.count):
            if bits >> motor & 1:
                self.put(motor, LOST, reason)

    def cut(self, moving):
        """All motors have lost their power, those of the bits `moving` in motion."""
        self.lose(moving, UNPOWERED)
        for motor in range(self.count):
            self.release(motor)
