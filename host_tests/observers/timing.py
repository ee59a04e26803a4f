"""How late ticks come on the emulated board, and for how long interrupts are off."""

import base64
import contextlib
import struct

from framestep.pulse import stepper
from framestep_tools.payloads import HardStop
from host_tests.fuzz.findings import Finding
from host_tests.observers import Tolerances

LATE_US, MASKED_US = Tolerances.late_us, Tolerances.masked_us


class Ticks:
    """The tick of an emulated board, from outside. address: of its state, if that is known."""

    def __init__(self, emulator, repl=None, address=None):
        self.emulator = emulator
        if address is None:
            self.repl = repl or emulator.repl()
            self.repl.exec("import uctypes, framestep.boot")
            address = self.repl.eval("uctypes.addressof(framestep.boot.hal.kernel.state)")
        self.address = address

    def _words(self, address, count):
        data = self.emulator.cmd("peek", address=address, length=4 * count)["data"]
        return struct.unpack(f"<{count}i", base64.b64decode(data))

    def worst_late(self):
        """Return the worst lateness of a tick in motion since it was set to 0, microseconds."""
        return self._words(self.address, stepper.HEADER_WORDS)[stepper.WORST_LATE]

    def masked(self):
        """Return the longest time with interrupts off since it was cleared, microseconds."""
        return self.emulator.cycles()["masked"]["us"]


# by board and rig file: it boots in the same way each time, as long as its modules are the same
addresses: dict[str, int] = {}


def watched(emulator, boot):
    """Return the Ticks of a board that has just booted; `boot` says which board and rig file."""
    ticks = Ticks(emulator, address=addresses.get(boot))
    addresses[boot] = ticks.address
    emulator.cycles(clear=True)
    return ticks


def finding(ticks, within):
    """Return what is too late, or None."""
    if (late := ticks.worst_late()) > within.late_us:
        return Finding("late", f"a tick in motion came {late} µs late")
    if (masked := ticks.masked()) > within.masked_us:
        return Finding("masked", f"interrupts were off for {masked:.0f} µs")
    return None


class Timing(Ticks):
    """Measures the board of a session. `late_us` and `masked_us` come from the last judged()."""

    def __init__(self, session, repl=None):
        super().__init__(session.board.emulator, repl)
        self.session = session
        self.late_us = self.masked_us = 0
        self.hard_stops = []
        self.least_queued = 1000

    def wait_for_tick(self, before_us):
        """Let time pass until `before_us` microseconds before the next tick."""
        header = self._words(self.address, stepper.HEADER_WORDS)
        wait = (header[stepper.DUE] - self._words(header[stepper.CLOCK], 1)[0] - before_us) % 1000
        self.session.board.run_until(self.emulator.ns + 1000 * wait)

    def queued(self):
        """Return the fewest ticks queued of a motor in motion with more planned, or None."""
        address = self._words(self.address, stepper.HEADER_WORDS)[stepper.FIRST]
        least = None
        while address:
            block = self._words(address, stepper.BLOCK_WORDS)
            address = block[stepper.NEXT]
            if (
                block[stepper.MODE] == stepper.RUN
                and block[stepper.PLANNED] & stepper.PLAN_SEGMENTS
            ):
                words = stepper.SEGMENTS * stepper.SEGMENT_WORDS
                queue = self._words(block[stepper.QUEUE], words)
                ticks = block[stepper.LEFT] + sum(
                    queue[k % stepper.SEGMENTS * stepper.SEGMENT_WORDS]
                    for k in range(block[stepper.READ_INDEX], block[stepper.WRITE_INDEX])
                )
                least = ticks if least is None else min(least, ticks)
        return least

    def run(self, seconds):
        """Let time pass, and keep in `least_queued` the fewest ticks of queued()."""
        for _ in range(round(seconds * 100)):
            self.session.run(0.01)
            ticks = self.queued()
            if ticks is not None:
                self.least_queued = min(self.least_queued, ticks)

    def begin(self):
        """Forget the measurements."""
        self.repl.exec(f"framestep.boot.hal.kernel.state[{stepper.WORST_LATE}] = 0")
        self.session.board.run_until(self.emulator.ns)
        self.emulator.cycles(clear=True)
        self.least_queued = 1000

    @contextlib.contextmanager
    def judged(self, stops=False):
        """Fail if meanwhile a tick in motion comes late, interrupts are off for long, or the board
        reports a HARD_STOP.

        stops: HARD_STOPs of switches may come.
        """
        self.begin()
        self.session.forget()
        yield
        self.late_us = self.worst_late()
        self.masked_us = self.masked()
        self.hard_stops = self.session.events(HardStop)
        print(f"late {self.late_us} µs, masked {self.masked_us:.0f} µs")
        assert stops or not self.hard_stops
        assert 0 < self.late_us <= LATE_US
        assert self.masked_us <= MASKED_US
