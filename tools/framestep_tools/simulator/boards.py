"""A whole controller, simulated or emulated, with one interface: time, ports and edges.

Time only passes in `run_until`. So the same input gives the same run, and a server or a test
decides the speed. `Board.edges` returns edges in no particular order, but all of them up to now.
"""

import base64
import contextlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from framestep.rig import Rig, RigError

from ..board.rig_file import read
from ..building.board_files import board_chip, board_data
from ..errors import ToolError
from ..judge.trace import Edge, PinDecoder, load_board
from . import driver_chips
from .driver_chips import Chip, Chips

if TYPE_CHECKING:
    from typing_extensions import Self

    from framestep.hal.host import HostFlash
    from framestep.hal.host_board import HostBoard

_BOOT_LIMIT_MS = 10_000


def read_rig(path: str | Path | None) -> dict[str, Any]:
    """Read the settings of a rig file, {} for none. The controller checks them."""
    return {} if path is None else read(path)


def closed_switches(rig: Rig) -> list[int]:
    """Return pins that untouched stop switches hold low: those of normally closed switches."""
    pins = [rig.board["estop"]] if rig.estop == "nc" else []
    for limit in rig.limits:
        if limit["contact"] == "nc":
            pins += [limit[end] for end in ("high", "low") if limit[end] >= 0]
    return pins


class Channel(Protocol):
    """One serial port of a board, as the host sees it."""

    def receive(self, data: bytes) -> None:
        """Send bytes to the board; they wait until it reads them."""

    def transmit(self) -> bytes:
        """Return the board's bytes since the last call."""

    def open_port(self, on: bool) -> None:
        """Open or close the port (DTR)."""

    @property
    def pending(self) -> int:
        """Number of bytes that the board has not read yet."""


class Board(Protocol):
    """A controller with its protocol port, perhaps a REPL, and pins."""

    slice_ns: int  # time to pass at once, long against the cost of a call
    protocol: Channel
    repl: Channel | None

    @property
    def now_ns(self) -> int:
        """Virtual time in ns."""

    def run_until(self, ns: int, until_output: bool = False) -> None:
        """Let time pass. until_output: stop as soon as the protocol port has sent something."""

    def edges(self) -> list[Edge]:
        """Return the edges since the last call. Later calls return none before `now_ns`."""

    def close(self) -> None:
        """End the board."""


# ---- on the host ---------------------------------------------------------------------------------


