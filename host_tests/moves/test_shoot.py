"""Go-motion (field notes 7.1 to 7.3): refusals, when the shutter opens, and where the motors are
then."""

import numpy as np
import pytest

from framestep.motion import reals
from framestep.moves.operation_runner import READY, RUNNING
from framestep.moves.run_outputs import METER, SHUTTER
from framestep.moves.shoot import LONGEST_MS, ShootFrame
from framestep.protocol import messages as m
from framestep.pulse import stepper
from framestep.pulse.engine import CUE_DELAY_US, LEAD
from host_tests.fakes import OperationBench
from host_tests.pulse.engine import PER_TICK, PER_US

LOWEST, HIGHEST = -(2**31), 2**31 - 1


class Shot:
    """One exposure; the times of edges count from the tick in which it starts."""

    def __init__(self, *paths, **settings):
        self.bench = OperationBench(*paths, **settings)
        self.shoot = ShootFrame(self.bench.operations, self.bench.run_outputs)
        self.shoot.blurred = -1

    def blur(self, *entries, frame=1, backward=False, ms=400, permille=1000):
        return self.shoot.prepare_blur(frame, backward, ms, permille, self.list(entries, backward))

    def angles(self, *entries, frame=1, ms=400, opened=0, closed=360):
        return self.shoot.prepare_angles(frame, ms, opened, closed, self.list(entries))

    def list(self, entries, backward=False):
        """Put entries, (motor from 1, A, B), into the draft as requests.py does."""
        draft, listed = self.shoot.draft, 0
        for number, *places in entries:
            if not 1 <= number <= len(draft.a):
                return -1
            draft.a[number - 1], draft.b[number - 1] = reversed(places) if backward else places
            listed |= 1 << number - 1
        return listed

    def play(self):
        """GO, and wait until it rests."""
        self.bench.until(READY)
        self.waits = self.places
        self.bench.operations.start()
        self.bench.until(RUNNING)
        self.began = self.bench.now()
        ((self.starts, *meter), (self.opens, *opened), (self.closes, *closed)) = (
            self.bench.run_outputs.signals
        )
        assert (meter, opened, closed) == ([METER, METER], [SHUTTER, SHUTTER], [SHUTTER | METER, 0])
        self.bench.rest()
        return self

    @property
    def places(self):
        return [self.bench.place(motor) for motor in range(self.bench.axes.count)]

    def at(self, tick, ms=0.0, motor=0):
        """Return where a motor is, `ms` milliseconds after the moment of a cue."""
        return self.bench.place_at(
            self.began + (tick - self.starts + ms) * PER_TICK + self.late, motor
        )

    @property
    def late(self):
        """Return how much later than a tick's first pulse its cues come, cycles."""
        return LEAD * PER_TICK - self.bench.kernel[stepper.AHEAD] + CUE_DELAY_US * PER_US


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize("frame, code", [(0, m.ERR_RANGE), (1, m.OK), (3, m.OK), (4, m.ERR_RANGE)])
def test_a_frame_outside_the_upload_is_refused(frame, code):
    """field note 5.2"""
    assert Shot([0, 0, 0]).blur((1, 0, 100), frame=frame) == code
    assert Shot([0, 0, 0]).angles((1, 0, 100), frame=frame) == code


def test_without_a_finished_upload_it_is_refused():
    assert Shot(None).blur((1, 0, 100)) == m.ERR_GENERAL


@pytest.mark.parametrize("number", [0, 3])
def test_a_motor_that_there_is_not_is_refused(number):
    assert Shot([0], [0]).angles((number, 0, 100)) == m.ERR_RANGE


@pytest.mark.parametrize(
    "ms, code", [(LONGEST_MS, m.OK), (LONGEST_MS + 1, m.ERR_RANGE), (-1, m.ERR_RANGE)]
)
def test_an_exposure_of_more_than_an_hour_is_refused(ms, code):
    assert Shot([0]).blur((1, 0, 100), ms=ms) == code


def test_a_blur_of_more_than_the_whole_frame_is_refused():
    assert Shot([0]).blur((1, 0, 100), permille=1001) == m.ERR_RANGE


@pytest.mark.parametrize(
    "opened, closed, code", [(90, 91, m.OK), (90, 90, m.ERR_RANGE), (90, 89, m.ERR_RANGE)]
)
def test_a_shutter_has_to_close_after_it_opens(opened, closed, code):
    assert (
        Shot([0], velocity=500_000, acceleration=4_000_000).angles(
            (1, 0, 9), opened=opened, closed=closed
        )
        == code
    )


def test_what_is_faster_than_the_motor_is_refused():
    """800 steps in 400 ms are 2000 steps/s."""
    assert Shot([0], velocity=2000).blur((1, 0, 800)) == m.OK
    assert Shot([0], velocity=1999).blur((1, 0, 800)) == m.ERR_RANGE


