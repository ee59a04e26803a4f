"""The time from a request to stop to the first slower tick, at each moment of a motion."""

import base64
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from framestep.protocol.messages import MOTOR_BLUR, MOTOR_ENABLED
from framestep.pulse import stepper

from ..client.wire import encode
from ..errors import ToolError
from ..payloads import (
    BlurMotor,
    MotorConfigure,
    MotorJog,
    MotorMove,
    MotorResetPosition,
    MotorSetSpeed,
    MotorStop,
    MotorStopAll,
    Payload,
    Request,
    RtGo,
    RtJogAll,
    RtPositionFrame,
    RtShootFrame,
)
from .moves import FPS, RAMP, READY_S
from .session import Session

_LOOK_NS = 50_000
_GIVEN_UP_NS = 100_000_000
_VELOCITY = 20_000  # steps/s
_STEADY_S = 0.6  # from the start of a motion to the first of the moments
_SPAN_NS = 110_000_000  # the checks that passes make least often come every 100 ms
APART_NS = 310_000
_PLANNED_NS = 20_000_000  # longer than a planned stop takes to begin
_CARRIED_OUT_NS = 25_000_000  # a request that moves five motors, and the reports after it
_TAKEN_NS = 500_000  # before the board has taken a packet, the next one waits on the host's side
SURVEYED_NS = 40_000_000  # a request that moves a rig along a line
_REQUESTS = (MotorStopAll(), MotorStop(1))
_MOVES = stepper.RUN | stepper.STOP
_Block = tuple[int, ...]


class _Motors:
    """The tick's blocks of the motors, read in the emulated memory. To be made at rest: what it
    asks on the REPL holds up passes."""

    def __init__(self, session: Session):
        self._emulator = session.board.emulator
        self._state = int(
            session.repl(
                "import uctypes, framestep.boot\n"
                "print(uctypes.addressof(framestep.boot.hal.kernel.state))"
            )
        )
        header = self._words(self._state, stepper.HEADER_WORDS)
        self._addresses = list(self._chain(header[stepper.FIRST]))

    def _words(self, address: int, count: int) -> _Block:
        data = self._emulator.cmd("peek", address=address, length=4 * count)["data"]
        return struct.unpack(f"<{count}i", base64.b64decode(data))

    def _chain(self, address: int) -> Iterator[int]:
        while address:
            yield address
            address = self._words(address, stepper.BLOCK_WORDS)[stepper.NEXT]

    def blocks(self) -> list[_Block]:
        return [self._words(address, stepper.BLOCK_WORDS) for address in self._addresses]

    def velocities(self) -> tuple[int, list[int]]:
        """Return the ticks done, and the velocities of the next one."""
        ticks = self._words(self._state, stepper.HEADER_WORDS)[stepper.TICKS]
        return ticks, [block[stepper.VELOCITY] for block in self.blocks()]


def _slower(block: _Block, before: _Block) -> bool:
    """Whether a motor stops: it rests, or slows down by itself."""
    if not block[stepper.MODE] & _MOVES:
        return True
    return bool(block[stepper.MODE] & stepper.STOP) and abs(block[stepper.VELOCITY]) < abs(
        before[stepper.VELOCITY]
    )


def _latency_ms(
    session: Session,
    motors: _Motors,
    request: Payload,
    run: bool,
    ahead: Iterable[Payload] = (),
    first: int = 1,
) -> float:
    """Send a request to stop, and return the time until all motors that it stops are slower. In a
    run it stops all of them. Motors below `first` do not count. ahead: what comes before it, in the
    same packet."""
    board = session.board
    before = motors.blocks()
    left = {i for i, block in enumerate(before) if block[stepper.MODE] & _MOVES}
    left -= set(range(first - 1))
    if isinstance(request, MotorStop) and not run:
        left &= {request.motor - 1}
    if not left:
        raise ToolError("no motor moved that was to be stopped")
    begun = board.now_ns
    frames = [encode(each.TYPE, each.pack(), 1) for each in (*ahead, request)]
    session.client.port.write(b"".join(frames))
    while left:
        board.run_until(board.now_ns + _LOOK_NS)
        now = motors.blocks()
        left -= {i for i in left if _slower(now[i], before[i])}
        before = now
        if board.now_ns - begun > _GIVEN_UP_NS:
            raise ToolError(f"motors went on after {type(request).__name__}: {sorted(left)}")
    return (board.now_ns - begun) / 1e6


