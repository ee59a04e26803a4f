"""The client against a scripted device with its own clock."""

from collections import deque

import numpy as np
import pytest

from framestep.protocol import messages
from framestep_tools import payloads as p
from framestep_tools.client.client import (
    Client,
    ClientError,
    NoAnswer,
    RequestRefused,
    upload_requests,
)
from framestep_tools.client.wire import FrameDecoder, encode

INFO = p.DeviceInfo("fake", 1, 2, 3, 8, 512, 4, 4, 0, 10_000, 3, 2)


class FakeDevice:
    """A port whose device answers each request with the result of `script`.

    The script returns pieces to send: bytes for at once, or (seconds, bytes) for later. Time passes
    only in reads.
    """

    def __init__(self, script=lambda frame, request: ()):
        self.script = script
        self.timeout = None
        self.now = 0.0
        self.requests = []
        self.unanswered = 0
        self.most_unanswered = 0
        self._decoder = FrameDecoder()
        self._queue = deque()  # (time, bytes)
        self._arrived = bytearray()
        self.closed = False

    def clock(self):
        return self.now

    def send(self, data, after=0.0):
        self._queue.append((self.now + after, data))

    def write(self, data):
        for frame in self._decoder.feed(data):
            request = p.REQUESTS[frame.type].unpack(frame.payload)
            self.requests.append((frame.id, request))
            self.unanswered += 1
            self.most_unanswered = max(self.most_unanswered, self.unanswered)
            for piece in self.script(frame, request) or ():
                after, piece = piece if isinstance(piece, tuple) else (0.0, piece)
                self.send(piece, after)
        return len(data)

    def _arrive(self):
        while self._queue and self._queue[0][0] <= self.now:
            self._arrived += self._queue.popleft()[1]
            self.unanswered -= 1

    def read(self, size=1):
        self._arrive()
        if len(self._arrived) < size and self.timeout:
            end = self.now + self.timeout
            while len(self._arrived) < size and self._queue and self._queue[0][0] <= end:
                self.now = max(self.now, self._queue[0][0])
                self._arrive()
            if len(self._arrived) < size:
                self.now = end
        data = bytes(self._arrived[:size])
        del self._arrived[:size]
        return data

    def close(self):
        self.closed = True


def ack(frame, code=p.Ack.OK, size=2):
    return encode(frame.type | messages.MSG_FLAG_ACK, int(code).to_bytes(size, "little"), frame.id)


def report(message, id=0):
    return encode(message.TYPE, message.pack(), id)


def always(reply):
    return Client(FakeDevice(lambda frame, request: [reply(frame)]))


def test_typed_reply():
    client = always(lambda frame: report(INFO, frame.id))
    assert client.request(p.Hi()) == INFO
    assert client.code(p.Hi()) is p.Ack.OK


@pytest.mark.parametrize("size", [2, 4], ids=["spec", "dmc-lite"])
def test_acknowledgements_and_refusals_of_both_dialects(size):
    client = always(lambda frame: ack(frame, size=size))
    assert client.request(p.MotorStop(1)) is p.Ack.OK
    client = always(lambda frame: ack(frame, p.Ack.ERR_MOVING, size))
    with pytest.raises(
        RequestRefused, match=r"MOTOR_STOP was refused with ERR_MOVING \(0x0012\)"
    ) as refused:
        client.request(p.MotorStop(1))
    assert "something moves that must be at rest. It was MotorStop(motor=1)" in str(refused.value)
    assert refused.value.code is p.Ack.ERR_MOVING
    assert refused.value.request == p.MotorStop(1)
    assert client.code(p.MotorStop(1)) is p.Ack.ERR_MOVING
    with pytest.raises(RequestRefused):
        client.request(p.Hi())  # the client expects a typed reply, and gets a refusal


def test_motor_move_is_acknowledged_in_the_dmc_lite_dialect():
    acknowledged = always(lambda frame: ack(frame, size=4))
    assert acknowledged.request(p.MotorMove(1, 5)) == p.Moving(1)
    answered = always(lambda frame: report(p.Moving(0), frame.id))
    assert answered.request(p.MotorMove(1, 5)) == p.Moving(0)


