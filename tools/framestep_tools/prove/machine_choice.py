"""Choice of the motors that are measured and the state machines that watch them."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

from ..errors import ToolError
from .borrowed_machines import BLOCK_MACHINES

_PINS_AT_ONCE = 2  # steps and direction of a motor


class Layout(NamedTuple):
    """Motors and state machines of a board.

    motors: number of motors, motor 1 on state machine 0 and so on; servos: motors that are servos;
    left_out: {motor: why} of other motors that are not measured; unused: state machines that
    nothing has set up; blocks: PIO blocks with room for the watching program.
    """

    motors: int
    servos: Collection[int]
    left_out: Mapping[int, str]
    unused: Collection[int]
    blocks: Collection[int]

    @property
    def measured(self) -> list[int]:
        """Return the motors to measure."""
        return [m for m in self._steppers if m not in self.left_out]

    @property
    def _steppers(self) -> list[int]:
        return [m for m in range(1, self.motors + 1) if m not in self.servos]

    @property
    def groups(self) -> list[tuple[int, ...]]:
        """Return the motors that are measured together, grouped by PIO block."""
        found: dict[int, list[int]] = {}
        for motor in self.measured:
            found.setdefault((motor - 1) // BLOCK_MACHINES, []).append(motor)
        return [tuple(motors) for motors in found.values()]

    def watchers(self, moving: Collection[int]) -> list[int]:
        """Return state machines that can watch while these motors move.

        They are of one block, the one with most of them; machines without a motor come first.
        """
        standing = [m - 1 for m in self._steppers if m not in moving]
        best: list[int] = []
        for block in self.blocks:
            mine = range(BLOCK_MACHINES * block, BLOCK_MACHINES * (block + 1))
            found = [i for i in mine if i in self.unused]
            found += [i for i in mine if i in standing and i not in found]
            if len(found) > len(best):
                best = found
        return best

    def check(self) -> None:
        """Raise ToolError if there is nothing to measure, or no machine to watch with."""
        if not self.measured:
            why = ", ".join(f"motor {m} {text}" for m, text in self.left_out.items())
            raise ToolError(
                f"the rig file leaves no motor that can be measured ({why or 'all are servos'}): "
                "take these settings out of it first (framestep rig edit)"
            )
        for motors in self.groups:
            if len(self.watchers(motors)) < _PINS_AT_ONCE:
                raise ToolError(
                    "too few of the chip's state machines are free to watch "
                    f"motors {motors[0]} to {motors[-1]}: take `driver` and `servo` out of the rig "
                    "file first (framestep rig edit), and reset the board if a program on the REPL "
                    "has used PIO"
                )


def layout(
    data: Mapping[str, Any], rig: Mapping[str, Any], unused: Collection[int], blocks: Sequence[int]
) -> Layout:
    """Return a board's layout. data: from its board.json; rig: settings of its rig file."""
    motors = [settings or {} for settings in rig.get("motors") or []]
    servos, left_out = set(), {}
    for motor, settings in enumerate(motors, 1):
        if settings.get("servo") is not None:
            servos.add(motor)
        elif settings.get("backlash") or settings.get("jerk"):
            named = " and ".join(key for key in ("backlash", "jerk") if settings.get(key))
            left_out[motor] = f"has {named}"
        elif (settings.get("driver") or {}).get("both_edges"):
            left_out[motor] = "steps on both edges"  # the watching program counts rising ones
    return Layout(len(data["step"]), servos, left_out, unused, blocks)
