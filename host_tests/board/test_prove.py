"""`framestep lab prove` on the emulated board: what the board measures on its pins is what the
emulator saw."""

import numpy as np
import pytest

from framestep_tools.errors import ToolError
from framestep_tools.payloads import MotorGetPosition, MotorMove, MotorSetSpeed
from framestep_tools.prove.board import emulated
from framestep_tools.prove.figures import AS_EMULATED, FIGURES
from framestep_tools.prove.measure import RUNS, Measuring
from framestep_tools.prove.measurement import Options, prove
from framestep_tools.prove.report import emulated_boards

CYCLE_NS = 8
MOVED = 90


@pytest.fixture(scope="module")
def board():
    with emulated() as board:
        yield board


def record(board, pins, motors, both, skip):
    """Return the edges of a move of some motors: the board's own, and the emulator's."""
    client, emulator = board.client, board.chip.emulator
    stands = client.request(MotorGetPosition()).steps

    def move():
        for motor in motors:
            client.request(MotorSetSpeed(motor, 20_000, 400_000))
            way = MOVED * motor * (-1) ** (motor + (stands[motor - 1] != 0))
            client.request(MotorMove(motor, stands[motor - 1] + way))
        client.wait_idle()

    emulator.trace_start(pins)
    machines = board.layout.watchers(motors)
    found = board.instrument.capture(machines, pins, move, both, skip)
    return found, emulator.trace_stop()


@pytest.mark.parametrize(
    "motors, both, skip",
    [((1, 2, 3, 4), True, 0), ((5, 6, 7, 8), False, 0), ((2, 3), True, 75), ((6,), False, 1000)],
)
def test_the_board_sees_what_the_emulator_sees(board, motors, both, skip):
    """Every edge counts, and is within the two cycles of the loop, with one origin for all
    pins."""
    steps = [board.step(motor) for motor in motors]
    pins = steps + [board.direction(m) for m in motors] if len(motors) < 3 and both else steps
    found, seen = record(board, pins, motors, both, skip)
    origins = []
    for pin, edges in zip(pins, found, strict=True):
        mine = seen[seen["pin"] == pin][1:]
        if not both:
            mine = mine[mine["level"] == 1]
        assert edges.count == len(mine)
        assert pin not in steps or edges.count >= MOVED
        kept = mine["t"][skip:].astype(float)
        assert len(edges.times_ns) == len(kept)
        if len(kept):
            origins.append(kept - edges.times_ns)
    assert skip == 1000 or np.ptp(np.concatenate(origins)) <= 2 * CYCLE_NS


def test_the_motors_that_watched_move_as_before(board):
    """The tool has returned what it borrowed: the steps of the motors of both blocks are right."""
    client, emulator = board.client, board.chip.emulator
    before = client.request(MotorGetPosition()).steps
    pins = [board.step(motor) for motor in range(1, 9)]
    emulator.trace_start(pins)
    for motor in range(1, 9):
        client.request(MotorSetSpeed(motor, 20_000, 400_000))
        client.request(MotorMove(motor, before[motor - 1] + 50 + motor))
    client.wait_idle()
    seen = emulator.trace_stop()
    for motor, pin in enumerate(pins, 1):
        rises = seen[(seen["pin"] == pin) & (seen["level"] == 1)]
        assert len(rises) == 50 + motor
    assert client.request(MotorGetPosition()).steps[:8] == tuple(
        at + 50 + motor for motor, at in enumerate(before[:8], 1)
    )


def test_the_drivers_stay_off_while_motors_move(board):
    """Whatever framestep does with the pin; afterwards it has the pin again."""
    client, emulator = board.client, board.chip.emulator
    pin = board.data["enable"]
    at = client.request(MotorGetPosition()).steps[0]
    for wanted, held in ((1, True), (0, False)):
        if held:
            with board.drivers_off():
                client.request(MotorMove(1, at + 400))
                client.pump(0.005)
                level = emulator.pin(pin)
                client.wait_idle()
        else:
            client.request(MotorMove(1, at))
            client.pump(0.005)
            level = emulator.pin(pin)
            client.wait_idle()
        assert level == wanted


