"""Commands of `framestep` against the whole controller: what they print, and refusals that say what
is set where."""

import json

import pytest

from framestep_tools import cli
from framestep_tools.boards import LockstepPort, SimulatedBoard
from framestep_tools.client import Client
from framestep_tools.payloads import (
    MotorConfigure,
    MotorSetLimits,
    MotorSetSpeed,
    MotorStopAll,
    Positions,
    RtUploadMoveAxis,
    RtUploadMoveBegin,
    RtUploadMoveEnd,
)

RIG = {"limits": [{"high": 22, "contact": "no"}, {"low": 26, "contact": "no"}], "estop": "no"}


@pytest.fixture(scope="module")
def board():
    found = SimulatedBoard(RIG)
    for pin in ("estop", 22, 26):
        found._board.set_input(pin, 1)
    found.run_until(50_000_000)
    return found


@pytest.fixture
def framestep(board, monkeypatch, capsys):
    """A command line, run: what it prints, where its status is as expected."""
    monkeypatch.setattr(Client, "open", lambda device: Client(LockstepPort(board)))

    def run(line, status=0):
        found = cli.app.status([line.split()[0], "socket://x", *line.split()[1:]])
        said = "".join(capsys.readouterr())
        assert found == status, said
        return said.strip()

    return run


def tell(board, *requests):
    with Client(LockstepPort(board)) as client:
        for request in requests:
            client.request(request)


def test_positions_as_they_are_typed(framestep):
    assert framestep("zero 1 -700") == "motor 1: -700"
    assert framestep("move 1 -1200 --velocity 5000 --acceleration 50000") == "motor 1: -1200"
    assert framestep("jog 1 -1300 --speed 5000") == "motor 1: -1300"
    assert framestep("zero 1") == "motor 1: 0"
    assert framestep("buzz 1 --steps 30 --times 2 --speed 5000") == "motor 1: 0"


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
        "estop": "released",
        "inputs": {"1": False, "2": False},
        "limits": {"1": ["upper"], "2": []},
    }
    assert framestep("switches").splitlines() == [
        "E-stop: released",
        "input 1: off",
        "input 2: off",
        "limit set 1: upper switch active",
        "limit set 2: -",
    ]
    board._board.set_input(22, 1)
    board.run_until(board.now_ns + 100_000_000)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("move 9 5", "there is no motor 9, the device has motors 1 to 8"),
        ("buzz 9", "there is no motor 9: the device has motors 1 to 8"),
        ("move 3 60000", "60000 is past the upper soft limit of motor 3, 50000 (set by SET_LIMITS"),
        ("move 3 -1", "-1 is past the lower soft limit of motor 3, 0 (set by SET_LIMITS"),
        ("move 4 5", "motor 4 is switched off by MOTOR_CONFIGURE"),
        ("move 6 5", "motor 6 does what motor 5 does (they are coupled): move that one"),
        ("move 1 5 --velocity 4000000 --acceleration 5", "motor 1 cannot do 4000000 steps/s"),
        ("virtual", "no virtual axes are configured"),
        ("run 1 3", "no move has been uploaded since the board's start: framestep upload FILE"),
    ],
)
def test_refused_in_words(framestep, board, line, words):
    tell(
        board, MotorSetLimits(3, 1, 0, 1, 50_000, 0), MotorConfigure(4, 0), MotorConfigure(5, 0x11),
        MotorSetSpeed(1, 5000, 20_000),
    )  # fmt: skip
    assert words in framestep(line, status=7)


@pytest.mark.parametrize(
    ("path", "line", "words"),
    [
        ([0, 0, 300, 300], "run 11 14",
         "motor 3 at frame 13 would need 7200 steps/s at 24 frames/s, its "),
        ([0, 0, 0, -1], "run 11 14",
         "motor 3 at frame 14 would be past its lower soft limit, 0 (set by SET_LIMITS"),
        ([49_990, 49_999, 50_001, 50_003], "run 11 14",
         "motor 3 at frame 13 would be past its upper soft limit"),
        ([100, 200, 300, 400], "run 11 14",
         "in its pre-roll of 1000 ms motor 3 would need more than its 20000"),
        ([100, 200, 300, 400], "run 11 14 --preroll-ms 1",
         "in its pre-roll of 1 ms motor 3"),
        ([100, 101, 102, 103], "run 11 20",
         "frames 11 to 20 at 24 frames/s are not all in the upload"),
    ],
)  # fmt: skip
def test_a_run_refused_in_words(framestep, board, path, line, words):
    tell(
        board, MotorSetLimits(3, 1, 0, 1, 50_000, 0), RtUploadMoveBegin(11, 14),
        RtUploadMoveAxis(3, 1 << 31, path), RtUploadMoveEnd(),
    )  # fmt: skip
    assert words in framestep(line, status=7)


@pytest.mark.parametrize("line", ["virtual roll -1e9", "run 1 2 --fps 1e9", "run 1 99999999999"])
def test_values_that_fit_no_message(framestep, line):
    said = framestep(line, status=2)
    assert "does not fit" in said
    assert len(said.splitlines()) == 1


def test_a_run_that_is_stopped_is_not_told_as_played(framestep, board, monkeypatch):
    tell(
        board, MotorSetLimits(3, 0, 0, 0, 0, 0), RtUploadMoveBegin(1, 24),
        RtUploadMoveAxis(3, 1 << 31, range(0, 2400, 100)), RtUploadMoveEnd(),
    )  # fmt: skip
    assert framestep("run 1 4 --preroll-ms 200") == "frames 1 to 4 played"
    take = Client._take
    stops = [MotorStopAll()]

    def stopping(client, data):
        take(client, data)
        late = [
            e
            for e in client.events
            if isinstance(e.message, Positions) and e.message.move_time > 3000
        ]
        if client.on_event and late and stops:
            client.send(stops.pop())

    monkeypatch.setattr(Client, "_take", stopping)
    said = framestep("run 1 24 --preroll-ms 200", status=7)
    assert "the run ended at frame" in said
    assert "before 24: another program or a soft limit stopped it" in said
