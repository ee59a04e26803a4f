"""`framestep check`: its verdict is the controller's, and its figures describe the path that is
played."""

import functools
import json

import numpy as np
import pytest

from framestep_tools import payloads as p
from framestep_tools.judge.judge import judge
from framestep_tools.judge.reference import Reference
from framestep_tools.move.move_check import FITS, REFUSED, STEEP, Device, Setting, check
from framestep_tools.move.move_file import Move, read_move
from framestep_tools.move.move_peaks import peaks
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.session import simulated, tell

pytestmark = pytest.mark.needs("inside")

FAST = Setting(20_000, 100_000)


def move_of(*motors, start=1):
    positions = {motor: list(steps) for motor, steps in enumerate(motors, 1)}
    return Move(start, {motor: f"axis {motor}" for motor in positions}, positions)


def run_of(move, fps=24, pre=1000, post=1000, flags=0):
    return p.RtRunMove(fps * 1000, move.start_frame, move.end_frame, pre, post, flags=flags)


def verdicts(found):
    return [each.verdict for each in found.motors]


# ---- figures


@pytest.mark.parametrize("seed", range(6))
def test_peaks_are_those_of_the_path(seed):
    """Against many samples of the path: none is beyond, and some come close."""
    random = np.random.default_rng(seed)
    steps = np.cumsum(np.cumsum(random.integers(-40, 41, 30))).tolist()
    path = Reference({1: steps}, 25_000, 500, 700)
    found = peaks(path, 1)
    t = np.linspace(-0.5, 30 / 25 + 0.7, 200_001)
    position, velocity = path(1, t), path.velocity(1, t)
    acceleration = path.acceleration(1, t)
    for peak, sampled in (
        (found.velocity.value, abs(velocity).max()),
        (found.acceleration.value, abs(acceleration).max()),
        (found.highest.value, position.max()),
        (-found.lowest.value, -position.min()),
    ):
        assert peak >= sampled - 1e-6 * abs(sampled)
        assert peak == pytest.approx(sampled, rel=2e-3, abs=0.01)
    assert abs(path.velocity(1, np.array([found.velocity.seconds])))[0] == pytest.approx(
        found.velocity.value, rel=2e-4
    )
    assert path(1, np.array([found.lowest.seconds]))[0] == pytest.approx(
        found.lowest.value, abs=0.02
    )
    knots, _ = path.pieces(1)
    begin, end = knots[:-1] + 1e-6, knots[1:] - 1e-6  # within each cubic
    jerk = (path.acceleration(1, end) - path.acceleration(1, begin)) / (end - begin)
    assert found.jerk.value == pytest.approx(abs(jerk).max(), rel=1e-6)


def test_places_are_scene_frames_and_rolls():
    """A motor at constant velocity has its greatest acceleration in the pre-roll; a motor that
    jumps has it next to the jump, also backward."""
    even = move_of([10 * i for i in range(20)], start=101)
    found = check(even, run_of(even), {1: FAST}, Device({}))
    assert found.place(found.motors[0].peaks.acceleration)[0] == "pre-roll"
    jump = move_of([0] * 10 + [100] * 10, start=101)
    for run in (run_of(jump), p.RtRunMove(24_000, 120, 101, 1000, 1000)):
        found = check(jump, run, {1: FAST}, Device({}))
        part, frame = found.place(found.motors[0].peaks.velocity)
        assert part == "frames"
        assert frame == pytest.approx(110.5)


def test_the_path_that_is_judged_is_the_one_that_is_played():
    """The motor's velocity limits the path's slopes: then every edge is elsewhere."""
    steps = [0, 10, 30, 130, 330, 530, 630, 650, 660, 660, 660, 660]
    setting = Setting(4850, 100_000)
    move = move_of(steps)
    run = run_of(move)
    (found,) = check(move, run, {1: setting}, Device({})).motors
    assert found.peaks.velocity.value < peaks(Reference({1: steps}, 24_000, 1000, 1000), 1)[0].value
    session = simulated()
    session.speed(1, setting.velocity, setting.acceleration).upload(move.positions)
    start = session.play(run)
    played = judge(session.trace(), move.positions, 24_000, start, session.positions, found.path)
    assert played.good, played.complaints


# ---- verdicts


def test_what_fits():
    move = read_move()
    found = check(move, run_of(move), {m: FAST for m in move.positions}, Device({}))
    assert verdicts(found) == [FITS] * 4
    assert found.fits
    assert not found.refused


