"""The state of a simulated board as a picture for a terminal."""

from collections import deque
from typing import TYPE_CHECKING, Any, NamedTuple

from rich.columns import Columns
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from framestep import texts
from framestep.repl.commands import operation

from ..traffic.log import Entry
from ..traffic.sniffer import timed

if TYPE_CHECKING:
    from framestep.hal.host_board import HostBoard

_TRAFFIC_LINES = 12
_LIGHTS = 24  # number of DMX channels in the picture


class Switch(NamedTuple):
    """A switch or an input that can be pressed: its name, its pin, its level at rest."""

    name: str
    pin: int
    rest: int


def switches_of(rig: Any) -> list[Switch]:
    """List the limit switches of a rig, then its inputs."""
    found = []
    for i, limit in enumerate(rig.limits, 1):
        for end, name in (("high", "upper"), ("low", "lower")):
            if limit[end] >= 0:
                found.append(
                    Switch(f"limit set {i} {name}", limit[end], int(limit["contact"] == "no"))
                )
    for i, entry in enumerate(rig.inputs, 1):
        found.append(Switch(f"input {i}", entry["pin"], int(entry["on"] != "high")))
    return found


class View:
    """Draws a HostBoard. `traffic` has the latest messages."""

    def __init__(self, board: "HostBoard", heading: str, keys: str):
        self.board = board
        self.message = ""
        self.switches = switches_of(board.rig)
        self.traffic: deque[str] = deque(maxlen=_TRAFFIC_LINES)
        self._heading, self._keys = heading, keys
        self._steps = [0] * board.hal.motors
        self._velocities = [0.0] * board.hal.motors
        self._since = board.now_ns

    def add(self, entry: Entry) -> None:
        """Add a line of traffic."""
        self.traffic.append(timed(entry))

    def draw(self, plugged: bool) -> Group:
        """Return the present picture."""
        self._measure()
        parts: list[RenderableType] = [
            Text(self._heading, style="bold"),
            Text(self._keys, style="dim"),
            Text(self.message, style="bold"),
            Text(self._state(plugged)),
            self._motors(),
            Columns([self._levels(), self._lights()], padding=(0, 3)),
            Panel(Text("\n".join(self.traffic), no_wrap=True), title="traffic", title_align="left"),
        ]
        return Group(*parts)

    def _measure(self) -> None:
        board = self.board
        passed = board.now_ns - self._since
        if passed <= 0:
            return
        for motor in range(board.hal.motors):
            steps = board.steps(motor)
            self._velocities[motor] = (steps - self._steps[motor]) * 1e9 / passed
            self._steps[motor] = steps
        self._since = board.now_ns

    def _state(self, plugged: bool) -> str:
        controller = self.board.controller
        host = "a host is connected" if controller.was_open else "no host is connected"
        does = operation(controller) or ("motors move" if self.board.moving() else "nothing moves")
        lines = [
            f"{self.board.now_ns * 1e-9:.1f} s: {host if plugged else 'the cable is out'}; {does}"
        ]
        lines += texts.conditions(controller.condition()) + texts.faults(controller.faults)
        return "\n".join(lines)

    def _motors(self) -> Table:
        controller = self.board.controller
        controller.axes.choose_sample()
        found = controller.axes.positions
        shown = Table("motor", box=None, padding=(0, 2))
        shown.add_column("position", justify="right", min_width=11)
        shown.add_column("steps/s", justify="right", min_width=9)
        shown.add_column("trust")
        for motor in range(self.board.hal.motors):
            shown.add_row(
                str(motor + 1),
                str(controller.axes.reported[motor]),
                f"{self._velocities[motor]:.0f}",
                texts.trust(found.states[motor], found.reasons[motor]),
            )
        return shown

    def pressed(self, switch: Switch) -> bool:
        """Return whether a switch is pressed."""
        return (self.board.hal.levels() >> switch.pin & 1) != switch.rest

    def _levels(self) -> Table:
        board = self.board
        shown = Table("pin", "", box=None, padding=(0, 1))
        levels = board.hal.levels()
        for i, entry in enumerate(board.rig.outputs, 1):
            on = (levels >> entry["pin"] & 1) == (entry["on"] == "high")
            shown.add_row(f"output {i}", "on" if on else "off")
        for name in ("shutter", "meter"):
            if name in board.hal.board:
                on = (levels >> board.hal.board[name] & 1) == (
                    getattr(board.rig, f"{name}_on") == "high"
                )
                shown.add_row(name, "on" if on else "off")
        if board.rig.estop != "none":
            shown.add_row("E-stop (e)", "held" if board.controller.safety.tripped else "released")
        for i, switch in enumerate(self.switches, 1):
            key = f" ({i})" if i <= 9 else ""
            shown.add_row(switch.name + key, "pressed" if self.pressed(switch) else "released")
        return shown

    def _lights(self) -> Table:
        shown = Table("light", "level", box=None, padding=(0, 1))
        levels = getattr(self.board.hal.dmx, "shown", b"")
        lit = [(channel, level) for channel, level in enumerate(levels) if channel and level]
        for channel, level in lit[:_LIGHTS]:
            shown.add_row(str(channel), str(level))
        if not lit:
            shown.add_row("none", "")
        elif len(lit) > _LIGHTS:
            shown.add_row(f"and {len(lit) - _LIGHTS} more", "")
        return shown