class SimulatedBoard:
    """The controller on the host HAL, with the pins of a board in boards/.

    motors: number of motors, if not the board's; upload_bytes: memory for the uploaded move, 0 for
    somewhat more than its chip has; flash: what keeps positions over a power cut, None for one that
    is new. `chips`: simulated TMC2209 drivers of motors 1, 2, …, if the board has a UART for them.
    """

    slice_ns = 1_000_000
    protocol: Channel
    repl: Channel | None = None

    def __init__(
        self,
        rig: Mapping[str, Any] | None = None,
        motors: int | None = None,
        board: str = "pico",
        upload_bytes: int = 0,
        flash: "HostFlash | None" = None,
    ):
        from framestep.hal.host_board import HostBoard

        self.chips: list[Chip] = []

        def wire(hal):
            self.chips = driver_chips.of(hal.board)
            return Chips(
                self.chips, lambda: hal.now_ns, apart="pins" in hal.board.get("drivers", {})
            )

        self._board = HostBoard(
            dict(rig) if rig else None,
            motors,
            board_data(board),
            wire=wire,
            flash=flash,
            upload_bytes=upload_bytes or 1024 * board_chip(board).upload_kb,
        )
        self._edges: list[Edge] = []
        self._board.on_edge = lambda time_ns, signal, value: self._edges.append(
            (time_ns, signal, value)
        )
        self.protocol = self

    def upload_bytes_for(self, frames: int) -> int:
        """Return the approximate memory for this many uploaded frames of all motors."""
        moves, hal = self._board.controller.moves, self._board.hal
        return -(-hal.upload_bytes * frames // moves.upload_frames)

    @property
    def host_board(self) -> "HostBoard":
        """The controller itself, for tests that look inside."""
        return self._board

    def wire_switches(self) -> None:
        """Connect the rig's stop switches, untouched."""
        for pin in closed_switches(self._board.rig):
            self._board.set_input(pin, 0)

    def receive(self, data: bytes) -> None:
        self._board.receive(data)

    def transmit(self) -> bytes:
        return self._board.transmit()

    def open_port(self, on: bool) -> None:
        self._board.open_port(on)

    @property
    def pending(self) -> int:
        return getattr(self._board, "pending", 0)

    @property
    def now_ns(self) -> int:
        return self._board.now_ns

    def run_until(self, ns: int, until_output: bool = False) -> None:
        self._board.run_until(ns, until_output)

    def edges(self) -> list[Edge]:
        edges, self._edges = self._edges, []
        return edges

    def close(self) -> None:
        self._board.on_edge = None

    def __enter__(self) -> "Self":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


# ---- on the emulated chip ------------------------------------------------------------------------


class _EmulatedPort:
    def __init__(self, emulator, number: int):
        self.emulator, self.number = emulator, number
        self._queued = 0

    def receive(self, data: bytes) -> None:
        answer = self.emulator.cmd("write", port=self.number, data=base64.b64encode(data).decode())
        self._queued = answer["queued"]

    def transmit(self) -> bytes:
        return self.emulator.read(self.number)

    def open_port(self, on: bool) -> None:
        self.emulator.cmd("open", port=self.number, on=on)

    @property
    def pending(self) -> int:
        if self._queued:
            self._queued = self.emulator.cmd("ports")["ports"][self.number]["queued"]
        return self._queued


def registers_of(data: Mapping[str, Any]) -> list[str]:
    """Return options of the emulator for a board's shift registers, if it has some."""
    if "registers" not in data:
        return []
    wires = data["registers"]
    pins = [wires[key] for key in ("data", "clock", "latch", "enable")]
    return ["--registers", ",".join(map(str, [*pins, min(data["step"])]))]


class BoardHalted(ToolError):
    """The emulated processor has stopped. The text says why."""


class EmulatedBoard:
    """A board's unpatched image on an emulated board.

    rig: content of its rig.json; with `ports: 1` the protocol is on the built-in port and there is
    no REPL channel; files: {path: content} of other files; args: options of the emulator (see its
    --help); board: a folder in boards/. `emulator` is the framestep_emulator.Emulator, for pins and
    loads; `pins` is the pin map.
    """

    slice_ns = 4_000_000

    def __init__(
        self,
        rig: Mapping[str, Any] | None = None,
        trace: bool = True,
        flash: str | None = None,
        board: str = "pico",
        args: Sequence[str] = (),
        files: Mapping[str, bytes] | None = None,
    ):
        from framestep_emulator import Emulator

        from ..building import images

        rig = dict(rig or {})
        files = dict(files or {})
        if rig:
            files["/rig.json"] = json.dumps(rig).encode()
        single = rig.get("ports") == 1
        data = board_data(board)
        args = [*args, *registers_of(data)]
        self.emulator = Emulator(images.frozen(board), files=files, flash=flash, args=args).start()
        try:
            self.pins = load_board(board, rig)
            inverted = [
                i for i, motor in enumerate(rig.get("motors", []), 1) if _is_inverted(motor)
            ]
            self._decoder = PinDecoder(self.pins, inverted)
            self._tracing = trace
            self._single = single
            self.emulator.once(f"ready {single} {trace and self.pins.pins}", self._come_up)
            self._now = self.emulator.ns
        except BaseException:
            self.emulator.close()
            raise
        self._rig, self._data = rig, data
        self.protocol: Channel = _EmulatedPort(self.emulator, 0 if single else 1)
        self.repl: Channel | None = None if single else _EmulatedPort(self.emulator, 0)

    def _come_up(self) -> None:
        if self._tracing:
            self.emulator.trace_start(self.pins.pins)
        if self._single:
            # Only its greeting shows that the controller is up. It waits for its reader.
            self.emulator.cmd("open", port=0, on=True)
            self.emulator.cmd(
                "run_until_ns", ns=self.emulator.ns + _BOOT_LIMIT_MS * 1_000_000, until_rx=0
            )
        else:
            self.emulator.wait_usb(_BOOT_LIMIT_MS, ports=2)

    def wire_switches(self) -> None:
        """Connect the rig's stop switches, untouched. A rig file with a mistake has none."""
        try:
            rig = Rig(self._rig or None, self._data)
        except RigError:
            return
        for pin in closed_switches(rig):
            self.emulator.set_pin(pin, 0)

    @property
    def now_ns(self) -> int:
        return self._now

    def run_until(self, ns: int, until_output: bool = False) -> None:
        until = {"until_rx": self.protocol.number} if until_output else {}  # type: ignore[attr-defined]
        state = self.emulator.cmd("run_until_ns", ns=ns, **until)
        self._now = state["ns"]
        if state["halted"]:
            raise BoardHalted(
                f"the emulated board has stopped at {self._now * 1e-9:.6f} s: {state['halted']}"
            )

    @contextlib.contextmanager
    def undone(self) -> Iterator[None]:
        """Put the board back afterwards to what it is now. Within, its client may send, but read
        nothing."""
        now = self._now
        self.emulator.cmd("keep", name="undone")
        try:
            yield
        finally:
            self.emulator.cmd("rewind", name="undone")
            self._now = now

    def edges(self) -> list[Edge]:
        return self._decoder.feed(self.emulator.trace_read()) if self._tracing else []

    def close(self) -> None:
        self.emulator.close()

    def __enter__(self) -> "Self":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _is_inverted(motor: Any) -> bool:
    return isinstance(motor, dict) and bool(motor.get("invert"))


# ---- a port on it --------------------------------------------------------------------------------


class LockstepPort:
    """A board's port for Client. Waiting reads let the board's time pass; `timeout` is in its
    seconds."""

    def __init__(self, board: Board, channel: Channel | None = None):
        self.board = board
        self.channel = channel or board.protocol
        self.timeout: float | None = 1.0
        self._arrived = bytearray()
        self.is_open = True
        self.channel.open_port(True)

    def clock(self) -> float:
        """Return the board's time in seconds."""
        return self.board.now_ns * 1e-9

    @property
    def in_waiting(self) -> int:
        """Number of bytes that can be read at once."""
        self._arrived += self.channel.transmit()
        return len(self._arrived)

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes, after waiting for at most `timeout`."""
        board = self.board
        deadline = None if self.timeout is None else board.now_ns + round(self.timeout * 1e9)
        while self.in_waiting < size and (deadline is None or board.now_ns < deadline):
            step = board.now_ns + 10**9
            board.run_until(step if deadline is None else min(step, deadline), until_output=True)
        data = bytes(self._arrived[:size])
        del self._arrived[:size]
        return data

    def write(self, data: bytes) -> int:
        """Send bytes to the board; it reads them when time passes."""
        self.channel.receive(bytes(data))
        return len(data)

    def close(self) -> None:
        """Close the port, as a host does."""
        if self.is_open:
            self.is_open = False
            self.channel.open_port(False)