@pytest.mark.repeats
def test_a_measurement_in_short(board):
    """There are no complaints, every figure is there, and the figures of edges are those in the
    emulated board's file."""
    before = board.client.request(MotorGetPosition()).steps
    report = prove(board, Options(short=True), emulated_boards(), lambda line: None)
    assert not report.complaints
    assert not report.remarks
    left_out = {key for key in RUNS if key not in report.figures}
    assert len(left_out) == len(RUNS) - 1
    assert {f.key for f in FIGURES} - left_out == set(report.figures)
    verdicts = report.as_json()["verdicts"]
    edges = [k for k in report.figures if k.startswith(("steps", "rate", "edge", "pulse", "dmx"))]
    assert {key: verdicts[key] for key in edges} == dict.fromkeys(edges, AS_EMULATED)
    assert board.client.request(MotorGetPosition()).steps == before
    assert "dmx_break_us" in report.as_markdown()
    files = board.run("import os\nprint(os.listdir())")
    assert "prove.tmp" not in files
    # W25Q16JV, typical: 45 ms for a sector, 0.4 ms for a page; the call takes up to one more
    assert 45 <= report.figures["erase_ms"] <= 46.5
    assert report.figures["program_ms"] == pytest.approx(0.4, rel=0.05)


def test_what_was_measured_before_it_broke_off_is_in_the_report(board, monkeypatch):
    def broken(_):
        raise ToolError("the board stumbled")

    with monkeypatch.context() as at_once:
        at_once.setattr(Measuring, "_positions", broken)
        with pytest.raises(ToolError, match="the board stumbled"):
            prove(board, Options(short=True), emulated_boards(), lambda line: None)

    monkeypatch.setattr(Measuring, "_together", broken)
    report = prove(board, Options(short=True), emulated_boards(), lambda line: None)
    assert report.faults == ["the measurement broke off here: the board stumbled"]
    assert {"upload_frames", "rate_350k", "edge_350k_us"} <= set(report.figures)
    assert "reply_ms" not in report.figures
    assert "the board stumbled" in report.as_markdown()


SERVO_PIN = 27
RIG = {"motor_count": 6, "motors": [{}, {}, {}, {"servo": {"pin": SERVO_PIN, "at_start": "on"}}]}


@pytest.mark.repeats
def test_machines_that_no_motor_has_watch_as_well():
    """The tool leaves them as if unused, a servo's pulses continue, and one machine watches a motor
    of its own block while all others move."""
    with emulated(rig=RIG) as board:
        unused = board.instrument.unused()
        assert unused == {6, 7}
        assert board.layout.groups == [(1, 2, 3), (5, 6)]
        assert board.layout.watchers((1, 2, 3)) == [6, 7, 4, 5]
        assert board.layout.watchers((5, 6)) == [0, 1, 2]
        began = board.client.request(MotorGetPosition()).steps
        board.chip.emulator.trace_start([SERVO_PIN, *map(board.step, (1, 2, 3, 5, 6))])
        for motors, machines, pins in (
            ((1, 2, 3), [6, 7, 4], (1, 2, 3)),
            ((5, 6), [0, 1], (5, 6)),
            ((1, 2, 5, 6), [2], (1,)),
        ):
            before = board.client.request(MotorGetPosition()).steps

            def move(motors=motors, before=before):
                for motor in motors:
                    board.client.request(MotorSetSpeed(motor, 20_000, 400_000))
                    board.client.request(MotorMove(motor, before[motor - 1] + MOVED * motor))
                board.client.wait_idle()

            steps = [board.step(motor) for motor in pins]
            found = board.instrument.capture(machines, steps, move)
            assert [edges.count for edges in found] == [MOVED * motor for motor in pins]
        seen = board.chip.emulator.trace_stop()
        rises = {
            pin: seen["t"][(seen["pin"] == pin) & (seen["level"] == 1)] for pin in set(seen["pin"])
        }
        ended = board.client.request(MotorGetPosition()).steps
        for motor in (1, 2, 3, 5, 6):
            assert len(rises[board.step(motor)]) == ended[motor - 1] - began[motor - 1]
        rises = rises[SERVO_PIN]
        assert len(rises) > 3
        assert np.diff(rises.astype(float)) == pytest.approx(20e6, abs=1.5e6)
        assert board.instrument.unused() == unused
        assert board.instrument.blocks() == [0, 1]
