"""Worst lateness of a tick during a fixed set of requests in motion."""

import numpy as np

from framestep.protocol import messages
from framestep.pulse import stepper

from ..client.client import Client
from ..judge.virtual_reference import Rig
from ..payloads import (
    GioOut,
    Hi,
    MotorGetPosition,
    MotorJog,
    MotorMove,
    MotorResetPosition,
    MotorSetLimits,
    MotorSetSpeed,
    MotorStatus,
    MotorStop,
    MotorStopAll,
    RtEnd,
    RtGo,
    RtJogAll,
    RtRunMove,
    VirtConfig,
    VirtJog,
    VirtJogOnLine,
    VirtMove,
    VirtStop,
)
from .session import Session

_STATE = "__import__('framestep.boot').boot.hal.kernel.state"
_FAR = 2**31 - 1
_FRAMES = 240
_SPEED = (50_000, 200_000)


def worst_late_us(session: Session, arm: Rig, speed: tuple[int, int]) -> float:
    """Return the worst lateness of a tick in motion, as the firmware counts it.

    arm: a rig of virtual axes; speed: velocity and acceleration of its motors.
    """
    client = session.client
    session.repl(f"{_STATE}[{stepper.WORST_LATE}] = 0")
    _single(session)
    _uploaded(session)
    _virtual(client, arm, speed)
    return float(session.repl(f"print({_STATE}[{stepper.WORST_LATE}])"))


def _ask_all(client: Client) -> None:
    for question in (MotorStatus(), MotorGetPosition(), Hi()):
        client.answer_to(client.send(question))
    client.code(GioOut(0))


def _single(session: Session) -> None:
    """Send to all motors: moves, new targets, limits, jogs, each kind of stop."""
    client, motors = session.client, range(1, session.info.motors + 1)
    for motor in motors:
        client.request(MotorSetSpeed(motor, *_SPEED))
        client.request(MotorResetPosition(motor, 0))
    stops = ([MotorStopAll()], 2 * [MotorStopAll()], [MotorStop(n) for n in motors])
    for stop in stops:
        for motor in motors:
            client.request(MotorMove(motor, 30_000))
        client.pump(0.25)
        for motor in motors:
            client.request(MotorMove(motor, -5000))
            client.request(MotorSetLimits(motor, 1, -100_000, 1, 100_000))
        _ask_all(client)
        for request in stop:
            client.code(request)
        client.wait_idle()
        for motor in motors:
            client.request(MotorJog(motor, 10_000, _FAR))
        client.wait_idle()  # the jog is not repeated, so it ends
        for motor in motors:
            client.request(MotorSetLimits(motor, 0, 0, 0, 0))
            client.request(MotorMove(motor, 0))
        client.wait_idle()


def _uploaded(session: Session) -> None:
    """Play a run, its stops, and JOG_ALL."""
    client = session.client
    stands = session.positions
    frames = np.arange(_FRAMES)
    client.upload_move(
        1,
        _FRAMES,
        {n: stands[n] + np.rint(100 * n * np.sin(frames / 20)).astype(int) for n in stands},
    )
    for stop in ([MotorStopAll()], [MotorStop(1)], 2 * [MotorStopAll()]):
        client.request(RtRunMove(24_000, 1, _FRAMES, 500, 500))
        client.wait_idle()
        client.request(RtGo())
        client.pump(1)
        _ask_all(client)
        for request in stop:
            client.code(request)
        client.wait_idle()
    client.request(RtRunMove(24_000, 1, 12, 500, 500))
    client.wait_idle()
    client.request(RtGo())
    client.wait_event(RtEnd, 10)
    client.wait_idle()
    for to, moment in ((200, 0.8), (20, 1.5)):
        for last in (MotorStopAll(), MotorStop(1)):
            client.code(RtJogAll(24_000, to))
            client.pump(moment)
            client.code(last)
            client.wait_idle()


def _virtual(client: Client, arm: Rig, speed: tuple[int, int]) -> None:
    """Play a virtual move and jogs, with stops and without repeats."""
    for axis in arm.axes:
        client.request(MotorSetSpeed(axis.motor, *speed))
        client.request(MotorResetPosition(axis.motor, axis.step))
    client.request(VirtConfig.unpack(arm.payload()))
    east_west = messages.VIRT_MOTOR_EW
    for motion in (
        VirtMove(east_west, 98 * 100_000),
        VirtJog(east_west, 10_000, _FAR),
        VirtJogOnLine(messages.LINE_X, -8000),
    ):
        for stop in (VirtStop(east_west), MotorStopAll(), None):
            client.code(motion)
            client.pump(0.37)
            _ask_all(client)
            if stop:
                client.code(stop)
            elif isinstance(motion, VirtJogOnLine):
                client.code(MotorStopAll())
            client.wait_idle()
    client.request(VirtConfig.unpack(b"\0"))