def test_same_message_back():
    client = always(lambda frame: encode(frame.type, frame.payload, frame.id))
    assert client.request(p.SetVirtAimPoint(1, 2, 3, 4)) == p.VirtAimPoint(1, 2, 3, 4)


@pytest.mark.parametrize(
    "reply",
    [
        lambda frame: report(p.Status(0, 0), frame.id)[:-2] + b"\0\0",  # damaged: no answer at all
        lambda frame: encode(frame.type | messages.MSG_FLAG_ACK, b"\x10", frame.id),
        lambda frame: encode(frame.type, b"\0", frame.id),
        lambda frame: ack(frame),  # where the client expects data
    ],
)
def test_answers_that_are_none(reply):
    client = always(reply)
    with pytest.raises(ClientError):
        client.request(p.MotorStatus(), timeout_s=0.5)
    assert not client._waiting


def test_data_where_an_acknowledgement_is_expected():
    client = always(lambda frame: encode(frame.type, b"\1", frame.id))
    with pytest.raises(ClientError, match="MOTOR_STOP expects Ack"):
        client.request(p.MotorStop(1))


def test_silence_takes_the_time_that_was_given():
    device = FakeDevice()
    client = Client(device)
    with pytest.raises(
        NoAnswer, match=r"HI within 1\.5 s; a board's other port may be the one \(framestep ports\)"
    ):
        client.request(p.Hi(), timeout_s=1.5)
    assert device.now == pytest.approx(1.5)
    with pytest.raises(TimeoutError):  # and the default
        client.request(p.Hi())


def test_chatter_does_not_prolong_the_wait():
    device = FakeDevice()
    for i in range(100):
        device.send(report(p.Positions(i, [0])), 0.1 * i)
    client = Client(device)
    with pytest.raises(NoAnswer):
        client.request(p.Hi(), timeout_s=1.0)
    assert device.now == pytest.approx(1.0, abs=0.11)


def test_ids_count_up_and_leave_out_zero():
    client = always(lambda frame: ack(frame))
    client._next_id = 0xFFFF_FFFE
    for _ in range(4):
        client.request(p.MotorStop(1))
    assert [id for id, _ in client.port.requests] == [0xFFFF_FFFE, 0xFFFF_FFFF, 1, 2]


def test_answers_find_their_requests_in_any_order():
    held = []

    def script(frame, request):
        held.append(report(p.Status(request.TYPE and frame.id, 0), frame.id))
        return reversed(held) if len(held) == 3 else []

    client = Client(FakeDevice(script))
    ids = [client.send(p.MotorStatus()) for _ in range(3)]
    assert [client.answer_to(id).motor_bits for id in ids] == ids


def test_events_are_kept_apart_from_answers():
    device = FakeDevice(
        lambda frame, request: [
            report(p.Positions(1, [10])),
            report(p.Positions(2, [20]), frame.id),
            report(p.RtEnd()),
            encode(0x7777, b"??"),
        ]
    )
    client = Client(device)
    heard = []
    client.on_event = heard.append
    assert client.request(p.MotorGetPosition()).steps == (20,)
    client.pump()
    assert [event.message for event in client.events][:2] == [p.Positions(1, (10,)), p.RtEnd()]
    assert client.events[2].message.type == 0x7777
    assert heard == list(client.events)
    assert client.stray == 0


def test_a_late_answer_is_stray():
    device = FakeDevice(lambda frame, request: [(1.0, report(INFO, frame.id))])
    client = Client(device)
    with pytest.raises(NoAnswer):
        client.request(p.Hi(), timeout_s=0.5)
    client.pump(1.0)
    assert client.stray == 1
    assert not client.events


def test_wait_event_takes_the_oldest_that_fits():
    device = FakeDevice()
    client = Client(device)
    for i in range(4):
        device.send(report(p.InputLevels(i)), 0.1 * i)
    device.send(report(p.RtEnd()), 0.35)
    assert client.wait_event(p.RtEnd) == p.RtEnd()
    found = client.wait_event(p.InputLevels, where=lambda levels: levels.levels == 2)
    assert found == p.InputLevels(2)
    assert [event.message.levels for event in client.events] == [0, 1, 3]
    assert client.take_event(p.RtEnd) is None
    with pytest.raises(NoAnswer, match=r"no RtEnd came within 0\.5 s"):
        client.wait_event(p.RtEnd, timeout_s=0.5)


