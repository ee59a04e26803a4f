"""The device under test, and the actions of checks: ask, move, upload, play, return."""

import contextlib
import math
import struct
from typing import Any, NamedTuple, Protocol

from ..judge.trace import Edge
from . import spec
from .link import Failed, Link, Reply
from .pace import HoldUps
from .spec import Request

VELOCITY, ACCELERATION = 1000, 8000  # steps/s, steps/s²: slow for any rig
_IDLE_S = 20.0
_LOOK_S = 0.02
_SET_OUT_S = 2.0
FRAMES = 12


class Position(NamedTuple):
    """A message of positions: its time (0 for an answer), MOVE TIME in 1/1000 frames, steps."""

    time_s: float
    move_time: int
    steps: tuple[int, ...]


class Played(NamedTuple):
    """A run as a host sees it: position messages since GO, and the times of RT_END."""

    ready: tuple[int, ...]
    go_s: float
    positions: list[Position]
    ends: list[float]


class Hello(NamedTuple):
    """The fields of HI."""

    name: bytes
    version: tuple[int, int, int]
    motors: int
    lights: int
    outputs: int
    inputs: int
    limits: int
    frames: int
    can: int
    size: int


class Pins(Protocol):
    """A source of a device's edges, such as a trace that is written while it runs."""

    def take(self) -> list[Edge]:
        """Return the edges since the last call, up to now, in the order of their times."""


class Hands(Protocol):
    """Presses the switches of a device: `input 1`, `upper limit 1` or `lower limit 1` (of limit set
    1), `E-stop`. `slow`: takes more than a fraction of a second."""

    slow: bool

    def has(self, what: str) -> bool:
        """Return whether there is such a switch."""

    def press(self, what: str, on: bool) -> None:
        """Press or release a switch."""

    def ready(self, what: str) -> None:
        """Announce that a motor is about to move; slow hands press the switch once it does."""


