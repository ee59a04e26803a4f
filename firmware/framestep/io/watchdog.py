"""Feeds the watchdog while a motor moves, and detects a host that has stopped reading.

The watchdog runs only while a motor moves. So it never restarts a board at rest on which somebody
uses the REPL, copies files or does a soft reset. It is fed every CHECK_MS while three things are
alive: the main loop, which calls check(); the tick, whose count must have increased; and the host,
which must have read something within HOST_UNREAD_MS. If it is not fed for TIMEOUT_MS it restarts
the board: drivers off, HARD_STOP 100. As a rule the motors are at rest by then: without the main
loop their queues run dry after some tenths of a second, and the tick ramps them down.

A host that has the port open but does not read gets no answers and cannot stop the rig. It counts
as lost, and the motors ramp down (field note 1.11).

Nothing allocates.
"""

from framestep.base.clock import elapsed
from framestep.base.native import const
from framestep.pulse import stepper

TIMEOUT_MS = const(8000)  # the chip's longest is 8388; a slow rig takes seconds to ramp down
CHECK_MS = const(100)
HOST_UNREAD_MS = const(3000)


class Watchdog:
    """Watches over main loop, tick and host.

    hal: see hal/contract.py. outgoing: the FrameWriter, whose `taken` counts the bytes read.
    """

    def __init__(self, hal, outgoing):
        self.hal = hal
        self.dog = hal.watchdog
        self.outgoing = outgoing
        self.checked_at = 0
        self.armed = False
        self._ticks = 0
        self._taken = 0
        self._heard_at = 0  # last time at which the host read, or there was nothing to read

    def check(self, now, moving, is_open):
        """Check the three, every CHECK_MS. Return whether a motor moves although the host is lost.

        now: milliseconds modulo 2^29. moving: whether a motor moves. is_open: whether a host has
        the port open.
        """
        self.checked_at = now
        taken = self.outgoing.taken
        if taken != self._taken or not is_open or not self.outgoing.pending:
            self._taken = taken
            self._heard_at = now
        unread = elapsed(now, self._heard_at) >= HOST_UNREAD_MS
        ticks = self.hal.kernel.state[stepper.TICKS]
        if not moving:
            if self.armed:
                self.armed = False
                self.dog.disarm()
        elif not self.armed:
            self.armed = True
            self.dog.arm(TIMEOUT_MS)
        elif ticks != self._ticks and not unread:
            self.dog.feed()
        self._ticks = ticks
        return moving and unread