def _at_each_moment(
    session: Session, motors: _Motors, run: bool, requests: Iterable[Payload]
) -> list[float]:
    """Return how long each request takes at each of many moments, and stop everything."""
    board = session.board
    found = []
    until = board.now_ns + _SPAN_NS
    while board.now_ns < until:
        for request in requests:
            with board.undone():
                found.append(_latency_ms(session, motors, request, run))
        board.run_until(board.now_ns + APART_NS)
    session.client.request(MotorStopAll())
    session.client.wait_idle()
    return found


def _look(session: Session, motors: _Motors, span_ns: int) -> Iterator[tuple[int, list[int]]]:
    """Let a board go on, and yield the motors' velocities by ticks."""
    board = session.board
    until = board.now_ns + span_ns
    while board.now_ns < until:
        board.run_until(board.now_ns + _LOOK_NS)
        yield motors.velocities()


def planned_stops(
    session: Session, begin: Sequence[Request[Any]], steady_s: float, apart_ns: int = APART_NS
) -> list[float]:
    """Return the times from sending STOP_ALL, or a STOP of motor 1, until its motors are slower
    than they would be at that tick, in ms, wherever in a pass the request comes.

    In a JOG_ALL, until all of them have left their plan for a slower one. That slows down by some
    thousandths in each millisecond, so that it shows only later where the paths bend.

    begin: what begins a motion whose stops are planned: along a line, within jerk limits, or a
    JOG_ALL. It has to last for `steady_s` and 120 ms more. apart_ns: between the moments.
    """
    board = session.board
    motors = _Motors(session)
    for request in begin:
        session.client.request(request)
    session.client.pump(steady_s)
    with board.undone():
        # with the present one, as a request may hold up the next tick
        unstopped = dict([motors.velocities(), *_look(session, motors, _SPAN_NS + _PLANNED_NS)])
    found = []
    until = board.now_ns + _SPAN_NS
    while board.now_ns < until:
        for stop in _REQUESTS:
            with board.undone():
                begun = board.now_ns
                session.client.send(stop)
                one = isinstance(stop, MotorStop) and isinstance(begin[0], MotorMove)
                left = 0
                for tick, now in _look(session, motors, _PLANNED_NS):
                    pairs = list(zip(now, unstopped[tick], strict=True))[: 1 if one else None]
                    if not left and all(a != b for a, b in pairs if b):
                        left = board.now_ns
                    if left and sum(abs(a) - abs(b) for a, b in pairs) < 0:
                        break
                else:
                    raise ToolError(f"a motion went on after {type(stop).__name__}")
                if not isinstance(begin[0], RtJogAll):
                    left = board.now_ns
                found.append((left - begun) / 1e6)
        board.run_until(board.now_ns + apart_ns)
    session.client.request(MotorStopAll())
    session.client.wait_idle()
    return found


def stops_in_moves(session: Session) -> list[float]:
    """Return the times from sending STOP_ALL, or a STOP of motor 1, to slower motors, in ms, while
    all motors move by themselves, wherever in a pass the request comes."""
    client = session.client
    motors = _Motors(session)
    for motor in range(1, session.info.motors + 1):
        client.request(MotorSetSpeed(motor, _VELOCITY, RAMP))
        client.request(MotorResetPosition(motor, 0))
    for motor in range(1, session.info.motors + 1):
        client.request(MotorMove(motor, _VELOCITY))  # takes over a second
    client.pump(_STEADY_S)
    return _at_each_moment(session, motors, False, _REQUESTS)


def stops_beside(
    session: Session,
    requests: Sequence[Payload],
    first: int,
    span_ns: int,
    apart_ns: int = APART_NS,
    bursts: Sequence[Sequence[Payload]] = (),
) -> list[float]:
    """Return the times from sending STOP_ALL to slower motors, in ms, while the motors from `first`
    on move by themselves: at moments of the first `span_ns` after each of the requests, which
    concern other motors, and behind each burst, in the same packet."""
    client, board = session.client, session.board
    motors = _Motors(session)
    for motor in range(first, session.info.motors + 1):
        client.request(MotorSetSpeed(motor, _VELOCITY, RAMP))
        client.request(MotorResetPosition(motor, 0))
        client.request(MotorMove(motor, 3 * _VELOCITY))
    client.pump(_STEADY_S)
    found = []
    for request in requests:
        for after_ns in range(_TAKEN_NS, span_ns, apart_ns):
            with board.undone():
                client.send(request)
                board.run_until(board.now_ns + after_ns)
                found.append(_latency_ms(session, motors, MotorStopAll(), True, first=first))
    for ahead in bursts:
        for after_ns in range(0, 1_000_000, apart_ns):
            with board.undone():
                board.run_until(board.now_ns + after_ns)
                found.append(_latency_ms(session, motors, MotorStopAll(), True, ahead, first))
    client.request(MotorStopAll())
    client.wait_idle()
    return found


