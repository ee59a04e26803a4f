"""A trial of a session that is conducted by somebody else."""

from operator import itemgetter

from host_tests.fuzz.findings import Finding
from host_tests.fuzz.shown import CYCLE_NS, MS_NS, Shown
from host_tests.fuzz.trial import Trial
from host_tests.observers import IN_CHIPS, Tolerances, timing
from host_tests.observers.timing import Ticks
from host_tests.script import Script


class _Shown(Shown):
    """What a board has shown by a millisecond. What it does next is up to somebody else."""

    def __init__(self, rig, motors, levels, within: Tolerances):
        super().__init__(rig, motors, levels, is_open=True)
        self.within = within
        self.arrived = b""  # in the present millisecond

    def happen(self, verb, argument=None):
        """Take what the host has done."""
        if verb in ("open", "close"):
            self.board.hal.port.open = verb == "open"
        elif verb == "pin":
            self.level(*argument)

    def step(self):
        if self.arrived:
            self.sent.append((self.ms, self.arrived))
            self.arrived = b""
        self.ms += 1

    def close(self):
        """Do nothing: the board is somebody else's."""


def _levels(board, rig):
    """Return the levels of all pins of a board that has just started."""
    if hasattr(board, "host_board"):
        hal = board.host_board.hal
        estop = rig.board.get("estop", 0)
        levels = hal.levels()
        # with a chain of outputs the HAL's bits are not numbered by pins
        return levels if "chain" not in rig.board else (levels >> hal._place(estop) & 1) << estop
    levels = (1 << 128) - 1  # inputs are pulled up
    for name, on in (("shutter", rig.shutter_on), ("meter", rig.meter_on)):
        if name in rig.board and on == "high":
            levels &= ~(1 << rig.board[name])
    for output in rig.outputs:
        if (output["on"] == "high") == (output["safe"] != "on"):
            levels &= ~(1 << output["pin"])
    return levels


class Watch:
    """Notes what passes a board's port and pins, by replacing methods on the object."""

    def __init__(self, board, rig, within: Tolerances):
        self.board = board
        self.found: Finding | None = None
        self.ticks: Ticks | None = None  # of an emulated chip
        self._earlier_ns = within.earlier_ns
        on_host = hasattr(board, "host_board")
        motors = board.host_board.hal.motors if on_host else len(rig.board["step"])
        self._shown = _Shown(rig, motors, _levels(board, rig), within)
        script = Script("watched", {})
        self.trial = Trial(script, self._shown)
        self._steps = {f"m{i}": motor.edges for i, motor in enumerate(self.trial.motors, 1)}
        self._noted: list[tuple[int, str, object]] = []
        self._kept: list = []  # edges that the session has not taken yet
        self._seen: list = []  # edges that have not been judged yet, the last one first
        self._edges = board.edges
        board.edges = self._take_edges
        self._run_until = board.run_until
        board.run_until = self._run
        port = board.protocol
        self._replace(port, "receive", lambda data: self._note("rx", bytes(data)))
        self._replace(port, "open_port", lambda on: self._note("open" if on else "close"))
        self._transmit = port.transmit
        port.transmit = self._pass_on
        if on_host:
            pins, drive = board.host_board.hal, "set_level"
        else:
            pins, drive = getattr(board, "emulator", board), "set_pin"
        self._replace(pins, drive, lambda pin, level: self._note("pin", (pin, level)))

    def _replace(self, thing, name, note):
        done = getattr(thing, name)

        def noted(*words):
            note(*words)
            return done(*words)

        setattr(thing, name, noted)

    def _note(self, verb, argument=None):
        self._noted.append((self.board.now_ns, verb, argument))

    def _run(self, ns, until_output=False):
        self._run_until(ns, until_output)
        if not until_output:
            self._note("away")

    def _pass_on(self):
        data = self._transmit()
        if data:
            self._note("tx", data)
        return data

    def _take_edges(self):
        self._read_edges()
        edges, self._kept = self._kept, []
        return edges

    def _read_edges(self):
        edges = self._edges()
        self._kept += edges
        self._seen += edges

    def end(self) -> None:
        """Judge nothing from now on."""
        self.found = Finding("ended", "")

    def settle(self) -> Finding | None:
        """Judge what has happened so far, and the motors up to now. Return the first finding,
        once."""
        if self.found:
            self._noted.clear()
            self._seen.clear()
            return None
        try:
            self.follow()
            for motor in self.trial.motors:
                self.trial.judge(motor)
            if self.ticks:
                self.trial.looks |= IN_CHIPS
                timing.judge(self.ticks, self.trial)
        except Finding as finding:
            self.found = finding
        return self.found

    def looks(self) -> set[str]:
        """Return the observers that have compared something since the last call."""
        found = set(self.trial.looks)
        self.trial.looks.clear()
        return found

    def follow(self) -> None:
        """Take what has happened so far. Raises Finding for what must not happen."""
        self._read_edges()
        noted, self._noted = self._noted, []
        self._seen.sort(key=itemgetter(0), reverse=True)
        for ns, verb, argument in noted:
            self._until(ns)
            self._shown.heard_ms = ns / MS_NS
            if verb == "tx" and self._shown.ms > ns // MS_NS:  # a second answer in a millisecond
                self.trial.moving = 0
                self.trial.link.heard(argument)
            elif verb == "tx":
                self._shown.arrived = argument
                self.trial.step()
            elif verb == "away":  # what comes next has waited for its reader
                self.trial.stale = self.trial.ms + 3
            else:
                self.trial.do(verb, argument)
                if verb == "open" and self._shown.within.keeps_unread:
                    self.trial.stale = self.trial.ms + 100
        self._until(self.board.now_ns)

    def _until(self, ns):
        """Let the trial pass to this time: single milliseconds only where it looks at one."""
        trial, shown = self.trial, self._shown
        shown.now_ns = ns
        seen, earlier, steps = self._seen, self._earlier_ns, self._steps
        while seen and seen[-1][0] + earlier <= ns:
            at, signal, value = seen.pop()
            if signal in steps:
                steps[signal].append((at + earlier) // CYCLE_NS << 1 | (value > 0))
            else:
                shown.level(signal, value)
        end = ns // MS_NS
        while shown.ms < end:
            stops = trial.stops
            looks = [end, *(ms for ms in (stops.rest_by, stops.safe_at) if ms is not None)]
            skipped = min(looks) - shown.ms - 1
            if trial.open:
                skipped = min(skipped, 100)
            if skipped > 0:
                shown.ms += skipped
                trial.passes += skipped
            trial.step()
