"""Observers: what must hold in every scenario, on every target, whatever the scenario is about.

The rules are the fuzzer's (fuzz/trial.py): answers and their form, edges within what the requests
allow, positions that match the edges, frames met, outputs safe, no HARD_STOP without a reason. Here
they judge a session that somebody else conducts. `watch(board)` notes what passes a board's port
and pins; `Watch.settle` judges it. timing.py has what only the emulated chip shows: late ticks, the
time with interrupts off, and long passes of the main loop.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Tolerances:
    """How exactly a target shows when something happens."""

    lag_ms: int = 0  # from a tick to its edges, at most
    report_s: float = 0.0025  # age of the positions in a report, at most
    keeps_unread: bool = False  # what nobody read is read by a host that returns, as by a UART
    earlier_ns: int = 0  # how much earlier than it happens an edge is said to be
    # the latest that a tick may come while a motor moves; from 1813 µs on pulses would break off
    late_us: int = 200
    masked_us: int = 140  # the longest time with interrupts off, except for writing to flash
    # until a request that moves nothing is answered, from when it or the answer before it was sent
    answer_ms: int | None = None
    # passes of the main loop, more than `settled_ms` after a request: the longest, and how many of
    # `long_pass_ms` may end within a second
    settled_ms: int = 200
    longest_pass_ms: float = 8.0
    long_pass_ms: float = 2.8
    long_passes: int = 6


CHIP = Tolerances(lag_ms=5, report_s=0.005, answer_ms=15)  # an emulated RP2040 or RP2350

OBSERVERS = {
    "answers": "each request gets one answer, in time and in its form",
    "limits": "edges keep to velocity and acceleration, and to where the requests allow",
    "jerk": "edges of a motor with a jerk limit keep to that, too",
    "soft limits": "edges stay between them",
    "quiet": "no edge comes while the motors are said to stand",
    "pins": "positions reported in motion match the edges",
    "positions": "positions reported at rest match the edges",
    "goals": "motors come to rest on their targets",
    "frames": "motors pass each frame of a run exactly",
    "couples": "coupled motors go together",
    "stops": "motors rest in time after a stop",
    "outputs": "outputs are safe after a stop",
    "HARD_STOP": "it has a reason",
    "late": "ticks come in time (emulated chips)",
    "masked": "interrupts are on (emulated chips)",
    "passes": "passes of the main loop are short (emulated chips)",
    "replay": "32-bit MicroPython with a locked heap does the same (host)",
}
IN_CHIPS = {"late", "masked", "passes"}  # what only an emulated chip shows
ON_PINS = set(OBSERVERS) - IN_CHIPS - {"replay"}  # what a board's port and pins show
FED_BY_EACH = {"answers", *IN_CHIPS}  # by any share of ten scenarios

watches: list | None = None  # of the boards of a module's sessions, if they are observed


def begin(board) -> None:
    """Watch a board from now on, as it has just started; not one whose pins nobody sees."""
    shows = getattr(board, "shows", Tolerances())
    if watches is None or shows is None or hasattr(board, "watch"):
        return
    from host_tests.observers import timing
    from host_tests.observers.watch import Watch

    rig = board._board.controller.rig
    if not _hidden(rig):
        board.watch = Watch(board, rig, shows)
        # its REPL on a port of its own says where the tick's state is
        if hasattr(board, "emulator") and board.repl:
            board.watch.ticks = timing.watched(board.emulator, f"{board.pins} {board._rig}")
        watches.append(board.watch)


def _hidden(rig) -> bool:
    """Whether motors of a rig move by what neither a request nor a step pulse shows."""
    homes = [motor["home"] for motor in rig.motors if motor["home"]]
    return (
        bool(rig.pendant or rig.shoot_input)
        or any(motor["servo"] for motor in rig.motors)
        or any(home["square_within"] for home in homes)
    )