def stops_amid_requests(session: Session, apart_ns: int = APART_NS) -> list[float]:
    """Return stops_beside() of requests that concern the first five motors."""
    client = session.client
    count = session.info.motors
    others = range(1, 6)
    for motor in others:
        client.request(MotorSetSpeed(motor, _VELOCITY, RAMP))
        client.request(MotorResetPosition(motor, 0))
    waves = {motor: np.rint(300 * np.sin(np.arange(100) / (5 + motor))) for motor in others}
    client.upload_move(1, 100, {motor: wave.astype(np.int64) for motor, wave in waves.items()})
    requests = (
        MotorMove(1, 5000),
        MotorJog(1, 5000, 5000),
        MotorStop(2),
        MotorSetSpeed(count, _VELOCITY // 2, RAMP),
        RtPositionFrame(50),
    )
    bursts = (
        [MotorMove(motor, 5000) for motor in others],
        [MotorSetSpeed(motor, _VELOCITY // 2, RAMP) for motor in others],
        [MotorStop(motor) for motor in others],
    )
    return stops_beside(session, requests, others[-1] + 1, _CARRIED_OUT_NS, apart_ns, bursts)


def stops_in_run(
    session: Session,
    run: Mapping[int, np.ndarray],
    velocity: int,
    fps: int = FPS,
    requests: Iterable[Payload] = _REQUESTS,
) -> list[float]:
    """Return the same for a run, which has to last for more than 1 s."""
    motors = _Motors(session)
    session.prepare(run, velocity, fps)
    session.client.request(RtGo())
    session.client.pump(_STEADY_S)
    return _at_each_moment(session, motors, True, requests)


def begin_shot(session: Session, velocity: int) -> RtShootFrame:
    """Return a SHOOT_FRAME of all motors with an exposure of 2 s, for which they are configured
    and an upload is there. velocity: steps/s."""
    client = session.client
    stands = session.positions
    blur = MOTOR_ENABLED | MOTOR_BLUR
    for motor in stands:
        client.request(MotorSetSpeed(motor, velocity, RAMP))
        client.request(MotorConfigure(motor, blur))
    client.upload_move(1, 3, {motor: np.full(3, stand) for motor, stand in stands.items()})
    ways = [BlurMotor(motor, stand, stand + velocity) for motor, stand in stands.items()]
    return RtShootFrame(2, 0, 2000, 1000, ways)


def stops_in_shot(
    session: Session, velocity: int, after_s: Sequence[float] = (0.5, 1.5)
) -> list[float]:
    """Return the same as stops_in_run() for begin_shot(), so many seconds after GO: in its ramp of
    1 s, and while the shutter is open."""
    client = session.client
    motors = _Motors(session)
    shot = begin_shot(session, velocity)
    found = []
    for steady_s in after_s:
        client.request(shot)
        client.wait_idle()
        client.pump(READY_S)
        client.request(RtGo())
        client.pump(steady_s)
        found += _at_each_moment(session, motors, True, _REQUESTS[:1])
    for way in shot.motors:
        client.request(MotorConfigure(way.motor, MOTOR_ENABLED))
    return found


def begin_jog_all(session: Session, velocity: int) -> RtJogAll:
    """Return a JOG_ALL of eight motors on curved paths on whose first frame they are: it becomes
    ever faster. velocity: of the motors, steps/s."""
    frames = np.arange(160)
    paths = {m: 40 * m * frames + np.round(300 * np.sin(frames / (2 + m))) for m in range(1, 9)}
    session.prepare({m: path.astype(np.int64) for m, path in paths.items()}, velocity)
    session.client.request(RtPositionFrame(1))
    session.client.wait_idle()
    return RtJogAll(24_000, len(frames))


def stops_in_jogs(
    session: Session,
    velocity: int,
    after_s: Sequence[float] = (0.5, 3),
    apart_ns: int = APART_NS,
) -> list[float]:
    """Return planned_stops() of begin_jog_all(), so many seconds after its beginning."""
    found = []
    for steady_s in after_s:
        found += planned_stops(session, [begin_jog_all(session, velocity)], steady_s, apart_ns)
    return found
