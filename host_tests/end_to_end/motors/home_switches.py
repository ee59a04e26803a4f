"""Home switches of a simulated board that follow the motors."""

from dataclasses import dataclass, field

from framestep_tools.payloads import GetCondition, HardStop, Home
from host_tests.end_to_end.session import simulated

HIGH, LOW = 22, 26  # pins of limit set 1
HIGH_2, LOW_2 = 27, 28
LIMITS = [{"high": HIGH, "low": LOW}, {"high": HIGH_2, "low": LOW_2}]
HOME = {"limit": 1, "travel": 9000, "speed": 2000, "slow_speed": 200, "position": -50}
WAIT_S = 60


@dataclass
class Switch:
    """A switch on a pin, normally closed, which a motor opens at a step and beyond.

    at: counted from the motor's first position. upward: whether beyond is above. bounce: the levels
    after each change, before the switch keeps the new one: a list for each millisecond. works: it
    follows the motor.
    """

    motor: int
    pin: int
    at: int
    upward: bool = False
    bounce: list[list[int]] = field(default_factory=list)
    works: bool = True

    def __post_init__(self):
        self.hit = False
        self.pending: list[list[int]] = []

    def levels(self, steps):
        """Return the pin's levels of this millisecond, in order."""
        hit = steps >= self.at if self.upward else steps <= self.at
        if not self.works:
            return []
        if hit != self.hit:
            self.hit = hit
            self.pending = [*self.bounce, [int(hit)]]
        return self.pending.pop(0) if self.pending else []


class Rails:
    """The rails of the motors: they move by the edges on the pins, and open the switches."""

    def __init__(self, session, *switches):
        self.session = session
        self.hal = session.board._board.hal
        self.switches = list(switches)
        self.steps = {}  # made so far, by motor
        self.coming = []
        self.tick = self.hal.tick
        tell = self.hal.on_edge

        def on_edge(time_ns, signal, value):
            if signal[0] == "m" and signal[1:].isdigit():
                self.coming.append((time_ns, int(signal[1:]), value))
            tell(time_ns, signal, value)

        self.hal.on_edge = on_edge
        self.hal.tick = self._tick

    def _tick(self):
        now = self.hal.now_ns
        for _, motor, step in (edge for edge in self.coming if edge[0] <= now):
            self.steps[motor] = self.steps.get(motor, 0) + step
        self.coming = [edge for edge in self.coming if edge[0] > now]
        for switch in self.switches:
            for level in switch.levels(self.steps.get(switch.motor, 0)):
                self.hal.set_level(switch.pin, level)
        self.tick()


def on_rails(settings, *switches):
    """Return a session with these switches on its rails, and the rails."""
    session = simulated(settings)
    session.board.wire_switches()
    found = Rails(session, *switches)
    session.run(0.05)
    return session, found


def rails(*switches, rig=None, **home):
    """Return a session whose motor 1 homes by HOME with changes, and its rails."""
    motors = [{"home": {**HOME, **home}}]
    return on_rails({"limits": LIMITS, "motors": motors, **(rig or {})}, *switches)


def reasons(session):
    """Return [(reason, motor)] of the hard stops so far."""
    return [(message.reason, message.motor) for _, message in session.events(HardStop)]


def home(session, *motors):
    """Home motors and wait until they rest."""
    session.accept(Home(bytes(motors))).wait_idle(WAIT_S)


def trust(session, motor=1):
    """Return (state, reason) of a motor's position."""
    reported = session.ask(GetCondition()).positions[motor - 1]
    return reported.state, reported.reason
