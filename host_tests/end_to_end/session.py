"""A session with a controller, like Dragonframe's: requests, unasked messages, and the edges on the
pins.

The tests use only what comes over the protocol port or from the pins; only `settings` looks
inside.
"""

import os
import re
import weakref
from array import array
from collections import deque
from pathlib import Path

import numpy as np

from framestep.moves.operation_runner import READY
from framestep_tools import payloads as p
from framestep_tools.client.client import Client
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.judge import motion_limits
from framestep_tools.judge.trace import Trace
from framestep_tools.simulator.boards import LockstepPort, SimulatedBoard
from framestep_tools.traffic.log import DEVICE, HOST, LogWriter, Recorder
from framestep_tools.traffic.sniffer import describe_entry
from host_tests import observers

DIALECTS = ("spec", "dmc-lite")
SETTLE_S = 0.05  # from the last report to the last edges
_SHOWN = 12  # lines of a log, with a failure
BOOT_S = 10  # a board with one port appears before it has loaded its code


class _LoggedPort(LockstepPort):
    """Keeps what has passed, (time, who, bytes), for the log of a test that fails."""

    def __init__(self, board):
        self.passed = deque(maxlen=20_000)
        self.test = ""  # the last one that has sent something
        super().__init__(board)

    def read(self, size=1):
        data = super().read(size)
        if data:
            self.passed.append((self.clock(), DEVICE, data))
        return data

    def write(self, data):
        self.test = os.environ.get("PYTEST_CURRENT_TEST", "")
        self.passed.append((self.clock(), HOST, bytes(data)))
        return super().write(data)

    def write_log(self, path):
        """Write the log of all that has passed, as `framestep lab sniff` does. Return its lines."""
        path.parent.mkdir(parents=True, exist_ok=True)
        times = [0.0]
        with path.open("w") as file:
            recorder = Recorder(LogWriter(file, self.test, describe_entry).add, lambda: times[-1])
            recorder.port(True)
            for time, who, data in self.passed:
                times.append(time)
                recorder.passed(who, data)
            recorder.end()
        return path.read_text().splitlines()


_ports = weakref.WeakSet()  # of all sessions that are in use


def logs_of(test: str, folder: Path) -> str:
    """Write the logs of the sessions in which a test has sent something last. Return the end of
    each, and where it is."""
    said = ""
    ports = [port for port in _ports if port.test.startswith(f"{test} (")]
    for number, port in enumerate(ports, 1):
        path = folder / f"{re.sub('[^a-zA-Z0-9_.-]+', '-', test)}-{number}.log"
        last = [line[:200] for line in port.write_log(path)[-_SHOWN:]]
        said += "\n".join([*last, f"all of it: {path}", "again: framestep lab replay FILE PORT\n"])
    return said