@pytest.mark.parametrize("acceleration, code", [(2000, m.OK), (1999, m.ERR_PREROLL)])
def test_a_run_up_steeper_than_the_motor_is_refused(acceleration, code):
    """field note 7.1: 2000 steps/s within the run-up of a second."""
    assert Shot([0], acceleration=acceleration).blur((1, 0, 800)) == code


@pytest.mark.parametrize(
    "lower, upper, code",
    [(-1000, 1800, m.OK), (-999, 1800, m.ERR_PREROLL), (-1000, 1799, m.ERR_POSTROLL)],
)
def test_a_limit_in_the_way_of_run_up_or_run_out_is_refused(lower, upper, code):
    """Half of 2000 steps/s for a second, on either side."""
    shot = Shot([0])
    shot.bench.limit(lower, upper)
    assert shot.blur((1, 0, 800)) == code


@pytest.mark.parametrize("acceleration, code", [(51_500, m.OK), (50_000, m.ERR_RANGE)])
def test_ramps_of_an_eighth_steeper_than_the_motor_are_refused(acceleration, code):
    """field note 7.3: 900 steps in 7/8 of 400 ms, reached within 50 ms, are 51429 steps/s²."""
    assert Shot([0], acceleration=acceleration).angles((1, 0, 900)) == code


@pytest.mark.parametrize("a, b", [(LOWEST, HIGHEST), (HIGHEST, LOWEST), (0, 2**30 - 1)])
def test_places_farther_apart_than_any_motor_goes_are_refused(a, b):
    assert Shot([0]).blur((1, a, b)) == m.ERR_RANGE


def test_a_refused_request_leaves_the_shot_that_waits():
    shot = Shot([0])
    shot.blur((1, 0, 800))
    kept = shot.shoot.shot
    assert shot.blur((1, 0, 800), permille=1001) == m.ERR_RANGE
    assert shot.angles((1, 0, 800), ms=1) == m.ERR_RANGE
    assert shot.shoot.shot is kept
    assert kept.a[0] == 0


# ---------------------------------------------------------------- which motors move


def test_only_motors_with_the_blur_flag_move():
    """field note 7.1"""
    shot = Shot([0], [0])
    shot.shoot.blurred = 0b10
    shot.blur((1, 0, 800), (2, 0, 800))
    assert shot.shoot.bits == 0b10


def test_excluded_motors_do_not_move():
    shot = Shot([0], [0])
    shot.bench.player.excluded = 0b10
    shot.angles((1, 0, 800), (2, 0, 800))
    assert shot.shoot.bits == 0b01


@pytest.mark.parametrize("frame, a, b", [(2, 37.5, 187.5), (1, -25, 37.5), (3, 187.5, 425)])
def test_without_a_pair_a_and_b_are_the_path_half_a_frame_before_and_after(frame, a, b):
    """field note 7.2: these frames lie on 50·x + 50·x²; beyond the ends the path continues
    straight."""
    shot = Shot([0, 100, 300])
    assert shot.angles(frame=frame, ms=4000) == m.OK
    assert shot.shoot.shot.starts[0] == pytest.approx(a, abs=0.5)
    assert shot.shoot.shot.ends[0] == pytest.approx(b, abs=0.5)


# ---------------------------------------------------------------- SHOOT_FRAME


@pytest.mark.parametrize("a, b", [(0, 800), (300, -500), (40, 40)])
@pytest.mark.parametrize("ms", [20, 400, 1000])
def test_the_shutter_opens_on_a_and_closes_on_b(a, b, ms):
    """field note 7.1"""
    shot = Shot([0], velocity=500_000)
    assert shot.blur((1, a, b), ms=ms) == m.OK
    shot.play()
    assert shot.closes - shot.opens == ms
    assert shot.at(shot.opens) == pytest.approx(a, abs=1)
    assert shot.at(shot.closes) == pytest.approx(b, abs=1)


def test_the_run_up_and_the_run_out_last_a_second():
    """field note 7.1: Dragonframe times its shutter by it."""
    shot = Shot([0])
    shot.blur((1, 0, 800))
    shot.play()
    assert shot.opens - shot.starts == 1001
    assert shot.waits == [-1000]
    assert shot.places == [1800]
    assert shot.at(shot.closes, 990) < 1800 <= shot.at(shot.closes, 1010)


def test_the_motion_comes_as_much_later_than_its_ticks_as_cues_do():
    """One tick, because the shutter opens in a whole one, and the delay of cues: 100 µs and
    12."""
    shot = Shot([0])
    shot.blur((1, 0, 800))
    assert reals.value(shot.shoot.shot.times, 0) == pytest.approx(1 + 0.100 + 0.012, abs=1e-6)


def test_the_speed_is_constant_while_the_shutter_is_open():
    shot = Shot([0])
    shot.blur((1, 0, 800))
    shot.play()
    places = [shot.at(shot.opens, 10 * k) for k in range(41)]
    assert np.abs(np.array(places) - 20 * np.arange(41)).max() <= 1


