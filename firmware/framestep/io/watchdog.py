"""What keeps the watchdog quiet, and the host that no longer listens.

The watchdog runs only while a motor moves, so it never strikes someone who works on the REPL, copies files or resets
softly with the motors at rest. It is fed every LOOK_MS, as long as three things are alive: the main loop, which calls
look(); the tick, whose count must have gone on; and the queue of reports, from which the host must have taken
something within DEAF_MS. If it is not fed for TIMEOUT_MS the board starts again: drivers off, HARD_STOP 100. By then
the motors have come to rest on their own, as a rule: without the main loop their queues run dry after some tenths of a
second, and the tick ramps them down.

A host that has the port open and takes nothing is deaf: positions pile up, no request gets an answer, so nobody could
stop the rig. That is a lost host, and the motors ramp down as for one (field note 1.11).

Nothing allocates.
"""

from framestep.clock import elapsed
from framestep.motion import stepper
from framestep.native import const

TIMEOUT_MS = const(8000)  # the chip's longest is 8388; a slow rig takes seconds to ramp down
LOOK_MS = const(100)
DEAF_MS = const(3000)


class Watchdog:
    """hal: see framestep.hal; outgoing: what the host is to take, with `taken` and `pending` bytes."""

    def __init__(self, hal, outgoing):
        self.hal = hal
        self.dog = hal.watchdog
        self.outgoing = outgoing
        self.looked_at = 0
        self.armed = False
        self._ticks = 0
        self._taken = 0
        self._heard_at = 0  # when the host last took something, or there was nothing to take

    def look(self, now, moving, is_open):
        """To be called every LOOK_MS. True where something moves although the host is deaf.

        now: milliseconds modulo 2^29; moving: whether a motor does; is_open: whether a host has the port open.
        """
        self.looked_at = now
        taken = self.outgoing.taken
        if taken != self._taken or not is_open or not self.outgoing.pending:
            self._taken = taken
            self._heard_at = now
        deaf = elapsed(now, self._heard_at) >= DEAF_MS
        ticks = self.hal.kernel.state[stepper.TICKS]
        if not moving:
            if self.armed:
                self.armed = False
                self.dog.disarm()
        elif not self.armed:
            self.armed = True
            self.dog.arm(TIMEOUT_MS)
        elif ticks != self._ticks and not deaf:
            self.dog.feed()
        self._ticks = ticks
        return moving and deaf
