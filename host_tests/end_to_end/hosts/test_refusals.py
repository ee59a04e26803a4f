"""A refused request changes nothing, neither in what the controller keeps nor in what it does
next."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.client.wire import encode
from host_tests.end_to_end.session import DIALECTS, run_request, simulated, state
from host_tests.protocol.notes import table

pytestmark = pytest.mark.needs("inside")

MOVE = {1: [100 + 60 * i for i in range(25)], 2: [abs(40 * (i - 12)) for i in range(25)]}


def prepared(dialect="spec"):
    """Return a rig with limits, speeds, an upload, and a run that waits for GO."""
    rig = simulated({"dialect": dialect})
    for motor in MOVE:
        rig.speed(motor, 15000, 90_000).accept(p.MotorSetLimits(motor, 1, -5000, 1, 5000))
    rig.accept(p.MotorConfigure(6, 0), p.MotorResetPosition(7, 2**30 + 5))
    rig.upload(MOVE, start_frame=5)
    rig.ready(run_request(24, 5, 29))
    return rig


# ---- lengths -------------------------------------------------------------------------------------

# The notes' table, by number. VIRT_CONFIG has a form for each type
# (../virtual_axes/test_moves.py), and framestep's own take any length.
LENGTHS = {
    row.number: row
    for row in table().values()
    if row.asked and row.number < 0x4600 and row.number != m.MSG_VIRT_CONFIG
}
TRIED = (*range(48), 93, 97, 200, 577, 581, 1035, 1036)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_wrong_lengths(dialect):
    """Field note 1.8: 0x14 for each length that is too short or uneven, without any change."""
    rig = prepared(dialect)
    handled = set(rig.board._board.controller.handlers)
    assert {
        0x0001, *range(0x0020, 0x0024), *range(0x0030, 0x003A), *range(0x0100, 0x0105),
    } <= handled  # fmt: skip
    assert {*range(0x0110, 0x0114), 0x0115, 0x0116, 0x0120} <= handled
    before = state(rig)
    asked = 0
    for kind in LENGTHS:
        wrong = [length for length in TRIED if not LENGTHS[kind].fits(length)]
        expected = p.Ack.ERR_RANGE if kind in handled else p.Ack.ERR_UNSUPPORTED
        data = b"".join(
            encode(kind, bytes(i % 7 for i in range(length)), 1 + length) for length in wrong
        )
        answers = {f.id: f for f in rig.bytes_for(data, 0.2)}
        assert sorted(answers) == [1 + length for length in wrong]
        asked += len(wrong)
        for frame in answers.values():
            assert frame.type == kind | m.MSG_FLAG_ACK, f"type {kind:#06x}, {frame.id - 1} bytes"
            assert p.Ack.unpack(frame.payload) == expected, (
                f"type {kind:#06x}, {frame.id - 1} bytes"
            )
    assert asked > 300
    assert state(rig) == before
    assert rig.moving == []


LONGER = [
    (p.Ack.OK, p.MotorStop(3)),
    (p.Ack.OK, p.MotorStopAll()),
    (p.Ack.OK, p.MotorStopAll(1)),
    (p.Ack.OK, p.MotorResetPosition(3, -70)),
    (p.Ack.OK, p.MotorJog(3, 5000, 900)),
    (p.Ack.OK, p.MotorConfigure(5, 3)),
    (p.Ack.OK, p.MotorSetSpeed(5, 900, 7000)),
    (p.Ack.OK, p.MotorSetLimits(5, 1, -4, 1, 5)),
    (p.Ack.ERR_RANGE, p.MotorSetSpeed(1, 0, 7)),
    (p.Ack.OK, p.GioOut(0)),
    (p.Ack.OK, p.GioCam(0)),
    (p.Ack.OK, p.RtPositionFrame(7)),
    (p.Ack.OK, p.RtJogAll(24000, 9)),
    (p.Ack.OK, p.RtUploadMoveEnd()),
    (p.Ack.OK, p.RtUploadMoveBegin(1, 9)),
]


def settings_of(rig):
    kept = (
        ".flags", ".velocity", ".acceleration", ".bounds", ".store.state", ".store.start",
        ".store.end",
    )  # fmt: skip
    return {path: value for path, value in state(rig).items() if path.endswith(kept)}


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("more", [1, 2, 3, 4, 9, 40, 1000])
def test_longer_than_known(dialect, more):
    """Field note 1.8: a fixed layout with more bytes is accepted, and any further bytes are
    ignored."""
    plain, longer = (simulated({"dialect": dialect}) for _ in range(2))
    answers = []
    for rig, tail in ((plain, b""), (longer, bytes(range(200, 256)) * 20)):
        for motor in MOVE:
            rig.speed(motor, 15000, 90_000)
        rig.upload(MOVE, start_frame=5)
        for kind in (m.MSG_HI, m.MSG_MOTOR_STATUS, m.MSG_MOTOR_GET_POSITION, m.MSG_GIO_IN):
            answers.append(rig.answer_to(kind, tail[:more]).payload)
        for code, request in LONGER:
            rig.run(1.1)  # away from the STOP_ALL before
            rig.wait_idle()
            frame = rig.answer_to(request.TYPE, request.pack() + tail[:more])
            assert frame.is_ack, request
            assert p.Ack.unpack(frame.payload) == code, request
        rig.wait_idle()
    assert answers[:4] == answers[4:]
    assert longer.positions == plain.positions
    assert settings_of(longer) == settings_of(plain)


def test_run_move_between_its_forms():
    """Field note 1.8: a RUN_MOVE of 30 bytes counts as 29 bytes; one of 32 to 34 has flags and no
    angles, longer ones have all."""
    rig = prepared()
    run = rig.board._board.controller.moves.run
    whole = p.RtRunMove(**RUN, flags=0x22, open_angle=10, close_angle=300).pack()
    for length, flags, angles in (
        (29, 0, None), (30, 0, None), (31, 0x22, None), (32, 0x22, None), (34, 0x22, None),
        (35, 0x22, (10, 300)), (36, 0x22, (10, 300)), (90, 0x22, (10, 300)),
    ):  # fmt: skip
        rig.wait_idle()
        frame = rig.answer_to(m.MSG_RT_RUN_MOVE, (whole + bytes([255] * 90))[:length])
        assert p.Ack.unpack(frame.payload) == p.Ack.OK
        plan = run.plan
        assert (plan.loops, plan.stills, plan.turns, plan.video) == (
            flags != 0, flags != 0, False, False,
        ), length  # fmt: skip
        assert ((run.plan.open_angle, run.plan.close_angle) == (10, 300)) == bool(angles), length


@pytest.mark.parametrize(
    "kind", [0x0000, 0x0002, 0x003A, 0x0114, 0x0204, 0x0300, 0x7FFF, 0x8031, 0xFFFF]
)
def test_unknown_types(kind):
    """Field note 1.7: 0x13 whatever the length; an acknowledgement is no request."""
    rig = prepared()
    before = state(rig)
    for length in (0, 1, 5, 1036):
        frames = [f for f in rig.bytes_for(encode(kind, bytes(length), 9)) if f.id == 9]
        assert [(f.type, p.Ack.unpack(f.payload)) for f in frames] == [
            (kind | 0x8000, p.Ack.ERR_UNSUPPORTED)
        ]
    assert state(rig) == before


# ---- the state ----------------------------------------------------------------------------------

RUN = dict(fps_milli=24000, start_frame=5, end_frame=29, preroll_ms=500, postroll_ms=500)
FAR = 2**31 - 1

# A rig from prepared() refuses these for their contents
ALWAYS = [
    (p.Ack.ERR_RANGE, p.MotorMove(0, 5)),
    (p.Ack.ERR_RANGE, p.MotorMove(9, 5)),
    (p.Ack.ERR_GENERAL, p.MotorMove(6, 5)),
    (p.Ack.ERR_RANGE, p.MotorStop(0)),
    (p.Ack.ERR_RANGE, p.MotorStop(9)),
    (p.Ack.ERR_RANGE, p.MotorResetPosition(0, 1)),
    (p.Ack.ERR_RANGE, p.MotorJog(3, 0, 1)),
    (p.Ack.ERR_RANGE, p.MotorJog(3, 10001, 1)),
    (p.Ack.ERR_GENERAL, p.MotorJog(6, 100, 1)),
    (p.Ack.ERR_RANGE, p.MotorConfigure(9, 1)),
    (p.Ack.ERR_RANGE, p.MotorSetSpeed(1, 0, 7)),
    (p.Ack.ERR_RANGE, p.MotorSetSpeed(1, 2**31, 7)),
    (p.Ack.ERR_RANGE, p.MotorSetSpeed(9, 100, 7)),
    (p.Ack.ERR_RANGE, p.MotorSetLimits(1, 1, 5, 1, 4)),
    (p.Ack.ERR_RANGE, p.MotorSetLimits(1, 3, 4, 1, 5)),
    (p.Ack.ERR_RANGE, p.MotorSetLimits(1, 1, 4, 1, 5, limit_set=9)),
    (p.Ack.ERR_RANGE, p.MotorSetLimits(9, 1, 4, 1, 5)),
    (p.Ack.ERR_RANGE, p.Dmx(2, 1, (1, 2))),
    (p.Ack.ERR_RANGE, p.Dmx(0, 0, (1, 2))),
    (p.Ack.ERR_RANGE, p.Dmx(0, 512, (1, 2))),
]
# and these while no run is in progress; after that the answer is 0x12
AT_REST = [
    (p.Ack.ERR_SOFT_UP, p.MotorMove(1, 5001)),
    (p.Ack.ERR_SOFT_LOW, p.MotorMove(2, -5001)),
    (p.Ack.ERR_RANGE, p.RtUploadMoveBegin(9, 8)),
    (p.Ack.ERR_RANGE, p.RtUploadMoveBegin(1, FAR)),
    (p.Ack.ERR_GENERAL, p.RtUploadMoveAxis(1, 0, (9, 9))),
    (p.Ack.ERR_GENERAL, p.RtUploadMoveDmx(1, 0, (9, 9))),
    (p.Ack.ERR_GENERAL, p.RtUploadMoveTriggers(1, (p.Trigger(0, 1),))),
    (p.Ack.ERR_RANGE, p.RtPositionFrame(4)),
    (p.Ack.ERR_RANGE, p.RtPositionFrame(30)),
    (p.Ack.ERR_RANGE, p.RtRunMove(**RUN | {"fps_milli": 0})),
    (p.Ack.ERR_RANGE, p.RtRunMove(**RUN | {"fps_milli": 2**31})),
    (p.Ack.ERR_RANGE, p.RtRunMove(**RUN | {"start_frame": 4})),
    (p.Ack.ERR_RANGE, p.RtRunMove(**RUN | {"end_frame": 30})),
    (p.Ack.ERR_RANGE, p.RtRunMove(**RUN | {"fps_milli": 200_001})),
    (p.Ack.ERR_RANGE, p.RtRunMove(**RUN | {"sync_dmx": 2})),
    (p.Ack.ERR_RANGE, p.RtRunMove(**RUN | {"bloop_channel": 513})),
    (p.Ack.ERR_RANGE, p.RtRunMove(**RUN | {"flags": 0x80})),
    (p.Ack.ERR_RANGE, p.RtRunMove(**RUN | {"flags": 0x20, "open_angle": 0, "close_angle": 361})),
    (p.Ack.ERR_PREROLL, p.RtRunMove(**RUN | {"preroll_ms": 20_000})),
    (p.Ack.ERR_POSTROLL, p.RtRunMove(**RUN | {"postroll_ms": 20_000})),
    (p.Ack.ERR_PREROLL, p.RtRunMove(**RUN | {"preroll_ms": 1})),
    (p.Ack.ERR_RANGE, p.RtShootFrame(40, 1, 500, 500)),
    (p.Ack.ERR_RANGE, p.RtShootFrame(10, 2, 500, 500)),
    (p.Ack.ERR_RANGE, p.RtShootFrame2(40, 500, 0, 360)),
    (p.Ack.ERR_RANGE, p.RtShootFrame2(10, 500, 0, 360, (p.BlurMotor(9, 1, 2),))),
    (p.Ack.ERR_RANGE, p.RtJogAll(24000, 40)),
    (p.Ack.ERR_RANGE, p.RtJogAll(0, 10)),
    (p.Ack.ERR_NOT_IN_POSITION, p.RtJogAll(24000, 10)),
]
RUNNING = [
    p.MotorMove(1, 0),
    p.MotorJog(2, 100, 0),
    p.MotorResetPosition(2, 0),
    p.MotorConfigure(1, 0),
    p.RtUploadMoveBegin(1, 9),
    p.RtUploadMoveAxis(1, 0, (5, 6)),
    p.RtUploadMoveDmx(1, 0, (5, 6)),
    p.RtUploadMoveTriggers(1, (p.Trigger(0, 1),)),
    p.RtUploadMoveEnd(),
    p.RtPositionFrame(9),
    p.RtRunMove(**RUN),
    p.RtShootFrame(9, 1, 500, 500),
    p.RtShootFrame2(9, 500, 0, 360),
    p.RtGo(),
    p.RtJogAll(24000, 9),
]


def test_refusals_leave_everything_as_it_was():
    rig = prepared()
    before = state(rig)
    assert len(before) > 300
    for code, request in ALWAYS + AT_REST:
        rig.refuse(code, request)
        changed = {path for path, value in state(rig).items() if before.get(path) != value}
        assert not changed, request
    rig.accept(p.MotorSetSpeed(1, 15001, 90_000))
    assert state(rig) != before


def in_an_upload():
    rig = simulated()
    rig.accept(
        p.RtUploadMoveBegin(1, 10),
        p.RtUploadMoveAxis(1, 0, (1, 2, 3)),
        p.RtUploadMoveAxis(3, 5, (7,)),
    )
    return rig


def test_refusals_within_an_upload():
    """Field note 5.3: the upload stays as it was before that message."""
    rig = in_an_upload()
    before = state(rig)
    for code, request in (
        (p.Ack.ERR_RANGE, p.RtUploadMoveAxis(1, 10, (1,))),
        (p.Ack.ERR_RANGE, p.RtUploadMoveAxis(1, 11, (1, 2))),
        (p.Ack.ERR_RANGE, p.RtUploadMoveAxis(0, 0, (1,))),
        (p.Ack.ERR_RANGE, p.RtUploadMoveAxis(9, 0, (1,))),
        (p.Ack.ERR_RANGE, p.RtUploadMoveAxis(2, 0x7FFF_FFFF, (1,))),
        (p.Ack.ERR_RANGE, p.RtUploadMoveDmx(513, 0, (1,))),
        (p.Ack.ERR_RANGE, p.RtUploadMoveDmx(1, 10, (1,))),
        (p.Ack.ERR_RANGE, p.RtUploadMoveTriggers(1, (p.Trigger(10, 1), p.Trigger(0, 1)))),
        (p.Ack.ERR_RANGE, p.RtUploadMoveTriggers(1, (p.Trigger(0, 1), p.Trigger(2**32 - 1, 1)))),
        (p.Ack.ERR_RANGE, p.RtUploadMoveBegin(1_000_001, 1_000_002)),
        (p.Ack.ERR_RANGE, p.RtUploadMoveBegin(3, 2)),
        (p.Ack.ERR_GENERAL, p.RtPositionFrame(1)),
        (p.Ack.ERR_GENERAL, run_request(24, 1, 2)),
        (p.Ack.ERR_GENERAL, p.RtGo()),
        (p.Ack.ERR_GENERAL, p.RtShootFrame(1, 1, 500, 500)),
        (p.Ack.ERR_GENERAL, p.RtJogAll(24000, 1)),
    ):
        rig.refuse(code, request)
        assert state(rig) == before, request


ANY = st.one_of(
    st.integers(0, 12),
    st.sampled_from((24000, 2**31 - 1, 2**31, 2**32 - 1, 5, 29, 30, 500)),
    st.binary(max_size=4),
)


@st.composite
def requests(draw):
    """Draw a frame of any type, mostly of a valid length, whose numbers sometimes make sense."""
    kind = draw(st.sampled_from(sorted(LENGTHS)))
    least, entry = draw(st.sampled_from(LENGTHS[kind].asked))
    length = least + entry * draw(st.integers(0, 9))
    parts = [
        v if isinstance(v, bytes) else struct.pack("<I", v)[: draw(st.sampled_from((1, 2, 4)))]
        for v in draw(st.lists(ANY, max_size=12))
    ]
    return kind, (b"".join(parts) + bytes(length))[:length]


@settings(max_examples=30)
@given(st.lists(requests(), min_size=3, max_size=20), st.booleans())
def test_whatever_is_refused_changes_nothing(frames, waiting):
    """Any sequence: after each refused request the controller keeps what it kept before."""
    rig = prepared() if waiting else in_an_upload()
    for kind, payload in frames:
        rig.client.wait_idle(60, poll_s=1.0)
        rig.run(1.2)  # until reports, inputs and the time of a second STOP_ALL are over
        rig.client.events.clear()
        before = state(rig)
        answers = [f for f in rig.bytes_for(encode(kind, payload, 5), 0.003) if f.id == 5]
        assert len(answers) == 1
        if answers[0].is_ack and p.Ack.unpack(answers[0].payload) != p.Ack.OK:
            changed = {path for path, value in state(rig).items() if before.get(path) != value}
            assert not changed, (hex(kind), payload)
        rig.port.channel.receive(encode(m.MSG_MOTOR_STOP_ALL))


# ---- what happens --------------------------------------------------------------------------------


def session_with(refusals):
    """Play a session at fixed times; `refusals`: in between, send everything that must be
    refused."""
    rig = simulated()

    def wait_until(seconds):
        rig.run(max(0.0, seconds - rig.now - 1e-6))
        rig.board.run_until(round(seconds * 1e9))

    def at(seconds, *requests):
        wait_until(seconds)
        rig.accept(*requests)

    def bother(seconds, refused):
        for i, (code, request) in enumerate(refused):
            wait_until(seconds + 0.004 * i)  # without them as well, for the same passes
            if refusals:
                rig.refuse(code, request)

    def moving(requests):
        return [(p.Ack.ERR_MOVING, request) for request in requests]

    at(0.1)
    for motor in MOVE:
        rig.accept(
            p.MotorSetSpeed(motor, 15000, 90_000), p.MotorSetLimits(motor, 1, -5000, 1, 5000)
        )
    rig.accept(p.MotorConfigure(6, 0))
    rig.upload(MOVE, start_frame=5)
    bother(
        0.5, ALWAYS + [refusal for refusal in AT_REST if refusal[0] != p.Ack.ERR_NOT_IN_POSITION]
    )
    at(1.0, p.RtRunMove(**RUN))
    bother(
        1.01,
        ALWAYS
        + [(p.Ack.ERR_NOT_IN_POSITION, p.RtGo())]
        + moving([p.RtRunMove(**RUN), p.MotorResetPosition(1, 5)]),
    )
    bother(2.0, ALWAYS + AT_REST)
    at(3.0, p.RtGo())
    disturbing = {type(request) for request in RUNNING} - {p.RtJogAll}
    bother(
        3.1,
        moving(RUNNING)
        + ALWAYS
        + [(p.Ack.ERR_MOVING, r) for _, r in AT_REST if type(r) in disturbing],
    )
    at(6.0)
    bother(6.0, ALWAYS + [(p.Ack.ERR_GENERAL, p.RtGo())])
    at(6.5, p.MotorJog(1, 10000, FAR), p.MotorMove(2, -5000))
    bother(
        6.6,
        ALWAYS
        + [
            (p.Ack.ERR_SOFT_UP, p.MotorMove(1, 5001)),
            (p.Ack.ERR_MOVING, p.MotorResetPosition(1, 0)),
        ],
    )
    at(9.0, p.RtPositionFrame(20))
    at(11.0)
    said = [
        (round(e.time_s, 6), e.message)
        for e in rig.client.events
        if isinstance(e.message, p.Positions | p.RtEnd)
    ]
    return {
        signal: (times.tolist(), values.tolist())
        for signal, (times, values) in rig.trace().signals.items()
    }, said


def test_refusals_leave_no_trace_on_the_pins():
    """Edge by edge and report by report the session is the same with and without two hundred
    refused requests."""
    edges, said = session_with(refusals=False)
    assert len(edges["m1"][0]) > 5000
    assert len(edges["m2"][0]) > 5000
    assert sum(isinstance(message, p.RtEnd) for _, message in said) == 1
    bothered_edges, bothered_said = session_with(refusals=True)
    assert bothered_edges == edges
    assert bothered_said == said
