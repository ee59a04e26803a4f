"""Devices that are correct in another way than the simulator: none of them may cause an alarm."""

from collections.abc import Callable
from typing import Any, NamedTuple

from framestep_tools.client.wire import Frame
from framestep_tools.conform import spec
from framestep_tools.judge.trace import Edge

from .fault_proxy import Behaviour

_SLOW_S = 0.02


class Variant(NamedTuple):
    """A correct device: its motors, what else its rig file has, how it behaves."""

    name: str
    motors: int | None = None
    rig: dict[str, Any] | None = None
    behave: Callable[[], Behaviour] | None = None


class _ShortHi(Behaviour):
    """Answers HI as before 2020-10-02, without PROTOCOL VERSION."""

    def said(self, frame: Frame) -> Frame:
        return frame._replace(payload=frame.payload[:49]) if frame.type == spec.HI else frame


class _Slow(Behaviour):
    """Delays each message of the device, and keeps their order."""

    def said(self, frame: Frame) -> None:
        self.port.tell(frame, _SLOW_S)


class _LevelsUnseen(Behaviour):
    """Its trace has no light levels, like the emulated board's."""

    def edges(self, edges: list[Edge]) -> list[Edge]:
        return [edge for edge in edges if not edge[1].startswith("dmx")]


VARIANTS = (
    Variant("as the simulator is"),
    Variant("DWORD acknowledgements, an acknowledged MOVE", 2, {"dialect": "dmc-lite"}),
    Variant("HI of 49 bytes", 2, None, _ShortHi),
    Variant("no lights", 2, {"dmx": False}),
    Variant("lights that no trace shows", 2, None, _LevelsUnseen),
    Variant("each step at its frame's time", 2, {"smoothing": False}),
    Variant("one motor", 1),
    Variant("two motors", 2),
    Variant("answers after 20 ms", 3, None, _Slow),
    Variant("S-curve ramps and play in the gears", 2,
            {"motors": [{"jerk": 100, "backlash": 12}, {"backlash": 5}]}),
    Variant("no inputs, outputs or switches", 2,
            {"limits": [], "inputs": [], "outputs": [], "estop": "none"}),
)  # fmt: skip
