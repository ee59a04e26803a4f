"""Stops and their effects: when everything must rest, which outputs must be off, and why a
HARD_STOP may come."""

from framestep.protocol import messages as m

from .bounds import FREE, STEEPEST
from .findings import Part

LONG_AGO = -(10**9)


class Stops(Part):
    """STOP_ALL, E-stop, limit switches, faults and lost hosts."""

    def __init__(self, trial):
        super().__init__(trial)
        self.factor = self.rig.hard_stop_factor
        self.asked = 0  # STOP_ALLs since everything was at rest
        self.all_at = LONG_AGO  # the last of them
        self.reason = -1  # until then a fault has a reason, ms
        self.rest_by: int | None = None
        self.stood_by: int | None = None  # the end of the stop; nothing may move since
        self.estop_pin = self.rig.board.get("estop") if self.rig.estop != "none" else None
        self.estop_level = 0 if self.rig.estop == "no" else 1  # while pressed
        self.limit_pins = {
            limit[e] for limit in self.rig.limits for e in ("high", "low") if limit[e] >= 0
        }
        self.held_since: int | None = None
        self.let_go = LONG_AGO  # its last release
        self.pressed = False  # since the last HARD_STOP 0
        self.struck = 0  # the last change of a limit switch
        self.safe_at: int | None = None  # by then all outputs have their safe levels
        self.reported_at = LONG_AGO  # the last HARD_STOP
        self.lit = LONG_AGO  # the last request to switch one on
        self.enabling: list[tuple[int, int]] = []  # (ms, motor) of drivers switched on

    def pin(self, name, level):
        """Take another level of an input."""
        pins = (
            {name} if isinstance(name, int) else {p for p, n in self.hal.names.items() if n == name}
        )
        if self.estop_pin in pins:
            self.estop(level)
        if self.rig.go_input and pins & {item["pin"] for item in self.rig.inputs}:
            self.set_off()
            self.trial.idle_since = None
            for motor in self.motors:
                motor.wake(self.ms)
        if pins & self.limit_pins:
            self.struck = self.ms
            self.hard()

    def estop(self, level):
        if level == self.estop_level:
            self.pressed = True
            if self.held_since is not None:
                return
            self.held_since = self.ms
            if self.ms - self.let_go < 40:
                return  # a bounce: for the firmware it was not released
            self.hard()
            if "chain" in self.rig.board:  # the pulses end at once
                for motor in self.motors:
                    motor.allow(self.ms, 0, FREE)
                    motor.renumbered = motor.jerky = motor.free = True
            self.begin()
            self.safe_at = self.ms + self.safe_ms()
        elif self.held_since is not None:
            self.held_since = None
            self.let_go = self.ms

    @property
    def stopping(self):
        """Whether a stop of everything has come that may not be complete."""
        return self.asked > 0 or self.ms - self.reported_at < self.longest_ms()

    def safe_ms(self):
        """Return how long outputs may take to get to their safe levels: a pulse first stops a video
        camera."""
        video = self.trial.runs.run and self.trial.runs.run.get("flags", 0) & m.RUN_VIDEO
        return (400 if video else 12) + self.player.within.lag_ms

    def hard(self):
        """Allow motors to slow down as steeply as a hard stop from now on."""
        for motor in self.motors:
            motor.allow(self.ms, 0, min(motor.steep[-1][1] * self.factor, STEEPEST))
            motor.jerky = True

    def begin(self):
        """Begin a stop of all motors."""
        by = self.ms + self.longest_ms()
        self.rest_by = by if self.rest_by is None else min(by, self.rest_by)

    def longest_ms(self):
        """Return the time within which all motors come to rest if they stop now, ms."""
        longest = 0.0
        for motor in self.motors:
            slow = min(motor.least, motor.acceleration)
            t = motor.top[-1][1] / slow
            if motor.jerk:
                t += 2 * max(slow, motor.acceleration) / motor.jerk
            longest = max(longest, t)
        bound = 1.3 * longest * 1000 + 600 + max(motor.backlash for motor in self.motors) * 2
        bound += self.trial.runs.jogs_all + self.player.within.lag_ms
        if self.trial.virtual:
            bound = 3 * bound + 3000
        return round(bound)

    def set_off(self):
        """Allow motion from now on."""
        self.stood_by = self.rest_by = None
        for motor in self.motors:
            motor.rest_by = None

    def enabled(self):
        """Check the drivers switched on: none belongs to a disabled motor."""
        for ms, i in self.enabling:
            motor = self.motors[i]
            asked = any(
                r.kind == m.MSG_MOTOR_CONFIGURE and r.motor == i
                for r in self.open.values()
                if r.payload
            )
            if not motor.flags & m.MOTOR_ENABLED and not asked:
                self.fail(
                    "enabled",
                    f"motor {i + 1} is switched on at {ms} ms, but configured as disabled",
                )
        self.enabling.clear()

    def safe(self):
        """Check that outputs have their safe levels."""
        self.safe_at = None
        self.looks.add("outputs")
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

    def reported(self, payload):
        """Check that a HARD_STOP has a reason."""
        self.looks.add("HARD_STOP")
        reason = payload[0]
        self.reported_at = self.ms
        self.trial.anything_may_stop()
        if reason == m.HARD_STOP_FAULT:
            if self.ms > self.reason:
                self.fail(
                    "fault",
                    "HARD_STOP 100 without a reason "
                    f"(fault {self.trial.board.controller.faults.fault:#x})",
                )
            for motor in self.motors:
                motor.jerky = motor.loose = True
            self.begin()
            if self.lit < self.ms - 3:
                self.safe_at = self.ms + self.safe_ms()
        elif reason == m.HARD_STOP_GENERAL:
            if not self.pressed:
                self.fail("hard-stop", "HARD_STOP 0 without an E-stop")
            self.pressed = self.held_since is not None
        elif self.ms - self.struck > 3000 and not self.limit_pins:
            self.fail("hard-stop", f"HARD_STOP {reason} without a limit switch")
        self.trial.runs.disturbed()
