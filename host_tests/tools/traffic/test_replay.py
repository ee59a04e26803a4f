"""Logs of traffic: written, read, played to a simulated board in virtual time, compared."""

import io
import os
import re
from dataclasses import replace as replaced

import pytest

from framestep.protocol.messages import MSG_FLAG_ACK
from framestep_tools import cli
from framestep_tools import payloads as p
from framestep_tools.client.client import Client, NoAnswer
from framestep_tools.client.wire import Frame, encode
from framestep_tools.errors import ToolError
from framestep_tools.simulator.boards import LockstepPort, SimulatedBoard
from framestep_tools.simulator.serve import PtyLink
from framestep_tools.traffic import replay
from framestep_tools.traffic.compare import Rules, differences, names_known
from framestep_tools.traffic.log import (
    CLOSE,
    DEVICE,
    HOST,
    OPEN,
    Entry,
    LogError,
    LogWriter,
    Recorder,
    line_of,
    parse,
    read,
)
from framestep_tools.traffic.sniffer import Relay, describe, describe_entry
from host_tests.tools.client.test_client import FakeDevice
from host_tests.tools.simulator.test_serve import serving, tcp_url

DAMAGED = encode(p.Hi.TYPE, b"", 77)[:-1] + b"\x55"


class Listening(LockstepPort):
    """A board's port with a listener."""

    def __init__(self, board, recorder):
        super().__init__(board)
        self.recorder = recorder
        recorder.port(True)

    def read(self, size=1):
        data = super().read(size)
        self.recorder.passed(DEVICE, data)
        return data

    def write(self, data):
        self.recorder.passed(HOST, data)
        return super().write(data)

    def close(self):
        super().close()
        self.recorder.port(False)


def session(board):
    """Return the log of a host's session: moves, a refusal, a damaged frame, an uploaded run."""
    entries = []
    recorder = Recorder(entries.append, lambda: board.now_ns * 1e-9)
    with Client(Listening(board, recorder)) as client:
        client.greet()
        client.request(p.MotorSetSpeed(1, 20000, 100000))
        client.request(p.MotorMove(1, 3000))
        client.pump(0.1)
        client.request(p.MotorGetPosition())  # under way
        client.wait_idle()
        client.request(p.MotorGetPosition())
        client.code(p.MotorMove(99, 1))
        client.port.write(DAMAGED)
        client.pump(0.05)
        client.upload_move(1, 12, {1: [3000 + 40 * i for i in range(12)]})
        client.request(p.RtRunMove(24000, 1, 12, 500, 500))
        client.wait_idle()
        client.request(p.RtGo())
        client.wait_event(p.RtEnd, 10)
        client.wait_idle()
        client.request(p.MotorGetPosition())
    return entries


@pytest.fixture(scope="module")
def log():
    with SimulatedBoard({}, 2) as board:
        return session(board)


def played(log, rig=None, motors=2, **options):
    with SimulatedBoard(rig or {}, motors) as board:
        return replay.Replay(log, lambda: LockstepPort(board), **options).play()


def asked(log, kind, nth=0):
    """Return the frame of the nth request of a kind."""
    frames = [entry.frame for entry in log if entry.who == HOST and entry.frame]
    return [frame for frame in frames if frame.type == kind.TYPE][nth]


def with_answer(log, request, payload):
    """Return the log with another payload in the answer to a request."""
    answers = [(request.id, request.type), (request.id, request.type | MSG_FLAG_ACK)]
    return [
        Entry(e.time_s, e.who, encode(e.frame.type, payload, e.frame.id))
        if e.who == DEVICE and e.frame and e.frame[:2] in answers
        else e
        for e in log
    ]


# ---- the file


@pytest.fixture
def path(log, tmp_path):
    """Return the log as a file."""
    file = io.StringIO()
    writer = LogWriter(file, "a test", describe_entry)
    for entry in log:
        writer.add(entry)
    (tmp_path / "log").write_text(file.getvalue())
    return str(tmp_path / "log")


