"""JOG_ALL (field note 6.10): all motors along the uploaded path as one axis, whose unit is the
frame."""

import numpy as np
import pytest

from framestep.moves.jog import JogAll
from framestep.moves.jog_landing import ACCELERATION
from framestep.moves.operation_runner import IDLE, POSITIONING, RUNNING
from framestep.protocol import messages as m
from host_tests.fakes import OperationBench

LANDING_MS = 2000  # a landing takes no longer (field note 6.10)
EVEN = [100 * k for k in range(61)]  # a hundred steps to the frame
WAVE = [round(100 * k + 400 * np.sin(k / 4)) for k in range(61)]


class Jog:
    """Motors at rest on the first frame of an upload; `heads` is MOVE TIME at each tick from the
    request on."""

    def __init__(self, *paths, at=0, **settings):
        self.bench = OperationBench(*paths, **settings)
        self.bench.stand_on(*(0 if path is None else path[at] for path in paths))
        self.jog = JogAll(self.bench.operations)
        self.heads = []

    def to(self, frame, fps=10):
        return self.jog.prepare(round(fps * 1000), frame)

    def run(self, ticks=1):
        for _ in range(ticks):
            self.bench.run()
            if self.bench.operations.state == RUNNING:
                self.heads.append(self.bench.operations.sample_move_time(False) / 1000)
        return self

    def rest(self):
        while self.bench.operations.state != IDLE or self.bench.axes.moving:
            self.run()
            assert len(self.heads) < 60_000
        self.bench.run(5)
        self.bench.operations.sample_move_time(False)
        return self

    @property
    def frame(self):
        """Return MOVE TIME at rest, in frames."""
        return self.bench.operations.move_time / 1000

    def place(self, motor=0):
        return self.bench.place(motor)


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    "frame, fps, code",
    [
        (1, 10, m.OK),
        (61, 10, m.OK),
        (0, 10, m.ERR_RANGE),  # field note 5.2
        (62, 10, m.ERR_RANGE),
        (5, 0, m.ERR_RANGE),
        (5, 0.001, m.OK),
        (5, 120, m.OK),
        (5, 200.001, m.ERR_RANGE),
    ],
)
def test_what_lies_outside_its_range_is_refused(frame, fps, code):
    assert Jog(EVEN).to(frame, fps) == code


def test_without_a_finished_upload_it_is_refused():
    assert Jog(None).jog.prepare(1000, 1) == m.ERR_GENERAL


def test_motors_beside_every_uploaded_frame_are_not_in_position():
    """field note 6.10"""
    jog = Jog(EVEN, EVEN)
    jog.bench.stand_on(100, 101)
    assert jog.to(5) == m.ERR_NOT_IN_POSITION
    jog.bench.stand_on(100, 100)
    assert jog.to(5) == m.OK


@pytest.mark.parametrize("at", [0, 33, 60])
def test_it_finds_the_frame_on_which_the_motors_stand(at):
    jog = Jog(EVEN, at=at)
    jog.to(31)
    assert jog.jog.last_queued == at


def test_while_a_motor_moves_it_is_refused():
    jog = Jog(EVEN)
    jog.bench.operations.send_to_frame(20, jog.jog.positions)
    jog.bench.run(20)
    assert jog.to(5) == m.ERR_MOVING


def test_into_a_limit_switch_it_is_refused():
    jog = Jog(EVEN, at=10)
    jog.bench.safety.held = 1
    jog.bench.safety.code = m.ERR_HARD_UP
    assert jog.to(20) == m.ERR_HARD_UP
    assert jog.bench.operations.state == IDLE


@pytest.mark.parametrize("acceleration, rate", [(410, 24_000), (390, 2792)])
def test_a_path_too_steep_for_a_motor_at_four_frames_per_second_squared_is_gone_slower(
    acceleration, rate
):
    """field note 5.5"""
    jog = Jog(EVEN, acceleration=acceleration)
    assert jog.to(61, 24) == m.OK
    assert jog.bench.move_check.rate == pytest.approx(rate, abs=2)


def test_to_where_it_stands_nothing_moves():
    jog = Jog(EVEN)
    assert jog.to(1) == m.OK
    assert jog.bench.operations.state == IDLE


