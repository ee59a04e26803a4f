"""How late ticks come on the emulated board, for how long interrupts are off, and how long passes
of the main loop are."""

import base64
import contextlib
import struct
from bisect import bisect

from framestep.pulse import stepper
from framestep_tools.payloads import HardStop
from host_tests.fuzz.findings import Finding
from host_tests.observers import Tolerances

LATE_US, MASKED_US = Tolerances.late_us, Tolerances.masked_us


class Ticks:
    """The tick of an emulated board, from outside. address: of its state, if that is known.
    begun_ns: when its trial began."""

    def __init__(self, emulator, repl=None, address=None, begun_ns=0):
        self.emulator = emulator
        self.begun_ns = begun_ns
        self.long: list[float] = []  # when long passes ended within the last second, ms
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

    def passes(self):
        """Return [(when it ended in ms, its length in ms without ticks)] of each pass of a
        millisecond or more since the last call."""
        return [
            ((ns - self.begun_ns) * 1e-6, us * 1e-3)
            for ns, us in self.emulator.cmd("growth")["growths"]
        ]


# by board and rig file: it boots in the same way each time, as long as its modules are the same
addresses: dict[str, int] = {}


def watched(emulator, boot, begun_ns=0):
    """Return the Ticks of a board that has just booted; `boot` says which board and rig file."""
    ticks = Ticks(emulator, None, addresses.get(boot), begun_ns)
    addresses[boot] = ticks.address
    emulator.cycles(clear=True)
    emulator.cmd("growth", address=ticks.address + 4 * stepper.PASSES, least=1000)
    return ticks


def judge(ticks, trial):
    """Raise Finding for what was too late, or took too long, since the last call."""
    within = trial.player.within
    if (late := ticks.worst_late()) > within.late_us:
        raise Finding("late", f"a tick in motion came {late} µs late")
    if (masked := ticks.masked()) > within.masked_us:
        raise Finding("masked", f"interrupts were off for {masked:.0f} µs")
    for end, took in ticks.passes():
        busy = trial.busy[bisect(trial.busy, end) - 1]
        # a pass that saves positions writes to flash
        if end - took - busy < within.settled_ms or trial.rig.remember_positions:
            continue
        text = f"a pass took {took:.2f} ms, {end - busy:.0f} ms after the last request"
        if took > within.longest_pass_ms:
            raise Finding("passes", f"at {end:.0f} ms, {text}")
        if took > within.long_pass_ms:
            ticks.long = [ms for ms in ticks.long if ms > end - 1000] + [end]
            if len(ticks.long) > within.long_passes:
                raise Finding(
                    "passes", f"at {end:.0f} ms, {text}: number {len(ticks.long)} within a second"
                )


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
