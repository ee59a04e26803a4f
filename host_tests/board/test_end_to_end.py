"""The firmware as on a board: both dialects, the REPL during a run, no allocation, one port for
both.

test_realtime.py tests how the motors move; the ports alone are the subject of test_usb_port.py
and test_stdin_port.py.
"""

import struct

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.judge.judge import judge
from framestep_tools.payloads import Ack, DeviceInfo, HardStop, MotorMove, RtEnd, RtGo
from host_tests.board.chips import on_pico
from host_tests.end_to_end.session import Session, run_request

FRAMES = 40


def move(session, motors=(1, 2, 3, 4), frames=FRAMES):
    """Return positions that begin where the motors are."""
    stands = session.positions
    k = np.arange(frames)
    return {
        motor: stands[motor]
        + np.round((100 + 150 * motor) * (1 - np.cos(2 * np.pi * k / (frames - 1)))).astype(int)
        for motor in motors
    }


def load(session, positions):
    for motor in positions:
        session.speed(motor, 20_000, 100_000)
    session.upload(positions)
    session.ready(run_request(24, 1, len(next(iter(positions.values()))), 300, 300))
    stands = session.positions
    session.forget()
    return stands


def assert_played(session, stands, positions):
    assert not session.events(HardStop)
    verdict = judge(session.trace(), positions, 24_000, stands, session.positions)
    assert verdict.good, verdict.complaints


@pytest.fixture(scope="module")
def session(chip):
    with chip.emulated() as board:
        yield Session(board, reply_s=0.1)


def assert_form(session, wide):
    ok = int(Ack.OK).to_bytes(4 if wide else 2, "little")
    for kind, payload in (
        (m.MSG_MOTOR_STOP, b"\1"),
        (m.MSG_MOTOR_STOP_ALL, b""),
        (m.MSG_MOTOR_CONFIGURE, b"\1\1"),
    ):
        answer = session.answer_to(kind, payload)
        assert answer.is_ack
        assert answer.payload == ok
    answer = session.answer_to(m.MSG_MOTOR_MOVE, struct.pack("<Bi", 2, 2**31 - 1))
    assert (answer.is_ack, answer.payload) == ((True, ok) if wide else (False, b"\1"))
    for kind, size in ((m.MSG_HI, 51), (m.MSG_MOTOR_STATUS, 5), (m.MSG_MOTOR_GET_POSITION, 36)):
        answer = session.answer_to(kind)
        assert not answer.is_ack
        assert len(answer.payload) == size
    answer = session.answer_to(m.MSG_RT_GO)
    assert answer.is_ack
    assert answer.payload == int(Ack.ERR_GENERAL).to_bytes(len(ok), "little")


@on_pico
def test_form_of_the_answers(session):
    """Field note 1.4; the next host is greeted again (1.5) by a rig that has come to rest
    (1.11)."""
    assert_form(session, wide=False)
    session.leave()
    session.board.run_until(session.board.now_ns + 10**9)
    session.come_back()
    hello = [f for f in session.bytes_for(b"", 0.1) if f.type == m.MSG_HI]
    assert len(hello) == 1
    assert DeviceInfo.unpack(hello[0].payload).name == "framestep"
    assert session.moving == []


@on_pico
@pytest.mark.repeats
def test_form_of_the_answers_in_the_other_dialect(chip):
    with chip.emulated({"dialect": "dmc-lite"}, trace=False) as board:
        assert_form(Session(board, reply_s=0.1), wide=True)


def test_repl_beside_a_run(session):
    """A program on the REPL that calculates and collects garbage disturbs neither edges nor
    answers."""
    positions = move(session)
    stands = load(session, positions)
    repl = session.board.emulator.repl()
    repl.exec("import gc, framestep.boot as boot")
    session.accept(RtGo())
    turns = 0
    while repl.eval("boot.controller.operations.running"):
        assert repl.eval("sum(i * i for i in range(100))") == 328350
        repl.exec("x = [bytearray(40) for _ in range(50)]\ngc.collect()")
        turns += 1
    assert turns >= 2
    session.client.wait_event(RtEnd, 10)
    session.run(0.1)
    assert_played(session, stands, positions)
    assert repl.eval("boot.runner.failure") is None