# ---------------------------------------------------------------- MOVE TIME before the first pulse


def test_move_time_is_the_frame_it_sets_out_from():
    """field note 4.6; another motion may have brought the motors there"""
    jog = Jog(EVEN, at=33)
    jog.to(41)
    assert jog.bench.operations.sample_move_time(False) == 34_000
    jog.run(60)
    assert jog.bench.operations.state == RUNNING
    assert min(jog.heads) >= 34


def test_move_time_where_it_stands_on_its_frame_already():
    jog = Jog(EVEN, at=33)
    assert jog.to(34) == m.OK
    assert jog.frame == 34


# ---------------------------------------------------------------- the motion


@pytest.mark.parametrize("at, frame", [(55, 61), (5, 1), (30, 41), (30, 21), (30, 32), (30, 30)])
def test_it_comes_to_rest_on_the_frame_asked_for(at, frame):
    jog = Jog(EVEN, WAVE, at=at)
    assert jog.to(frame) == m.OK
    jog.rest()
    assert (jog.place(0), jog.place(1)) == (EVEN[frame - 1], WAVE[frame - 1])
    assert jog.frame == frame


def test_there_is_no_rt_end():
    jog = Jog(EVEN)
    jog.to(5)
    assert jog.rest().bench.ends == 0


@pytest.mark.parametrize("fps, frames", [(0.5, 2), (2, 6), (5, 20)])
def test_its_velocity_is_fps_and_its_acceleration_four_frames_per_second_squared(fps, frames):
    """From rest to rest: fps/4 seconds up, as long down, and at fps between them."""
    jog = Jog(EVEN)
    jog.to(1 + frames, fps)
    jog.rest()
    heads = np.array(jog.heads[10:])
    rate = (heads[100:] - heads[:-100]) * 10  # frames/s, over a tenth of a second
    assert rate.max() == pytest.approx(fps, rel=0.02)
    assert np.abs(rate[100:] - rate[:-100]).max() * 10 <= ACCELERATION * 1.1
    ideal = frames / fps + fps / ACCELERATION
    # the jog reaches its rate on a whole frame, so the first and the last one take up to twice as
    # long
    assert ideal - 0.06 <= len(heads) / 1000 <= ideal + 2 / fps


def test_all_motors_follow_the_path_as_one_axis():
    """At every moment each motor follows the even one, but for the cubics' distance from chords."""
    jog = Jog(EVEN, WAVE)
    jog.to(11, 4)
    jog.rest()
    even, wave = (jog.bench.bench.times(motor) for motor in (0, 1))
    places = np.interp(even[0], wave[0], np.cumsum(wave[1]))
    assert np.abs(places - np.interp(np.cumsum(even[1]) / 100, range(61), WAVE)).max() < 6


def test_the_play_head_is_where_the_motors_are():
    """field note 4.6: by the edges on the pins, within the distance of two ticks."""
    jog = Jog(EVEN)
    jog.to(6, 4)
    times = []
    while jog.bench.operations.state != IDLE:
        jog.run()
        if jog.bench.operations.state == RUNNING:
            times.append(jog.bench.bench.now)
    edges, _ = jog.bench.bench.times()
    begun = int(np.searchsorted(times, edges[0]))
    by_edges = 1 + np.searchsorted(edges, times) / 100
    assert np.abs(by_edges - np.array(jog.heads))[begun:].max() < 0.03


@pytest.mark.parametrize("ticks", [2**29 - 1, 2**29 - 200, 2**29 - 1000])
def test_the_counter_of_ticks_may_wrap_on_the_way(ticks):
    jog = Jog(EVEN, ticks=ticks)
    jog.to(4, 5)
    jog.rest()
    assert (jog.place(), jog.frame) == (300, 4)
    assert np.diff(jog.heads).min() >= 0


def test_of_65535_frames_it_goes_from_one_to_the_next():
    path = np.arange(65_535) * 10
    jog = Jog(path, at=65_533)
    assert jog.to(65_535) == m.OK
    jog.rest()
    assert (jog.place(), jog.frame) == (int(path[-1]), 65_535)


