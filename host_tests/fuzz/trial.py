"""A session under trial: played millisecond by millisecond, and held to what may never happen.

Everything is judged from what a host sees, what it has sent and been answered, and from the edges on the pins; the
firmware's own words are only compared with these. A Trial knows nothing of who makes up the events, so a script that
has been found once is judged the same when it is replayed.

What is held to:

* every sound request is answered once, in time, in its form; nothing else is answered, nothing but frames is sent
* each motor keeps its velocity, its acceleration (a hard stop: times the factor) and, in moves of its own, its jerk,
  and stays between where it was, where it has been sent to, and its soft limits; coupled motors go together
* at rest the positions told are those of the edges, and while MOTOR_STATUS is 0 no edge comes
* after a stop everything stands within the time that the limits allow; RT_END comes once, and no HARD_STOP without
  a reason
* in a run every motor has made the uploaded position's steps at every frame's time
* outputs have their safe level after an E-stop, a fault or a lost host; a driver that is switched off stays off

The path through uploaded frames may exceed a motor's acceleration (field note 5.5): there the bounds are those of the
cubic through the frames, and what counts is where the motor is at each frame.
"""

import struct
import traceback
from collections import Counter
from itertools import accumulate
from typing import ClassVar

import numpy as np

from framestep.hal.host import CYCLES as MS
from framestep.protocol import messages as m
from framestep_tools import int32
from framestep_tools.script import Script
from framestep_tools.script_player import Player

FREE = float("inf")
STEEPEST = 4_000_000
ANSWER_MS = 300  # passes within which a request is answered, when the host takes the answers
SLOW_MS = 150  # a frame that takes longer to come may be given up
DAMAGE_MS = 2500  # the same behind damage, which may look like the beginning of long frames
FLUSH_EDGES = 150_000
MOTIONS = frozenset(
    (
        m.MSG_MOTOR_MOVE,
        m.MSG_MOTOR_JOG,
        m.MSG_RT_POSITION_FRAME,
        m.MSG_RT_RUN_MOVE,
        m.MSG_RT_SHOOT_FRAME,
        m.MSG_RT_SHOOT_FRAME2,
        m.MSG_RT_GO,
        m.MSG_RT_JOG_ALL,
        m.MSG_VIRT_MOVE,
        m.MSG_VIRT_JOG,
        m.MSG_VIRT_JOG_ON_LINE,
        m.MSG_VIRT_AIM_POINT,
    )
)
LIGHTS = frozenset((m.MSG_GIO_OUT, m.MSG_GIO_CAM, m.MSG_RT_POSITION_FRAME)) | MOTIONS
HEAD = struct.Struct("<2sIHH")


class Finding(Exception):
    """Something that may never happen. kind: one word for what, by which findings are told apart."""

    def __init__(self, kind: str, text: str):
        super().__init__(f"{kind}: {text}")
        self.kind = kind


def checksum(data: bytes) -> tuple[int, int]:
    """Fletcher-16, both sums."""
    return sum(data) % 255, sum(accumulate(data)) % 255


def frame(kind: int, payload: bytes, number: int) -> bytes:
    """The bytes of a message."""
    body = HEAD.pack(b"DF", number, kind, len(payload)) + payload
    a, b = checksum(body)
    first = 255 - (a + b) % 255
    return body + bytes((first, 255 - (a + first) % 255))


class Request:
    """A sound frame that the host has sent. copies: how often, which a fault of the link may do."""

    __slots__ = ("copies", "deadline", "kind", "number", "order", "payload", "sent")

    def __init__(self, number, kind, payload, sent, deadline):
        self.number, self.kind, self.payload, self.sent, self.deadline = number, kind, payload, sent, deadline
        self.copies = 1
        self.order = 0

    @property
    def motor(self):
        return self.payload[0] - 1

    def words(self, form):
        return struct.unpack_from("<" + form, self.payload)


class Motor:
    """What is known of a motor: its settings as acknowledged, and its edges since it last stood."""

    def __init__(self, index, settings):
        self.index = index
        self.backlash = settings["backlash"]
        self.jerk = settings["jerk"] * 1000
        self.edges: list[int] = []  # cycle · 2, +1 where it goes up
        self.seen = self.made = 0  # how many of them have been pulsed by now, and their sum
        self.at = 0  # of the motor, in the numbers that are told, before these edges
        self.load = 0  # the place of the load before these edges
        self.velocity, self.acceleration = 5000, 20000  # as set
        self.flags = m.MOTOR_ENABLED
        self.limits = (None, None)
        self.coupled = 0  # 1 or -1: the next motor does the same
        self.base = 0
        self.leader = None
        self.top = [(0, 5000)]  # (ms, steps/s): what it may do from then on, since it last stood; never less
        self.steep = [(0, 20000)]
        self.least = 20000  # the lowest acceleration since it last stood
        self.jerky = False  # something else than moves of its own since it last stood
        self.low = self.high = 0  # where it may be, since it last stood: of the motor
        self.free = False  # that is not known
        self.soft: tuple | None = (None, None)  # bounds of the motor by the soft limits, None: not known
        self.fresh = True  # it stood before these edges
        self.sent = 0  # places that it has been sent to since it last stood
        self.quiet: int | None = 0  # since when it may not move, ms
        self.quiets: list[tuple[int, int]] = []

    def allow(self, ms, velocity=0.0, acceleration=0.0):
        if velocity > self.top[-1][1]:
            self.top.append((ms, velocity))
        if acceleration > self.steep[-1][1]:
            self.steep.append((ms, acceleration))

    def reach(self, *places):
        """It may go to these places of the load."""
        self.sent += 1
        self.low = min(self.low, min(places) - self.backlash)
        self.high = max(self.high, *places)

    def stands(self, ms):
        """It is known to stand where the edges so far have brought it: bounds begin anew."""
        self.top = [(ms, self.velocity)]
        self.steep = [(ms, self.acceleration)]
        self.least = self.acceleration
        self.jerky = self.free = False
        self.fresh = True
        self.sent = 0
        self.low = self.high = self.at
        self.bound()

    def bound(self):
        lower, upper = self.limits
        self.soft = (
            None if lower is None else min(lower, self.load) - self.backlash,
            None if upper is None else max(upper, self.load),
        )

    def wake(self, ms):
        if self.quiet is not None:
            self.quiets.append((self.quiet, ms))
            self.quiet = None

    def rest(self, ms):
        if self.quiet is None:
            self.quiet = ms