@pytest.mark.parametrize(
    "permille, a, b", [(500, 200, 600), (1000, 0, 800), (0, 0, 800), (1, 400, 400)]
)
def test_a_blur_of_less_is_the_middle_of_the_way(permille, a, b):
    """field note 7.1: frame ± blur/2; 0 means 100 % (7.3)."""
    shot = Shot([0])
    shot.blur((1, 0, 800), permille=permille)
    shot.play()
    assert (shot.at(shot.opens), shot.at(shot.closes)) == (
        pytest.approx(a, abs=1),
        pytest.approx(b, abs=1),
    )


def test_direction_0_exchanges_a_and_b():
    """field note 7.1"""
    shot = Shot([0])
    shot.blur((1, 100, 900), backward=True)
    shot.play()
    assert (shot.at(shot.opens), shot.at(shot.closes)) == (
        pytest.approx(900, abs=1),
        pytest.approx(100, abs=1),
    )


def test_an_exposure_of_0_lasts_a_second():
    """field note 7.3"""
    shot = Shot([0])
    shot.blur((1, 0, 800), ms=0)
    shot.play()
    assert shot.closes - shot.opens == 1000


# ---------------------------------------------------------------- SHOOT_FRAME2


def test_the_motors_wait_on_a_and_come_to_rest_on_b():
    """field note 7.3"""
    shot = Shot([0], [0])
    shot.angles((1, 0, 900), (2, 70, -80))
    shot.play()
    assert shot.waits == [0, 70]
    assert shot.places == [900, -80]


def test_the_first_and_the_last_eighth_are_ramps_and_between_the_speed_is_constant():
    """field note 7.3: of 360 degrees in 400 ms, each ramp makes 1/14 of the way."""
    shot = Shot([0])
    shot.angles((1, 0, 1400))
    shot.play()
    assert shot.at(shot.opens, 50) == pytest.approx(100, abs=1)
    assert shot.at(shot.opens, 200) == pytest.approx(700, abs=1)
    assert shot.at(shot.opens, 350) == pytest.approx(1300, abs=1)
    places = [shot.at(shot.opens, ms) for ms in range(50, 351, 10)]
    assert np.abs(np.diff(places) - 40).max() <= 1


@pytest.mark.parametrize("opened, closed", [(0, 360), (90, 270), (-90, 270), (90, 450), (-36, 396)])
def test_the_exposure_spans_open_to_close(opened, closed):
    """field note 7.2: a degree takes exposure/(close - open); the motion is symmetrical about 180
    degrees."""
    shot = Shot([0])
    shot.angles((1, 0, 700), ms=closed - opened, opened=opened, closed=closed)
    shot.play()
    assert shot.closes - shot.opens == closed - opened
    assert shot.at(shot.opens, 180 - opened) == pytest.approx(350, abs=1)
    # -opened milliseconds after angle 0
    assert shot.at(shot.opens, -opened) <= 1
    assert shot.at(shot.opens, 360 - opened) >= 699


@pytest.mark.parametrize("opened, after_go", [(0, 1), (90, 91), (-90, 1)])
def test_go_starts_the_motors_unless_the_shutter_opens_before(opened, after_go):
    """field note 7.3: with OPEN < 0 they start that much later."""
    shot = Shot([0])
    shot.angles((1, 0, 700), ms=360 - opened, opened=opened)
    shot.play()
    assert shot.opens - shot.starts == after_go


def test_the_end_comes_when_the_motors_stand_and_the_shutter_is_closed():
    for closed in (180, 360, 720):
        shot = Shot([0])
        shot.angles((1, 0, 700), ms=closed, closed=closed)
        shot.play()
        assert shot.shoot.shot.lasts_ms == pytest.approx(max(closed, 360), abs=2)
        assert shot.bench.ends == 1


def test_a_stop_closes_the_shutter():
    shot = Shot([0])
    shot.blur((1, 0, 800))
    shot.bench.until(READY).operations.start()
    shot.bench.until(RUNNING).run(1200)
    shot.bench.operations.stop()
    assert ("drop_scheduled",) in shot.bench.run_outputs.calls
    assert shot.bench.run_outputs.signals[-1][1:] == (SHUTTER | METER, 0)
    assert shot.bench.rest().ends == 1


@pytest.mark.parametrize("ticks", [2**29 - 100, 2**29 - 600, 2**29 - 1300])
def test_the_counter_of_ticks_may_wrap_in_the_middle_of_a_shot(ticks):
    shot = Shot([0], ticks=ticks)
    shot.blur((1, 0, 800))
    shot.play()
    assert shot.bench.ends == 1
    assert shot.at(shot.opens) == pytest.approx(0, abs=1)
    assert shot.places == [1800]
