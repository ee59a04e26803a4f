"""Rounds on the emulated board: positions as exact as in the host simulation, and what that cannot
tell, how late the ticks come."""

from dataclasses import dataclass

from framestep.pulse.stepper import LATEST, WORST_LATE
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.session import Session
from host_tests.soak.rounds import MOTORS, RIG, Rounds

LATE_US = (
    200  # the most that a tick may be late while a motor moves; far from where pulses break off
)
_LOOK = "__import__('framestep.boot').boot.hal.kernel.state"


@dataclass
class OnBoard:
    """Emulated seconds, rounds, motions checked, how late the worst tick in motion was, and from
    which lateness on pulses would break off (microseconds)."""

    seconds: float
    rounds: int
    motions: int
    late_us: int
    limit_us: int

    @property
    def wrong(self) -> str:
        return late(self.late_us)


def late(worst_us: int) -> str:
    """What is wrong with this worst lateness, "" for nothing."""
    if 0 < worst_us <= LATE_US:
        return ""
    return f"a tick in motion was {worst_us} µs late; between 1 and {LATE_US} are right"


def worst_late(repl) -> tuple[int, int]:
    """(worst lateness of a tick in motion since the start, the lateness that breaks pulses off), in
    microseconds, as the firmware has them."""
    worst, limit = (int(repl.eval(f"{_LOOK}[{word}]")) for word in (WORST_LATE, LATEST))
    return worst, limit


def play(rounds: int, seed: int) -> OnBoard:
    """So many rounds. AssertionError where anything but the lateness is wrong."""
    with EmulatedBoard({**RIG, "motor_count": MOTORS}) as board:
        session = Session(board, MOTORS, reply_s=0.1)
        played = Rounds(session, seed)
        for _ in range(rounds):
            played.round()
        return OnBoard(session.now, rounds, played.motions, *worst_late(board.emulator.repl()))
