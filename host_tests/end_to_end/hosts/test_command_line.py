"""Commands of `framestep` on the whole controller: their output, and refusals that name the setting
and its place."""

import functools
import json
import re
import sys

import pytest

from framestep.protocol.messages import CONDITION_EXCEEDED
from framestep_tools import payloads as p
from framestep_tools.building.board_files import ROOT
from framestep_tools.client.client import Client, RequestRefused
from framestep_tools.client.refusals import explain
from framestep_tools.move.move_file import CAMERA_MOVE
from framestep_tools.simulator.boards import LockstepPort
from host_tests.end_to_end.session import released, tell

RIG = {"limits": [{"high": 22, "contact": "no"}, {"low": 26, "contact": "no"}], "estop": "no"}


def ready_board():
    return released(RIG, 22, 26)


@pytest.fixture(scope="module")
def board():
    return ready_board()


@pytest.fixture
def framestep(board, said):
    """Return a command line, which checks its status and gives its output."""
    return functools.partial(said, board)


def test_positions_as_they_are_typed(framestep):
    assert framestep("zero 1 -700") == "motor 1: -700"
    assert framestep("move 1 -1200 --velocity 5000 --acceleration 50000") == "motor 1: -1200"
    assert framestep("jog 1 -1300 --speed 50%") == "motor 1: -1300"
    assert framestep("zero 1") == "motor 1: 0"
    assert framestep("buzz 1 --steps 30 --times 2 --speed 50%") == "motor 1: 0"


def test_a_speed_that_the_board_limits_is_reported(framestep):
    said = framestep("move 8 0 --velocity 3000 --acceleration 100000000")
    assert said == ("motor 8: 0\nmotor 8: the board limits its acceleration to 4000000 steps/s²")
    assert framestep("move 8 0 --velocity 3000 --acceleration 50000") == "motor 8: 0"


def test_a_terminal_shows_where_a_motor_is_while_it_moves(framestep, monkeypatch, axes):
    framestep("zero 8 0")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    said = framestep("move 8 3000 --velocity 3000 --acceleration 50000")
    shown = [int(line.rpartition(" ")[2]) for line in re.findall(r"\rmotor 8: -?\d+", said)]
    assert len(shown) > 5
    assert shown == sorted(shown)
    assert shown[0] < 2000
    assert any(0 < at < 3000 for at in shown)
    assert said.startswith("motor 8: 3000\n")


@pytest.fixture
def axes(tmp_path):
    """Return the option with the axes.toml of docs/use/axes.md, and that page."""
    page = (ROOT / "docs/use/axes.md").read_text(encoding="utf-8")
    example = page.split("## The file")[1].split("| key |")[0]
    (tmp_path / "axes.toml").write_text("\n".join(map(str.strip, example.splitlines())))
    return f" --axes {tmp_path / 'axes.toml'}", page


def test_names_and_units_as_the_page_shows_them(framestep, axes):
    option, page = axes
    shown = [line.strip() for line in page.splitlines() if line.startswith("    ")]
    assert framestep(f"zero track 12.55cm{option}") == "track: 125.5 mm (10040)"
    assert framestep(f"zero pan 9.6°{option}") == "pan: 9.6° (-22410)"
    moved = framestep(f"move pan 10deg{option}")
    at = shown.index("$ framestep move pan 10deg")
    assert moved == shown[at + 1]
    found = framestep(f"status{option}").splitlines()
    assert found[1:3] == shown[at + 3 : at + 5]
    motors, rest = shown[at + 5].split(" 8: ")  # a target may have fewer
    assert found[3].startswith(f"{motors} ")
    assert found[3].endswith(f": {rest}")
    assert json.loads(framestep(f"status --json{option}"))["motors"][1] == {
        "motor": 2, "position": -22_500, "moving": False, "axis": "pan", "unit": "deg",
        "value": 10.0, "trust": "known", "reason": "set by the host",
    }  # fmt: skip
    said = framestep(f"move pan 9.92deg --velocity 20deg/s --acceleration 40deg/s2{option}")
    assert said == "pan: 9.92° (-22482)"
    assert framestep(f"jog PAN -22455 --speed 50%{option}") == (
        "pan: 9.8° (-22455)\n-22455 are steps; for deg write -22455deg"
    )
    assert framestep(f"buzz pan --steps 0.2deg --times 1{option}") == "pan: 9.8° (-22455)"
    assert framestep(f"stop pan{option}") == "nothing was moving"
    assert framestep(f"zero pan{option}") == "pan: -90° (0)"


