"""The time from a request to stop to the first slower tick."""

import base64
import struct
from collections.abc import Iterator

import numpy as np

from framestep.pulse import stepper

from ..errors import ToolError
from ..payloads import (
    MotorMove,
    MotorResetPosition,
    MotorSetSpeed,
    MotorStop,
    MotorStopAll,
    Payload,
    RtGo,
    RtRunMove,
)
from .moves import FPS, MOTORS, RAMP, ROLL_MS, STEADY_RATES, mixed_move
from .session import Session

_LOOK_NS = 50_000
_GIVEN_UP_NS = 100_000_000
_VELOCITY = 20_000  # steps/s
_MOVES = stepper.RUN | stepper.STOP
_Block = tuple[int, ...]


class _Motors:
    """The tick's blocks of the motors, read in the emulated memory."""

    def __init__(self, session: Session):
        self._emulator = session.board.emulator
        state = int(
            session.repl(
                "import uctypes, framestep.boot\n"
                "print(uctypes.addressof(framestep.boot.hal.kernel.state))"
            )
        )
        self._addresses = list(self._chain(self._words(state, stepper.HEADER_WORDS)[stepper.FIRST]))

    def _words(self, address: int, count: int) -> _Block:
        data = self._emulator.cmd("peek", address=address, length=4 * count)["data"]
        return struct.unpack(f"<{count}i", base64.b64decode(data))

    def _chain(self, address: int) -> Iterator[int]:
        while address:
            yield address
            address = self._words(address, stepper.BLOCK_WORDS)[stepper.NEXT]

    def blocks(self) -> list[_Block]:
        return [self._words(address, stepper.BLOCK_WORDS) for address in self._addresses]


def _slower(block: _Block, before: _Block) -> bool:
    """Whether a motor stops: it rests, or slows down by itself."""
    if not block[stepper.MODE] & _MOVES:
        return True
    return bool(block[stepper.MODE] & stepper.STOP) and abs(block[stepper.VELOCITY]) < abs(
        before[stepper.VELOCITY]
    )


def _latency_ms(session: Session, motors: _Motors, request: Payload, run: bool) -> float:
    """Send a request to stop, and return the time until each motor that it stops is slower: in a
    run, all of them."""
    board = session.board
    before = motors.blocks()
    left = {i for i, block in enumerate(before) if block[stepper.MODE] & _MOVES}
    if isinstance(request, MotorStop) and not run:
        left &= {request.motor - 1}
    if not left:
        raise ToolError("no motor moved that was to be stopped")
    begun = board.now_ns
    session.client.send(request)
    while left:
        board.run_until(board.now_ns + _LOOK_NS)
        now = motors.blocks()
        left -= {i for i in left if _slower(now[i], before[i])}
        before = now
        if board.now_ns - begun > _GIVEN_UP_NS:
            raise ToolError(f"motors went on after {type(request).__name__}: {sorted(left)}")
    return (board.now_ns - begun) / 1e6


def stop_times(session: Session, runs: int = 6) -> list[float]:
    """Return the times from sending STOP_ALL, or a STOP of motor 1, to slower motors, in ms: in
    moves of eight motors and in runs, at random moments."""
    client = session.client
    random = np.random.default_rng(5)
    motors = _Motors(session)
    found = []

    def stop(request: Payload, run: bool = False) -> None:
        found.append(_latency_ms(session, motors, request, run))
        client.pump(0.02)
        client.request(MotorStopAll())
        client.wait_idle()
        client.pump(0.05)

    for motor in range(1, MOTORS + 1):
        client.request(MotorSetSpeed(motor, _VELOCITY, RAMP))
        client.request(MotorResetPosition(motor, 0))
    target = _VELOCITY  # over a second away
    for _ in range(runs):
        for request in (MotorStopAll(), MotorStop(1)):
            for motor in range(1, MOTORS + 1):
                client.request(MotorMove(motor, target))
            target = -target
            client.pump(random.uniform(0.1, 0.8))
            stop(request)
    positions = session.prepare(mixed_move(), max(STEADY_RATES) * 11 // 10)
    frames = len(positions[1])
    for _ in range(runs):
        for request in (MotorStopAll(), MotorStop(1)):
            client.request(RtRunMove(FPS * 1000, 1, frames, ROLL_MS, ROLL_MS))
            client.wait_idle()
            client.pump(0.05)
            client.request(RtGo())
            client.pump(random.uniform(0.5, 2))
            stop(request, run=True)
    return found
