"""What a trial finds, and what its parts have in common."""


class Finding(Exception):
    """Something that may never happen. kind: one word for what, by which findings are told
    apart."""

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

    @property
    def ms(self):
        return self.player.ms

    def may_set_off(self):
        """Whether a request that is not answered yet may move something."""
        return any(request.moves for request in self.open.values())

    def goes_to(self, motor, order, *places):
        """A motor that no other one moves, nor is moved by, is to come to rest on one of these.
        order: of the request for it."""
        if order >= self.trial.upset and not (motor.coupled or motor.leader or self.trial.virtual):
            motor.goals = places

    def led(self, motor):
        """What moves this motor moves the one that is coupled to it: where to is not known."""
        if motor.coupled:
            self.motors[motor.index + 1].free = True

    def anywhere(self):
        """All motors may go anywhere, and begin and end as steeply as their acceleration has it."""
        for motor in self.motors:
            motor.free = motor.jerky = True