def test_a_log_holds_every_byte(log, path):
    back = read(path)
    assert [e[1:] for e in back] == [e[1:] for e in log]
    assert all(abs(a.time_s - b.time_s) < 1e-6 for a, b in zip(back, log, strict=True))
    assert (log[0].who, log[-1].who) == (OPEN, CLOSE)
    assert DAMAGED in [entry.data for entry in log if entry.frame is None]


def test_a_log_is_read_by_people(log, path, capsys):
    assert cli.app.status(["lab", "sniff", path]) == 0
    text = capsys.readouterr().out
    assert re.match(r" +0\.0000   the host opens its port\n", text)
    assert re.search(r"^ +0\.\d{4} > +[1-9]\d*  HI$", text, re.MULTILINE)
    assert text.count("MOTOR_MOVE            ACK ERR_RANGE (0x0014)  (there is no such motor") == 1
    assert "frame with a wrong checksum among them" in text
    assert "motor_bits=1  dmx=0  (motor 1 under way)" in text
    assert "the host opens its port" in text
    end = text.splitlines()[-1]
    assert "1 times MOTOR_MOVE ERR_RANGE" in end
    assert f"{len(DAMAGED)} bytes outside frames" in end
    assert "the slowest answer after" in end
    assert (
        f"{sum(1 for e in log if e.who == HOST and e.frame)} requests, 0 without an answer" in text
    )


@pytest.mark.parametrize(
    "line", ["x open", "1.0 > 4", "2 jump", "1 >", "-1 open", "nan open", "1 open 44", "1 * 44"]
)
def test_a_line_that_is_none_is_named(line):
    with pytest.raises(LogError, match="line 2 of the log is none"):
        list(parse(["0.5 open", line]))
    with pytest.raises(LogError, match="ascending"):
        list(parse(["0.5 open", "0.4 close"]))


def test_files_that_are_no_logs(tmp_path, capsys):
    other = tmp_path / "other"
    other.write_text("hello")
    for path, text in ((other, "is not a traffic log"), (tmp_path / "none", "cannot read the log")):
        assert cli.app.status(["lab", "replay", str(path)]) == 1
        assert text in capsys.readouterr().err


def test_bytes_are_cut_into_frames_however_they_come():
    stream = b"xx" + encode(p.Hi.TYPE, b"", 1) + DAMAGED + encode(p.GioIn.TYPE, b"", 2)
    for size in (1, 3, 7, len(stream)):
        entries = []
        recorder = Recorder(entries.append, iter(range(1000)).__next__)
        for at in range(0, len(stream), size):
            recorder.passed(HOST, stream[at : at + size])
        recorder.end()
        assert b"".join(entry.data for entry in entries) == stream
        assert [entry.frame.id for entry in entries if entry.frame] == [1, 2]


def test_what_is_left_of_a_frame_is_in_the_log():
    entries = []
    recorder = Recorder(entries.append)
    recorder.port(True)
    recorder.passed(HOST, encode(p.Hi.TYPE, b"", 1)[:5])
    recorder.port(False)
    assert [entry[1:] for entry in entries] == [
        (OPEN, b""),
        (HOST, encode(p.Hi.TYPE, b"", 1)[:5]),
        (CLOSE, b""),
    ]
    assert line_of(entries[0]) == "0.000000 open"


# ---- words


@pytest.mark.parametrize(
    ("said", "by_host", "words"),
    [
        (p.HardStop(1, 2), False, "reason=1  motor=2  (stopped by an upper limit switch)"),
        (p.Status(5, 1), False, "(motor 1, motor 3, lights under way)"),
        (p.Status(0, 0), False, "(nothing moves)"),
        (p.Moving(0), False, "(it is there)"),
        (p.Positions(12500, (1,)), False, "(at frame 12.5)"),
        (p.Condition(2, (p.PositionTrust(2, 1),)), False, "positions=[2/1]  ("),
        (p.RtRunMove(24000, 1, 9, flags=3), True, "(24 frames/s; ping-pong, loop)"),
        (p.RtUploadMoveAxis(1, p.LAST_SECTION | 5, (1,)), True,
         "(from frame 5 of the move, the last of"),
        (p.MotorJog(1, 500, 9), True, "(5 % of its speed)"),
        (p.MotorConfigure(1, 0x11), True, "(on, coupled)"),
    ],
)  # fmt: skip
def test_messages_are_reported_in_words(said, by_host, words):
    assert words in describe(Frame(1, said.TYPE, said.pack()), by_host)