@pytest.mark.repeats
def test_nothing_is_allocated(session):
    """Over a whole session the heap grows by no byte, apart from the bytes for the REPL itself,
    which are measured first."""
    positions = move(session)
    repl = session.board.emulator.repl()
    repl.exec("import gc")

    def taken():
        return repl.eval("gc.mem_alloc()")

    def between(work):
        """Return the bytes allocated by work(), including garbage: nothing is collected."""
        repl.exec("gc.collect()\ngc.disable()")
        before = taken()
        work()
        after = taken()
        repl.exec("gc.enable()")
        return after - before

    def whole_session():
        stands = load(session, positions)
        session.accept(RtGo())
        session.client.wait_event(RtEnd, 10)
        session.run(0.1)
        assert_played(session, stands, positions)
        session.ask(MotorMove(1, int(positions[1][0]) - 500))
        session.run(0.2)
        session.refuse(Ack.ERR_RANGE, MotorMove(9, 2**30))
        session.wait_idle()

    whole_session()  # allocates whatever is made once
    own = between(lambda: session.run(2.0))
    assert between(whole_session) == own


@pytest.mark.repeats
def test_one_port(chip):
    """`ports: 1`: the protocol on the REPL's port. A move from upload to RT_END, then Ctrl-C
    returns to the REPL."""
    with chip.emulated({"ports": 1}) as board:
        session = Session(board)
        positions = move(session, (1, 2))
        stands = load(session, positions)
        session.accept(RtGo())
        session.client.wait_event(RtEnd, 10)
        session.run(0.1)
        assert_played(session, stands, positions)

        def typed(text):
            session.port.write(text)
            board.run_until(board.now_ns + 300_000_000)
            return board.protocol.transmit()

        assert typed(b"\r\x03").endswith(b">>> ")
        # it is an ordinary REPL: Ctrl-C ends a program, and the text of an exception in the core
        # is visible
        assert b">>> " not in typed(b"while True: pass\r\r")
        assert b"KeyboardInterrupt" in typed(b"\x03")
        typed(b"import framestep.repl\r")
        assert b"refused: framestep has been stopped" in typed(b"move(1, 5)\r")
        typed(b"import framestep.boot as b; b.controller.moves.poll = None\r")
        said = typed(b"b.runner.run(b.controller)\r")
        assert b'File "framestep/controller.py", line' in said
        assert b"TypeError" in said
        assert said.endswith(b">>> ")
        assert m.MSG_MOTOR_HARD_STOP in [frame.type for frame in FrameDecoder().feed(said)], (
            "the host is told first"
        )


@on_pico
@pytest.mark.repeats
def test_one_port_closed_within_a_frame(chip):
    """There is no DTR. The beginning of a frame from an earlier client never has an effect, nor
    does a mixture of it with later bytes: at most that is damaged. The next client's first request
    gets its answer."""
    with chip.emulated({"ports": 1}) as board:
        port = board.protocol
        left = (
            encode(m.MSG_MOTOR_MOVE, struct.pack("<Bi", 1, 500), 77),
            encode(m.MSG_DMX, bytes(300), 78),
        )
        port.open_port(True)
        for data in left:
            for cut in (1, 2, 5, 9, 10, 13, len(data) - 1):
                port.receive(data[:cut])
                board.run_until(board.now_ns + 2_000_000)
                port.open_port(False)
                board.run_until(board.now_ns + (5 + cut % 2 * 120) * 1_000_000)
                port.transmit()
                port.open_port(True)
                port.receive(encode(m.MSG_HI, b"", 1000 + cut))
                decoder, frames, end = FrameDecoder(), [], board.now_ns + 250_000_000
                while board.now_ns < end and all(frame.id != 1000 + cut for frame in frames):
                    board.run_until(board.now_ns + 5_000_000)
                    frames += decoder.feed(port.transmit())
                *before, answer = frames
                assert (answer.type, answer.id) == (m.MSG_HI, 1000 + cut)
                assert all(
                    struct.unpack("<H", frame.payload[:2]) == (m.ERR_CHECKSUM,) for frame in before
                )
        assert "m1" not in {signal for _, signal, _ in board.edges()}