def test_a_mistake_in_axes_toml_stops_nobody_from_stopping(framestep, tmp_path):
    wrong = tmp_path / "axes.toml"
    wrong.write_text("[[axis]\n")
    assert "not valid TOML" in framestep(f"move 1 5 --axes {wrong}", status=1)
    for line in ("stop", "stop 1", "stop --hard"):
        assert framestep(f"{line} --axes {wrong}") == "nothing was moving"
    assert framestep(f"stop pan --axes {wrong}", status=1).startswith(
        f"framestep: NOT STOPPED: {wrong}: not valid TOML"
    )


def test_for_programs(framestep, board):
    framestep("zero 2 -5")
    found = json.loads(framestep("status --json"))
    assert found["motors"][1] == {
        "motor": 2, "position": -5, "moving": False, "trust": "known", "reason": "set by the host",
    }  # fmt: skip
    assert found["exceeded"] is None
    assert found["firmware"].count(".") == 2
    board._board.set_input(22, 0)
    board.run_until(board.now_ns + 100_000_000)
    found = json.loads(framestep("switches --json"))
    assert found == {
        "estop": "released or none",
        "inputs": {"1": False, "2": False},
        "limits": {"1": ["upper"], "2": []},
    }
    assert framestep("switches").splitlines() == [
        "E-stop: released, or there is none", "input 1: off", "input 2: off",
        "limit set 1: upper active, lower clear", "limit set 2: upper clear, lower clear",
    ]  # fmt: skip
    board._board.set_input(22, 1)
    board.run_until(board.now_ns + 100_000_000)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("move 9 5", "there is no motor 9, the device has motors 1 to 8"),
        ("buzz 9", "there is no motor 9: the device has motors 1 to 8"),
        (
            "move 3 60000",
            "60000 is past the upper soft limit of motor 3, 50000 (set in Dragonframe's",
        ),
        ("move 3 -1", "-1 is past the lower soft limit of motor 3, 0 (set in Dragonframe's"),
        ("move 4 5", "motor 4 is switched off by MOTOR_CONFIGURE"),
        ("move 6 5", "motor 6 does what motor 5 does (they are coupled): move that one"),
        ("move 1 5 --velocity 4000000 --acceleration 5", "motor 1 cannot do 4000000 steps/s"),
        ("virtual", "no virtual axes are configured"),
    ],
)
def test_refused_in_words(framestep, board, line, words):
    tell(
        board, p.MotorSetLimits(3, 1, 0, 1, 50_000, 0), p.MotorConfigure(4, 0),
        p.MotorConfigure(5, 0x11), p.MotorSetSpeed(1, 5000, 20_000),
    )  # fmt: skip
    assert words in framestep(line, status=7)


@pytest.mark.parametrize(
    ("path", "line", "words"),
    [
        ([0, 250, 550, 550], "play FILE",
         "motor 3 at frame 13 would need 7200 steps/s at 24 frames/s, its "),
        ([0, 0, 0, -1], "play FILE",
         "motor 3 at frame 14 would be past its lower soft limit, 0 (set in Dragonframe's"),
        ([49_990, 49_999, 50_001, 50_003], "play FILE",
         "motor 3 at frame 13 would be past its upper soft limit"),
        ([100, 200, 300, 400], "play FILE",
         "in its pre-roll of 1000 ms motor 3 would pass its soft limit, 0 or 50000 (set in "
         "Dragonframe's axis set-up, or in framestep console): give it a shorter one"),
        ([100, 200, 300, 400], "play FILE --preroll 0.02",
         "in its pre-roll of 20 ms motor 3 would need 120000 steps/s², its acceleration is 20000"),
        ([2000, 2100, 2200, 2300], "play FILE --postroll 0.02",
         "in its post-roll of 20 ms motor 3 would need 120000 steps/s², its acceleration is 20000"),
        ([100, 101, 102, 103], "play FILE --fps 300",
         "300 frames/s: expected more than 0, at most 200"),
    ],
)  # fmt: skip
def test_a_run_refused_in_words(framestep, board, tmp_path, path, line, words):
    tell(board, p.MotorSetLimits(3, 1, 0, 1, 50_000, 0))
    move = tmp_path / "move.csv"
    move.write_text(
        "frame,a,b,c\n" + "".join(f"{11 + i},0,0,{steps}\n" for i, steps in enumerate(path))
    )
    assert words in framestep(line.replace("FILE", str(move)), status=7)