# ---- played again


def test_the_same_board_answers_the_same(log):
    now = played(log)
    assert list(differences(log, now, Rules())) == []
    sent = [e.data for e in log if e.who == HOST]
    assert [e.data for e in now if e.who == HOST] == sent  # including the damaged frame
    assert list(differences(log, played(now), Rules())) == []


def test_in_the_same_virtual_time_all_is_exactly_the_same(log):
    now = played(log)
    found = list(differences(log, now, Rules(exact=True, ignored=names_known(["motor_status"]))))
    assert len(found) <= 1, found  # at most the position under way


def test_another_board_is_recognised(log):
    now = played(log, {"dialect": "dmc-lite"}, 3)
    found = list(differences(log, now, Rules()))
    assert any("HI" in text and "motors=3" in text for text in found)
    assert not any("MOTOR_MOVE" in text for text in found)  # the dialects are alike there


def test_where_the_motors_were_before_does_not_matter(log):
    with SimulatedBoard({}, 2) as board:
        with Client(LockstepPort(board)) as client:
            client.request(p.MotorResetPosition(1, -7))
        for _ in range(2):  # the second time the play head is on the uploaded move
            now = replay.Replay(log, lambda: LockstepPort(board)).play()
            assert list(differences(log, now, Rules())) == []


def test_a_board_whose_limit_is_nearer_is_reported(log):
    with SimulatedBoard({}, 2) as board:
        with Client(LockstepPort(board)) as client:
            client.request(p.MotorSetLimits(1, 0, 0, 1, 2000))
        now = replay.Replay(log, lambda: LockstepPort(board), patience_s=1).play()
    found = list(differences(log, now, Rules()))
    assert "MOTOR_MOVE" in found[0]
    assert any("the last positions are" in text for text in found)


@pytest.mark.parametrize(
    ("kind", "nth", "payload", "reported"),
    [
        (p.MotorSetSpeed, 0, b"\x14\0", "OK (0x0010) instead of ACK ERR_RANGE"),
        (p.MotorMove, 1, b"\x12\0", "ERR_RANGE (0x0014) (there is no such motor"),
        (p.MotorGetPosition, 1, p.Positions(0, (2999, 0)).pack(), "instead of move_time=0 steps=["),
        (p.MotorMove, 0, b"\0", "(it moves) instead of moving=0"),
    ],
)
def test_an_answer_that_differs_is_reported(log, kind, nth, payload, reported):
    changed = with_answer(log, asked(log, kind, nth), payload)
    found = list(differences(changed, log, Rules()))
    assert len(found) == 1, found
    assert reported in found[0]
    assert p.type_name(kind.TYPE) in found[0]
    ignored = names_known(["MSG_" + p.type_name(kind.TYPE).lower()])
    assert list(differences(changed, log, Rules(ignored=ignored))) == []


def test_a_position_at_rest_may_differ_by_as_much_as_is_asked_for(log):
    request = asked(log, p.MotorGetPosition, 1)
    changed = with_answer(log, request, p.Positions(0, (2998, 0)).pack())
    assert list(differences(changed, log, Rules(steps=1)))
    assert not list(differences(changed, log, Rules(steps=2)))


def test_a_position_under_way_is_compared_by_kind(log):
    changed = with_answer(log, asked(log, p.MotorGetPosition), p.Positions(0, (5, 0)).pack())
    assert not list(differences(changed, log, Rules()))
    assert list(differences(changed, log, Rules(exact=True)))


def test_what_is_reported_unasked_is_compared(log):
    ends = [e for e in log if e.frame and e.frame.type == p.RtEnd.TYPE]
    without = [e for e in log if e not in ends]
    (found,) = differences(log, without, Rules())
    assert "unasked: nothing instead of RT_END" in found
    stop = Entry(ends[0].time_s, DEVICE, encode(p.HardStop.TYPE, p.HardStop(1, 1).pack(), 0))
    (found,) = differences(log, [stop if e in ends else e for e in log], Rules())
    assert (
        "HARD_STOP reason=1 motor=1 (stopped by an upper limit switch) instead of RT_END" in found
    )


