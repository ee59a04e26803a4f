"""Live positions for other programs over UDP: FreeD and OSC, a packet for each report.

FreeD's message D1 is that of Vinten's free-d manual V1.4.4, appendices A.3.2 and B: X to the right,
Y forward, height up; pan to the right, tilt up and roll clockwise from behind are positive. OSC is
version 1.0. A packet that cannot be sent at once is dropped, so nobody waits for a network.
"""

import socket
import struct
from collections.abc import Callable, Iterable
from typing import NamedTuple
from urllib.parse import quote

from ..axes.axes_file import Axis
from ..axes.rig_axes import Axes
from ..axes.units import UNITS, factor
from ..errors import USAGE, ToolError
from ..payloads import Positions, VirtPositions
from .client import Event

_LARGEST = 2**23 - 1  # 24 bits signed
_AXES = {  # names in axes.toml, and FreeD's unit
    "pan": (("pan",), "deg"), "tilt": (("tilt",), "deg"), "roll": (("roll",), "deg"),
    "x": (("x", "ew"), "mm"), "y": (("y", "ns"), "mm"), "z": (("z", "track"), "mm"),
}  # fmt: skip
_LENS = ("zoom", "focus")


class Pose(NamedTuple):
    """A camera's place and angles as virtual axes have them (field note 9.4): X right, Y up, Z
    back; pan to the left, tilt up, roll clockwise."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    pan: float = 0.0
    tilt: float = 0.0
    roll: float = 0.0


class LiveError(ToolError):
    """An address or an axis does not fit. The text says what to do."""

    status = USAGE


# ---- packets


def freed(pose: Pose, zoom: int = 0, focus: int = 0, camera: int = 1) -> bytes:
    """Return a D1 message. pose: in mm and degrees; zoom, focus: numbers as a lens's encoder counts
    them. What does not fit has the nearest value that does."""
    angles = (-pose.pan, pose.tilt, pose.roll)
    fields = [round(((angle + 180) % 360 - 180) * 32768) for angle in angles]
    fields += [round(mm * 64) for mm in (pose.x, -pose.z, pose.y)]
    body = bytes((0xD1, camera))
    for number in fields:
        body += max(-_LARGEST - 1, min(_LARGEST, number)).to_bytes(3, "big", signed=True)
    for number in (zoom, focus):
        body += max(0, min(2**24 - 1, number)).to_bytes(3, "big")
    body += bytes(2)
    return body + bytes(((0x40 - sum(body)) & 0xFF,))


def osc_message(address: str, *values: float | int) -> bytes:
    """Return an OSC message with whole numbers as int32 and others as float32."""
    types = "".join("i" if isinstance(value, int) else "f" for value in values)
    return _text(address) + _text("," + types) + struct.pack(">" + types, *values)


def osc_bundle(messages: Iterable[bytes]) -> bytes:
    """Return an OSC bundle to be carried out at once."""
    parts = (struct.pack(">i", len(message)) + message for message in messages)
    return _text("#bundle") + struct.pack(">Q", 1) + b"".join(parts)


def _text(text: str) -> bytes:
    data = text.encode("ascii")
    return data + bytes(4 - len(data) % 4)


# ---- what is sent


def place(report: VirtPositions, mm: float = 1.0) -> Pose:
    """Return the pose that virtual axes report. mm: in a unit of their lengths."""
    east_west, north_south, track, pan, tilt, roll = (
        value / 100_000
        for value in (
            report.east_west, report.north_south, report.track,
            report.pan, report.tilt, report.roll,
        )
    )  # fmt: skip
    return Pose(east_west * mm, north_south * mm, track * mm, pan, tilt, roll)


class FreeD:
    """Packets for FreeD: the pose of virtual axes, or else of the axes with its names."""

    def __init__(self, axes: Axes, unit: str | None, camera: int):
        """unit: of virtual axes' lengths (None: that of the lengths in axes.toml, else mm).

        Raises LiveError if an axis or the unit does not fit.
        """
        self._axes = axes
        self._camera = camera
        lengths = {axis.unit for axis in axes.list if UNITS[axis.unit][0] == "length"}
        if unit is None and len(lengths) > 1:
            raise LiveError(
                f"--freed: {axes.path} has lengths in {' and '.join(sorted(lengths))}: name the "
                "unit of virtual axes by --unit"
            )
        self._mm = factor(unit or min(lengths, default="mm"), "mm") or 1.0
        self._named: dict[str, tuple[Axis, float]] = {}
        for name, (names, wanted) in _AXES.items():
            motors = [motor for motor in map(axes.named_motor, names) if motor]
            axis = axes.axis(motors[0]) if motors else None
            if axis:
                times = factor(axis.unit, wanted)
                if times is None:
                    raise LiveError(
                        f"--freed: expected axis {axis.name} in a unit such as {wanted}, "
                        f"found {axis.unit} in {axes.path}"
                    )
                self._named[name] = axis, times
        self._lens = [axes.named_motor(name) for name in _LENS]

    def check(self, virtual: bool) -> None:
        """Raise LiveError if there is no pose to send."""
        if not virtual and not self._named:
            raise LiveError(
                "--freed needs a camera's pose: configure virtual axes in Dragonframe or the "
                "console, or name axes pan, tilt, roll, x, y or z in axes.toml"
            )

    def packet(self, report: Positions, virtual: VirtPositions | None) -> bytes | None:
        """Return the packet for a report, or None if there is no pose."""
        if virtual:
            pose = place(virtual, self._mm)
        elif self._named:
            pose = Pose(
                **{
                    name: axis.position(report.steps[axis.motor - 1]) * times
                    for name, (axis, times) in self._named.items()
                    if axis.motor <= len(report.steps)
                }
            )
        else:
            return None
        zoom, focus = (
            report.steps[motor - 1] if motor and motor <= len(report.steps) else 0
            for motor in self._lens
        )
        return freed(pose, zoom, focus, self._camera)


def osc(axes: Axes, report: Positions, virtual: VirtPositions | None) -> bytes:
    """Return the packet for a report: the frame, each axis in its unit, motors without an axis in
    steps, the camera's pose in the virtual axes' own units."""
    messages = [osc_message("/framestep/frame", report.move_time / 1000)]
    for motor, steps in enumerate(report.steps, 1):
        axis = axes.axis(motor)
        if axis:
            name = quote(axis.name, safe="")
            messages.append(osc_message(f"/framestep/axis/{name}", float(axis.position(steps))))
        else:
            messages.append(osc_message(f"/framestep/motor/{motor}", steps))
    if virtual:
        messages.append(osc_message("/framestep/camera", *place(virtual)))
    return osc_bundle(messages)


# ---- the line


class Target:
    """An address that gets packets."""

    def __init__(self, option: str, text: str):
        """Find HOST:PORT. Raises LiveError."""
        host, _, port = text.rpartition(":")
        host = host[1:-1] if host[:1] + host[-1:] == "[]" else host
        if not host or not (port.isascii() and port.isdecimal() and 1 <= int(port) <= 65535):
            raise LiveError(
                f"{option}: expected HOST:PORT such as 192.168.1.20:40000, found {text[:60]!r}"
            )
        try:
            family, kind, protocol, _, self._address = socket.getaddrinfo(
                host, int(port), type=socket.SOCK_DGRAM
            )[0]
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise LiveError(f"{option}: there is no host {host[:60]!r}: {reason}") from None
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self.name = text
        self.dropped = 0
        self.why = ""  # the last one was dropped

    def send(self, packet: bytes) -> None:
        """Send a packet, or drop it."""
        try:
            self._socket.sendto(packet, self._address)
        except OSError as error:
            self.dropped += 1
            self.why = error.strerror or str(error)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


Maker = Callable[[Positions, VirtPositions | None], bytes | None]


class Stream:
    """Sends a packet to each target for each report of positions.

    The pose of virtual axes comes right after the positions (field note 9.8), as long as there
    are virtual axes: a packet then waits for it.
    """

    def __init__(
        self,
        outputs: list[tuple[Target, Maker]],
        report: Positions,
        virtual: VirtPositions | None,
    ):
        self._outputs = outputs
        self._report = report
        self._virtual = virtual
        self._waits = False  # for the pose that belongs to the positions
        self.sent = 0  # reports

    def hear(self, event: Event) -> None:
        """Take an unasked message of the device."""
        message = event.message
        if isinstance(message, Positions):
            if self._waits:  # the one before had no pose
                self._virtual = None
            self._report = message
            self._waits = self._virtual is not None
            if not self._waits:
                self.send()
        elif isinstance(message, VirtPositions):
            self._virtual = message
            self._waits = False
            self.send()

    def send(self) -> None:
        """Send what was reported last."""
        self.sent += 1
        for target, packet_of in self._outputs:
            packet = packet_of(self._report, self._virtual)
            if packet:
                target.send(packet)