@pytest.mark.parametrize(
    ("steps", "setting", "words"),
    [
        ([0, 250, 550, 550], FAST, ""),
        ([0, 250, 550, 550], Setting(7000, 500_000),
         "motor 2 at frame 3 would need 7200 steps/s at 24 frames/s, its velocity is 7000"),
        ([0, 5, 9, -1], Setting(20_000, 100_000, 0, None),
         "motor 2 at frame 4 would be past its lower soft limit, 0"),
        ([0, 100, 200, 300], Setting(20_000, 100_000, 0, None),
         "in its pre-roll of 1000 ms motor 2 would pass its soft limit, 0"),
        ([0, 100, 200, 300], Setting(20_000, 2000),
         "in its pre-roll of 1000 ms motor 2 would need 2400 steps/s², its acceleration is 2000"),
        ([0, 100, 200, 300], Setting(3_000_000, 2000), "motor 2 cannot do 3000000 steps/s"),
        ([0, 100, 200, 300], Setting(9000, 9000, 5, 4), "is above the upper one, 4"),
    ],
)  # fmt: skip
def test_what_is_refused_is_so_in_the_controllers_words(steps, setting, words):
    """The message names the one of two motors that does not fit."""
    move = move_of([0] * 4, steps)
    found = check(move, run_of(move), {1: FAST, 2: setting}, Device({}))
    if words:
        assert verdicts(found) == [FITS, REFUSED]
        assert words in found.motors[1].reason
        assert found.refused
    else:
        assert verdicts(found) == [FITS, STEEP]
        assert "motor 2 at frame 3 would need" in found.motors[1].reason
        assert "its acceleration is 100000 steps/s²" in found.motors[1].reason
        assert not found.refused
        assert not found.fits


def test_the_rig_file_counts():
    """strict_moves refuses steep moves; pulse_us limits the velocity; motor_count gives the
    number of motors."""
    move = move_of([0] * 4, [0, 250, 550, 550])
    settings = {1: FAST, 2: FAST}
    for rig, words in (
        ({"strict_moves": True}, "strict_moves is set in the rig file"),
        ({"motor_count": 1}, "there is no motor 2"),
    ):
        found = check(move, run_of(move), settings, Device(rig))
        assert verdicts(found) == [FITS, REFUSED]
        assert words in found.motors[1].reason


def test_memory_counts_for_the_move_as_a_whole():
    wild = [((i * 7919) % 4001) * 3 for i in range(300)]
    fast = Setting(400_000, 2_000_000)
    settings = {motor: fast for motor in range(1, 9)}
    run = p.RtRunMove(1000, 1, 300, 600_000, 600_000)
    device = Device({}, frames=384)
    assert check(move_of(wild), run, settings, device).reason == ""
    found = check(move_of(*[wild] * 8), run, settings, device)
    assert not any(each.verdict == REFUSED for each in found.motors)
    assert "memory is full" in found.reason
    assert found.refused
    longer = check(move_of([0] * 400), run_of(move_of([0] * 400)), {1: FAST}, device)
    assert longer.motors[0].reason == "400 frames are more than the 384 that fit"


# ---- the command


@pytest.fixture
def framestep(command):
    """Return a command line without a board, which gives its status, its output and its errors."""
    return functools.partial(command, None)


def test_exit_status_is_for_scripts(framestep):
    fits = "check camera_move.csv --velocity 20000 --acceleration 100000"
    assert framestep(fits)[0] == 0
    assert framestep(f"{fits} --velocity 3=100")[0] == 7
    status, out, _ = framestep(f"{fits} --acceleration 1=6000")
    assert status == 1
    assert "motor 1, track: too steep: at frame 149 it would need " in out
    assert "steps/s² at frame 149, set 6000; above it\n" in out
    assert "motor 3, swing: fits" in out


def test_what_is_said(framestep, tmp_path):
    path = tmp_path / "move.csv"
    path.write_text("frame,pan\n" + "".join(f"{i},{100 * i}\n" for i in range(1, 25)))
    status, out, err = framestep(f"check {path} --fps 25 --limits 1=-1200:")
    assert (status, err) == (0, "")
    assert out.splitlines() == [
        "motor 1, pan: fits",
        "  velocity      2500 steps/s at frame 1, set 5000",
        "  acceleration  2503 steps/s² in the pre-roll, set 20000",
        "  jerk          6 steps/s³ in the pre-roll",
        "  positions     -1150 to 3750, soft limits -1200 and none",
    ]


