"""What is set between the request and GO, or during a loop, counts: GO checks again (field note 6.12)."""

import numpy as np
import pytest

from framestep_tools.payloads import (
    Ack,
    BlurMotor,
    MotorConfigure,
    MotorResetPosition,
    MotorSetLimits,
    MotorSetSpeed,
    RtEnd,
    RtGo,
    RtShootFrame,
    RtShootFrame2,
    VirtConfig,
    VirtualAxis,
)
from host_tests.end_to_end.realtime import rig, upload
from host_tests.end_to_end.session import assert_within, run_request

FRAMES = 25
UP = 1000 + 60 * np.arange(FRAMES)  # 1440 steps/s at 24 frames/s
VELOCITY, ACCELERATION = 20_000, 100_000
RUN = run_request(24, 1, FRAMES, 500, 500)
LOOP, PING_PONG = 2, 1
UPPER, LOWER = 2440 + 60 + 360, 1000 - 360  # where the post-roll ends, where the motor waits

CHANGES = [
    (MotorSetSpeed(1, 1300, ACCELERATION), Ack.ERR_RANGE),
    (MotorSetSpeed(1, VELOCITY, 2000), Ack.ERR_PREROLL),
    (MotorSetLimits(1, 0, 0, 1, 2000), Ack.ERR_SOFT_UP),
    (MotorSetLimits(1, 1, 1100, 0, 0), Ack.ERR_SOFT_LOW),
    (MotorSetLimits(1, 0, 0, 1, UPPER - 1), Ack.ERR_POSTROLL),
    (MotorSetLimits(1, 1, LOWER + 1, 0, 0), Ack.ERR_PREROLL),
    (MotorSetLimits(1, 1, LOWER, 1, UPPER), Ack.OK),
    (MotorConfigure(1, 0x00), Ack.ERR_GENERAL),
    (MotorConfigure(1, 0x09), Ack.ERR_GENERAL),
    (MotorConfigure(2, 0x11), Ack.OK),
    (MotorConfigure(1, 0x11), Ack.ERR_GENERAL),  # motor 2 would be led by it, but has a part of its own
    (MotorResetPosition(1, 5), Ack.ERR_NOT_IN_POSITION),
    (MotorResetPosition(1, LOWER), Ack.OK),
    (MotorSetSpeed(1, 1500, 3000), Ack.OK),
    (MotorSetSpeed(3, 10, 10), Ack.OK),  # has no part in it
    (VirtConfig(2, (VirtualAxis(1, 1000), VirtualAxis(2, 1000))), Ack.OK),
]
BACK = (
    MotorSetSpeed(1, VELOCITY, ACCELERATION),
    MotorSetLimits(1, 0, 0, 0, 0),
    MotorConfigure(1, 0x03),
    MotorResetPosition(1, LOWER),
)


def loaded(**settings):
    session = rig(virtuals=12, **settings)
    upload(session, {1: UP, 2: UP[::-1]})
    return session


@pytest.mark.parametrize("pause", [0, 0.3], ids=["at once", "later"])
@pytest.mark.parametrize(("change", "code"), CHANGES, ids=lambda value: str(value)[:60])
def test_before_go(change, code, pause):
    """As RUN_MOVE would answer; refused, nothing moves, and what is set back lets it go."""
    session = loaded()
    session.ready(RUN)
    session.forget()
    session.accept(change)
    session.run(pause)
    if code != Ack.OK:
        session.refuse(code, RtGo())
        session.run(0.2)
        assert not session.trace().motors
        assert not session.moving
        session.refuse(code, RtGo())
        session.accept(*BACK)
        session.run(pause)
    session.accept(RtGo())
    session.client.wait_event(RtEnd, 10)
    session.wait_idle()
    assert session.position(1) == UP[-1]


def test_shortest_rolls_are_others_now():
    """The motors wait where they would begin no more."""
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 0, 0))
    session.speed(1, VELOCITY, 20_000)
    session.refuse(Ack.ERR_NOT_IN_POSITION, RtGo())
    session.ready(run_request(24, 1, FRAMES, 0, 0))
    session.forget()
    session.accept(RtGo())
    session.client.wait_event(RtEnd, 10)
    session.wait_idle()
    times, signs = session.steps(1)
    assert_within(times, signs, 20_000, 20_000)


