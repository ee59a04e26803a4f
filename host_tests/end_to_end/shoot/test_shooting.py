"""`framestep shoot` against the whole controller, on virtual time."""

import io

import numpy as np
import pytest
from rich.console import Console

from framestep_tools import payloads as p
from framestep_tools.client.client import Client
from framestep_tools.errors import INTERRUPTED, REFUSED
from framestep_tools.judge.trace import Trace
from framestep_tools.move.half_frame import ends
from framestep_tools.move.move_display import ShotDisplay
from framestep_tools.move.shoot import FramesError, frames_of, spans
from framestep_tools.simulator.boards import LockstepPort
from host_tests.end_to_end.session import released, tell

PAN = [0, 0, 40, 120, 260, 420, 560, 640, 660, 640]
FOCUS = [5 * i for i in range(10)]
FAST = "--velocity 20000 --acceleration 100000"


@pytest.fixture
def board():
    return released({"estop": "no"})


@pytest.fixture
def move(tmp_path):
    path = tmp_path / "move.csv"
    lines = [f"{5 + i},{a},{b}\n" for i, (a, b) in enumerate(zip(PAN, FOCUS, strict=True))]
    path.write_text("frame,1,2\n" + "".join(lines))
    return path


def exposures(edges):
    """Return when the shutter was open: begin and end."""
    times = [time for time, name, _ in sorted(edges) if name == "shutter"]
    return list(zip(times[::2], times[1::2], strict=True))


def test_frames_are_shot_in_motion(framestep, board, move):
    """The shutter is open for the exposure, in the middle of the motion from half a frame before to
    half a frame after, and so is the meter; a motor that does not blur rests on its frame."""
    status, out, err = framestep(f"shoot 8-10 --move {move} --motors 1 --exposure 0.5 {FAST}")
    assert (status, out, err) == (0, "3 frames shot: 8-10\n", "")
    edges = board.edges()
    trace = Trace.from_edges(edges)
    opened = exposures(edges)
    assert len(opened) == 3
    assert len([1 for _, name, value in edges if name == "meter" and value]) == 3
    for frame, (begin, end) in zip((8, 9, 10), opened, strict=True):
        assert end - begin == pytest.approx(500e6, abs=1e6)
        a, b = ends(PAN, frame - 5)
        there = trace.position_at(1, np.array([begin, end]))
        # 180 of 360 degrees, at constant velocity except for ramps in the first and the last eighth
        way = (b - a) * 180 / 315
        assert there == pytest.approx([(a + b - way) / 2, (a + b + way) / 2], abs=1.5)
        assert set(trace.position_at(2, np.array([begin, end]))) == {FOCUS[frame - 5]}


@pytest.mark.parametrize("index", range(10))
def test_the_ends_of_the_blur_are_those_of_the_firmware(index, board):
    """Without a list the firmware takes them from the path."""
    with Client(LockstepPort(board)) as client:
        client.request(p.MotorSetSpeed(1, 20_000, 100_000))
        client.request(p.MotorConfigure(1, 3))
        client.upload_move(5, 14, {1: PAN})
        client.request(p.RtShootFrame2(5 + index, 500, 0, 360))
        client.wait_idle()
        waits = client.request(p.MotorGetPosition()).steps[0]
        client.request(p.RtGo())
        client.wait_event(p.RtEnd, 10)
        client.wait_idle()
        assert (waits, client.request(p.MotorGetPosition()).steps[0]) == ends(PAN, index)


def test_what_is_there_is_shot(framestep, board, move):
    """It uses an earlier upload; motors that do not blur rest on the frame. Frames in any order."""
    assert framestep(f"upload {move}")[0] == 0
    status, out, _ = framestep("shoot 9 7,6 --exposure 0.1")
    assert (status, out) == (0, "3 frames shot: 9, 7-6\n")
    edges = board.edges()
    trace = Trace.from_edges(edges)
    for frame, times in zip((9, 7, 6), exposures(edges), strict=True):
        assert set(trace.position_at(1, np.array(times))) == {PAN[frame - 5]}


def test_pauses_are_of_the_boards_time(framestep, board, move):
    framestep(f"shoot 8,8 --move {move} --motors none --exposure 0.1")
    (_, closed), (opened, _) = exposures(board.edges())
    framestep(f"shoot 8,8 --move {move} --motors none --exposure 0.1 --settle 2 --pause 3")
    (_, closed_2), (opened_2, _) = exposures(board.edges())
    assert (opened_2 - closed_2) - (opened - closed) == pytest.approx(5e9, abs=50e6)