class Session:
    """One board, one client, and every edge so far. Times are seconds of the board's clock.

    What the host does and what passes time returns the session, so that a line can say what is
    requested and how long it goes on: `session.accept(MotorMove(1, 100)).run(0.5)`.

    reply_s: how long `answer_to` waits for an answer.
    """

    def __init__(self, board, motors=8, reply_s=0.02):
        self.board = board
        self.motors = motors
        self.reply_s = reply_s
        observers.begin(board)
        self.port = _LoggedPort(board)
        _ports.add(self.port)
        self.client = Client(self.port)
        self._trace = Trace({})  # the edges so far
        self.client.wait_event(p.DeviceInfo, BOOT_S)  # field note 1.5

    # ---- the host's end

    def leave(self):
        """Close the port, as the host."""
        self.port.channel.open_port(False)
        return self

    def come_back(self):
        """Open it again."""
        self.port.channel.open_port(True)
        return self

    # ---- time and messages

    @property
    def now(self):
        return self.client.clock()

    def run(self, seconds):
        self.client.pump(seconds)
        return self

    def ask_positions(self):
        return self.client.request(p.MotorGetPosition())

    def ask(self, request):
        return self.client.request(request)

    def code(self, request):
        return self.client.code(request)

    def accept(self, *requests):
        """Send requests; each must be accepted."""
        return self.refuse(p.Ack.OK, *requests)

    def refuse(self, code, *requests):
        """Send requests; each must be refused with this code."""
        for request in requests:
            sent = self.now
            found = self.code(request)
            assert found == code, (
                f"sent at {sent:.3f} s of the board's time: {request}; "
                f"came: {_name(found)}; expected: {_name(code)}"
            )
        return self

    def bytes_for(self, data, seconds=0.02):
        """Return the answer to raw bytes, as frames. Unasked messages are among them."""
        self.port.write(data)
        self.board.run_until(self.board.now_ns + round(seconds * 1e9))
        decoder = FrameDecoder()
        self.port.timeout = 0
        frames = decoder.feed(self.port.read(100_000))
        assert decoder.skipped == 0, "something else than frames came"
        assert decoder.pending == 0, "something else than frames came"
        return frames

    def answer_to(self, kind, payload=b"", id=77):
        """Return the one frame that answers a request."""
        answers = [f for f in self.bytes_for(encode(kind, payload, id), self.reply_s) if f.id == id]
        assert len(answers) == 1, answers
        assert answers[0].request_type == kind, answers
        return answers[0]

    def wait_idle(self, timeout_s=60):
        self.client.wait_idle(timeout_s, poll_s=0.02)
        return self.run(SETTLE_S)

    def until(self, kind, timeout_s=None, where=None):
        """Wait for an unasked message of a class (Client.wait_event)."""
        self.client.wait_event(kind, timeout_s, where)
        return self

    def input(self, name, level):
        """Set an input of a simulated board, by its name or its pin."""
        self.board._board.set_input(name, level)
        return self

    def events(self, kind):
        """Return [(time, message)] of the unasked messages of a class so far."""
        return [
            (event.time_s, event.message)
            for event in self.client.events
            if isinstance(event.message, kind)
        ]

    def forget(self):
        """Drop the unasked messages and the edges until now."""
        self.client.events.clear()
        self.board.edges()
        self._trace = Trace({})
        return self

    # ---- motors

    @property
    def positions(self):
        """Return {motor: reported position}."""
        return dict(enumerate(self.ask(p.MotorGetPosition()).steps, 1))

    def position(self, motor):
        return self.positions[motor]

    @property
    def moving(self):
        return self.ask(p.MotorStatus()).moving

    def speed(self, motor, velocity, acceleration):
        return self.accept(p.MotorSetSpeed(motor, velocity, acceleration))

    def trace(self):
        """Return all edges so far."""
        edges = self.board.edges()
        if edges:
            self._trace = self._trace.with_edges(edges)
        return self._trace

    def steps(self, motor):
        """Return the times (s) and directions of a motor's steps."""
        times, signs = self.trace().steps(motor)
        return times * 1e-9, signs

    def made(self, motor):
        """Return the steps of a motor, counted from its edges."""
        return int(self.steps(motor)[1].sum())

    # ---- moves

    def upload(self, positions, start_frame=1, window=4):
        frames = max(len(steps) for steps in positions.values())
        self.client.upload_move(start_frame, start_frame + frames - 1, positions, window)
        return self

    def ready(self, run):
        """Send RUN_MOVE, and wait until the motors are where it begins."""
        return self.accept(run).wait_idle()

    def play(self, run, timeout_s=60):
        """Play a whole run. Return where the motors waited; the trace then has only the run's
        edges."""
        self.ready(run)
        before = self.positions
        self.forget()
        self.accept(p.RtGo())
        self.client.wait_event(p.RtEnd, timeout_s)
        self.run(0.3)
        self.wait_idle()  # on the end frame again (field note 6.11)
        assert not self.events(p.RtEnd), "RT_END came twice"
        return before

    def frames_reported(self):
        """MOVE TIMEs of the position reports, without repetitions."""
        times = [message.move_time for _, message in self.events(p.Positions)]
        return [t for i, t in enumerate(times) if i == 0 or times[i - 1] != t]


def _name(code):
    name = p.Ack(code).name if code in set(p.Ack) else "an unknown code"
    return f"{name} (0x{code:04X})"


def simulated(rig=None, motors=8, **memory):
    """Return a session with the host simulation. memory: upload_bytes of SimulatedBoard."""
    return Session(SimulatedBoard(rig=rig, motors=motors, **memory), motors)


def released(rig, *pins):
    """Return a simulated board whose stop button and switches on these pins are open."""
    board = SimulatedBoard(rig)
    for pin in ("estop", *pins):
        board._board.set_input(pin, 1)
    board.run_until(50_000_000)
    board.edges()
    return board