def refused(client, request):
    with pytest.raises(RequestRefused) as caught:
        client.request(request)
    return str(explain(client, caught.value))


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (p.RtShootFrame(12, 1, 1000, 1000, [p.BlurMotor(9, 0, 5)]), "there is no motor 9"),
        (p.RtShootFrame(12, 1, 1000, 1000, [p.BlurMotor(2, 0, 5001)]),
         "motor 2 at frame 12 would need 5001 steps/s, its velocity is 5000 steps/s (set in"),
        (p.RtShootFrame2(12, 700, 0, 360, [p.BlurMotor(2, 0, 4000)]),
         "motor 2 at frame 12 would need 6531 steps/s, its velocity is 5000 steps/s (set in"),
        (p.RtShootFrame(12, 1, 1000, 1000, [p.BlurMotor(2, 9000, 9500)]),
         "in the second before the exposure of frame 12 motor 2 would need 500 steps/s², "
         "its acceleration is 400 steps/s² (set in Dragonframe's"),
        (p.RtShootFrame2(12, 1000, 0, 360, [p.BlurMotor(2, 9000, 9500)]),
         "in the exposure of frame 12 motor 2 would need 4566 steps/s², its acceleration is 400"),
        (p.RtShootFrame(12, 1, 1000, 1000, [p.BlurMotor(2, 50, 350)]),
         "in the second before the exposure of frame 12 motor 2 would pass its soft limit, "
         "0 or 10000 (set in Dragonframe's"),
        (p.RtShootFrame(12, 1, 1000, 1000, [p.BlurMotor(2, 9600, 9900)]),
         "in the second after the exposure of frame 12 motor 2 would pass its soft limit"),
        (p.RtShootFrame2(12, 10000, 0, 360, [p.BlurMotor(2, 9800, 10001)]),
         "in the exposure of frame 12 motor 2 would pass its soft limit, 0 or 10000"),
        (p.RtShootFrame(19, 1, 1000, 1000, []), "frame 19 is not in the upload"),
        (p.RtShootFrame2(12, 1000, 90, 60, []), "would close at 60 degrees, before it opens at 90"),
    ],
)  # fmt: skip
def test_a_shot_refused_in_words(request_, words):
    board = ready_board()
    upload = [p.RtUploadMoveBegin(11, 14), p.RtUploadMoveAxis(2, 1 << 31, [0]), p.RtUploadMoveEnd()]
    tell(board, *upload, p.MotorSetSpeed(2, 5000, 400), p.MotorConfigure(2, 3))
    tell(board, p.MotorSetLimits(2, 1, 0, 1, 10_000, 0))
    with Client(LockstepPort(board)) as client:
        assert words in refused(client, request_)
        reported = client.request(p.GetCondition()).bits & CONDITION_EXCEEDED
        assert bool(reported) == ("motor 2" in words), "the REPL tells it, too"


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (p.VirtMove(4, 5), "no virtual axes are configured"),
        (p.VirtStop(9), "no virtual axes are configured"),
        (p.RtUploadMoveAxis(1, 0, [1]), "no upload has begun"),
        (p.RtUploadMoveBegin(5, 1), "the move would end at frame 1, before it begins at 5"),
        (p.RtUploadMoveBegin(1, 99_999), "99999 frames are more than the"),
        (p.RtPositionFrame(1), "no move has been uploaded since the board's start"),
        (p.RtJogAll(24_000, 1), "no move has been uploaded since the board's start"),
        (p.RtGo(), "no run waits"),
        (p.MotorSetLimits(1, 1, 5, 1, -5, 0),
         "the lower limit of motor 1, 5, is above the upper one, -5"),
        (p.MotorSetLimits(1, 0, 0, 0, 0, 3),
         "motor 1 cannot have limit switch set 3: the rig file has sets 1 to 2"),
    ],
)  # fmt: skip
def test_other_requests_refused_in_words(request_, words):
    with Client(LockstepPort(ready_board())) as client:
        assert words in refused(client, request_)


@pytest.mark.needs("little memory")
def test_a_section_that_does_not_fit_is_reported_without_its_positions():
    wild = [10_000_000 * (-1) ** i for i in range(1000)] * 16
    with Client(LockstepPort(ready_board())) as client:
        with pytest.raises(RequestRefused) as caught:
            client.upload_move(1, 16_000, {motor: wild for motor in range(1, 9)})
        said = str(explain(client, caught.value))
    assert "the positions of motor " in said
    assert "memory is full; this section needs " in said
    assert len(said) < 300