class Upload:
    """The uploaded move as the acknowledged requests have made it."""

    def __init__(self, start=1, end=0):
        self.start, self.count = start, end - start + 1
        self.sent: dict[int, dict[int, int]] = {}
        self.ready = False
        self.known = True
        self.paths: dict[int, np.ndarray] = {}

    def section(self, motor, index, last, steps):
        sent = self.sent.setdefault(motor, {})
        for i, step in enumerate(steps, index):
            if i < self.count:
                sent[i] = step
        if last and steps:
            for i in range(index + len(steps), self.count):
                sent[i] = steps[-1]

    def finish(self):
        self.paths = {}
        for motor, sent in self.sent.items():
            if not sent:
                continue
            path = np.zeros(self.count, np.int64)
            value = sent[min(sent)]
            for i in range(self.count):
                value = sent.get(i, value)
                path[i] = value
            self.paths[motor] = path
        self.ready = True


def play(path, gap, backlash):
    """The load's places for the motor's, both arrays; gap: how far the load is above the motor before."""
    if not backlash:
        return path
    out = np.empty_like(path)
    load = path[0] + gap
    for i, p in enumerate(path.tolist()):
        load = min(max(load, p), p + backlash)
        out[i] = load
    return out


def driven(path, backlash):
    """The motor's steps for a path of the load, and the play taken up where it turns, the worst way."""
    if not backlash:
        return path
    offset, out = 0, path.copy()
    for i in range(1, len(path)):
        if path[i] != path[i - 1]:
            offset = 0 if path[i] > path[i - 1] else -backlash
        out[i] += offset
    return out


def bounds_of(path, fps, backlash):
    """Velocity and acceleration that a smooth, monotonic cubic through these frames may have at most."""
    if len(path) < 2:
        return 0.0, 0.0
    steps = np.abs(np.diff(path)) + backlash
    bends = np.abs(np.diff(path, 2)) + 2 * backlash if len(path) > 2 else steps
    first = np.concatenate((steps[:1], steps, steps[-1:]))
    slopes = 3 * np.minimum(first[1:], first[:-1])
    # the curve's own slopes are central differences, and never beyond three times the lesser chord
    slopes = np.minimum(slopes, 1.7 * np.maximum(first[1:], first[:-1]) + 1)
    # at either end it is a parabola's
    slopes[0] = 1.5 * steps[0] + 0.5 * steps[min(1, len(steps) - 1)]
    slopes[-1] = 1.5 * steps[-1] + 0.5 * steps[max(-2, -len(steps))]
    velocity = max(float(slopes.max()), 1.5 * float(steps.max())) + 1
    acceleration = 9.0 * (max(float(bends.max()), float(steps[0]), float(steps[-1])) + 2)
    return velocity * fps, acceleration * fps * fps