def tell(board, *requests):
    """Send requests by a client that then leaves."""
    with Client(LockstepPort(board)) as client:
        for request in requests:
            client.request(request)


def run_request(fps=24, start=1, end=2, pre=500, post=500, **more):
    return p.RtRunMove(round(fps * 1000), start, end, pre, post, **more)


# ---- switches and inputs of a simulated board ----------------------------------------------------

VELOCITY, ACCELERATION = 5000, 20000  # field note 4.1
SWITCHES = {"limits": [{"high": 22, "low": 26}, {"high": 27, "low": 28, "contact": "no"}]}


def inputs(session):
    return session.ask(p.GioIn()).levels


def calm(session, estop=False):
    """Close the switches, so that no input is active."""
    for pin in (22, 26):
        session.input(pin, 0)
    if estop:
        session.input("estop", 0)
    session.run(0.05).forget()


# ---- what edges show -----------------------------------------------------------------------------


def velocities(times, signs, window, begin=None, end=None):
    """Return the mean velocities (steps/s) in consecutive windows, and when each begins."""
    begin = times[0] if begin is None else begin
    end = times[-1] if end is None else end
    places, grid = _places(times, signs, window, begin, end)
    return np.diff(places) / window, grid[:-1]


def _places(times, signs, window, begin, end):
    """Return where a motor was at the beginning of each window, and when that was."""
    grid = np.arange(begin, end, window)
    made = np.searchsorted(times, grid, side="right")
    return np.concatenate(([0], np.cumsum(signs)))[made], grid


def assert_within(times, signs, velocity, acceleration, window=0.04):
    """Assert that edges are as far apart as the velocity demands, and keep within the
    acceleration."""
    assert len(times) > 2
    assert_no_faster(times, velocity)
    places, begins = _places(times, signs, window, times[0], times[-1])
    most = motion_limits.EDGES.most(motion_limits.ACCELERATION, acceleration, window)
    if found := motion_limits.beyond(places, motion_limits.ACCELERATION, 1, most):
        at, steps, allowed = found
        raise AssertionError(
            f"between two windows of {window} s from {begins[at]:.4f} s on the steps differ by "
            f"{steps}, allowed are {allowed:.1f}"
        )


def assert_no_faster(times, velocity):
    """Assert that edges are as far apart as the velocity demands."""
    first = motion_limits.too_close(times, 1 / velocity - motion_limits.EDGES.early_s)
    assert first is None, (
        f"at {times[first]:.6f} s two steps are {1e6 * (times[first + 1] - times[first]):.1f} µs "
        f"apart, allowed are {velocity} steps/s"
    )


def deceleration(times, signs, after):
    """Return how steeply a motor slowed down to rest after a time, steps/s²: a parabola through the
    edges of the ramp."""
    late = times > after
    position = np.cumsum(signs[late])
    left = np.abs(position - position[-1])
    # without the first ms, in which nothing happens
    ramp = (left > 0.02 * left[0]) & (left < 0.7 * left[0])
    assert ramp.sum() >= 8, "too few steps to tell"
    return abs(2 * np.polyfit(times[late][ramp] - after, position[ramp], 2)[0])


# ---- the inside ------------------------------------------------------------------------------

# What changes with time or with any request, working memory (jog.phases.numbers is
# player.numbers), and memory beyond the entries in use
_SCRATCH = re.compile(
    r"\.(now|now_ns|housekept_at|refused|active_passes|beat|colour|unreported|watchdog|_clock|port|header|kernel\.state|reader|writer|heard_at|begun_at|words"
    r"|exceeded|axes\.axes\.\d+\.word|(axes\.)?samples|store\._words|values|draft|moves\.positions|(player|move_check|phases)\.(numbers|window|rate)|planner\.(lasts|rests)|triggers\._table)(\.|$)"
)


