"""Common part of all measurements: the board, the figures so far, the motors' positions."""

from collections.abc import Callable, Sequence

from ..payloads import MotorGetPosition
from .board import Board

STEEPEST = 4_000_000  # steps/s²
WRAP_US = 1 << 32  # of the board's microsecond counter


class Gathering:
    """Measures a board into `figures`. say: called with what comes next; short: only the motors of
    one PIO block, and one frame rate."""

    def __init__(self, board: Board, say: Callable[[str], None], short: bool = False):
        self.board, self.client, self._say, self._short = board, board.client, say, short
        self.figures: dict[str, float] = {"steps_wrong": 0}
        self.complaints: list[str] = []
        self._began_at: Sequence[int] = ()

    def _positions(self) -> Sequence[int]:
        return self.client.request(MotorGetPosition()).steps[: self.board.layout.motors]

    def _clocks(self) -> tuple[float, int]:
        """Return the host's clock in seconds and the board's in microseconds at one moment, from
        the quickest of some readings."""
        looks = []
        for _ in range(5):
            before = self.client.clock()
            own = self.board.instrument.now_us()
            after = self.client.clock()
            looks.append((after - before, (before + after) / 2, own))
        _, host, own = min(looks)
        return host, own

    def _note(self, key: str, value: float, worst: Callable[..., float]) -> None:
        """Store a figure; of repeated measurements the worst one."""
        self.figures[key] = worst(value, self.figures.get(key, value))

    def _count(self, motor: int, made: int, moved: int) -> None:
        if made != moved:
            self.figures["steps_wrong"] += abs(made - moved)
            self.complaints.append(f"motor {motor}: {made} steps at its pin, {moved} reported")

    def _away(self, motor: int, origins: Sequence[int], way: int) -> int:
        """Return a target `way` steps below, or above if that would be below the motor's start."""
        at = origins[motor - 1]
        return at - way if at - way >= self._began_at[motor - 1] else at + way

    def _up(self, motor: int) -> int:
        """Return the level of a motor's direction pin when it counts up."""
        return 0 if self.board.settings(motor).get("invert") else 1


def named(motors: Sequence[int]) -> str:
    """Return text such as "motor 3" or "motors 1, 2"."""
    return f"motor{'s' * (len(motors) > 1)} {', '.join(map(str, motors))}"