def test_for_programs(framestep):
    status, out, _ = framestep(
        "check camera_move.csv --velocity 20000 --acceleration 80000 --limits 1=0:40000 --json"
    )
    assert status == 7
    found = json.loads(out)
    assert (found["fits"], found["refused"], found["frames"]) == (False, True, [1, 240])
    first = found["motors"][0]
    assert first["set"] == {"velocity": 20_000, "acceleration": 80_000, "lower": 0, "upper": 40_000}
    assert first["verdict"] == "refused"
    assert "past its upper soft limit, 40000" in first["reason"]
    assert first["highest"]["value"] == pytest.approx(47_500, abs=0.5)  # the path, not the steps
    assert found["motors"][1]["reason"] is None


def test_what_a_board_has_set_is_asked(command):
    board = SimulatedBoard({"motor_count": 3})
    tell(board, p.MotorSetSpeed(1, 15_000, 90_000), p.MotorSetLimits(1, 1, -3000, 0, 0, 0))
    _, out, _ = command(board, "check camera_move.csv --json")
    motors = json.loads(out)["motors"]
    assert motors[0]["verdict"] == "fits"
    assert motors[0]["set"] == {
        "velocity": 15_000, "acceleration": 90_000, "lower": -3000, "upper": None,
    }  # fmt: skip
    assert motors[1]["reason"].startswith("motor 2 at frame 72 would need")
    assert motors[3]["reason"] == "there is no motor 4, the device has motors 1 to 3"


def test_what_a_board_does_not_report_is_said(command, tmp_path):
    """Its rig file may let it refuse what fits without."""
    rig, path = tmp_path / "rig.json", tmp_path / "move.csv"
    settings = {"motor_count": 3, "strict_moves": True, "motors": [{"backlash": 24}]}
    rig.write_text(json.dumps(settings))
    path.write_text("frame,1\n1,0\n2,10\n3,0\n4,10\n5,10\n")
    board = SimulatedBoard(settings)
    line = "not considered, as a board does not report them: strict_moves, backlash, pulse_us of"
    for given, options, status, count, found in (
        (board, "", 0, 1, ["strict_moves", "backlash", "pulse_us"]),
        (board, f"--rig {rig}", 7, 0, []),
        (None, "", 0, 0, []),
    ):
        done, out, _ = command(given, f"check {path} {options}")
        assert (done, out.count(line)) == (status, count)
        _, out, _ = command(given, f"check {path} {options} --json")
        assert json.loads(out)["not_considered"] == found


def test_a_picture(framestep, tmp_path):
    move = tmp_path / "move.csv"
    move.write_text("frame,pan\n1,0\n2,3\n3,5\n")
    for name, begin in (("a.png", b"\x89PNG"), ("b.svg", b"<?xml")):
        path = tmp_path / "new" / name
        assert framestep(f"check {move} --plot {path}")[0] == 0
        assert path.read_bytes().startswith(begin)


@pytest.mark.parametrize(
    ("options", "status", "words"),
    [
        ("--plot x.txt", 1, "x.txt: a picture is one of .png, .svg, .pdf"),
        ("--rig /not/there.json", 1, "cannot read the rig file /not/there.json"),
        ("--board toaster", 1, "no board 'toaster'"),
        ("--velocity fast", 2, "expected a velocity of motor 1 in whole steps"),
        ("--velocity 0", 2, "expected a velocity of 1 to 1073741823 steps"),
        ("--acceleration 5=10", 2, "the move has no motor 5, it has motors 1, 2, 3, 4"),
        ("--limits 1=5", 2, "--limits: expected MOTOR=LOWER:UPPER"),
        ("--limits 1=5: --limits 1=6:", 2, "--limits: motor 1 has two values: give one"),
        ("--velocity 5 --velocity 6", 2, "--velocity: every motor has two values: give one"),
        ("--acceleration 1=5 --acceleration 1=6", 2, "--acceleration: motor 1 has two values"),
        ("--limits 1=5:4", 2, "--limits: 5 is above 4"),
        ("--loop --ping-pong", 2, "do not go together"),
        ("--fps 1e9", 2, "expected frames per second from 0.001 to 1000"),
        ("--from 0", 1, "the move has frames 1 to 240, not 0"),
    ],
)
def test_one_sentence_says_what_is_wrong(framestep, options, status, words):
    found, out, err = framestep(f"check camera_move.csv {options}")
    assert (found, out) == (status, "")
    assert words in err
    assert len(err.splitlines()) == 1


def test_a_rig_file_with_a_mistake(framestep, tmp_path):
    path = tmp_path / "rig.json"
    path.write_text('{"strict_moves": 1}')
    status, _, err = framestep(f"check camera_move.csv --rig {path}")
    assert status == 1
    assert "strict_moves: found 1, allowed is true or false" in err
