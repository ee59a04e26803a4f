"""Homing on the emulated board; the edges on the motor's pins open its switch. More of it is in
end_to_end/motors/test_homing.py."""

import pytest

from framestep.motors.positions import HOMED, KNOWN
from framestep_tools import payloads as p
from host_tests.end_to_end.motors.home_switches import trust
from host_tests.end_to_end.session import Session

SWITCH, SPEED, BACK = 22, 3000, 150
RIG = {
    "limits": [{"low": SWITCH}],
    "motors": [
        {
            "home": {
                "limit": 1, "travel": 3000, "speed": SPEED, "slow_speed": 500, "back_off": BACK,
                "position": 1000,
            }
        }
    ],
}  # fmt: skip
RUN_ON = SPEED**2 / (2 * 4 * 20000)  # steps of the hard stop
BOUNCE = (1, 0, 1, 1, 0, 1)  # levels of the switch after each change, one each millisecond


class Rail:
    """A rail that a motor moves by its edges; at a step and below it opens the switch."""

    def __init__(self, session, at, motor=1, switch=SWITCH):
        self.session = session
        self.at = at
        self.signal = f"m{motor}"
        self.switch = switch
        self.steps = self.lowest = 0
        self.level = int(self.steps <= at)
        self.coming = [self.level]
        self._switch()

    def _switch(self):
        level = int(self.steps <= self.at)
        if level != self.level:
            self.level = level
            self.coming = [*BOUNCE, level]
        if self.coming:
            self.session.board.emulator.set_pin(self.switch, self.coming.pop(0))

    def run(self, ms):
        for _ in range(ms):
            self.session.run(0.001)
            for _, signal, value in sorted(self.session.board.edges()):
                if signal == self.signal:
                    self.steps += value
                    self.lowest = min(self.lowest, self.steps)
            self._switch()

    def run_until_at_rest(self):
        while self.session.moving:
            self.run(20)
        self.run(20)


@pytest.fixture(scope="module")
def session(chip):
    with chip.emulated(RIG) as board:
        board.wire_switches()
        yield Session(board, reply_s=0.1)


def test_home(session):
    """While a call in C on the REPL holds the main loop up for more than a second, the motor
    reaches its switch, which bounces: it makes the hard stop all the same, and homing continues.
    The REPL shows it."""
    repl = session.board.emulator.repl()
    repl.exec("import time")
    rail = Rail(session, -700)
    session.accept(p.Home())
    rail.run(100)
    repl.start("x = sum(range(60000))\ntime.sleep_ms(1500)")
    rail.run(500)
    assert rail.steps < -700, "it has not come to its switch"
    assert rail.lowest >= -700 - RUN_ON - 0.004 * SPEED
    rail.run_until_at_rest()
    assert repl.finish(2) == ""
    assert repl.unasked() == "framestep: motor 1 is homed\n"
    assert trust(session) == (KNOWN, HOMED)
    assert session.position(1) == 1000 + BACK
    # the switch may be found as many milliseconds late as it bounces
    assert -len(BOUNCE) <= rail.steps - (-700 + BACK) <= 1
    assert session.events(p.HardStop) == []
