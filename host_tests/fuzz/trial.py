"""A session under trial: played millisecond by millisecond, and checked for what must not happen.

The trial judges by what a host sees, by its requests and their answers, and by the edges on the
pins; it only compares the firmware's own statements with these. A Trial does not know who makes up
the events, so it judges a script in the same way whenever it is replayed.

These are the rules:

* every valid request gets one answer, in time and in its form; nothing else gets an answer, and
  only frames are sent
* on an emulated chip ticks come in time, interrupts are on, and passes are short between requests
* each motor keeps within its velocity, its acceleration (in a hard stop: times the factor) and, in
  its own moves, its jerk, and stays between where it was, its targets, and its soft limits; coupled
  motors go together
* at rest the reported positions match the edges, and while MOTOR_STATUS is 0 no edge comes
* a motor with a target, and a motor at the end of a run, comes to rest there
* after a stop of everything, or of one motor, or of a jog that is not repeated, the motors rest
  within the time that their limits allow; RT_END comes once, and no HARD_STOP without a reason
* no operation is accepted while MOTOR_STATUS has a bit
* at every frame's time of a run every motor has made the steps of the uploaded position
* outputs have their safe level after an E-stop, a fault or a lost host; a driver that is switched
  off stays off

Each subject has its own file: link.py the bytes, replies.py the answers, bounds.py what a motor may
do, edges.py the judge of edges, runs.py uploaded moves, stops.py whatever stops motors.

The path through uploaded frames may exceed a motor's acceleration (field note 5.5): then the bounds
are those of the cubic through the frames, and the place of the motor at each frame counts.
"""

import traceback
from collections import Counter
from typing import Any

from framestep.io.watchdog import HOST_UNREAD_MS
from framestep.motors.backlash import LOAD
from framestep.protocol import messages as m
from host_tests.observers import timing
from host_tests.script import Script
from host_tests.script_player import Player

from .bounds import FREE, STEEPEST, Motor
from .chip_player import ChipPlayer
from .edges import Edges
from .findings import Finding
from .link import Link, Request
from .replies import DAMAGE_MS, QUESTIONS, Replies
from .runs import Runs
from .stops import Stops

ANSWER_MS = 300  # passes within which a request gets its answer, if the host takes the answers
WORKING_MS = 3000  # the same while somebody works on the REPL
TIMING_MS = 500  # from one look at an emulated chip's ticks to the next
FLUSH_EDGES = 150_000
# what leaves motors on their way, besides what concerns neither motors nor virtual axes
KEEPS_GOALS = QUESTIONS | {m.MSG_MOTOR_SET_SPEED, m.MSG_DMX, m.MSG_GIO_OUT, m.MSG_GIO_CAM}


