"""`framestep play` on the whole controller, in virtual time: what moves, what the outputs do, what
it prints."""

import io

import numpy as np
import pytest
from rich.console import Console

from framestep_tools import payloads as p
from framestep_tools.client.client import Client
from framestep_tools.errors import INTERRUPTED, REFUSED
from framestep_tools.judge.judge import frame_times_ns
from framestep_tools.move.light_file import read_lights
from framestep_tools.move.move_display import MoveDisplay
from framestep_tools.move.move_file import MoveFileError
from framestep_tools.simulator.boards import LockstepPort
from host_tests.end_to_end.session import released

RIG = {"estop": "no", "outputs": [{"pin": 22}, {"pin": 26}]}
FRAMES = 36
STEPS = [round(8 * i * i * (1 - i / (1.5 * FRAMES))) for i in range(FRAMES)]
FIRST, LAST = 11, 11 + FRAMES - 1
FAST = "--velocity 20000 --acceleration 100000"


@pytest.fixture
def board():
    return released(RIG)


@pytest.fixture
def move(tmp_path):
    path = tmp_path / "move.csv"
    lines = [f"{FIRST + i},{steps},{-steps}\n" for i, steps in enumerate(STEPS)]
    path.write_text("frame,pan,tilt\n" + "".join(lines))
    return path


def standing(board):
    with Client(LockstepPort(board)) as client:
        return list(client.request(p.MotorGetPosition()).steps)[:2]


def rises(edges, signal):
    return [time for time, name, value in sorted(edges) if name == signal and value]


@pytest.mark.parametrize(
    ("options", "begin", "end"),
    [
        ("", FIRST, LAST),
        ("--reverse", LAST, FIRST),
        ("--from 20 --to 30 --fps 12 --preroll 0 --postroll 0", 20, 30),
    ],
)
def test_a_move_is_played(framestep, board, move, options, begin, end):
    status, out, err = framestep(f"play {move} {FAST} {options}")
    assert (status, err) == (0, "")
    assert out == f"pan is motor 1, tilt is motor 2\nframes {begin} to {end} played\n"
    assert standing(board) == [STEPS[end - FIRST], -STEPS[end - FIRST]]


def test_what_is_too_steep_is_played_and_reported(framestep, board, tmp_path):
    path = tmp_path / "jump.csv"
    path.write_text("frame,pan\n1,0\n2,0\n3,300\n4,300\n5,300\n")
    status, out, err = framestep(f"play {path} --velocity 20000 --acceleration 50000")
    assert (status, out) == (0, "pan is motor 1\nframes 1 to 5 played\n")
    assert err == (
        "motor 1 at frame 2 would need 172800 steps/s², its acceleration is 50000 steps/s²: "
        "it is played as uploaded and may lose steps\n"
    )


@pytest.mark.needs("lights")
def test_lights_and_outputs_play_with_it(framestep, board, move, tmp_path):
    """Each level and output changes at its frame, except for a tick and the time of a pass."""
    levels = [5 * i for i in range(FRAMES)]
    on = [1 if i in (3, 9) else 0 for i in range(FRAMES)]
    lights = tmp_path / "lights.csv"
    lights.write_text(
        "frame,dmx 7,output 2\n"
        + "".join(f"{FIRST + i},{levels[i]},{on[i]}\n" for i in range(FRAMES))
    )
    status, _, err = framestep(
        f"play {move} {FAST} --dmx {lights} --camera stills --shutter-angle 180 --bloop 1"
    )
    assert status == 0, err
    edges = sorted(board.edges())
    frames = [FIRST + i for i in range(FRAMES)]
    opened = rises(edges, "shutter")
    assert len(opened) == len(frames)
    at = dict(zip(frames, opened, strict=True))  # with angle 0 the shutter opens at its frame
    assert abs(np.diff(opened) - np.diff(frame_times_ns(FRAMES, 24_000))).max() <= 1_000_000
    shown = [(time, value) for time, name, value in edges if name == "dmx7" and time >= opened[0]]
    assert [value for _, value in shown] == levels[1:]
    for i, (time, _) in enumerate(shown, 1):
        assert abs(time - at[FIRST + i]) < 10_000_000
    for time, frame in zip(rises(edges, "gio2"), (FIRST + 3, FIRST + 9), strict=True):
        assert abs(time - at[frame]) < 2_000_000
    (bloop,) = rises(edges, "gio1")
    assert abs(bloop - opened[0]) < 2_000_000


