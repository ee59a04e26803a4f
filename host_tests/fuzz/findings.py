"""What a trial finds, and what its parts share."""


class Finding(Exception):
    """Something that must never happen. kind: one word for it, by which findings are
    distinguished."""

    def __init__(self, kind: str, text: str):
        super().__init__(f"{kind}: {text}")
        self.kind = kind


class Part:
    """One subject of a trial (trial.py); it sees the others by `trial`."""

    def __init__(self, trial):
        self.trial = trial
        self.player, self.hal, self.rig = trial.player, trial.hal, trial.rig
        self.motors, self.count = trial.motors, trial.count
        self.counts, self.open, self.fail = trial.counts, trial.open, trial.fail
        self.looks = trial.looks

    @property
    def ms(self):
        return self.player.ms

    def may_set_off(self):
        """Whether a request without an answer may move something."""
        return any(request.moves for request in self.open.values())

    def goes_to(self, motor, order, *places):
        """Expect a motor to come to rest on one of these places, if it is in no couple and no
        virtual rig. order: of the request."""
        if order >= self.trial.upset and not (motor.coupled or motor.leader or self.trial.virtual):
            motor.goals = places

    def led(self, motor):
        """Allow the coupled motor any place: it moves with this one."""
        if motor.coupled:
            self.motors[motor.index + 1].free = True

    def anywhere(self):
        """Allow all motors any place, and starts and stops with their full acceleration."""
        for motor in self.motors:
            motor.free = motor.jerky = True
