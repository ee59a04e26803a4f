"""What a motor may do, by the acknowledged requests: velocities, accelerations, places, paths."""

import numpy as np

from framestep.protocol import messages as m

FREE = float("inf")
STEEPEST = 4_000_000


class Motor:
    """What is known of a motor: its settings as acknowledged, and its edges since its last rest."""

    def __init__(self, index, settings):
        self.index = index
        self.backlash = settings["backlash"]
        self.jerk = settings["jerk"] * 1000
        self.edges: list[int] = []  # cycle · 2, +1 for a step up
        self.seen = self.made = 0  # how many of them the pins have shown by now, and their sum
        self.at = 0  # the motor before these edges, in the reported numbers
        self.load = 0  # the load before these edges
        self.velocity, self.acceleration = 5000, 20000  # as set
        self.flags = m.MOTOR_ENABLED
        self.limits = (None, None)
        self.coupled = 0  # 1 or -1: the next motor is coupled to it
        self.leader = None
        # (ms, steps/s): what it may do from then on, since its last rest; never less
        self.top = [(0, 5000)]
        self.steep = [(0, 20000)]
        self.least = 20000  # the lowest acceleration since its last rest
        self.jerky = False  # anything but its own moves since its last rest
        self.low = self.high = 0  # the motor's range since its last rest
        self.free = False  # the range is not known
        # bounds of the motor by the soft limits, None: not known
        self.soft: tuple | None = (None, None)
        self.fresh = True  # it was at rest before these edges
        self.sent = 0  # the places it was sent to since its last rest
        self.quiet: float | None = 0  # a millisecond after this it may not move any more
        self.quiets: list[tuple[float, int]] = []
        self.rest_by: int | None = None  # the end of a stop that was for it alone, ms
        self.let_go_by: int | None = None  # the end of a jog that was not repeated, ms
        self.home = settings["home"]  # None: it cannot be homed
        self.homing = False
        self.goals: tuple[int, ...] = ()  # it comes to rest on one of these, if known
        self.renumbered = False  # homing has ended and may have changed its position
        self.uploaded = False  # a section of its path, whose answer was lost: it may be in force
        # a fault: the main loop may have missed where it turned, and so where the load is
        self.loose = False

    def allow(self, ms, velocity=0.0, acceleration=0.0):
        if velocity > self.top[-1][1]:
            self.top.append((ms, velocity))
        if acceleration > self.steep[-1][1]:
            self.steep.append((ms, acceleration))

    def reach(self, *places):
        """Allow these places of the load."""
        self.sent += 1
        self.free |= self.homing  # homing has ended and may have changed the numbers
        self.low = min(self.low, min(places) - self.backlash)
        self.high = max(self.high, *places)

    def may_come_back(self):
        """Allow the way back to the present place of the load, with its backlash taken up: a limit
        has been set that is passed already (field note 4.3)."""
        pins = self.at + 2 * sum(edge & 1 for edge in self.edges) - len(self.edges)
        self.low = min(self.low, pins - self.backlash)
        self.high = max(self.high, pins + self.backlash)

    def at_rest(self, ms):
        """Begin new bounds: it is known to rest at the end of the edges so far."""
        self.top = [(ms, self.velocity)]
        self.steep = [(ms, self.acceleration)]
        self.least = self.acceleration
        self.jerky = self.uploaded
        self.free = self.renumbered or self.uploaded
        self.fresh = True
        self.sent = 0
        self.low = self.high = self.at
        self.bound()

    def homes(self, factor):
        """Allow homing from here: toward the switch its travel and a stop, and back twice the
        back-off. factor: of the hard stop."""
        ahead = self.home["travel"] + self.home["back_off"] + self.backlash
        ahead += self.velocity**2 // (2 * self.acceleration * factor) + 2 + self.velocity // 50
        behind = 2 * self.home["back_off"] + self.backlash
        if self.home["toward"] == "low":
            self.low, self.high = self.at - ahead, self.at + behind
        else:
            self.low, self.high = self.at - behind, self.at + ahead
        self.homing = self.jerky = True
        self.soft = None
        self.sent += 1

    def bound(self):
        if self.renumbered:
            self.soft = None
            return
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
    """The uploaded move, by the acknowledged requests."""

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
    """Return the load's places for the motor's, both arrays; gap: the load's place above the motor
    before."""
    if not backlash:
        return path
    out = np.empty_like(path)
    load = path[0] + gap
    for i, p in enumerate(path.tolist()):
        load = min(max(load, p), p + backlash)
        out[i] = load
    return out


def bounds_of(path, fps, backlash, top=np.inf):
    """Return velocity and acceleration that a smooth, monotonic cubic through these frames may have
    at most.

    top: the motor's velocity, steps/s, which it does not exceed at any frame.
    """
    if len(path) < 2:
        return 0.0, 0.0
    steps = np.abs(np.diff(path)) + backlash
    bends = np.abs(np.diff(path, 2)) + 2 * backlash if len(path) > 2 else steps
    first = np.concatenate((steps[:1], steps, steps[-1:]))
    slopes = 3 * np.minimum(first[1:], first[:-1])
    # the curve's own slopes are central differences, at most three times the lesser chord
    slopes = np.minimum(slopes, 1.7 * np.maximum(first[1:], first[:-1]) + 1)
    # at either end it is the slope of a parabola
    slopes[0] = 1.5 * steps[0] + 0.5 * steps[min(1, len(steps) - 1)]
    slopes[-1] = 1.5 * steps[-1] + 0.5 * steps[max(-2, -len(steps))]
    velocity = max(min(float(slopes.max()), top / fps), 1.5 * float(steps.max())) + 1
    acceleration = 9.0 * (max(float(bends.max()), float(steps[0]), float(steps[-1])) + 2)
    return velocity * fps, acceleration * fps * fps
