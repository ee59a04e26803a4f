"""The state machine of every real-time operation: the order of its states, what prevents a step,
how it ends."""

from array import array

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from framestep.motion import reals
from framestep.moves.operation import Operation
from framestep.moves.operation_runner import ENDING, IDLE, POSITIONING, READY, RUNNING, STARTING
from framestep.moves.path.registers import TOP, ZERO
from framestep.moves.upload.store import EMPTY
from framestep.protocol import messages as m
from framestep.pulse import stepper
from host_tests.fakes import OperationBench
from host_tests.pulse.engine import PER_TICK, PER_US

TICKS = 200  # the operation below moves so long


class There(Operation):
    """Moves its motors from `begins` to `ends` within TICKS, then back, `laps` times; records
    each call."""

    def __init__(self, bench, begins, ends, laps=1):
        super().__init__(bench.operations)
        self.axes = bench.axes
        self.bits = (1 << bench.axes.count) - 1
        self.begins, self.ends = array("i", begins), array("i", ends)
        self.ways = array("i", [0] * len(begins))
        self.laps = laps
        self.code = m.OK
        self.asked = []
        self.began = None

    def take(self):
        self.operations.prepare(self, self.begins, self.ways, 1)

    def begin_lap(self):
        self.asked.append("start")

    def queue_first_phases(self, motor):
        self.asked.append(f"lead {motor}")
        numbers = self.operations.player.numbers
        reals.put(numbers, TOP, TICKS, 0)
        self.axes[motor].append_phase(TOP, ZERO, ZERO, numbers, self.ends, motor)
        self.axes[motor].set_more_to_come(False)

    def started(self, tick):
        self.began = tick

    def recheck(self, waiting):
        self.asked.append("recheck")
        return self.code

    def next_lap(self):
        self.laps -= 1
        self.begins, self.ends = self.ends, self.begins
        self.operations.start_positions = self.begins
        return self.laps > 0

    def still_wanted(self):
        return self.laps > 0

    def ended(self):
        self.asked.append("over")

    def leave_end(self):
        self.asked.append("leave")

    def stop_on_frame(self, everything):
        return False

    def heading(self, motor):
        return self.ends[motor] - self.begins[motor]


def prepared(begins=(50,), ends=(450,), laps=1, **settings):
    """Return (bench, operation); the operation is accepted."""
    bench = OperationBench(*([0, 10, 20] for _ in begins), **settings)
    operation = There(bench, begins, ends, laps)
    operation.take()
    return bench, operation


# ---------------------------------------------------------------- until READY


def test_an_operation_first_sends_its_motors_to_where_it_begins():
    bench, _ = prepared()
    assert bench.operations.state == POSITIONING
    assert bench.operations.busy
    assert not bench.operations.running
    bench.until(READY)
    assert bench.place() == 50
    assert not bench.axes.moving


def test_go_before_they_are_there_is_not_in_position():
    """field note 6.1"""
    bench, _ = prepared()
    assert bench.operations.may_go() == m.ERR_NOT_IN_POSITION
    assert bench.until(READY).operations.may_go() == m.OK


def test_go_without_an_operation_is_refused():
    assert OperationBench([0]).operations.may_go() == m.ERR_GENERAL


def test_go_while_it_runs_is_refused():
    bench, _ = prepared()
    bench.until(READY).operations.start()
    assert bench.until(RUNNING).operations.may_go() == m.ERR_MOVING


def test_go_for_a_motor_that_has_been_excluded_meanwhile_is_refused():
    bench, _ = prepared()
    bench.until(READY).player.excluded = 1
    assert bench.operations.may_go() == m.ERR_GENERAL


def test_what_is_set_meanwhile_is_checked_at_go():
    """field note 6.12"""
    bench, operation = prepared()
    bench.until(READY).operations.settings_changed()
    operation.code = m.ERR_PREROLL
    assert bench.operations.may_go() == m.ERR_PREROLL
    operation.code = m.OK
    assert bench.operations.may_go() == m.OK
    assert operation.asked.count("recheck") == 2
    assert bench.operations.may_go() == m.OK
    assert operation.asked.count("recheck") == 2, "nothing has been set since"