def state(session):
    """Return everything that the controller keeps, {path: value}, except its working memory: no
    refusal may change it."""
    found, seen = {}, set()

    def walk(thing, path):
        if isinstance(thing, int | float | str | bytes | None):
            found[path] = thing
        elif isinstance(thing, array | bytearray | memoryview):
            found[path] = bytes(thing)
        elif id(thing) not in seen and not _SCRATCH.search(path):
            seen.add(id(thing))
            if isinstance(thing, list | tuple):
                parts = enumerate(thing)
            elif isinstance(thing, dict):
                parts = thing.items()
            else:
                parts = (
                    vars(thing).items() if type(thing).__module__.startswith("framestep.") else ()
                )
            for name, part in parts:
                walk(part, f"{path}.{name}")

    controller = session.board._board.controller
    if controller.operations.state == READY:
        session.run(0.05)  # enough to plan again what any request drops
    walk(controller, "")
    return {path: value for path, value in found.items() if not _SCRATCH.search(path)}


LATEST = 0.0022  # s after the end of a pulse until the path reaches its width


def pulses(session, motor=2):
    """Return the rises of a servo's pulses in s, and their widths in µs."""
    none = np.array([], dtype=np.int64)
    times, levels = session.trace().signals.get(f"servo{motor}", (none, none))
    rises, falls = times[levels == 1], times[levels == 0]
    if len(falls) and len(rises):
        falls = falls[falls > rises[0]]
    count = min(len(rises), len(falls))
    return rises[:count] * 1e-9, (falls[:count] - rises[:count]) * 1e-3


def assert_follows(
    session, start, steps_per_us, motor=1, farthest=False, servo=2, sense=1, beside=None
):
    """Assert that each pulse has the width of a place of the step motor at its end or within
    LATEST.

    start: the motor's position before its first edge. Widths are 1500 µs at 0. farthest: only until
    its highest position, the end of the post-roll, because each motor starts its way back on its
    own. sense: -1 if the servo moves the other way. beside: the session with the step motor, if it
    is another one with the same requests.
    """
    rises, widths = pulses(session, servo)
    times, signs = (beside or session).steps(motor)
    made = start + np.concatenate([[0], np.cumsum(signs)])
    ends = rises + widths * 1e-6
    if farthest:
        ends = ends[ends < times[np.argmax(made) - 1]]
        assert len(ends) > 40
    first = np.searchsorted(times, ends)
    last = np.searchsorted(times, ends + LATEST)
    steps = (widths[: len(ends)] - 1500) * steps_per_us * sense
    for k, (i, j) in enumerate(zip(first, last, strict=True)):
        places = made[i : j + 1]
        assert places.min() - 1.1 < steps[k] < places.max() + 1.1, (
            f"at {ends[k]:.4f} s {steps[k]:.1f} steps, motor {places}"
        )


# ---- DMX512, from the edges of its pin alone -----------------------------------------------------

BIT_NS = 4000
SLOT_NS = 11 * BIT_NS
_BREAK_NS = 80_000  # longer than any data


def dmx_frames(times, levels):
    """Return [(start of break, break, mark after break in ns, slots, longest gap between slots in
    ns)] of a line's complete frames. times: of its edges, in ns; levels: after each."""
    falls = times[levels == 0]
    ends = np.append(times[1:], times[-1] + 1)[levels == 0]
    found = []
    breaks = np.flatnonzero(ends - falls > _BREAK_NS)
    for k, at in enumerate(breaks[:-1]):
        begin = ends[at]  # the mark's
        until = falls[breaks[k + 1]]
        inside = (times >= begin) & (times < until)
        found.append(
            (
                int(falls[at]),
                int(ends[at] - falls[at]),
                int(falls[at + 1] - begin),
                *_slots(times[inside], levels[inside]),
            )
        )
    return found


def _slots(times, levels):
    """Return a frame's bytes, by samples in the middle of bits, and the longest gap between them;
    8 data bits, two stop bits."""
    slots = bytearray()
    longest = 0
    at = 1  # times[0] is the rise that begins the mark
    previous = None
    while at < len(times):
        start = times[at]
        if previous is not None:
            longest = max(longest, int(start - previous - SLOT_NS))
        previous = start
        samples = start + BIT_NS * np.arange(0.5, 11)
        index = np.searchsorted(times, samples, side="right") - 1
        bits = levels[index]
        assert bits[0] == 0, "no start or stop bit"
        assert bits[9] == bits[10] == 1, "no start or stop bit"
        slots.append(int(np.packbits(bits[1:9], bitorder="little")[0]))
        at = int(np.searchsorted(times, start + 10 * BIT_NS))
    return bytes(slots), longest