def test_a_move_of_a_single_frame_has_nowhere_to_go():
    jog = Jog([50])
    assert jog.to(1) == m.OK
    assert jog.to(2) == m.ERR_RANGE
    assert jog.bench.operations.state == IDLE


def test_a_motor_without_data_stands_still():
    """field note 5.4"""
    jog = Jog(EVEN, None)
    jog.to(5)
    jog.rest()
    assert jog.bench.bench.engines[1].rises == []


# ---------------------------------------------------------------- another destination on the way


def test_a_destination_farther_on_is_gone_to_without_a_rest():
    jog = Jog(EVEN)
    jog.to(6, 4)
    jog.run(700)
    assert jog.to(12, 4) == m.OK
    before = len(jog.heads)
    jog.rest()
    assert jog.frame == 12
    assert np.diff(jog.heads[before : before + 1500]).min() > 0


def test_a_destination_behind_is_gone_to_from_where_it_can_turn():
    jog = Jog(EVEN)
    jog.to(61, 4)
    jog.run(1500)
    assert jog.to(2, 4) == m.OK
    jog.rest()
    assert (jog.place(), jog.frame) == (100, 2)
    assert max(jog.heads) == pytest.approx(round(max(jog.heads)), abs=1e-3), (
        "it turns on a whole frame"
    )


def test_a_refused_destination_leaves_the_one_under_way():
    jog = Jog(EVEN)
    jog.to(6, 4)
    jog.run(500)
    assert jog.to(62) == m.ERR_RANGE
    jog.rest()
    assert jog.frame == 6


# ---------------------------------------------------------------- stops


def stopped(fps, after, steps=100, everything=True):
    """Stop a jog after `after` ms; return (where it was then, its rate, where it rests, how long
    that took)."""
    jog = Jog([steps * k for k in range(61)])
    jog.to(61, fps)
    while jog.bench.operations.state != RUNNING:
        jog.run()
    jog.run(after)
    here, rate = jog.heads[-1], (jog.heads[-1] - jog.heads[-51]) * 20
    assert jog.bench.operations.stop(1, True, everything) == 1, "it lands in its own way"
    before = len(jog.heads)
    jog.rest()
    assert jog.place() == steps * round(jog.frame - 1)
    return here, rate, jog.frame, len(jog.heads) - before


@pytest.mark.parametrize(
    "fps, after, everything", [(2, 900, True), (2, 1333, False), (5, 999, True), (7, 2000, False)]
)
def test_a_stop_lands_on_the_next_whole_frame_that_can_be_reached(fps, after, everything):
    here, rate, rests, ms = stopped(fps, after, everything=everything)
    braking = rate * rate / 2 / ACCELERATION
    # the stop cuts the queues some tens of milliseconds ahead; a frame may pass in that time
    soonest, latest = np.ceil(here + braking), np.ceil(here + braking + 0.08 * rate)
    assert soonest <= rests <= latest
    assert ms <= LANDING_MS + 100


def test_a_landing_that_would_take_longer_than_two_seconds_goes_at_a_frame_per_second():
    """At 0.4 frames/s a landing from half a frame before takes 2·0.5/0.4 s."""
    here, _, rests, ms = stopped(0.4, 1600)
    assert rests == np.ceil(here)
    assert ms == pytest.approx((rests - here) * 1500, abs=400)


def test_a_second_stop_while_it_lands_is_left_to_the_landing_unless_it_is_a_stop_all():
    jog = Jog(EVEN)
    jog.to(61, 4)
    jog.run(900)
    jog.bench.operations.stop(1, True, False)
    assert not jog.bench.operations.stopping_on_frame
    jog.bench.operations.stop(1, True, True)
    assert jog.bench.operations.stopping_on_frame
    jog.rest()
    assert jog.frame == round(jog.frame)


def test_a_stop_before_it_has_begun_ends_it():
    jog = Jog(EVEN)
    jog.to(61, 4)
    assert jog.bench.operations.state == POSITIONING
    jog.bench.operations.stop(1, True, True)
    jog.rest()
    assert jog.place() == 0


def test_a_hard_stop_does_not_land():
    jog = Jog(EVEN)
    jog.to(61, 4)
    jog.run(900)
    assert jog.bench.operations.stop(4) == 0
    jog.rest()
    assert jog.place() % 100 != 0