@pytest.mark.parametrize("held, code", [(1, m.ERR_HARD_UP), (2, m.OK)])
def test_go_into_a_limit_switch_is_refused(held, code):
    """field note 8.4: the motor sets out upward."""
    bench, _ = prepared()
    bench.until(READY)
    bench.safety.active, bench.safety.held = True, held
    assert bench.operations.may_go() == code


def test_in_ready_the_first_phases_are_planned_and_nothing_moves():
    bench, operation = prepared()
    bench.until(READY).run(300)
    assert operation.asked[:2] == ["start", "lead 0"]
    assert bench.place() == 50
    assert bench.operations.may_go() == m.OK


def test_what_is_planned_early_can_be_dropped_and_is_planned_anew():
    bench, operation = prepared()
    bench.until(READY).run(50)
    bench.operations.discard_early_plan()
    bench.run(50)
    assert operation.asked.count("start") == 2
    bench.operations.start()
    bench.rest()
    assert bench.place() == 450


def test_an_operation_dropped_before_go_leaves_nothing():
    bench, _ = prepared()
    bench.until(READY).run(50)
    bench.operations.drop_prepared()
    assert bench.operations.state == IDLE
    bench.run(200)
    assert (bench.place(), bench.ends) == (50, 0)


# ---------------------------------------------------------------- the run


def test_all_motors_start_in_the_same_tick():
    """field note 6.3: equal motions of three motors have equal edges, however late GO comes."""
    bench, _ = prepared((5, 10, 15), (405, 410, 415))
    bench.until(READY).run(7)
    before = [len(engine.rises) for engine in bench.bench.engines]
    bench.operations.start()
    bench.rest()
    edges = [engine.rises[n:] for engine, n in zip(bench.bench.engines, before, strict=True)]
    assert len(edges[0]) == 400
    # except for the cycles in which the tick writes one command after another
    assert np.ptp(edges, axis=0).max() < PER_US


def test_it_gets_the_tick_of_the_first_pulses():
    bench, operation = prepared()
    bench.until(READY).run(50)
    first = len(bench.bench.engines[0].rises)
    bench.operations.start()
    bench.until(RUNNING)
    assert operation.began == bench.kernel[stepper.TICKS] + 1 + bench.kernel[stepper.LEAD]
    begins = bench.now()
    bench.rest()
    # 400 steps from rest to rest in 200 ticks: the first step is due when 3·x² - 2·x³ is 1/400
    x = Polynomial([-1 / 400, 0, 3, -2]).roots()[1].real
    assert bench.bench.engines[0].rises[first] == pytest.approx(
        begins + x * TICKS * PER_TICK, abs=0.5 * PER_TICK
    )


def test_the_end_is_reported_once():
    """field note 6.4"""
    bench, operation = prepared()
    bench.until(READY).operations.start()
    bench.rest().run(300)
    assert bench.place() == 450
    assert bench.ends == 1
    assert operation.asked[-2:] == ["over", "leave"]


def test_an_operation_without_an_rt_end_reports_none():
    bench, operation = prepared()
    operation.sends_rt_end = False
    bench.until(READY).operations.start()
    assert bench.rest().ends == 0


@pytest.mark.parametrize("laps", [1, 2, 3])
def test_each_lap_of_a_loop_begins_where_the_last_one_ended(laps):
    bench, operation = prepared(laps=laps)
    bench.until(READY).operations.start()
    bench.rest()
    assert operation.asked.count("start") == laps
    assert bench.place() == (450 if laps % 2 else 50)
    assert bench.ends == 1


@pytest.mark.parametrize("ticks", [2**29 - 1, 2**29 - 150, 2**29 - 400])
def test_the_counter_of_ticks_may_wrap_at_any_moment_of_it(ticks):
    bench, _ = prepared(ticks=ticks)
    bench.until(READY).operations.start()
    bench.rest()
    assert (bench.place(), bench.ends) == (450, 1)


# ---------------------------------------------------------------- stops