def test_a_motor_enabled_since():
    session = loaded()
    session.accept(MotorConfigure(2, 0))
    session.ready(RUN)
    session.accept(MotorConfigure(2, 3))
    session.refuse(Ack.ERR_NOT_IN_POSITION, RtGo())
    session.play(RUN)


@pytest.mark.parametrize("second", [False, True])
def test_before_go_of_an_exposure(second):
    pairs = (BlurMotor(1, 0, 800),)
    for change, first, angles in (
        (MotorSetSpeed(1, 700, ACCELERATION), Ack.ERR_RANGE, Ack.ERR_RANGE),
        (MotorSetSpeed(1, VELOCITY, 300), Ack.ERR_PREROLL, Ack.ERR_RANGE),
        (MotorSetLimits(1, 1, -399, 0, 0), Ack.ERR_PREROLL, Ack.OK),
        (MotorSetLimits(1, 1, 1, 0, 0), Ack.ERR_PREROLL, Ack.ERR_PREROLL),
        (MotorSetLimits(1, 0, 0, 1, 1199), Ack.ERR_POSTROLL, Ack.OK),
        (MotorSetLimits(1, 0, 0, 1, 799), Ack.ERR_POSTROLL, Ack.ERR_POSTROLL),
        (MotorConfigure(1, 0x01), Ack.ERR_GENERAL, Ack.OK),
        (MotorConfigure(1, 0x02), Ack.ERR_GENERAL, Ack.ERR_GENERAL),
    ):
        session = loaded()
        request = RtShootFrame2(12, 1000, 0, 360, pairs) if second else RtShootFrame(12, 1, 1000, 1000, pairs)
        session.ready(request)
        session.accept(change)
        code = angles if second else first
        if code != Ack.OK:
            session.refuse(code, RtGo())
            session.accept(*BACK[:3])
        session.accept(RtGo())
        session.client.wait_event(RtEnd, 10)


@pytest.mark.parametrize("flags", [LOOP, PING_PONG])
@pytest.mark.parametrize("after", [1.0, 1.9], ids=["in the pass", "between two"])
@pytest.mark.parametrize(
    "change", [MotorSetSpeed(1, 1300, ACCELERATION), MotorSetLimits(1, 0, 0, 1, 2000), MotorSetSpeed(1, 20_000, 2000)]
)
def test_in_a_loop(flags, after, change):
    """The pass under way ends as it was acknowledged, the next one would not be: the run ends there."""
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 500, 500, flags=flags))
    session.accept(RtGo())
    session.run(after)
    session.accept(change)
    session.client.wait_event(RtEnd, 6)
    session.wait_idle()
    assert session.now < 9


def test_a_slower_way_back_in_a_loop():
    """What allows the next pass still holds on the way there."""
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 500, 500, flags=LOOP))
    session.accept(RtGo())
    session.run(1)
    session.speed(1, 1500, 3000)
    session.forget()
    session.run(9)
    times, signs = session.steps(1)
    assert_within(times, signs, 1500 * 1.01, 3000 * 1.02, window=0.05)
    assert not session.events(RtEnd)
    assert np.count_nonzero(np.diff(signs)) >= 3


def test_a_limit_set_on_the_way_to_the_start():
    """The motors go no farther than that, and GO is refused."""
    session = loaded()
    session.accept(MotorSetSpeed(1, 2_000, 4_000), RUN)
    session.run(0.2)
    session.accept(MotorSetLimits(1, 1, -100, 1, 500))
    session.wait_idle()
    assert session.position(1) == session.made(1) == 500
    session.refuse(Ack.ERR_SOFT_UP, RtGo())


@pytest.mark.parametrize("when", ["on the way back", "before the way back"])
def test_a_limit_set_in_a_loop_holds_on_the_way_back(when):
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 500, 500, flags=LOOP))
    session.accept(RtGo())
    session.run(2.1 if when == "on the way back" else 1.5)
    assert session.position(1) > 1500
    set_at = session.now
    session.accept(MotorSetLimits(1, 1, 900, 1, 100_000))
    session.client.wait_event(RtEnd, 6)
    session.wait_idle()
    times, signs = session.steps(1)
    assert np.cumsum(signs)[times > set_at].min() >= 900