class Bench:
    """One device.

    `home`: positions at the start, to which everything is relative; `pins`, `hands`: show its pins
    and press its switches, or None; `hold_ups`: measures how late this computer is, unless the
    device runs in lockstep.
    """

    def __init__(
        self,
        link: Link,
        full: bool = False,
        pins: Pins | None = None,
        hands: Hands | None = None,
        hold_ups: HoldUps | None = None,
    ):
        self.link = link
        self.full = full
        self.pins = pins
        self.hands = hands
        self.hold_ups = hold_ups
        self.kept: dict[Any, Any] = {}  # results that several checks judge, by a key
        self.hello = self._hello()
        self.home = self.positions().steps if self.hello.motors else ()
        self._played: dict[Request, Played] = {}
        self.prepare()

    def _hello(self) -> Hello:
        data = self.data(spec.HI)
        if len(data) not in (49, 51):
            raise Failed(f"HI has {len(data)} bytes, the specification 51 (49 before 2020)")
        name, *rest = struct.unpack_from("<32s4BH3BII", data)
        fields = (name, tuple(rest[:3]), *rest[3:], len(data))
        return Hello._make(fields)

    # ---- requests

    def ask(self, request: Request) -> Reply:
        """Return the answer to a request."""
        return self.link.ask(*request)

    def expect(self, request: Request, *codes: int) -> None:
        """Require an acknowledgement with one of these codes, by default OK. A reply with data
        counts as OK."""
        code = self.ask(request).code
        code = spec.OK if code is None else code
        if code not in (codes or (spec.OK,)):
            wanted = " or ".join(f"0x{one:04X}" for one in codes or (spec.OK,))
            name = spec.NAMES.get(request.type, f"0x{request.type:04X}")
            raise Failed(
                f"{name} {request.payload.hex()} is answered with 0x{code:04X}, expected {wanted}"
            )

    def data(self, type: int, payload: bytes = b"") -> bytes:
        """Return the data of an answer that is not an acknowledgement."""
        reply = self.link.ask(type, payload)
        if reply.code is not None:
            raise Failed(f"0x{type:04X} is answered with code 0x{reply.code:04X} and no data")
        return reply.frame.payload

    def positions(self) -> Position:
        """Send MSG_MOTOR_GET_POSITION."""
        return self.unpack(self.data(spec.GET_POSITION), 0)

    def unpack(self, data: bytes, time_s: float) -> Position:
        """Decode a message of positions. Raises Failed if its length does not match the motors."""
        if len(data) != 4 + 4 * self.hello.motors:
            raise Failed(f"GET_POSITION has {len(data)} bytes for {self.hello.motors} motors")
        move_time, *steps = struct.unpack(f"<{1 + self.hello.motors}i", data)
        return Position(time_s, move_time, tuple(steps))

    def moving(self) -> int:
        """Return the bits of MSG_MOTOR_STATUS."""
        return int.from_bytes(self._status()[:4], "little")

    def _status(self) -> bytes:
        data = self.data(spec.STATUS)
        if len(data) != 5:
            raise Failed(f"MOTOR_STATUS has {len(data)} bytes, expected 5")
        return data

    def lit(self) -> int:
        """Return DMX STATUS of MSG_MOTOR_STATUS."""
        return self._status()[4]

    def refused(self, request: Request) -> None:
        """Require any code but OK as the answer."""
        self.expect(request, *(code for code in spec.CODES if code != spec.OK))

    def idle(self, limit_s: float = _IDLE_S) -> None:
        """Poll MOTOR_STATUS until nothing moves, as Dragonframe does."""
        end = self.link.clock() + limit_s
        while self.moving():
            if self.link.clock() > end:
                raise Failed(f"motors still move after {limit_s:g} s")
            self.link.pump(_LOOK_S)

    def set_out(self, motor: int) -> None:
        """Wait until a motor's position is another than at the start of the check: it takes up
        backlash first, and a limited jerk makes that and the first step slow."""
        end = self.link.clock() + _SET_OUT_S
        while self.positions().steps[motor - 1] == self.home[motor - 1]:
            if self.link.clock() > end:
                raise Failed(f"motor {motor} has made no step in {_SET_OUT_S:g} s")
            self.link.pump(_LOOK_S)

    # ---- a known state

    def prepare(self) -> None:
        """Enable every motor, slow and without limits."""
        for motor in range(1, self.hello.motors + 1):
            self.expect(spec.configure(motor, 1))
            self.expect(spec.speed(motor, VELOCITY, ACCELERATION))
            self.expect(spec.limits(motor))

    def rest(self) -> None:
        """Wait until nothing moves, and forget unasked messages."""
        if self.hello.motors:
            self.idle()
        self.link.reports.clear()
        self.link.answers.clear()

    def recover(self) -> None:
        """Return to a known state after a failed check, as far as possible. Raises Failed if the
        device is silent."""
        if self.link.answer(self.link.send(spec.HI)) is None:
            self.link.pump(_IDLE_S)
            if self.link.answer(self.link.send(spec.HI)) is None:
                raise Failed("it no longer answers, not even HI")
        for step in (
            lambda: self.link.ask(spec.STOP_ALL), self.idle, self.prepare, self.return_home,
        ):  # fmt: skip
            with contextlib.suppress(Failed, struct.error):
                step()
        self.link.reports.clear()
        self.link.answers.clear()

    def forget(self) -> None:
        """Forget the shared results, so they are played again."""
        self.kept.clear()
        self._played.clear()

    def return_home(self) -> None:
        """Bring every motor back to its start."""
        for motor, steps in enumerate(self.home, 1):
            self.expect(spec.move(motor, steps))
        self.idle()

    def at(self, motor: int, steps: int, within: int = 0) -> None:
        """Require a motor at a position, counted from home."""
        found = self.positions().steps[motor - 1] - self.home[motor - 1]
        if abs(found - steps) > within:
            raise Failed(f"motor {motor} is {found} steps from its start, expected {steps}")

    def go(self, motor: int, steps: int) -> None:
        """Move a motor to a position, in steps from home, and wait."""
        self.expect(spec.move(motor, self.home[motor - 1] + steps))
        self.idle()

    def reports(self, since: float = 0) -> list[Position]:
        """Return the unasked position messages."""
        return [
            self.unpack(report.frame.payload, report.time_s)
            for report in self.link.reports
            if report.frame.type == spec.GET_POSITION and report.time_s >= since
        ]

    # ---- uploaded moves

    def path(self, motor: int) -> list[int]:
        """Return the uploaded positions of a motor: there and half back, from rest. The second
        motor goes the other way."""
        sign = 1 if motor % 2 else -1
        return [
            self.home[motor - 1] + sign * round(60 * (1 - math.cos(math.pi * i / (FRAMES - 1))))
            for i in range(FRAMES)
        ]

    def off_path(self, frame: int, position: Position) -> str:
        """Name the motor that is more than a step off its path at a frame, or return ""."""
        for motor in range(1, min(2, self.hello.motors) + 1):
            reported, uploaded = position.steps[motor - 1], self.path(motor)[frame - 1]
            if abs(reported - uploaded) > 1:
                return f"at frame {frame} motor {motor} is at {reported}, uploaded is {uploaded}"
        return ""

    def upload(self) -> None:
        """Upload frames 1 to FRAMES for the first two motors, in two sections."""
        self.expect(spec.begin(1, FRAMES))
        for motor in range(1, min(2, self.hello.motors) + 1):
            path = self.path(motor)
            self.expect(spec.axis(motor, 0, path[:5]))
            self.expect(spec.axis(motor, 5 | spec.LAST, path[5:]))
        self.expect(Request(spec.UPLOAD_END))

    def play(self, request: Request, seconds: float, loop_s: float = 0) -> Played:
        """Upload, run, and wait for RT_END, at most `seconds`. Each request is played only once.

        loop_s: time after which to send STOP_LOOP.
        """
        if request in self._played:
            return self._ended(self._played[request], seconds)
        self.upload()
        self.expect(request)
        self.idle()
        ready = self.positions().steps
        self.link.reports.clear()
        self.expect(Request(spec.GO))
        go = self.link.clock()
        if loop_s:
            self.link.pump(loop_s)
            self.expect(Request(spec.STOP_LOOP))
        while not self.ends() and self.link.clock() < go + seconds:
            self.link.pump(0.1)
        self.link.pump(0.3)
        played = Played(ready, go, self.reports(), self.ends())
        self._played[request] = played
        return self._ended(played, seconds)

    @staticmethod
    def _ended(played: Played, seconds: float) -> Played:
        if not played.ends:
            raise Failed(f"no RT_END within {seconds:g} s of GO")
        return played

    def ends(self) -> list[float]:
        """Return the times of the received RT_END messages."""
        return [r.time_s for r in self.link.reports if r.frame.type == spec.END]