def test_a_run_against_a_limit_switch_names_the_motor():
    board = ready_board()
    tell(
        board, p.MotorSetLimits(3, 0, 0, 0, 0, 1), p.RtUploadMoveBegin(1, 3),
        p.RtUploadMoveAxis(3, 1 << 31, [500, 510, 520]), p.RtUploadMoveEnd(),
    )  # fmt: skip
    board._board.set_input(22, 0)
    board.run_until(board.now_ns + 200_000_000)
    words = "motor 3 is at its upper limit switch, and may move down only"
    with Client(LockstepPort(board)) as client:
        for request in (
            p.RtRunMove(24_000, 1, 3, 500, 500),
            p.RtPositionFrame(3),
            p.MotorMove(3, 5),
        ):
            assert words in refused(client, request)


@pytest.mark.parametrize(
    "line",
    [
        "virtual roll -1e9",
        "play camera_move.csv --preroll 1e9",
        "play camera_move.csv --postroll 1e9",
        "play camera_move.csv --preroll 700",
    ],
)
def test_values_that_fit_no_message(framestep, line):
    said = framestep(line, status=2)
    assert "expected at " in said
    assert len(said.splitlines()) == 1


def test_a_run_that_is_stopped_is_not_reported_as_played(framestep, board, monkeypatch, tmp_path):
    tell(board, p.MotorSetLimits(3, 0, 0, 0, 0, 0), p.MotorSetSpeed(3, 20_000, 50_000))
    move = tmp_path / "move.csv"
    move.write_text("frame,a,b,c\n" + "".join(f"{i + 1},0,0,{i * 100}\n" for i in range(24)))
    assert framestep(f"play {move} --to 4 --preroll 0.2") == (
        "a is motor 1, b is motor 2, c is motor 3\nframes 1 to 4 played"
    )
    take = Client._take
    stops = [p.MotorStopAll()]

    def stopping(client, data):
        take(client, data)
        late = [
            e
            for e in client.events
            if isinstance(e.message, p.Positions) and e.message.move_time > 3000
        ]
        if client.on_event and late and stops:
            client.send(stops.pop())

    monkeypatch.setattr(Client, "_take", stopping)
    said = framestep(f"play {move} --preroll 0.2", status=7)
    assert "the run ended at frame" in said
    assert "before 24: another program or a soft limit stopped it" in said


def test_a_short_e_stop_ends_what_is_repeated(framestep, board, monkeypatch):
    """buzz and jog repeat their request: if they did not look at messages, the motor would continue
    after the E-stop is released."""
    pump, taps = Client.pump, [1]

    def tapped(client, seconds=0.0):
        pump(client, seconds)
        if taps:
            taps.pop()
            for level in (0, 1):
                board._board.set_input("estop", level)
                board.run_until(board.now_ns + 400_000_000)

    monkeypatch.setattr(Client, "pump", tapped)
    said = framestep("buzz 7 --steps 2000", status=7)
    assert "the E-stop was pressed" in said
    assert said.startswith("framestep: motor 7 stopped at ")
    assert framestep("zero 7") == "motor 7: 0"
    assert framestep("jog 7 -1000 --speed 100% --seconds 60") == "motor 7: -1000"


def test_names_and_units_in_refusals(framestep, board, axes, tmp_path):
    option, _ = axes
    move = tmp_path / "track.csv"
    lines = CAMERA_MOVE.read_text().splitlines()
    move.write_text("\n".join(",".join(line.split(",")[:2]) for line in lines))
    tell(
        board, p.MotorResetPosition(2, 0), p.MotorSetLimits(2, 1, -2250, 1, 0, 0),
        p.MotorResetPosition(1, 0), p.MotorSetSpeed(1, 800, 8000),
    )  # fmt: skip
    for line, words in (
        ("move pan -79deg",
         "-79° (-2475) is past the lower soft limit of pan, -80° (-2250) (set in"),
        (f"play {move}",
         "track at frame 48 would need 145.8 mm/s (11664 steps/s) at 24 frames/s, its velocity is "
         "10 mm/s (800 steps/s) (set in Dragonframe's"),
        ("home pan", "no motor has `home` in the rig file"),
    ):  # fmt: skip
        assert words in framestep(line + option, status=7)
    assert framestep(f"move track 2m{option}", status=2) == (
        f"framestep: track: 2000 mm is beyond its limits of 0 to 1450 mm ({option.split()[1]})"
    )
