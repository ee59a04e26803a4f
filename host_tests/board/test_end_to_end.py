"""The firmware as on a board: the REPL during a run, no allocation, one port for both.

The ports alone are the subject of test_usb_port.py and test_stdin_port.py.
"""

import struct

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.judge.judge import judge
from framestep_tools.payloads import HardStop, RtEnd, RtGo
from host_tests.board.conftest import on_pico
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
    session.until(RtEnd, 10).run(0.1)
    assert_played(session, stands, positions)
    assert repl.eval("boot.runner.failure") is None


@pytest.mark.repeats
def test_one_port(chip):
    """`ports: 1`: the protocol on the REPL's port. A move from upload to RT_END, then Ctrl-C
    returns to the REPL."""
    with chip.emulated({"ports": 1}) as board:
        session = Session(board)
        positions = move(session, (1, 2))
        stands = load(session, positions)
        session.accept(RtGo()).until(RtEnd, 10).run(0.1)
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
