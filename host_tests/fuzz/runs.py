"""Uploaded moves and what plays them: where the motors may go, and where they must be at each
frame."""

import struct

import numpy as np

from framestep.hal.host import CYCLES as MS
from framestep.protocol import messages as m
from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.judge.ripple import origins_ns

from .bounds import Upload, bounds_of, play
from .findings import Part

_SLACK_NS = 20_000  # for a step onto a frame; on the ESP32 of chip_player.py, a pulse and a half


class Runs(Part):
    """RUN_MOVE, SHOOT_FRAME, POSITION_FRAME and JOG_ALL; `done` is the effect of an acknowledgement
    of each."""

    def __init__(self, trial):
        super().__init__(trial)
        self.upload = Upload()
        self.prepared = False  # there is an operation
        self.going: dict | None = None  # after GO
        self.lost = False  # it is not known whether RT_END comes
        self.goes: list[int] = []  # the time of each GO
        self.run: dict | None = None  # the last that was prepared
        self.jogs_all = 0  # ms that a JOG_ALL may take to come to rest; 0: there is none
        self.done = {
            m.MSG_RT_UPLOAD_MOVE_BEGIN: self._upload_begin,
            m.MSG_RT_UPLOAD_MOVE_AXIS: self._upload_axis,
            m.MSG_RT_UPLOAD_MOVE_END: self._upload_end,
            m.MSG_RT_POSITION_FRAME: self._position_frame,
            m.MSG_RT_RUN_MOVE: self._run_move,
            m.MSG_RT_GO: self.go,
            m.MSG_RT_JOG_ALL: self._jog_all,
            m.MSG_RT_SHOOT_FRAME: self._shoot,
            m.MSG_RT_SHOOT_FRAME2: self._shoot,
        }

    def _upload_begin(self, request, payload):
        start, end = request.words("ii")
        self.upload = Upload(start, end)
        self.prepared = False
        for motor in self.motors:
            motor.uploaded = False

    def _upload_axis(self, request, payload):
        i, index = request.words("BI")
        steps = struct.unpack_from(f"<{(len(request.payload) - 5) // 4}i", request.payload, 5)
        self.upload.section(i - 1, index & 0x7FFFFFFF, index >> 31, steps)
        self.upload.ready = False

    def _upload_end(self, request, payload):
        if not self.upload.ready:
            self.upload.finish()

    def _takers(self):
        """Return the motors of the upload."""
        return [
            motor
            for motor in self.motors
            if motor.index in self.upload.paths
            and motor.flags & (m.MOTOR_ENABLED | m.MOTOR_LIVE) == m.MOTOR_ENABLED
            and not motor.leader
            # a disabled motor also prevents its coupled motor from moving
            and not (motor.coupled and not self.motors[motor.index + 1].flags & m.MOTOR_ENABLED)
        ]

    def _place(self, motor, number):
        return int(self.upload.paths[motor.index][number - self.upload.start])

    def _position_frame(self, request, payload):
        (number,) = request.words("i")
        for motor in self._takers():
            motor.let_go_by = None
            motor.reach(self._place(motor, number))
            self.goes_to(motor, request.order, self._place(motor, number))
            self.led(motor)
        # An operation during its stop ends with RT_END; nobody knows whether that comes before or
        # after this request.
        self.lost = self.lost or (self.prepared and self.trial.stops.stopping)
        self.prepared = False

    def _run_move(self, request, payload):
        fps, start, end, pre, post = request.words("IiiII")
        flags = (
            struct.unpack_from("<H", request.payload, 29)[0] if len(request.payload) >= 31 else 0
        )
        fps /= 1000
        self.run = {
            "fps": fps, "start": start, "end": end, "pre": pre, "post": post, "flags": flags,
            "shot": False,
        }  # fmt: skip
        self.prepared = True
        self.lost = False
        self.going = None
        for motor in self._takers():
            motor.let_go_by = None
            self._rolled(motor, start, pre)
            self.led(motor)

    @staticmethod
    def _over(motor, path):
        """Allow this path, which passes a turning point by 4/27 of its slope at most."""
        past = 0 if len(path) < 2 else int(np.abs(np.diff(path)).max() * 4 / 27 + 1)
        motor.reach(int(path.min()) - past, int(path.max()) + past)

    @staticmethod
    def _beside(motor, path, fps):
        """Allow a stop beside the path, which turns more steeply than a stop: between whole steps,
        where it takes up backlash, or where the move asks for it."""
        velocity, acceleration = bounds_of(path, fps, motor.backlash, motor.velocity)
        velocity = min(velocity, 3 * (motor.velocity + fps))
        # below 100 steps/s it ends within the step
        turns = velocity > 100 and acceleration > motor.least
        way = int(velocity**2 / 2 / motor.least) + 1 if turns else 1
        motor.reach(int(path.min()) - way, int(path.max()) + way)

    def may_stop(self):
        """Allow a run that is under way to end beside its path."""
        if self.going and self.going.get("run") is self.run:
            for motor, path in self.going["paths"]:  # of the move, while the next is uploaded
                self._beside(motor, path, self.run["fps"])

    def _rolled(self, motor, number, roll_ms):
        """Allow the begin or end of a ramp at that frame."""
        velocity, _ = bounds_of(self._played(motor), self.run["fps"], 0)
        velocity = min(velocity, 3 * (motor.velocity + self.run["fps"]))
        # the last frame lasts its period (field note 6.11)
        acceleration = motor.acceleration
        if motor.coupled:  # the lower of the two counts
            acceleration = min(acceleration, self.motors[motor.index + 1].acceleration)
        way = velocity * roll_ms / 2000 if roll_ms else velocity**2 / 2 / acceleration
        if number == self.run["end"] or self.run["flags"] & 3:  # of a loop, either may be the last
            way += velocity / self.run["fps"]
        place = self._place(motor, number)
        motor.reach(int(place - way - 2), int(place + way + 2))

    def _played(self, motor):
        begin, end = sorted(
            (self.run["start"] - self.upload.start, self.run["end"] - self.upload.start)
        )
        return self.upload.paths[motor.index][max(begin - 2, 0) : end + 4]

    def go(self, request, payload):
        run = self.run
        self.prepared = False
        self.counts["go"] += 1
        self.goes.append(self.ms)
        self.going = {"ms": self.ms, "reported": [], "whole": True, "motors": [], "held": False}
        self.going["order"] = request.order if request else self.trial.counts["requests"]
        if run is None:
            return
        for motor in self.motors if run["shot"] else self._takers():
            motor.let_go_by = None
        if run["shot"]:
            self.going["whole"] = False
            self.going["motors"] = run["motors"]
            for motor in self.motors:
                motor.jerky = motor.free = True
            return
        self.going["run"] = run
        self.going["paths"] = []
        for motor in self._takers():
            self.going["motors"].append(motor)
            path = self._played(motor)
            self.going["paths"].append((motor, path))
            self._over(motor, path)
            self._rolled(motor, run["start"], run["pre"])
            self._rolled(motor, run["end"], run["post"])
            self._along(motor, path, run["fps"])

    def _along(self, motor, path, fps, extra=0.0):
        velocity, acceleration = bounds_of(path, fps, motor.backlash, motor.velocity)
        velocity = min(velocity, 3 * (motor.velocity + fps))
        motor.allow(self.ms, velocity, acceleration + extra)
        motor.jerky = True
        if motor.coupled:
            led = self.motors[motor.index + 1]
            led.allow(self.ms, min(velocity, 3 * (led.velocity + fps)), acceleration + extra)
            led.free = led.jerky = True

    def ended(self):
        """Judge a run at its RT_END: undisturbed, it has passed each frame exactly."""
        going, self.going, self.prepared = self.going, None, False
        if going and "run" in going and going["whole"] and not self.trial.stops.asked:
            self._frames(going)
            looped = going["run"]["flags"] & 3
            ends = [going["run"][end] for end in ("start", "end")[not looped :]]
            for motor in going["motors"]:
                places = (self._place(motor, end) for end in ends)
                self.goes_to(motor, going["order"], *places)

    def _frames(self, going):
        run = going["run"]
        if run["flags"] & 3:
            return
        step = 1 if run["end"] >= run["start"] else -1
        count = abs(run["end"] - run["start"]) + 1
        if count < 2:
            return
        numbers = [run["start"] + step * k for k in range(count)]
        times = {time: ms for ms, time in reversed(going["reported"])}
        if numbers[1] * 1000 not in times and not going["held"]:
            self.fail("frames", f"frame {numbers[1]} was not reported in a whole run")
        known = next((k for k in range(1, count) if times.get(numbers[k] * 1000)), None)
        if known is None:
            return  # the host read nothing during the run
        due = np.array([round((k - known) * 1e6 / run["fps"]) for k in range(count)]) / 1000
        due += times[numbers[known] * 1000]
        best = None
        moving = [motor for motor in going["motors"] if motor.edges]
        for motor in moving:
            if motor.backlash and len(motor.edges) > 20_000:
                return
        offsets = np.arange(-8 - self.player.within.report_s * 1000, 2.01, 0.125)
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
        self._exactly(moving, numbers, run["fps"])
        if len(moving):
            best = worst.min()
            if best > 1:
                self.fail(
                    "frames",
                    f"a motor is {best:.1f} times what is allowed beside a frame of the run",
                )
            self.counts["runs judged"] += 1
            self.looks.add("frames")

    def _exactly(self, moving, numbers, fps):
        """Motors without backlash have made just the steps of each frame at its time, all by one
        clock."""
        due = frame_times_ns(len(numbers), round(1000 * fps))
        clock = [(-(1 << 62), 1 << 62)]  # when the first frame can have been
        for motor in moving:
            if motor.backlash or motor.coupled:
                continue
            edges = np.array(motor.edges)
            ways = np.where(edges & 1, 1, -1)
            wanted = [self._place(motor, n) for n in numbers]
            times = (edges >> 1) * 1_000_000 // MS
            spans = origins_ns(times, ways, motor.at, wanted, due, _SLACK_NS)
            clock = [
                (max(a, c), min(b, d)) for a, b in clock for c, d in spans if max(a, c) < min(b, d)
            ]
            if not clock:
                self.fail("frames", f"motor {motor.index + 1} was beside a frame of the run")

    def _jog_all(self, request, payload):
        fps, _ = request.words("Ii")
        frame = 0.0  # s that the slowest motor takes for a frame
        self.prepared = False
        for motor in self._takers():
            motor.let_go_by = None
            path = self.upload.paths[motor.index]
            self._over(motor, path)
            self._beside(motor, path, max(fps / 1000, 2.0))
            fastest = np.abs(np.diff(path)).max() if len(path) > 1 else 0
            self._along(motor, path, max(fps / 1000, 2.0), 12 * float(fastest + motor.backlash))
            slower = [motor, self.motors[motor.index + 1]] if motor.coupled else [motor]
            for each in slower:
                way = float(fastest + motor.backlash)
                frame = max(frame, way / each.velocity + 2 * (way / each.acceleration) ** 0.5)
        # up to its rate with 4 frames/s² and back, on no more frames than there are; then to the
        # next frame, at two thirds of the rate on average, on a path with places steeper than its
        # average
        ramp = min(fps / 4000, (self.upload.count / 2) ** 0.5)
        self.jogs_all = max(self.jogs_all, 4500 + round(1000 * ramp + 2000 * frame))

    def _shoot(self, request, payload):
        self.prepared = True
        self.lost = False
        self.going = None
        for motor in self.motors:
            motor.free = True  # velocity and acceleration alone limit its ramps
            motor.let_go_by = None
        self.run = {"shot": True, "motors": []}

    def disturbed(self):
        if self.going:
            self.going["whole"] = False