def test_events_carry_the_time_of_the_port():
    device = FakeDevice()
    client = Client(device)
    device.send(report(p.RtEnd()), 0.25)
    client.pump(1.0)
    assert client.events[0].time_s == pytest.approx(0.25)
    assert device.now == pytest.approx(1.0)


def test_wait_idle_polls_until_nothing_moves():
    left = [p.Status(3, 0), p.Status(1, 0), p.Status(0, 1), p.Status(0, 0)]
    client = always(lambda frame: report(left.pop(0), frame.id))
    client.wait_idle()
    assert len(client.port.requests) == 4
    busy = always(lambda frame: report(p.Status(5, 0), frame.id))
    with pytest.raises(NoAnswer, match=r"still moving after 2 s: motors \[1, 3\]"):
        busy.wait_idle(timeout_s=2)
    assert busy.port.now == pytest.approx(2, abs=0.1)


# ---- upload


def test_upload_comes_in_sections_that_fit_the_device():
    rng = np.random.default_rng(1)
    move = {1: rng.integers(-(2**31), 2**31, 700), 3: rng.integers(-100, 100, 10)}
    requests = list(upload_requests(101, 800, move))
    assert requests[0] == p.RtUploadMoveBegin(101, 800)
    assert requests[-1] == p.RtUploadMoveEnd()
    assert max(len(r.pack()) for r in requests) <= messages.LARGEST_PAYLOAD
    for motor, steps in move.items():
        mine = [r for r in requests if isinstance(r, p.RtUploadMoveAxis) and r.motor == motor]
        last = [bool(r.start_index & p.LAST_SECTION) for r in mine]
        assert last == [False] * (len(mine) - 1) + [True]
        rebuilt = np.zeros(len(steps), np.int64)
        for r in mine:
            index = r.start_index & ~p.LAST_SECTION
            rebuilt[index : index + len(r.positions)] = r.positions
        assert np.array_equal(rebuilt, steps)


@pytest.mark.parametrize("window", [1, 2, 5])
def test_the_window_bounds_what_is_on_its_way(window):
    device = FakeDevice(lambda frame, request: [(0.01, ack(frame))])
    Client(device).upload_move(1, 1000, {1: range(1000), 2: range(1000)}, window)
    assert device.most_unanswered == window
    assert len(device.requests) == 2 + 2 * 4


def test_a_refused_section_ends_the_upload():
    def script(frame, request):
        bad = isinstance(request, p.RtUploadMoveAxis) and request.start_index == 50
        return [(0.01, ack(frame, p.Ack.ERR_RANGE if bad else p.Ack.OK))]

    device = FakeDevice(script)
    client = Client(device)
    with pytest.raises(RequestRefused) as refused:
        client.upload_move(1, 1000, {1: range(1000)}, window=3, section_bytes=205)
    assert refused.value.request.start_index == 50
    assert 3 <= len(device.requests) <= 5
    assert not client._waiting  # nothing remains


def test_of_several_refusals_the_first_one_counts():
    """The later ones follow from it: "no upload has begun" does not help."""
    device = FakeDevice(lambda frame, request: [(0.01, ack(frame, p.Ack.ERR_RANGE))])
    with pytest.raises(RequestRefused) as refused:
        Client(device).upload_move(1, 1000, {1: range(1000)}, window=4, section_bytes=205)
    assert isinstance(refused.value.request, p.RtUploadMoveBegin)


@pytest.mark.parametrize(
    ("positions", "section_bytes"), [({1: [1, 2, 3]}, 1036), ({1: []}, 1036), ({1: [1]}, 8)]
)
def test_uploads_that_cannot_be(positions, section_bytes):
    with pytest.raises(ValueError):
        list(upload_requests(1, 2, positions, section_bytes))


def test_leaving_closes_the_port():
    with always(lambda frame: ack(frame)) as client:
        assert not client.port.closed
    assert client.port.closed