@pytest.mark.parametrize("state", [POSITIONING, READY, STARTING, RUNNING])
def test_a_stop_in_any_state_ends_in_rest_and_one_rt_end(state):
    bench, operation = prepared()
    if state != POSITIONING:
        bench.until(READY).run(20)
    if state == STARTING:
        bench.operations.axes.wake(50)  # else the motors would start at once
    if state in (STARTING, RUNNING):
        bench.operations.start()
    if state == RUNNING:
        bench.until(RUNNING).run(60)
    assert bench.operations.state == state
    assert bench.operations.stop() == 0
    assert bench.operations.state == ENDING
    bench.rest()
    assert bench.ends == 1
    assert operation.asked[-1] == "over"
    assert bench.place() < 450


def test_a_stop_with_nothing_under_way_reports_no_end():
    bench = OperationBench([0])
    assert bench.operations.stop() == 0
    assert bench.run(50).ends == 0


def test_an_end_that_the_next_host_knows_nothing_of_is_not_reported():
    """field note 1.11"""
    bench, _ = prepared()
    bench.until(READY).operations.start()
    bench.until(RUNNING).run(60)
    bench.operations.host_lost(False, 0)
    assert bench.rest().ends == 0


def test_a_stop_of_a_loop_ends_all_laps():
    bench, operation = prepared(laps=5)
    bench.until(READY).operations.start()
    bench.until(RUNNING).run(60)
    operation.laps = 0
    bench.operations.stop()
    bench.rest()
    assert operation.asked.count("start") == 1


# ---------------------------------------------------------------- POSITION_FRAME


def to_frame(bench, frame, among=-1):
    return bench.operations.send_to_frame(frame, array("i", [0] * bench.axes.count), among)


@pytest.mark.parametrize("frame, place", [(101, 7), (102, 300), (103, -20)])
def test_to_a_frame_all_motors_go_to_its_uploaded_positions(frame, place):
    """field note 5.1: scene frame numbers; 4.6: MOVE TIME is that frame's on arrival."""
    bench = OperationBench([7, 300, -20], [0, 0, 40], start=101)
    bench.operations.move_time = 0
    assert to_frame(bench, frame) == m.OK
    assert bench.operations.move_time == 0
    bench.rest()
    assert bench.place(0) == place
    bench.operations.sample_move_time(False)
    assert bench.operations.move_time == frame * 1000


def test_a_motor_stopped_on_its_way_to_a_frame_is_not_on_it():
    bench = OperationBench([0, 3000])
    to_frame(bench, 2)
    bench.run(40)
    bench.axes[0].stop(bench.bench)
    bench.rest().operations.sample_move_time(False)
    assert bench.operations.move_time == 0


@pytest.mark.parametrize("frame, code", [(0, m.ERR_RANGE), (1, m.OK), (3, m.OK), (4, m.ERR_RANGE)])
def test_a_frame_outside_the_upload_is_out_of_range(frame, code):
    """field note 5.2"""
    assert to_frame(OperationBench([0, 10, 20]), frame) == code


def test_without_a_finished_upload_there_is_no_frame_to_go_to():
    """field note 5.2"""
    bench = OperationBench([0])
    bench.store.state = EMPTY
    assert to_frame(bench, 1) == m.ERR_GENERAL


@pytest.mark.parametrize(
    "target, code", [(101, m.ERR_SOFT_UP), (-101, m.ERR_SOFT_LOW), (100, m.OK)]
)
def test_a_frame_past_a_soft_limit_is_refused_and_nothing_moves(target, code):
    bench = OperationBench([0, target])
    bench.limit(-100, 100)
    assert to_frame(bench, 2) == code
    assert bench.axes.moving is (code == m.OK)


def test_a_frame_behind_a_limit_switch_is_refused_and_nothing_moves():
    bench = OperationBench([0, 100])
    bench.safety.code = m.ERR_HARD_UP
    assert to_frame(bench, 2) == m.ERR_HARD_UP
    assert not bench.axes.moving


def test_going_to_a_frame_drops_what_is_prepared():
    bench, _ = prepared()
    bench.until(READY)
    assert to_frame(bench, 2) == m.OK
    assert bench.operations.state == IDLE


def test_only_the_motors_asked_for_go_to_a_frame():
    bench = OperationBench([0, 100], [0, 100])
    to_frame(bench, 2, among=0b10)
    bench.rest()
    assert (bench.place(0), bench.place(1)) == (0, 100)
