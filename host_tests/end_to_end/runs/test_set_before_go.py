"""Settings between the request and GO, or during a loop, count: GO checks again (field note
6.12)."""

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end.realtime import rig, upload
from host_tests.end_to_end.session import assert_within, run_request

FRAMES = 25
UP = 1000 + 60 * np.arange(FRAMES)  # 1440 steps/s at 24 frames/s
VELOCITY, ACCELERATION = 20_000, 100_000
RUN = run_request(24, 1, FRAMES, 500, 500)
LOOP, PING_PONG = 2, 1
UPPER, LOWER = 2440 + 60 + 360, 1000 - 360  # where the post-roll ends, where the motor waits

CHANGES = [
    (p.MotorSetSpeed(1, 1300, ACCELERATION), p.Ack.ERR_RANGE),
    (p.MotorSetSpeed(1, VELOCITY, 2000), p.Ack.ERR_PREROLL),
    (p.MotorSetLimits(1, 0, 0, 1, 2000), p.Ack.ERR_SOFT_UP),
    (p.MotorSetLimits(1, 1, 1100, 0, 0), p.Ack.ERR_SOFT_LOW),
    (p.MotorSetLimits(1, 0, 0, 1, UPPER - 1), p.Ack.ERR_POSTROLL),
    (p.MotorSetLimits(1, 1, LOWER + 1, 0, 0), p.Ack.ERR_PREROLL),
    (p.MotorSetLimits(1, 1, LOWER, 1, UPPER), p.Ack.OK),
    (p.MotorConfigure(1, 0x00), p.Ack.ERR_GENERAL),
    (p.MotorConfigure(1, 0x09), p.Ack.ERR_GENERAL),
    (p.MotorConfigure(2, 0x11), p.Ack.OK),
    # motor 2 would follow it, but has a path of its own
    (p.MotorConfigure(1, 0x11), p.Ack.ERR_GENERAL),
    (p.MotorResetPosition(1, 5), p.Ack.ERR_NOT_IN_POSITION),
    (p.MotorResetPosition(1, LOWER), p.Ack.OK),
    (p.MotorSetSpeed(1, 1500, 3000), p.Ack.OK),
    (p.MotorSetSpeed(3, 10, 10), p.Ack.OK),  # takes no part
    (p.VirtConfig(2, (p.VirtualAxis(1, 1000), p.VirtualAxis(2, 1000))), p.Ack.OK),
]
BACK = (
    p.MotorSetSpeed(1, VELOCITY, ACCELERATION),
    p.MotorSetLimits(1, 0, 0, 0, 0),
    p.MotorConfigure(1, 0x03),
    p.MotorResetPosition(1, LOWER),
)


def loaded(**settings):
    session = rig(virtuals=12, **settings)
    upload(session, {1: UP, 2: UP[::-1]})
    return session


@pytest.mark.parametrize("pause", [0, 0.3], ids=["at once", "later"])
@pytest.mark.parametrize(("change", "code"), CHANGES, ids=lambda value: str(value)[:60])
def test_before_go(change, code, pause):
    """GO answers as RUN_MOVE would; a refused GO moves nothing, and the old setting allows it
    again."""
    session = loaded()
    session.ready(RUN).forget()
    session.accept(change).run(pause)
    if code != p.Ack.OK:
        session.refuse(code, p.RtGo()).run(0.2)
        assert not session.trace().motors
        assert not session.moving
        session.refuse(code, p.RtGo())
        session.accept(*BACK).run(pause)
    session.accept(p.RtGo()).until(p.RtEnd, 10).wait_idle()
    assert session.position(1) == UP[-1]


def test_shortest_rolls_are_others_now():
    """The motors no longer wait where they would begin."""
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 0, 0))
    session.speed(1, VELOCITY, 20_000).refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtGo())
    session.ready(run_request(24, 1, FRAMES, 0, 0)).forget()
    session.accept(p.RtGo()).until(p.RtEnd, 10).wait_idle()
    times, signs = session.steps(1)
    assert_within(times, signs, 20_000, 20_000)


def test_a_motor_enabled_since():
    session = loaded()
    session.accept(p.MotorConfigure(2, 0))
    session.ready(RUN)
    session.accept(p.MotorConfigure(2, 3))
    session.refuse(p.Ack.ERR_NOT_IN_POSITION, p.RtGo())
    session.play(RUN)