def test_an_answer_that_is_missing_is_reported(log):
    number = asked(log, p.MotorSetSpeed).id
    without = [e for e in log if not (e.who == DEVICE and e.frame and e.frame.id == number)]
    found = differences(log, without, Rules())
    assert any("no answer instead of an answer" in text for text in found)


def test_a_log_played_faster_waits_for_the_motors(log):
    """The replay waits for what the log's host waited for, at any speed."""
    now = played(log, speed=50)
    assert list(differences(log, now, Rules())) == []
    assert now[-1].time_s < log[-1].time_s


def test_a_device_that_says_nothing_is_given_up_soon(log):
    with pytest.raises(NoAnswer, match="first request"):
        replay.Replay(log, FakeDevice).play()


def test_names_that_are_no_messages():
    with pytest.raises(ToolError, match="FLY is not a message"):
        names_known(["fly"])


# ---- between a host and a device


class Device:
    """Answers everything with ANSWER; keeps what it got, and how often it was opened and closed."""

    ANSWER = encode(p.HardStop.TYPE, p.HardStop(0).pack(), 0)

    def __init__(self):
        self.log = ["open"]
        self.timeout = None
        self.got = self._out = b""

    def open(self):
        self.log.append("open")
        return self

    def write(self, data):
        self.got += data
        self._out += self.ANSWER

    def read(self, size):
        data, self._out = self._out[:size], self._out[size:]
        return data

    def close(self):
        self.log.append("close")


def test_the_device_sees_its_host_come_and_go():
    device, link, entries = Device(), PtyLink(), []
    relay = Relay(device, device.open, link, Recorder(entries.append))
    try:
        for _ in range(2):
            fd = os.open(link.path, os.O_RDWR | os.O_NOCTTY)
            os.write(fd, encode(p.Hi.TYPE, b"", 7))
            relay.run(lambda: bool(entries) and entries[-1].who == DEVICE)
            assert os.read(fd, 100) == device.ANSWER
            os.close(fd)
            relay.step()
            relay.step()
        assert device.log == ["open", "close", "open", "close"]
        assert device.got == encode(p.Hi.TYPE, b"", 7) * 2
        assert [e.who for e in entries] == [OPEN, HOST, DEVICE, CLOSE] * 2
    finally:
        relay.close()
        link.close()


def test_the_command_plays_a_log_against_a_device(log, tmp_path, capsys):
    """Only the greeting and a question: the tests above play motion in virtual time."""
    greeting, question = encode(p.Hi.TYPE, b"", 5), encode(p.MotorGetPosition.TYPE, b"", 6)
    with serving(SimulatedBoard({}, 2), speed=None, tcp="127.0.0.1:0") as server:
        url = tcp_url(server)
        answers = []
        with Client.open(url, 100) as client:
            info = client.request(p.Hi())
        for motors, status in ((2, 0), (3, 1)):
            reported = encode(p.DeviceInfo.TYPE, replaced(info, motors=motors).pack(), 5)
            said = ((HOST, greeting), (DEVICE, reported), (HOST, question))
            lines = [line_of(Entry(0.0, who, data)) for who, data in said]
            path = tmp_path / "log"
            path.write_text("\n".join(["# framestep sniff 1", "0 open", *lines, "0 close"]))
            record = tmp_path / "record"
            args = ["lab", "replay", str(path), url, "--log", str(record)]
            args += ["--ignore", "motor_get_position"]
            assert cli.app.status(args) == status
            answers.append(capsys.readouterr())
            answer = encode(p.DeviceInfo.TYPE, info.pack(), 5)
            assert answer in [entry.data for entry in read(str(record))]
    assert answers[0].out == "2 requests replayed: no difference\n"
    assert "HI (ID 5): name=" in answers[1].out
    assert "2 requests replayed: 1 differences" in answers[1].err
