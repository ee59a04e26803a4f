"""How late ticks come on the emulated board, and for how long interrupts are off."""

import base64
import contextlib
import struct

from framestep.motion.stepper import WORST_LATE
from framestep_tools.payloads import HardStop
from host_tests.soak.on_board import LATE_US

MASKED_US = 140  # the longest that interrupts may be off, but for writing of the flash


class Timing:
    """Measures the board of a session. `late_us` and `masked_us`: the last judged() found."""

    def __init__(self, session):
        self.session = session
        self.emulator = session.board.emulator
        self.repl = self.emulator.repl()
        self.repl.exec("import uctypes, framestep.boot")
        self.address = self.repl.eval("uctypes.addressof(framestep.boot.hal.kernel.state)")
        self.late_us = self.masked_us = 0
        self.hard_stops = []

    def worst_late(self):
        """The worst lateness of a tick in motion since begin(), microseconds."""
        data = self.emulator.cmd("peek", address=self.address + 4 * WORST_LATE, length=4)["data"]
        return struct.unpack("<i", base64.b64decode(data))[0]

    def begin(self):
        """Forget what has been measured."""
        self.repl.exec(f"framestep.boot.hal.kernel.state[{WORST_LATE}] = 0")
        self.session.board.run_until(self.emulator.ns)
        self.emulator.cycles(clear=True)

    @contextlib.contextmanager
    def judged(self, stops=False):
        """Fail if a tick in motion comes late meanwhile, interrupts are off for long, or the board
        reports a HARD_STOP.

        stops: HARD_STOPs of switches may come.
        """
        self.begin()
        self.session.forget()
        yield
        self.late_us = self.worst_late()
        self.masked_us = self.emulator.cycles()["masked"]["us"]
        self.hard_stops = self.session.events(HardStop)
        print(f"late {self.late_us} µs, masked {self.masked_us:.0f} µs")
        assert stops or not self.hard_stops
        assert 0 < self.late_us <= LATE_US
        assert self.masked_us <= MASKED_US