class Trial:
    """See above. `script` receives the events; its header names the board and the rig, unless there
    is a player already."""

    def __init__(self, script: Script, player: Any = None):
        self.script = script
        if player is None:
            player = (Player if script.target == "host" else ChipPlayer)(script, self._edge)
        self.player = player
        self.board = player.board
        self.hal = self.board.hal
        self.rig = self.board.rig
        self.count = self.hal.motors
        self.motors = [Motor(i, self.rig.motor(i)) for i in range(self.count)]
        for motor, engine in zip(self.motors, self.hal.engines, strict=True):
            engine.on_step = self._recorder(
                motor.edges, 0 if self.rig.motor(motor.index)["invert"] else 1
            )
        self.counts: Counter = Counter()
        self.looks: set[str] = set()  # what was compared, of observers.OBSERVERS
        self.open: dict[int, Request] = {}  # by number: without an answer
        # of this millisecond, for those who ask
        self.answers: list[tuple[Request | None, int, bytes]] = []
        self.passes = 0
        self.answered = 0  # the last answer, ms
        # when anything but a question came or was answered, a port or a pin changed, ms
        self.busy = [0]
        self.garbage = -(10**9)  # the last that was no frame, in passes
        self.virtual = False
        self.lines: set[int] = set()  # motors of the virtual rig
        self.moving = 0  # what MOTOR_STATUS says of this millisecond
        self.before_pass = 0  # bytes sent in this millisecond before its tick
        self.idle_since: int | None = 0  # since then MOTOR_STATUS is 0
        self.last_status = -1
        self.full_at = 0  # since then the host reads nothing
        self.skipped_from, self.skipped_to = 0, -1  # the last row of ms without ticks
        self.upset = 0  # goals are known for requests from this one on
        self.motion = 0  # number of the last request that may move something
        self.stale = -1  # the end of `late`, ms
        self.link = Link(self)
        self.edges = Edges(self)
        self.stops = Stops(self)
        self.runs = Runs(self)
        self.replies = Replies(self)
        for motor in self.motors:
            # as saved
            motor.at = motor.load = self.board.controller.axes[motor.index].backlash[LOAD]
            motor.at_rest(0)
        if self.stops.estop_pin is not None:
            self.stops.estop(self.hal.levels() >> self.stops.estop_pin & 1)

    @property
    def ms(self):
        return self.player.ms

    @property
    def late(self):
        """Whether what arrives now may have been made long before."""
        return self.player.full or self.ms < self.stale

    def fail(self, kind, text):
        raise Finding(kind, f"at {self.ms} ms, {text}")

    @staticmethod
    def _recorder(edges, up):
        put = edges.append

        def step(cycle, level):
            put(cycle << 1 | (level == up))

        return step

    def _edge(self, time_ns, signal, value):
        if signal.startswith("enable") and value:
            self.stops.enabling.append((time_ns // 1_000_000, int(signal[6:]) - 1))

    def do(self, verb, argument=None):
        """Do an event of a script, now."""
        self.script.events.append((self.ms, verb, argument))
        if verb != "rx":
            self.busy.append(self.ms)
        try:
            self.player.happen(verb, argument)
        except Exception as error:  # from an interrupt handler
            self._broken(error)
        if verb == "rx":
            if self.board.hal.port.open:
                self.link.sent(argument)
        elif verb == "prompt":
            self.before_pass = len(self.board.hal.port.outgoing)
        elif verb == "close":
            self._closed()
        elif verb == "open":
            self.open.clear()
            self.link.opened()
            self.answered = self.ms + self.player.within.settled_ms  # it may still be starting
        elif verb == "pin":
            self.anything_may_stop()
            self.stops.pin(*argument)
        elif verb == "full":
            self.full_at = self.ms
            self.anything_may_stop()
        elif verb == "drain":
            self.anything_may_stop()
            # a host that does not read is lost, and gets no RT_END
            self.runs.lost |= self.ms - self.full_at >= HOST_UNREAD_MS
            self.stale = self.ms + 100
        elif verb == "hold":
            self.stale = self.ms + argument + 100
            if argument >= 8:
                self.stops.reason = self.ms + argument + 1500
        elif verb == "skip":
            if self.ms > self.skipped_to:
                self.skipped_from = self.ms
            self.skipped_to = self.ms + argument
            if self.skipped_to - self.skipped_from >= 2:
                self.stale = self.skipped_to + 100
                self.stops.reason = self.skipped_to + 1500
                for motor in self.motors:
                    if motor.quiet is None:
                        motor.allow(self.ms, 0, FREE)
                        motor.jerky = True

    def _broken(self, error):
        where = traceback.extract_tb(error.__traceback__)[-1]
        text = (
            f"{type(error).__name__}: {error}, "
            f"in {where.name} ({where.filename.rsplit('/', 1)[-1]}:{where.lineno})"
        )
        finding = Finding("exception-" + where.name, f"at {self.ms} ms, {text}")
        raise finding from error

    def close(self):
        """End the board."""
        self.player.close()

    def judge(self, motor):
        """Compare a motor's edges so far with its limits, then start from their end."""
        self.edges.judge(motor)

    def anything_may_stop(self, order=None):
        """Forget where motors come to rest. order: of the request that causes it."""
        self.upset = order or self.counts["requests"] + 1
        for motor in self.motors:
            motor.goals = ()
        self.runs.may_stop()

    def _closed(self):
        self.anything_may_stop()
        for request in self.open.values():
            for motor in self.motors:  # perhaps they have been carried out: their answers are lost
                if request.payload[:1] != bytes((motor.index + 1,)):
                    continue
                if request.kind == m.MSG_MOTOR_RESET_POSITION:
                    motor.renumbered = True
                elif request.kind == m.MSG_MOTOR_SET_LIMITS:
                    motor.soft, motor.limits = None, (None, None)
                elif request.kind == m.MSG_RT_UPLOAD_MOVE_AXIS:
                    motor.uploaded = motor.free = motor.jerky = True
        self.open.clear()
        self.link.reply.clear()
        self.runs.prepared = False
        self.runs.going = None
        self.stops.begin()
        self.stops.safe_at = self.ms + self.stops.safe_ms()
        self.idle_since = None

    def asked(self, request, slow):
        """Take a valid request; from now on its effects are allowed. slow: some of it came long
        ago."""
        self.counts["requests"] += 1
        patience = DAMAGE_MS if self.passes - self.garbage < 2000 else ANSWER_MS
        request.deadline = self.passes + patience if not slow else None
        if request.number in self.open:
            self.open[request.number].copies += 1
            self.garbage = self.passes
            if request.kind == m.MSG_MOTOR_STOP_ALL:
                self.stops.hard()
            return
        self.open[request.number] = request
        request.order = self.counts["requests"]
        kind = request.kind
        if kind not in QUESTIONS:
            self.busy.append(self.ms)
        if kind == m.MSG_MOTOR_MOVE and 0 <= request.motor < self.count:
            self.motors[request.motor].goals = ()
        elif kind not in KEEPS_GOALS:
            self.anything_may_stop(request.order)
        if request.moves:
            self.stops.set_off()
            self.motion = request.order
            self.idle_since = None
            alone = (
                kind in (m.MSG_MOTOR_MOVE, m.MSG_MOTOR_JOG)
                and not self.virtual
                and len(request.payload) >= 1
            )
            for motor in self.motors:
                if not alone or motor.index in (
                    request.motor,
                    request.motor + 1,
                    request.motor - 1,
                ):
                    motor.wake(self.ms)
        if request.lights:
            self.stops.lit = self.ms
            self.stops.safe_at = None
        if kind == m.MSG_MOTOR_SET_SPEED and len(request.payload) >= 9:
            # from now on it may have effect
            motor, velocity, acceleration = request.words("BII")
            if 0 < motor <= self.count and 0 < velocity <= 500_000:
                velocity = max(velocity, 10)
                steep = min(acceleration or max(velocity // 2, 1), STEEPEST)
                self.motors[motor - 1].allow(self.ms, velocity, steep)
        elif kind == m.MSG_MOTOR_STOP_ALL:
            if self.ms - self.stops.all_at <= 1400 or (
                self.stops.asked and (self.runs.jogs_all or self.virtual)
            ):
                self.stops.hard()
            self.stops.all_at = self.ms
            self.stops.asked += 1

    def step(self):
        """Play a millisecond."""
        player = self.player
        if player.working:  # passes may be late, and queues run dry
            self.stale = self.ms + 100
            self.stops.reason = self.ms + 1500
        passing = not player._off and not player._held
        if (player._held or player.full) and self.runs.going:
            self.runs.going["held"] = True  # more than a frame may pass until the next report
        if player.full and self.ms <= self.stops.reason:
            self.stops.reason = self.ms + 1500  # the report of a fault waits
        player.sent.clear()
        self.answers.clear()
        self.moving = 0
        try:
            player.step()
        except Finding:
            raise
        except Exception as error:
            self._broken(error)
        if self.stops.enabling:
            self.stops.enabled()
        if player.sent:
            for _, data in player.sent:
                self.link.heard(data[: self.before_pass])
                self.moving = 0  # since then a tick may have brought it to rest
                self.link.heard(data[self.before_pass :])
        self.before_pass = 0
        if player.working and self.open:
            first = min(self.open.values(), key=lambda request: request.sent)
            if self.ms - first.sent > WORKING_MS:
                self._unanswered(first)
        if passing and not player.full:
            self.passes += 1
            if self.open:
                first = next(iter(self.open.values()))
                if first.deadline is None:
                    del self.open[first.number]
                    self.open[first.number] = first
                elif self.passes > first.deadline:
                    self._unanswered(first)
        if player.ticks and self.ms % TIMING_MS == 0:
            timing.judge(player.ticks, self)
        if self.stops.rest_by is not None and self.ms >= self.stops.rest_by:
            self.stops.rest_by = None
            self.stops.stood_by = self.ms
            self.looks.add("stops")
            for motor in self.motors:
                motor.rest(self.ms)
        if self.stops.safe_at is not None:
            if not passing:  # the passes after that have their full time
                self.stops.safe_at = max(self.stops.safe_at, self.ms + self.stops.safe_ms())
            elif self.ms >= self.stops.safe_at:
                self.stops.safe()
        for motor in self.motors:
            if len(motor.edges) > FLUSH_EDGES and not (
                self.runs.going and self.ms - self.runs.going["ms"] < 30_000
            ):
                self.judge(motor)

    def _unanswered(self, request):
        """Fail: after damage the reader may wait long for what looks like a frame; otherwise each
        request gets its answer in time."""
        self.fail(
            "unanswered", f"request {request.number} of type {request.kind:#06x} is not answered"
        )