@pytest.mark.needs("prompt")
@pytest.mark.parametrize("exposure", [0.1, 0.9])
def test_every_is_from_shot_to_shot(framestep, board, move, exposure):
    """Whatever the exposure and the way to the next frame."""
    status, out, _ = framestep(
        f"shoot 6-9 --move {move} --motors 1 --exposure {exposure} --every 5 {FAST}"
    )
    assert (status, out) == (0, "4 frames shot: 6-9\n")
    opened = np.array([begin for begin, _ in exposures(board.edges())])
    assert np.diff(opened) == pytest.approx(5e9, abs=3e6)


def test_a_rig_that_is_slower_than_every(framestep, board, move):
    status, out, _ = framestep(f"shoot 6-8 --move {move} --exposure 1 --every 0.5 {FAST}")
    assert (status, out) == (
        0,
        "3 frames shot: 6-8\n"
        "2 of them later than --every says: the rig and the exposure take longer\n",
    )
    status, _, err = framestep(f"shoot 6-8 --move {move} --every 5 --pause 1")
    assert status == 2
    assert "--every is from shot to shot, --pause between them: give one" in " ".join(err.split())


def test_ctrl_c_reports_what_is_shot(framestep, board, move, monkeypatch):
    def shot(display, done, frame):
        if done == 2:
            display.armed = True

    def show(display, event):
        if isinstance(event.message, p.Positions) and getattr(display, "armed", False):
            raise KeyboardInterrupt

    monkeypatch.setattr(ShotDisplay, "shot", shot)
    monkeypatch.setattr(ShotDisplay, "show", show)
    status, out, err = framestep(f"shoot 8-12 --move {move} {FAST} --exposure 0.5")
    assert (status, out) == (INTERRUPTED, "")
    lines = err.splitlines()
    assert lines[0] == "stopping; Ctrl-C once more stops harder"
    assert lines[1].startswith("stopped: ") or lines[1] == "nothing was moving"
    assert lines[2] == "8-9 shot, 10-12 not"
    assert len(exposures(board.edges())) in (2, 3)


@pytest.mark.needs("inside")
def test_a_stop_ends_the_sequence(framestep, board, move, monkeypatch):
    def show(display, event):
        if isinstance(event.message, p.Positions) and any(
            name == "shutter" for _, name, _ in board._edges
        ):
            board._board.set_input("estop", 0)

    monkeypatch.setattr(ShotDisplay, "show", show)
    status, out, err = framestep(f"shoot 8-12 --move {move} {FAST} --exposure 0.5")
    assert (status, out) == (REFUSED, "")
    assert err == "framestep: frame 8 was not shot: the E-stop was pressed\n"


def test_on_a_terminal(framestep, move, monkeypatch):
    shown = Console(file=io.StringIO(), force_terminal=True, width=90, highlight=False)
    monkeypatch.setattr("rich.console.Console", lambda **_: shown)
    assert framestep(f"shoot 8-9 --move {move} {FAST} --exposure 0.1")[0] == 0
    text = shown.file.getvalue()
    assert "2 of 2 frames" in text
    assert "motor 2" in text


# ---- wrong input


@pytest.mark.parametrize(
    ("texts", "frames"),
    [
        (["7"], [7]),
        (["1-3", "9"], [1, 2, 3, 9]),
        (["3-1,5, 6"], [3, 2, 1, 5, 6]),
        (["-2-1"], [-2, -1, 0, 1]),
        (["-1--3"], [-1, -2, -3]),
    ],
)
def test_frames_as_they_are_typed(texts, frames):
    assert frames_of(texts) == frames
    assert frames_of([spans(frames).replace(" ", "")]) == frames


@pytest.mark.parametrize(
    "text", ["", "a", "1-", "1..3", "1-2-3", "99999999999", "1-600000000", "1-60000,1-60000"]
)
def test_what_are_no_frames(text):
    with pytest.raises(FramesError, match=r"expected frames|frames have numbers|100000 frames"):
        frames_of([text])


@pytest.mark.parametrize(
    ("line", "status", "words"),
    [
        ("shoot 1", REFUSED, "no move has been uploaded since the board's start"),
        ("shoot 4-6 --move MOVE", 1, "the move has frames 5 to 14, not 4"),
        ("shoot 8 --motors 1", 2, "--motors needs --move"),
        ("shoot 8 --velocity 5 --acceleration 5", 2, "--velocity needs --move"),
        ("shoot 8 --move MOVE --motors 1,3", 2, "expected motors of the move, 1, 2"),
        ("shoot x --move MOVE", 2, "expected frames such as 7, 1-48 or 1-5,9, found 'x'"),
        ("shoot 8 --move MOVE --exposure 0.01", REFUSED,
         "motor 1 at frame 8 would need"),
    ],
)  # fmt: skip
def test_one_sentence_says_what_is_wrong(framestep, board, move, line, status, words):
    tell(board, p.MotorResetPosition(1, 0))
    found, out, err = framestep(line.replace("MOVE", str(move)))
    assert (found, out) == (status, "")
    assert words in err
    assert len(err.splitlines()) == 1
    assert not exposures(board.edges())
