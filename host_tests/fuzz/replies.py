"""What answers may say, and what each acknowledgement allows the motors to do from then on."""

import struct

from framestep.protocol import messages as m
from framestep_tools.payloads import REQUESTS, Ack
from host_tests.protocol.notes import table

from .bounds import STEEPEST
from .findings import Part

LATE_MS = 1500  # for delayed passes
DAMAGE_MS = 2500  # after damage, which may look like the beginning of long frames
OPERATIONS = (m.MSG_RT_RUN_MOVE, m.MSG_RT_SHOOT_FRAME, m.MSG_RT_SHOOT_FRAME2)
QUESTIONS = frozenset(
    kind for kind, cls in REQUESTS.items() if cls.REPLY is not Ack and not cls.MOVES
)
FORMS = {row.number: row.reported for row in table().values()}  # of the device's messages


class Replies(Part):
    """Takes what the device sends, message by message."""

    def __init__(self, trial):
        super().__init__(trial)
        self.done = {
            m.MSG_MOTOR_STATUS: self._status,
            m.MSG_MOTOR_GET_POSITION: self._positions,
            m.MSG_MOTOR_MOVE: self._moved,
            m.MSG_MOTOR_JOG: self._moved,
            m.MSG_HOME: self._homes,
            m.MSG_MOTOR_STOP: self._stopped,
            m.MSG_MOTOR_STOP_ALL: self._stop_all,
            m.MSG_MOTOR_SET_SPEED: self._set_speed,
            m.MSG_MOTOR_SET_LIMITS: self._set_limits,
            m.MSG_MOTOR_CONFIGURE: self._configured,
            m.MSG_MOTOR_RESET_POSITION: self._reset,
            m.MSG_VIRT_CONFIG: self._virt_config,
            m.MSG_VIRT_MOVE: self._virtual,
            m.MSG_VIRT_JOG: self._virtual,
            m.MSG_VIRT_JOG_ON_LINE: self._virtual,
            m.MSG_VIRT_AIM_POINT: self._virtual,
            **trial.runs.done,
        }

    def message(self, number, kind, payload):
        if number == 0 and not kind & m.MSG_FLAG_ACK:
            self.trial.answers.append((None, kind, payload))
            self._unasked(kind, payload)
            return
        request = self.open.get(number)
        plain = kind & ~m.MSG_FLAG_ACK
        if kind & m.MSG_FLAG_ACK:
            if len(payload) != (4 if self.rig.dword_acks else 2):
                self.fail("form", f"an acknowledgement of {len(payload)} bytes")
            code = payload[0] | payload[1] << 8
        else:
            code = m.OK
        if code == m.ERR_CHECKSUM:
            if self.trial.passes - self.trial.garbage > 5000:
                self.fail("checksum", f"request {number} of type {plain:#06x} is called damaged")
            return
        if request is None or request.kind & ~m.MSG_FLAG_ACK != plain:
            self.fail(
                "answers", f"an answer to nothing: id {number}, type {kind:#06x}, {payload.hex()}"
            )
        self.looks.add("answers")
        self._in_time(request)
        request.copies -= 1
        if not request.copies:
            del self.open[number]
        self.counts[f"{code:#04x}"] += 1
        if plain not in QUESTIONS and plain not in OPERATIONS:
            self.trial.moving = 0
        self.trial.answers.append((request, code, payload))
        if not kind & m.MSG_FLAG_ACK:
            self._form(kind, payload)
        if code == m.OK:
            if plain in OPERATIONS and self.trial.moving:
                self.fail(
                    "taken",
                    f"a request of type {plain:#06x} is taken while {self.trial.moving:#x} moves",
                )
            done = self.done.get(plain)
            if done:
                done(request, payload)
            held = self.trial.stops.held_since
            if request.moves and held is not None and held < request.sent - 3:
                self.fail(
                    "estop", f"a request of type {plain:#06x} is taken while the E-stop is held"
                )

    def _in_time(self, request):
        """Judge how long a request that moves nothing has waited, since the answer before it.
        Planning may go on for a while after the answer to one that moves something."""
        trial = self.trial
        waited = self.ms - max(request.sent, trial.answered)
        busy = self.player.within.settled_ms if request.moves else 0
        trial.answered = max(trial.answered, self.ms + busy)
        if request.kind not in QUESTIONS:
            trial.busy.append(self.ms)
        most = self.player.within.answer_ms
        if request.moves or trial.late or trial.passes - trial.garbage < DAMAGE_MS:
            return
        # a pass that saves positions writes to flash
        if most and waited > most and not self.rig.remember_positions:
            self.fail("slow", f"a request of type {request.kind:#06x} has waited {waited} ms")

    def _form(self, kind, payload):
        if len(payload) not in [least + entry * self.count for least, entry in FORMS.get(kind, ())]:
            self.fail("form", f"a reply of type {kind:#06x} with {len(payload)} bytes")

    def _unasked(self, kind, payload):
        self.counts["unasked"] += 1
        if kind == m.MSG_RT_END:
            runs = self.trial.runs
            if not runs.prepared and not runs.going and not runs.lost:
                self.fail("rt-end", "RT_END without an operation, or a second one")
            self.trial.runs.ended()
        elif kind == m.MSG_MOTOR_HARD_STOP:
            self.trial.stops.reported(payload)
        elif kind == m.MSG_RT_GO:
            if not self.rig.go_input or not self.trial.runs.prepared:
                self.fail("go", "RT_GO without an input that gives it, or nothing prepared")
            self.trial.idle_since = None  # a status from before its input was debounced says 0
            for motor in self.motors:
                motor.wake(self.ms - 1)
            self.trial.runs.go(None, payload)
        elif kind == m.MSG_MOTOR_GET_POSITION:
            self._form(kind, payload)
            self._pins(payload)
            going = self.trial.runs.going
            if going:
                ms = None if self.trial.late else self.ms - 1
                going["reported"].append((ms, struct.unpack_from("<i", payload)[0]))

    def _status(self, request, payload):
        bits = struct.unpack_from("<I", payload)[0]
        ms = self.ms - 1
        self.trial.last_status = bits
        self.trial.moving = bits
        self._overdue(bits, ms)
        if self.may_set_off():
            return
        if bits == 0:
            if self.trial.idle_since is None:
                self.trial.idle_since = ms
            self.trial.stops.asked = 0
            self.trial.runs.jogs_all = 0
            going = self.trial.runs.going
            if self.trial.runs.lost:
                going = None
            if going and going["motors"] and self.ms - self.trial.idle_since > 400:
                self.fail("rt-end", "everything stands after GO, and RT_END has not come")
        else:
            self.trial.idle_since = None
            stood_by = self.trial.stops.stood_by
            if stood_by is not None and ms > stood_by + 200 and not self.trial.late:
                self.fail("no-rest", f"long after everything was to stop MOTOR_STATUS is {bits:#x}")
        for motor in self.motors:
            if bits >> motor.index & 1:
                continue
            pair = self.motors[motor.index + 1] if motor.coupled else motor.leader
            if pair is not None and bits >> pair.index & 1:
                continue
            if motor.coupled:
                self.trial.edges.together(motor, pair)
            motor.rest(self.player.heard_ms - 1)
            if motor.edges or motor.quiets:
                self.trial.edges.judge(motor)
            if motor.homing:
                motor.homing, motor.renumbered = False, True
            elif motor.goals and not motor.renumbered:
                self.looks.add("goals")
                if motor.load not in motor.goals:
                    self.fail(
                        "goal",
                        f"motor {motor.index + 1} has come to rest on {motor.load}, not on "
                        f"{motor.goals}",
                    )
            motor.goals = ()
            motor.at_rest(ms)

    def _overdue(self, bits, ms):
        """Motors that were stopped, or whose jogs were not repeated, must rest in time."""
        for motor in self.motors:
            if not bits >> motor.index & 1:
                motor.rest_by = motor.let_go_by = None
            elif self.trial.late:
                continue
            elif motor.rest_by is not None and ms > motor.rest_by:
                self.fail("stop", f"motor {motor.index + 1} has been stopped, and still moves")
            elif motor.let_go_by is not None and ms > motor.let_go_by:
                self.fail(
                    "jog", f"motor {motor.index + 1} jogs on, though that is not asked for any more"
                )

    def _positions(self, request, payload):
        """At rest the reported positions match the edges."""
        self._pins(payload)
        if self.trial.idle_since is None or self.trial.idle_since < 0 or self.may_set_off():
            return
        for motor in self.motors:
            if motor.quiet is None:
                continue
            reported = struct.unpack_from("<i", payload, 4 + 4 * motor.index)[0]
            if motor.edges:
                self.trial.edges.judge(motor)
            if motor.renumbered:
                self._renumber(motor, reported)
            if motor.loose:
                motor.loose = False
                if abs(reported - motor.load) <= motor.backlash:
                    motor.load = reported
            self.looks.add("positions")
            if reported != motor.load:
                self.fail(
                    "positions",
                    f"motor {motor.index + 1} is reported at {reported}, "
                    f"its edges say {motor.load}",
                )

    def _renumber(self, motor, reported):
        """Accept this position after homing: a new one, or the one as before."""
        motor.renumbered = False
        if reported != motor.load and motor.sent == 0 and not motor.edges:
            self.counts["homed"] += 1
        motor.at += reported - motor.load
        motor.load = reported
        motor.at_rest(self.ms)

    def _pins(self, payload):
        """Positions in motion match the pins, except for a tick or two (field note
        4.6)."""
        if self.trial.late:
            return
        limit = (self.hal.cycle() << 1) + 1
        age = self.player.within.report_s
        if self.ms <= self.trial.skipped_to + 1:  # a single tick: more make it `late`
            age += 0.001
        for motor in self.motors:
            edges = motor.edges
            if not edges or motor.homing or motor.renumbered:
                continue
            n = motor.seen
            while n < len(edges) and edges[n] <= limit:
                motor.made += 1 if edges[n] & 1 else -1
                n += 1
            motor.seen = n
            reported = struct.unpack_from("<i", payload, 4 + 4 * motor.index)[0]
            ahead = reported - motor.at - motor.made
            slack = 2 + int(motor.top[-1][1] * age)
            self.looks.add("pins")
            if not -slack <= ahead <= motor.backlash + slack:
                self.fail(
                    "pins",
                    f"motor {motor.index + 1} is reported at {reported}, "
                    f"its pins are {ahead} steps away",
                )

    def _moved(self, request, payload):
        motor = self.motors[request.motor]
        motor.let_go_by = None
        if request.sent <= self.trial.stops.reported_at:  # it acts after that stop
            self.trial.stops.set_off()
        if (
            request.kind == m.MSG_MOTOR_JOG
            and self.rig.jog_timeout_ms
            and motor.index not in self.trial.lines
        ):
            motor.let_go_by = (
                self.ms + self.rig.jog_timeout_ms + self.trial.stops.longest_ms() + LATE_MS
            )
        place = request.words("Bi" if request.kind == m.MSG_MOTOR_MOVE else "BHi")[-1]
        motor.reach(place)
        if request.kind == m.MSG_MOTOR_MOVE:
            self.goes_to(motor, request.order, place)
        self.led(motor)
        if self.trial.virtual:
            self.anywhere()

    def _homes(self, request, payload):
        for motor in self.motors:
            asked = motor.index + 1 in request.payload if request.payload else motor.home
            if asked and motor.flags & m.MOTOR_ENABLED and motor.leader is None:
                if motor.edges:
                    self.trial.edges.judge(motor)
                motor.let_go_by = None
                motor.at_rest(self.ms)
                motor.homes(self.rig.hard_stop_factor)
                self.led(motor)
                if motor.coupled:  # its limits do not count either
                    self.motors[motor.index + 1].soft = None

    def _set_speed(self, request, payload):
        i, velocity, acceleration = request.words("BII")
        motor = self.motors[i - 1]
        if motor.quiet is not None and motor.edges:
            self.trial.edges.judge(motor)
        motor.velocity = max(velocity, 10)
        motor.acceleration = min(acceleration or max(motor.velocity // 2, 1), STEEPEST)
        motor.least = min(motor.least, motor.acceleration)
        motor.allow(self.ms, motor.velocity, motor.acceleration)
        if motor.quiet is not None:
            motor.at_rest(self.ms)

    def _set_limits(self, request, payload):
        i, lower_on, lower, upper_on, upper, switches = request.words("BBiBiB")
        motor = self.motors[i - 1]
        motor.limits = (lower if lower_on else None, upper if upper_on else None)
        if switches:
            self.trial.stops.hard()  # one of them may be active
        if motor.quiet is not None:
            if motor.edges:
                self.trial.edges.judge(motor)
            motor.bound()
        else:
            motor.soft = None
            motor.may_come_back()

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
                    self.trial.edges.judge(each)
            if flags & 0x30:
                motor.coupled = -1 if flags & m.MOTOR_COUPLE_REVERSED else 1
                partner.leader = motor

    def _reset(self, request, payload):
        i, value = request.words("Bi")
        motor = self.motors[i - 1]
        leader = motor if motor.coupled else motor.leader
        if leader is not None:
            partner = self.motors[leader.index + 1]
            self.trial.edges.together(leader, partner)
            for each in (leader, partner):
                self.trial.edges.judge(each)
                each.at_rest(self.ms)
        self.trial.edges.judge(motor)
        motor.renumbered = False
        motor.at += value - motor.load
        motor.load = value
        motor.at_rest(self.ms)

    def _virt_config(self, request, payload):
        kind = request.payload[0]
        self.trial.virtual = kind != 0
        size, axes = (8, 2) if kind == m.VIRT_SWING_PAN else (12, 6)
        data = request.payload if kind else b""
        at = range(1, min(1 + size * axes, len(data) - 3), size)
        self.trial.lines = {struct.unpack_from("<i", data, i)[0] - 1 for i in at}

    def _virtual(self, request, payload):
        self.anywhere()
        for i in self.trial.lines:
            if 0 <= i < self.count:
                self.motors[i].let_go_by = None

    def _stop_all(self, request, payload):
        if request.order > self.trial.motion:
            self.trial.stops.begin()
        self.trial.runs.disturbed()

    def _stopped(self, request, payload):
        if request.order > self.trial.motion and 0 <= request.motor < self.count:
            self.motors[request.motor].rest_by = self.ms + self.trial.stops.longest_ms() + LATE_MS
        self.trial.runs.disturbed()