def test_a_loop_ends_with_ctrl_c_where_it_is_said(framestep, board, move, monkeypatch):
    """Passes follow each other until then; the motors ramp down, and it prints where they are."""
    seen = []

    def show(display, event):
        if isinstance(event.message, p.Positions) and event.message.move_time % 1000 == 0:
            seen.append(event.message.move_time // 1000)
            if seen.count(20) == 2 and seen[-1] == 20:
                raise KeyboardInterrupt

    monkeypatch.setattr(MoveDisplay, "show", show)
    status, out, err = framestep(f"play {move} {FAST} --ping-pong")
    assert (status, out) == (INTERRUPTED, "pan is motor 1, tilt is motor 2\n")
    assert LAST in seen, "the second time is on the way back"
    pan, tilt = standing(board)
    assert err.splitlines() == [
        "stopping; Ctrl-C once more stops harder",
        f"stopped: motor 1 is at {pan}, motor 2 is at {tilt}",
    ]
    gaps = np.diff(sorted(time for time, name, _ in board.edges() if name == "m1")[-20:])
    assert gaps[-1] > 2 * gaps[0], "ramped down, not cut off"


def test_a_second_ctrl_c_stops_harder(framestep, board, move, monkeypatch):
    wait_idle, request, waits, stops = Client.wait_idle, Client.request, [], []

    def interrupted(client, *more, **options):
        """Interrupt on the way to the pre-roll, and again while the motors slow down."""
        waits.append(client)
        if len(waits) <= 2:
            client.pump(0.05)
            raise KeyboardInterrupt
        wait_idle(client, *more, **options)

    def noted(client, message, *more):
        if isinstance(message, p.MotorStopAll):
            stops.append(client.clock())
        return request(client, message, *more)

    monkeypatch.setattr(Client, "wait_idle", interrupted)
    monkeypatch.setattr(Client, "request", noted)
    status, _, err = framestep(f"play {move} {FAST}")
    assert status == INTERRUPTED
    assert len(stops) == 3
    assert stops[2] - stops[1] < 1, "two within a second are a hard stop (field note 4.4)"
    assert err.splitlines()[:2] == ["stopping; Ctrl-C once more stops harder", "stopping harder"]


def test_what_ends_a_run_is_reported(framestep, board, move, monkeypatch):
    def show(display, event):
        if isinstance(event.message, p.Positions) and event.message.move_time == 20_000:
            board._board.set_input("estop", 0)

    monkeypatch.setattr(MoveDisplay, "show", show)
    status, out, err = framestep(f"play {move} {FAST}")
    assert (status, out) == (REFUSED, "pan is motor 1, tilt is motor 2\n")
    assert "the run ended at frame 20." in err
    assert err.endswith(f"before {LAST}: the E-stop was pressed\n")


# ---- the table of lights


def test_a_table_of_lights(tmp_path):
    path = tmp_path / "lights.csv"
    path.write_text("Frame;5;DMX 12;Output 3\n1;0;255;0\n2;9;254;1\n")
    lights = read_lights(path)
    assert (lights.start_frame, lights.end_frame) == (1, 2)
    assert list(lights.requests()) == [
        p.RtUploadMoveDmx(5, 1 << 31, [0, 9]),
        p.RtUploadMoveDmx(12, 1 << 31, [255, 254]),
        p.RtUploadMoveTriggers(4, [p.Trigger(1, 4)]),
    ]


def test_a_long_table_goes_in_sections(tmp_path):
    path = tmp_path / "lights.csv"
    path.write_text("frame,1,output 1\n" + "".join(f"{i},{i % 256},1\n" for i in range(10_000)))
    levels, triggers, last = [], [], []
    for request in read_lights(path).requests():
        assert len(request.pack()) <= 4096
        if isinstance(request, p.RtUploadMoveDmx):
            assert request.start_index & 0x7FFF_FFFF == len(levels)
            levels += request.levels
            last.append(request.start_index >> 31)
        else:
            triggers += [(each.index, each.outputs) for each in request.triggers]
    assert levels == [i % 256 for i in range(10_000)]
    assert last == [0] * (len(last) - 1) + [1]
    assert triggers == [(i, 1) for i in range(10_000)]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("frame,513\n1,2\n", "line 1: expected a DMX channel, 1 to 512, or .* found '513'"),
        ("frame,lamp\n1,2\n", "line 1: expected a DMX channel, .* found 'lamp'"),
        ("frame,output 0\n1,1\n", "line 1: expected a DMX channel, .* found 'output 0'"),
        ("frame,5,dmx 5\n1,2,3\n", "line 1: dmx 5 occurs twice"),
        ("frame,5\n1,2\n2,256\n", "line 3: expected 0 to 255 for 5, found 256"),
        ("frame,output 1\n1,2\n", "line 2: expected 0 to 1 for output 1, found 2"),
        ("frame,5\n1,2\n3,2\n", "line 3: expected frame 2, found 3"),
    ],
)
def test_tables_that_are_no_lights(tmp_path, text, complaint):
    path = tmp_path / "lights.csv"
    path.write_text(text)
    with pytest.raises(MoveFileError, match=complaint):
        read_lights(path)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("frame,5\n12,2\n", "the lights begin at frame 12, the move begins at frame 11"),
        ("frame,5\n" + "".join(f"{11 + i},0\n" for i in range(FRAMES + 1)), "end at frame 47"),
        ("frame,output 3\n11,1\n", "there is no output 3: framestep has outputs 1 to 2"),
    ],
)
def test_lights_that_do_not_fit_the_move(framestep, move, tmp_path, text, complaint):
    path = tmp_path / "lights.csv"
    path.write_text(text)
    status, out, err = framestep(f"play {move} --dmx {path}")
    assert (status, out) == (1, "")
    assert complaint in err
    assert len(err.splitlines()) == 1


def test_a_bloop_needs_its_output(framestep, move):
    status, _, err = framestep(f"play {move} --bloop 3")
    assert status == 1
    assert "there is no output 3: the device has outputs 1 to 2" in err


# ---- on a terminal


def test_the_display_on_a_terminal(framestep, board, move, monkeypatch):
    shown = Console(file=io.StringIO(), force_terminal=True, width=90, highlight=False)
    monkeypatch.setattr("rich.console.Console", lambda **_: shown)
    status, _, err = framestep(f"play {move} {FAST}")
    assert status == 0, err
    text = shown.file.getvalue()
    assert f"frame {LAST}.0 of {FIRST} to {LAST}" in text
    assert "pan" in text
    assert "tilt" in text