@pytest.mark.parametrize("second", [False, True])
def test_before_go_of_an_exposure(second):
    pairs = (p.BlurMotor(1, 0, 800),)
    for change, first, angles in (
        (p.MotorSetSpeed(1, 700, ACCELERATION), p.Ack.ERR_RANGE, p.Ack.ERR_RANGE),
        (p.MotorSetSpeed(1, VELOCITY, 300), p.Ack.ERR_PREROLL, p.Ack.ERR_RANGE),
        (p.MotorSetLimits(1, 1, -399, 0, 0), p.Ack.ERR_PREROLL, p.Ack.OK),
        (p.MotorSetLimits(1, 1, 1, 0, 0), p.Ack.ERR_PREROLL, p.Ack.ERR_PREROLL),
        (p.MotorSetLimits(1, 0, 0, 1, 1199), p.Ack.ERR_POSTROLL, p.Ack.OK),
        (p.MotorSetLimits(1, 0, 0, 1, 799), p.Ack.ERR_POSTROLL, p.Ack.ERR_POSTROLL),
        (p.MotorConfigure(1, 0x01), p.Ack.ERR_GENERAL, p.Ack.OK),
        (p.MotorConfigure(1, 0x02), p.Ack.ERR_GENERAL, p.Ack.ERR_GENERAL),
    ):
        session = loaded()
        request = (
            p.RtShootFrame2(12, 1000, 0, 360, pairs)
            if second
            else p.RtShootFrame(12, 1, 1000, 1000, pairs)
        )
        session.ready(request)
        session.accept(change)
        code = angles if second else first
        if code != p.Ack.OK:
            session.refuse(code, p.RtGo())
            session.accept(*BACK[:3])
        session.accept(p.RtGo()).until(p.RtEnd, 10)


@pytest.mark.parametrize("flags", [LOOP, PING_PONG])
@pytest.mark.parametrize("after", [1.0, 1.9], ids=["in the lap", "between two"])
@pytest.mark.parametrize(
    "change",
    [
        p.MotorSetSpeed(1, 1300, ACCELERATION),
        p.MotorSetLimits(1, 0, 0, 1, 2000),
        p.MotorSetSpeed(1, 20_000, 2000),
    ],
)
def test_in_a_loop(flags, after, change):
    """The present lap ends as acknowledged; the next one would be refused, so the run ends
    there."""
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 500, 500, flags=flags))
    session.accept(p.RtGo()).run(after)
    session.accept(change).until(p.RtEnd, 6).wait_idle()
    assert session.now < 9


def test_a_slower_way_back_in_a_loop():
    """A setting that allows the next lap also counts on the way back."""
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 500, 500, flags=LOOP))
    session.accept(p.RtGo()).run(1)
    session.speed(1, 1500, 3000).forget().run(9)
    times, signs = session.steps(1)
    assert_within(times, signs, 1500 * 1.01, 3000 * 1.02, window=0.05)
    assert not session.events(p.RtEnd)
    assert np.count_nonzero(np.diff(signs)) >= 3


def test_a_limit_set_on_the_way_to_the_start():
    """The motors go no further than the limit, and GO is refused."""
    session = loaded()
    session.accept(p.MotorSetSpeed(1, 2_000, 4_000), RUN).run(0.2)
    session.accept(p.MotorSetLimits(1, 1, -100, 1, 500)).wait_idle()
    assert session.position(1) == session.made(1) == 500
    session.refuse(p.Ack.ERR_SOFT_UP, p.RtGo())


@pytest.mark.parametrize("when", ["on the way back", "before the way back"])
def test_a_limit_set_in_a_loop_holds_on_the_way_back(when):
    session = loaded()
    session.ready(run_request(24, 1, FRAMES, 500, 500, flags=LOOP))
    session.accept(p.RtGo()).run(2.1 if when == "on the way back" else 1.5)
    assert session.position(1) > 1500
    set_at = session.now
    session.accept(p.MotorSetLimits(1, 1, 900, 1, 100_000)).until(p.RtEnd, 6).wait_idle()
    times, signs = session.steps(1)
    assert np.cumsum(signs)[times > set_at].min() >= 900