class Trial:
    """See above. `script` gets the events that happen; its header says which board and rig."""

    def __init__(self, script: Script):
        self.script = script
        self.player = player = Player(script, self._edge)
        self.board = player.board
        self.hal = self.board.hal
        self.rig = self.board.rig
        self.count = self.hal.motors
        self.motors = [Motor(i, self.rig.motor(i)) for i in range(self.count)]
        for motor, engine in zip(self.motors, self.hal.engines, strict=True):
            engine.on_step = self._recorder(motor.edges, 0 if self.rig.motor(motor.index)["invert"] else 1)
        self.factor = self.rig.hard_stop_factor
        self.counts: Counter = Counter()
        self.open: dict[int, Request] = {}
        self.passes = 0
        self.stream = bytearray()
        self.since: dict[int, int] = {}  # when that place came, ms
        self.begun: list[int] = []  # places in the stream where a frame may begin that has not all come
        self.garbage = -(10**9)  # when something came that is no frame, in passes
        self.reply = bytearray()
        self.upload = Upload()
        self.prepared = False  # an operation is
        self.going: dict | None = None  # after GO
        self.run: dict | None = None  # what was prepared last
        self.jogs_all = False
        self.virtual = False
        self.virtual_motors: set[int] = set()
        self.idle_since: int | None = 0  # MOTOR_STATUS has been 0 since
        self.rest_by: int | None = None
        self.stood_by: int | None = None  # when that was over, and nothing may move since
        self.motion = 0  # number of the last request that may move something
        self.stop_sent = -(10**9)
        self.stops = 0
        self.stale = -1  # what is sent until then may have been made long before
        self.reason = -1  # a fault has a reason until
        self.estop_pin = self.rig.board.get("estop") if self.rig.estop != "none" else None
        self.estop_level = 0 if self.rig.estop == "no" else 1  # while held
        self.limit_pins = {limit[e] for limit in self.rig.limits for e in ("high", "low") if limit[e] >= 0}
        self.held_since: int | None = None
        self.let_go = -(10**9)  # when it was released last
        self.pressed = False  # since the last HARD_STOP 0
        self.struck = 0  # when a limit switch was touched last
        self.safe_at: int | None = None
        self.lit = -(10**9)
        self.answers: list[tuple[Request | None, int, bytes]] = []  # of this millisecond, for who asks
        self.last_status = -1
        self.told: tuple | None = None
        self.enabling: list[tuple[int, int]] = []
        self.hello = None
        for i in range(self.count):
            self.motors[i].at = self.motors[i].load = self.told_place(i)
            self.motors[i].stands(0)
        if self.estop_pin is not None:
            level = self.hal.levels() >> self.estop_pin & 1
            self._estop(level)

    def told_place(self, i):
        """Where a motor begins: remembered from before."""
        axis = self.board.controller.axes[i]
        return axis.place[0]

    @property
    def ms(self):
        return self.player.ms

    def fail(self, kind, text):
        raise Finding(kind, f"at {self.ms} ms, {text}")

    # ---------------------------------------------------------------- edges

    @staticmethod
    def _recorder(edges, up):
        put = edges.append

        def step(cycle, level):
            put(cycle << 1 | (level == up))

        return step

    def _edge(self, time_ns, signal, value):
        if signal.startswith("enable") and value:
            self.enabling.append((time_ns // 1_000_000, int(signal[6:]) - 1))

    # ---------------------------------------------------------------- events

    def do(self, verb, argument=None):
        """An event of a script, now."""
        self.script.events.append((self.ms, verb, argument))
        try:
            self.player.happen(verb, argument)
        except Exception as error:  # an interrupt handler's
            self._broken(error)
        if verb == "rx":
            if self.board.hal.port.open:
                self._rx(argument)
        elif verb == "close":
            self._closed()
        elif verb == "open":
            self.open.clear()
            self.stream.clear()
            self.begun.clear()
            self.since.clear()
        elif verb == "pin":
            self._pin(*argument)
        elif verb == "drain":
            self.stale = self.ms + 100
        elif verb == "hold":
            self.stale = self.ms + argument + 100
            if argument >= 8:
                self.reason = self.ms + argument + 1500
        elif verb == "skip" and argument >= 2:
            self.stale = self.ms + argument + 100
            self.reason = self.ms + argument + 1500
            for motor in self.motors:
                if motor.quiet is None:
                    motor.allow(self.ms, 0, FREE)
                    motor.jerky = True

    def _broken(self, error):
        places = [p for p in traceback.extract_tb(error.__traceback__) if not p.filename.endswith("int32.py")]
        where = places[-1]
        text = f"{type(error).__name__}: {error}, in {where.name} ({where.filename.rsplit('/', 1)[-1]}:{where.lineno})"
        finding = Finding("exception-" + where.name, f"at {self.ms} ms, {text}")
        raise finding from error

    def _closed(self):
        self.open.clear()
        self.reply.clear()
        self.prepared = False
        self.going = None
        self._stop_bound()
        self.safe_at = self.ms + self._safe_ms()
        self.idle_since = None

    def _pin(self, name, level):
        pins = {name} if isinstance(name, int) else {p for p, n in self.hal.names.items() if n == name}
        if self.estop_pin in pins:
            self._estop(level)
        if self.rig.go_input and pins & {item["pin"] for item in self.rig.inputs}:
            self._set_off()
            self.idle_since = None
            for motor in self.motors:
                motor.wake(self.ms)
        if pins & self.limit_pins:
            self.struck = self.ms
            self._hard()

    def _estop(self, level):
        if level == self.estop_level:
            self.pressed = True
            if self.held_since is not None:
                return
            self.held_since = self.ms
            if self.ms - self.let_go < 40:
                return  # it bounces, and has not been released for the firmware
            self._hard()
            self._stop_bound()
            self.safe_at = self.ms + self._safe_ms()
        elif self.held_since is not None:
            self.held_since = None
            self.let_go = self.ms

    def _safe_ms(self):
        """How long outputs have to get to their safe levels: a video camera is stopped by a pulse first."""
        return 400 if self.run and self.run.get("flags", 0) & m.RUN_VIDEO else 12

    def _hard(self):
        for motor in self.motors:
            motor.allow(self.ms, 0, min(motor.steep[-1][1] * self.factor, STEEPEST))
            motor.jerky = True

    def _stop_bound(self):
        """By when all must stand that is asked to stop now."""
        longest = 0.0
        for motor in self.motors:
            slow = min(motor.least, motor.acceleration)
            t = motor.top[-1][1] / slow
            if motor.jerk:
                t += 2 * max(slow, motor.acceleration) / motor.jerk
            longest = max(longest, t)
        bound = 1.3 * longest * 1000 + 600 + max(motor.backlash for motor in self.motors) * 2
        if self.jogs_all:
            bound += 4500
        if self.virtual:
            bound = 3 * bound + 3000
        by = self.ms + round(bound)
        self.rest_by = by if self.rest_by is None else min(by, self.rest_by)

    # ---------------------------------------------------------------- what the host sends

    def _rx(self, data):
        """Find the sound frames in the stream, wherever they begin."""
        stream = self.stream
        whole = len(data) >= 12 and int.from_bytes(data[8:10], "little") + m.FRAME_OVERHEAD == len(data)
        if whole and not self.begun and not stream and self._sound(data, 0) == len(data):
            return  # the usual case
        base = len(stream)
        stream += data
        begun, at = self.begun, max(base - 1, 0)
        while True:
            at = stream.find(b"DF", at)
            if at < 0:
                break
            if at not in begun:
                begun.append(at)
            at += 2
        left = []
        for at in begun:
            since = self.since.setdefault(at, self.ms)
            got = self._sound(stream, at, self.ms - since > SLOW_MS)
            if got == 0:
                left.append(at)
        self.garbage = self.passes
        self.begun = left
        if stream.endswith(b"D"):
            self.since.setdefault(len(stream) - 1, self.ms)
        if not left and not stream.endswith(b"D"):
            stream.clear()
            self.since.clear()
        elif len(stream) > 20_000:
            stream.clear()
            left.clear()
            self.since.clear()

    def _set_off(self):
        """Something may move from now on."""
        self.stood_by = self.rest_by = None

    def _sound(self, stream, at, slow=False):
        """How many bytes the sound frame there has; 0 if more must come, -1 if there is none."""
        if len(stream) - at < 10:
            return 0 if stream[at : at + 2] == b"DF" else -1
        mark, number, kind, length = HEAD.unpack_from(stream, at)
        if mark != b"DF" or length > m.LARGEST_PAYLOAD:
            return -1
        size = length + m.FRAME_OVERHEAD
        if len(stream) - at < size:
            return 0
        whole = bytes(stream[at : at + size])
        if checksum(whole) != (0, 0):
            return -1
        self._asked(Request(number, kind, whole[10:-2], self.ms, 0), slow)
        return size

    def _asked(self, request, slow):
        self.counts["requests"] += 1
        patience = DAMAGE_MS if self.passes - self.garbage < 2000 else ANSWER_MS
        request.deadline = self.passes + patience if not slow else None
        if request.number in self.open:
            self.open[request.number].copies += 1
            self.garbage = self.passes
            return
        self.open[request.number] = request
        request.order = self.counts["requests"]
        kind = request.kind
        if kind in MOTIONS:
            self._set_off()
            self.motion = request.order
            self.rest_by = None
            self.idle_since = None
            alone = kind in (m.MSG_MOTOR_MOVE, m.MSG_MOTOR_JOG) and not self.virtual and len(request.payload) >= 1
            for motor in self.motors:
                if not alone or motor.index in (request.motor, request.motor + 1, request.motor - 1):
                    motor.wake(self.ms)
        if kind in LIGHTS:
            self.lit = self.ms
            self.safe_at = None
        if kind == m.MSG_MOTOR_SET_SPEED and len(request.payload) >= 9:
            # from now on it may be in force
            motor, velocity, acceleration = request.words("BII")
            if 0 < motor <= self.count and 0 < velocity <= 500_000:
                velocity = max(velocity, 10)
                steep = min(acceleration or max(velocity // 2, 1), STEEPEST)
                self.motors[motor - 1].allow(self.ms, velocity, steep)
        elif kind == m.MSG_MOTOR_STOP_ALL:
            if self.ms - self.stop_sent <= 1400 or (self.stops and (self.jogs_all or self.virtual)):
                self._hard()
            self.stop_sent = self.ms
            self.stops += 1

    # ---------------------------------------------------------------- a millisecond

    def step(self):
        player = self.player
        passing = not player._off and not player._held
        player.sent.clear()
        self.answers.clear()
        int32.armed = True
        try:
            player.step()
        except Exception as error:
            self._broken(error)
        finally:
            int32.armed = False
        if self.enabling:
            self._enabled()
        if player.sent:
            for _, data in player.sent:
                self._heard(data)
        if passing and not player.full:
            self.passes += 1
            if self.open:
                first = next(iter(self.open.values()))
                if first.deadline is None:
                    del self.open[first.number]
                    self.open[first.number] = first
                elif self.passes > first.deadline:
                    self._unanswered(first)
        if self.rest_by is not None and self.ms >= self.rest_by:
            self.rest_by = None
            self.stood_by = self.ms
            for motor in self.motors:
                motor.rest(self.ms)
        if self.safe_at is not None and self.ms >= self.safe_at and passing:
            self._safe()
        for motor in self.motors:
            if len(motor.edges) > FLUSH_EDGES and not (self.going and self.ms - self.going["ms"] < 30_000):
                self.judge(motor)

    def _unanswered(self, request):
        """Behind damage what the reader waits for may look like a frame for long; else each is answered in time."""
        self.fail("unanswered", f"request {request.number} of type {request.kind:#06x} is not answered")

    def _enabled(self):
        for ms, i in self.enabling:
            motor = self.motors[i]
            asked = any(r.kind == m.MSG_MOTOR_CONFIGURE and r.motor == i for r in self.open.values() if r.payload)
            if not motor.flags & m.MOTOR_ENABLED and not asked:
                self.fail("enabled", f"motor {i + 1} is switched on at {ms} ms, but configured as disabled")
        self.enabling.clear()

    def _safe(self):
        """Outputs have their safe level."""
        self.safe_at = None
        levels = self.hal.levels()
        board = self.rig.board
        for name, on in (("shutter", self.rig.shutter_on), ("meter", self.rig.meter_on)):
            if name in board and levels >> board[name] & 1 == (on == "high"):
                self.fail("outputs", f"{name} is still on")
        for i, output in enumerate(self.rig.outputs, 1):
            if output["safe"] != "hold":
                on = (output["on"] == "high") == (output["safe"] == "on")
                if levels >> output["pin"] & 1 != on:
                    self.fail("outputs", f"output {i} is not {output['safe']}")

    # ---------------------------------------------------------------- what the device sends

    def _heard(self, data):
        reply = self.reply
        reply += data
        while len(reply) >= 12:
            mark, number, kind, length = HEAD.unpack_from(reply)
            if mark != b"DF":
                self.fail("bytes", f"something else than frames is sent: {bytes(reply[:20]).hex()}")
            if len(reply) < length + 12:
                return
            whole = bytes(reply[: length + 12])
            del reply[: length + 12]
            if checksum(whole) != (0, 0):
                self.fail("bytes", f"a frame with a wrong checksum is sent: {whole.hex()}")
            self._message(number, kind, whole[10:-2])

    def _message(self, number, kind, payload):
        if number == 0 and not kind & m.MSG_FLAG_ACK:
            self.answers.append((None, kind, payload))
            self._unasked(kind, payload)
            return
        request = self.open.get(number)
        plain = kind & ~m.MSG_FLAG_ACK
        if kind & m.MSG_FLAG_ACK:
            if len(payload) != (4 if self.rig.wide else 2):
                self.fail("form", f"an acknowledgement of {len(payload)} bytes")
            code = payload[0] | payload[1] << 8
        else:
            code = m.OK
        if code == m.ERR_CHECKSUM:
            if self.passes - self.garbage > 5000:
                self.fail("checksum", f"request {number} of type {plain:#06x} is called damaged")
            return
        if request is None or request.kind != plain:
            self.fail("answers", f"an answer to nothing: id {number}, type {kind:#06x}, {payload.hex()}")
        request.copies -= 1
        if not request.copies:
            del self.open[number]
        self.counts[f"{code:#04x}"] += 1
        self.answers.append((request, code, payload))
        if not kind & m.MSG_FLAG_ACK:
            self._reply_form(kind, payload)
        if code == m.OK:
            done = self.DONE.get(plain)
            if done:
                done(self, request, payload)
            if plain in MOTIONS and self.held_since is not None and self.held_since < request.sent - 3:
                self.fail("estop", f"a request of type {plain:#06x} is taken while the E-stop is held")

    def _reply_form(self, kind, payload):
        sizes = {
            m.MSG_HI: 51,
            m.MSG_MOTOR_STATUS: 5,
            m.MSG_MOTOR_GET_POSITION: 4 + 4 * self.count,
            m.MSG_GIO_IN: 4,
            m.MSG_MOTOR_MOVE: 1,
            m.MSG_VIRT_AIM_POINT: 13,
        }
        if sizes.get(kind, len(payload)) != len(payload):
            self.fail("form", f"a reply of type {kind:#06x} with {len(payload)} bytes")

    def _unasked(self, kind, payload):
        self.counts["unasked"] += 1
        if kind == m.MSG_RT_END:
            if not self.prepared and not self.going:
                self.fail("rt-end", "RT_END without an operation, or a second one")
            self._ended()
        elif kind == m.MSG_MOTOR_HARD_STOP:
            self._hard_stop(payload)
        elif kind == m.MSG_RT_GO:
            if not self.rig.go_input or not self.prepared:
                self.fail("go", "RT_GO without an input that gives it, or nothing prepared")
            self._go(None, payload)
        elif kind == m.MSG_MOTOR_GET_POSITION:
            self._reply_form(kind, payload)
            self._pins(payload)
            going = self.going
            if going:
                going["told"].append((self.ms - 1, struct.unpack_from("<i", payload)[0]))
        elif kind == m.MSG_HI:
            self.hello = payload

    def _hard_stop(self, payload):
        reason = payload[0]
        if reason == m.HARD_STOP_FAULT:
            if self.ms > self.reason:
                self.fail("fault", f"HARD_STOP 100 without a reason (fault {self.board.controller.fault:#x})")
            for motor in self.motors:
                motor.jerky = True
            self._stop_bound()
            if self.lit < self.ms - 3:
                self.safe_at = self.ms + self._safe_ms()
        elif reason == m.HARD_STOP_GENERAL:
            if not self.pressed:
                self.fail("hard-stop", "HARD_STOP 0 without an E-stop")
            self.pressed = self.held_since is not None
        elif self.ms - self.struck > 3000 and not self.limit_pins:
            self.fail("hard-stop", f"HARD_STOP {reason} without a limit switch")
        if self.going:
            self.going["whole"] = False

    # ---------------------------------------------------------------- acknowledged requests

    def _status(self, request, payload):
        bits = struct.unpack_from("<I", payload)[0]
        ms = self.ms - 1
        self.last_status = bits
        asked = any(r.kind in MOTIONS for r in self.open.values())
        if asked:
            return
        if bits == 0:
            if self.idle_since is None:
                self.idle_since = ms
            self.stops = 0
            self.jogs_all = False
            if self.going and self.going["motors"] and self.ms - self.idle_since > 400:
                self.fail("rt-end", "everything stands after GO, and RT_END has not come")
        else:
            self.idle_since = None
            if self.stood_by is not None and ms > self.stood_by + 200:
                self.fail("no-rest", f"long after everything was to stop MOTOR_STATUS is {bits:#x}")
        for motor in self.motors:
            if bits >> motor.index & 1:
                continue
            pair = self.motors[motor.index + 1] if motor.coupled else motor.leader
            if pair is not None and bits >> pair.index & 1:
                continue
            if motor.coupled:
                self._together(motor, pair)
            if motor.edges or motor.quiets:
                self.judge(motor)
            motor.stands(ms)
            motor.rest(ms)

    def _positions(self, request, payload):
        """At rest those told are those of the edges."""
        self._pins(payload)
        if self.idle_since is None or self.idle_since < 0 or any(r.kind in MOTIONS for r in self.open.values()):
            return
        for motor in self.motors:
            if motor.quiet is None:
                continue
            told = struct.unpack_from("<i", payload, 4 + 4 * motor.index)[0]
            if motor.edges:
                self.judge(motor)
            if told != motor.load:
                self.fail("positions", f"motor {motor.index + 1} is told to be at {told}, its edges say {motor.load}")

    def _pins(self, payload):
        """Positions in motion are those of the pins, to what may come in a tick or two (field note 4.6)."""
        if self.player.full or self.ms < self.stale:
            return
        limit = (self.hal.cycle() << 1) + 1
        for motor in self.motors:
            edges = motor.edges
            if not edges:
                continue
            n = motor.seen
            while n < len(edges) and edges[n] <= limit:
                motor.made += 1 if edges[n] & 1 else -1
                n += 1
            motor.seen = n
            told = struct.unpack_from("<i", payload, 4 + 4 * motor.index)[0]
            ahead = told - motor.at - motor.made
            slack = 2 + int(motor.top[-1][1] * 2.5e-3)
            if not -slack <= ahead <= motor.backlash + slack:
                self.fail("pins", f"motor {motor.index + 1} is told to be at {told}, its pins are {ahead} steps away")

    def _moved(self, request, payload):
        motor = self.motors[request.motor]
        place = request.words("Bi" if request.kind == m.MSG_MOTOR_MOVE else "BHi")[-1]
        motor.reach(place)
        self._led(motor)
        if self.virtual:
            self._anywhere()

    def _led(self, motor):
        if motor.coupled:
            self.motors[motor.index + 1].free = True

    def _anywhere(self, motors=None):
        for motor in self.motors:
            motor.free = motor.jerky = True

    def _set_speed(self, request, payload):
        i, velocity, acceleration = request.words("BII")
        motor = self.motors[i - 1]
        motor.velocity = max(velocity, 10)
        motor.acceleration = min(acceleration or max(motor.velocity // 2, 1), STEEPEST)
        motor.least = min(motor.least, motor.acceleration)
        motor.allow(self.ms, motor.velocity, motor.acceleration)
        if motor.quiet is not None:
            steep = motor.steep[-1][1]
            motor.stands(self.ms)
            del steep

    def _set_limits(self, request, payload):
        i, lower_on, lower, upper_on, upper, _ = request.words("BBiBiB")
        motor = self.motors[i - 1]
        motor.limits = (lower if lower_on else None, upper if upper_on else None)
        if motor.quiet is not None:
            if motor.edges:
                self.judge(motor)
            motor.bound()
        else:
            motor.soft = None

    def _configured(self, request, payload):
        i, flags = request.words("BB")
        motor = self.motors[i - 1]
        before = motor.flags & 0x30
        motor.flags = flags
        if flags & 0x30 != before and i < self.count:
            partner = self.motors[i]
            if motor.coupled:
                motor.coupled, partner.leader = 0, None
            for each in (motor, partner):
                if each.edges:
                    self.judge(each)
            if flags & 0x30:
                motor.coupled = -1 if flags & m.MOTOR_COUPLE_REVERSED else 1
                partner.leader = motor
                motor.base = partner.at - motor.coupled * motor.at

    def _reset(self, request, payload):
        i, value = request.words("Bi")
        motor = self.motors[i - 1]
        leader = motor if motor.coupled else motor.leader
        if leader is not None:
            partner = self.motors[leader.index + 1]
            self._together(leader, partner)
            for each in (leader, partner):
                self.judge(each)
                each.stands(self.ms)
        self.judge(motor)
        shift = value - motor.load
        motor.at += shift
        motor.load = value
        motor.stands(self.ms)
        if motor.coupled:
            motor.base -= motor.coupled * shift
        elif motor.leader:
            motor.leader.base += shift

    def _upload_begin(self, request, payload):
        start, end = request.words("ii")
        self.upload = Upload(start, end)
        self.prepared = False

    def _upload_axis(self, request, payload):
        i, index = request.words("BI")
        steps = struct.unpack_from(f"<{(len(request.payload) - 5) // 4}i", request.payload, 5)
        self.upload.section(i - 1, index & 0x7FFFFFFF, index >> 31, steps)
        self.upload.ready = False

    def _upload_end(self, request, payload):
        if not self.upload.ready:
            self.upload.finish()

    def _takers(self):
        """Motors with a part in the upload."""
        return [
            motor
            for motor in self.motors
            if motor.index in self.upload.paths
            and motor.flags & (m.MOTOR_ENABLED | m.MOTOR_LIVE) == m.MOTOR_ENABLED
            and not motor.leader
            # a disabled motor keeps still the one that it is coupled to
            and not (motor.coupled and not self.motors[motor.index + 1].flags & m.MOTOR_ENABLED)
        ]

    def _place(self, motor, number):
        return int(self.upload.paths[motor.index][number - self.upload.start])

    def _position_frame(self, request, payload):
        (number,) = request.words("i")
        for motor in self._takers():
            motor.reach(self._place(motor, number))
            self._led(motor)
        self.prepared = False

    def _run_move(self, request, payload):
        fps, start, end, pre, post = request.words("IiiII")
        flags = struct.unpack_from("<H", request.payload, 29)[0] if len(request.payload) > 29 else 0
        fps /= 1000
        self.run = {"fps": fps, "start": start, "end": end, "pre": pre, "post": post, "flags": flags, "shot": False}
        self.prepared = True
        self.going = None
        for motor in self._takers():
            self._rolled(motor, start, pre)
            self._led(motor)

    @staticmethod
    def _over(motor, path):
        """It may go along this path, which passes a turning point by 4/27 of its slope at most."""
        past = 0 if len(path) < 2 else int(np.abs(np.diff(path)).max() * 4 / 27 + 1)
        motor.reach(int(path.min()) - past, int(path.max()) + past)

    def _rolled(self, motor, number, roll_ms):
        """It may go where a ramp to that frame begins or ends."""
        velocity, _ = bounds_of(self._played(motor), self.run["fps"], 0)
        velocity = min(velocity, 3 * (motor.velocity + self.run["fps"]))
        # the last frame lasts its period (field note 6.11)
        way = velocity * roll_ms / 2000 if roll_ms else velocity**2 / 2 / motor.acceleration
        way += velocity / self.run["fps"] if number == self.run["end"] else 0
        place = self._place(motor, number)
        motor.reach(int(place - way - 2), int(place + way + 2))

    def _played(self, motor):
        begin, end = sorted((self.run["start"] - self.upload.start, self.run["end"] - self.upload.start))
        return self.upload.paths[motor.index][max(begin - 2, 0) : end + 4]

    def _go(self, request, payload):
        run = self.run
        self.prepared = False
        self.counts["go"] += 1
        self.going = {"ms": self.ms, "told": [], "whole": True, "motors": [], "marks": {}}
        if run is None:
            return
        if run["shot"]:
            self.going["whole"] = False
            self.going["motors"] = run["motors"]
            for motor in self.motors:
                motor.jerky = motor.free = True
            return
        self.going["run"] = run
        for motor in self._takers():
            self.going["motors"].append(motor)
            if motor.edges:
                self.going["marks"][motor.index] = len(motor.edges)
            path = self._played(motor)
            self._over(motor, path)
            self._rolled(motor, run["start"], run["pre"])
            self._rolled(motor, run["end"], run["post"])
            self._along(motor, path, run["fps"])

    def _along(self, motor, path, fps, extra=0.0):
        velocity, acceleration = bounds_of(path, fps, motor.backlash)
        velocity = min(velocity, 3 * (motor.velocity + fps))
        motor.allow(self.ms, velocity, acceleration + extra)
        motor.jerky = True
        if motor.coupled:
            led = self.motors[motor.index + 1]
            led.allow(self.ms, min(velocity, 3 * (led.velocity + fps)), acceleration + extra)
            led.free = led.jerky = True

    def _ended(self):
        """RT_END: where the run has been undisturbed, it has passed each frame exactly."""
        going, self.going, self.prepared = self.going, None, False
        if going and "run" in going and going["whole"] and not self.stops and not self.virtual:
            self._frames(going)

    def _frames(self, going):
        run = going["run"]
        if run["flags"] & 3:
            return
        step = 1 if run["end"] >= run["start"] else -1
        count = abs(run["end"] - run["start"]) + 1
        if count < 2:
            return
        second = (run["start"] + step) * 1000
        anchor = next((ms for ms, time in going["told"] if time == second), None)
        if anchor is None:
            self.fail("frames", f"frame {second // 1000} was not told in a whole run")
        due = np.array([round(k * 1e6 / run["fps"]) for k in range(-1, count - 1)]) / 1000 + anchor
        best = None
        moving = [motor for motor in going["motors"] if motor.edges]
        for motor in moving:
            if motor.backlash and len(motor.edges) > 20_000:
                return
        numbers = [run["start"] + step * k for k in range(count)]
        offsets = np.arange(-8, 2.01, 0.125)
        worst = np.zeros(len(offsets))
        for motor in moving:
            edges = np.array(motor.edges)
            times = (edges >> 1) / MS
            places = motor.at + np.concatenate(([0], np.cumsum(np.where(edges & 1, 1, -1))))
            if motor.backlash:
                places = play(places, motor.load - motor.at, motor.backlash)
            wanted = np.array([self._place(motor, n) for n in numbers])
            velocity = motor.top[-1][1]
            slack = 1 + velocity * 0.07e-3 + (1 if motor.backlash else 0)
            for i, offset in enumerate(offsets):
                there = places[np.searchsorted(times, due + offset, side="right")]
                worst[i] = max(worst[i], np.abs(there - wanted).max() / slack)
        if len(moving):
            best = worst.min()
            if best > 1:
                self.fail("frames", f"a motor is {best:.1f} times what is allowed beside a frame of the run")
            self.counts["runs judged"] += 1

    def _jog_all(self, request, payload):
        fps, _ = request.words("Ii")
        self.jogs_all = True
        self.prepared = False
        for motor in self._takers():
            path = self.upload.paths[motor.index]
            self._over(motor, path)
            fastest = np.abs(np.diff(path)).max() if len(path) > 1 else 0
            self._along(motor, path, max(fps / 1000, 2.0), 12 * float(fastest + motor.backlash))

    def _shoot(self, request, payload):
        self.prepared = True
        self.going = None
        for motor in self.motors:
            motor.free = True  # how far the ramps reach is for velocity and acceleration to say
        self.run = {"shot": True, "motors": []}

    def _virt_config(self, request, payload):
        self.virtual = request.payload[0] != 0

    def _virtual(self, request, payload):
        self._anywhere()

    def _stop_all(self, request, payload):
        if request.order > self.motion:
            self._stop_bound()
        self._disturbed()

    def _stopped(self, request, payload):
        self._disturbed()

    def _disturbed(self):
        if self.going:
            self.going["whole"] = False

    DONE: ClassVar = {
        m.MSG_MOTOR_STATUS: _status,
        m.MSG_MOTOR_GET_POSITION: _positions,
        m.MSG_MOTOR_MOVE: _moved,
        m.MSG_MOTOR_JOG: _moved,
        m.MSG_MOTOR_STOP: _stopped,
        m.MSG_MOTOR_STOP_ALL: _stop_all,
        m.MSG_MOTOR_SET_SPEED: _set_speed,
        m.MSG_MOTOR_SET_LIMITS: _set_limits,
        m.MSG_MOTOR_CONFIGURE: _configured,
        m.MSG_MOTOR_RESET_POSITION: _reset,
        m.MSG_RT_UPLOAD_MOVE_BEGIN: _upload_begin,
        m.MSG_RT_UPLOAD_MOVE_AXIS: _upload_axis,
        m.MSG_RT_UPLOAD_MOVE_END: _upload_end,
        m.MSG_RT_POSITION_FRAME: _position_frame,
        m.MSG_RT_RUN_MOVE: _run_move,
        m.MSG_RT_GO: _go,
        m.MSG_RT_JOG_ALL: _jog_all,
        m.MSG_RT_SHOOT_FRAME: _shoot,
        m.MSG_RT_SHOOT_FRAME2: _shoot,
        m.MSG_VIRT_CONFIG: _virt_config,
        m.MSG_VIRT_MOVE: _virtual,
        m.MSG_VIRT_JOG: _virtual,
        m.MSG_VIRT_JOG_ON_LINE: _virtual,
        m.MSG_VIRT_AIM_POINT: _virtual,
    }

    # ---------------------------------------------------------------- edges against limits

    def judge(self, motor):
        """Hold the edges of a motor so far to its limits, and go on from where they lead."""
        name = f"motor {motor.index + 1}"
        edges = motor.edges
        quiets, motor.quiets = motor.quiets, []
        if motor.quiet is not None:
            quiets.append((motor.quiet, self.ms + 10))
        if not edges:
            return
        e = np.array(edges)
        cycles = e >> 1
        signs = np.where(e & 1, 1, -1)
        self.counts["edges"] += len(e)
        for since, until in quiets:
            late = cycles[(cycles > (since + 1) * MS) & (cycles < until * MS)]
            if len(late):
                self.fail("quiet", f"{name} makes a step at {late[0] / MS:.2f} ms, but stands since {since} ms")
        places = motor.at + np.cumsum(signs)
        self._where(motor, name, places, cycles)
        first = int(cycles[0]) // MS + (-1 if motor.fresh else 1)
        motor.fresh = False
        # what comes later is not all known while it moves
        grid = np.arange(first, max(min(int(cycles[-1]) // MS + 3, self.ms), first + 1)) * MS
        place = np.concatenate(([motor.at], places))[np.searchsorted(cycles, grid, side="right")]
        ms = grid // MS
        top = self._bound(motor.top, ms)
        steep = self._bound(motor.steep, ms)
        self._fast(motor, name, place, top, ms)
        self._sharp(motor, name, place, steep, ms)
        apart = np.diff(cycles)[signs[1:] == signs[:-1]]
        if len(apart) and motor.top[-1][1] < 100_000:
            # a ramp of a tick or two is only as fine as ticks are
            brief = motor.top[-1][1] < 0.004 * min(motor.steep[-1][1], STEEPEST)
            least = 125e6 / motor.top[-1][1] * (0.5 if brief else 1) - 1000
            if apart.min() < least:
                self.fail(
                    "velocity",
                    f"{name} makes two steps {apart.min() * 8e-3:.1f} µs apart at "
                    f"{cycles[1:][signs[1:] == signs[:-1]][apart.argmin()] / MS:.2f} ms, "
                    f"allowed {motor.top[-1][1]:.0f}/s",
                )
        motor.load = int(play(np.concatenate(([motor.at], places)), motor.load - motor.at, motor.backlash)[-1])
        motor.at = int(places[-1])
        edges.clear()
        motor.seen = motor.made = 0

    def _where(self, motor, name, places, cycles):
        low, high = int(places.min()), int(places.max())
        slack = 1
        if motor.jerk and motor.sent > 1:
            # where no soft limit is near a plan may need more room than the one before it
            times = cycles // (16 * MS)
            fast = 62.5 * float(np.unique(times, return_counts=True)[1].max())
            slack += int(
                fast * fast / motor.least + 4 * fast * min((fast / motor.jerk) ** 0.5, motor.steep[-1][1] / motor.jerk)
            )
        if not motor.free and (low < motor.low - slack or high > motor.high + slack):
            out = low if low < motor.low - slack else high
            at = cycles[(places < motor.low - slack) | (places > motor.high + slack)][0] / MS
            self.fail("astray", f"{name} is at {out}, at {at:.1f} ms outside {motor.low} … {motor.high}")
        if motor.soft is not None:
            lower, upper = motor.soft
            if (lower is not None and low < lower) or (upper is not None and high > upper):
                self.fail("limits", f"{name} goes to {low} … {high}, its soft limits are {lower} … {upper}")

    @staticmethod
    def _bound(changes, ms):
        times = np.array([t for t, _ in changes])
        values = np.array([v for _, v in changes], float)
        return values[np.maximum(np.searchsorted(times, ms, side="right") - 1, 0)]

    def _fast(self, motor, name, place, top, ms):
        w = 1
        while w < len(place) and w <= 512:
            moved = np.abs(place[w:] - place[:-w])
            over = moved > top[w:] * (w * 1.003e-3) + 2.02
            if over.any():
                i = int(np.argmax(over))
                self.fail(
                    "velocity",
                    f"{name} makes {moved[i]} steps in {w} ms from {ms[i]} ms on, allowed {top[i + w]:.0f}/s",
                )
            w *= 2

    def _sharp(self, motor, name, place, steep, ms):
        w = 2
        while 2 * w < len(place) and w <= 512:
            bend = np.abs(place[2 * w :] - 2 * place[w:-w] + place[: -2 * w])
            # of whole steps each is off by less than one; virtual lines are followed within a step (field note 9.5)
            allowed = steep[2 * w :] * (w * w * 1.02e-6) + (7.05 if self.virtual else 4.05)
            over = bend > allowed
            if over.any():
                i = int(np.argmax(over))
                self.fail(
                    "acceleration",
                    f"{name} bends by {bend[i]} steps in 2 x {w} ms from {ms[i]} ms on, {allowed[i]:.1f} are allowed",
                )
            if motor.jerk and not motor.jerky and 3 * w < len(place):
                twist = np.abs(place[3 * w :] - 3 * place[2 * w : -w] + 3 * place[w : -2 * w] - place[: -3 * w])
                allowed = motor.jerk * (w / 1000) ** 3 * 1.02 + 8.05
                if (twist > allowed).any():
                    i = int(np.argmax(twist > allowed))
                    self.fail(
                        "jerk",
                        f"{name} twists by {twist[i]} in 3 x {w} ms from {ms[i]} ms on, {allowed:.1f} are allowed",
                    )
            w *= 2

    def _together(self, motor, partner):
        """Coupled motors go together, at every millisecond and at rest."""
        if motor.edges or partner.edges:
            both = []
            for each, sign in ((motor, motor.coupled), (partner, 1)):
                e = np.array(each.edges or [0])
                signs = np.where(e & 1, sign, -sign) if each.edges else np.array([0])
                both.append((e >> 1, np.concatenate(([0], np.cumsum(signs)))))
            last = max(int(times[-1]) for times, _ in both) // MS + 2
            grid = np.arange(last - 5000 if last > 5000 else 0, last) * MS
            a, b = (places[np.searchsorted(times, grid, side="right")] for times, places in both)
            apart = np.abs(a - b - (a[0] - b[0]))
            ends = int(both[0][1][-1] - both[1][1][-1])
            if apart.max() > 1 or ends:
                i = int(np.argmax(apart > 1))
                self.fail(
                    "coupled",
                    f"motors {motor.index + 1} and {partner.index + 1} are {apart.max()} steps apart from "
                    f"{grid[i] // MS} ms on, {ends} at rest",
                )
