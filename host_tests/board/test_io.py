"""The emulated board: DMX decoded from the wire, pins, the E-stop and an exception in motion, with
every edge judged."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep.pulse import stepper
from framestep_tools import payloads as p
from framestep_tools.client.wire import encode
from host_tests.board.conftest import on_both, on_pico, on_pico2
from host_tests.end_to_end.session import Session, deceleration, dmx_frames, run_request

DMX_PIN, ESTOP_PIN = 0, 19
EIGHT = tuple(range(1, 9))


def session(chip, rig=None):
    board = chip.emulated(rig)
    return Session(board), board


class Wire:
    """What leaves the DMX pin."""

    def __init__(self, board):
        self.emulator = board.emulator
        self.pins = board.pins.pins
        self.emulator.trace_start([*self.pins, DMX_PIN])
        self.emulator.trace_read()

    def frames(self, records):
        """See dmx_frames."""
        mine = records[records["pin"] == DMX_PIN]
        return dmx_frames(mine["t"].astype(np.int64), mine["level"])


def test_dmx_on_the_wire(chip):
    """Standard: ANSI E1.11; 40 frames a second or more, and only complete states, whatever the
    motors do."""
    board_session, board = session(chip)
    with board:
        wire = Wire(board)
        levels = bytes((7 * c + 3) & 0xFF for c in range(512))
        board_session.accept(p.Dmx(0, 1, list(levels))).run(0.1)
        wire.emulator.trace_read()
        board_session.run(0.1)
        frames = wire.frames(wire.emulator.trace_read())
        assert len(frames) >= 3
        check_timing(frames)
        for frame in frames:
            assert frame[3] == b"\0" + levels
        # A ramp while eight motors move: each frame is one state of the lights, and they follow
        # the line
        for motor in EIGHT:
            board_session.speed(motor, 50_000, 200_000).accept(p.MotorMove(motor, 20_000))
        board_session.accept(p.Dmx(0, 1, [0] * 512)).run(0.1)
        begin = board_session.now
        board_session.accept(p.Dmx(1, 1, [250] * 512))
        wire.emulator.trace_read()
        status = []
        while board_session.now - begin < 0.6:
            status.append(board_session.ask(p.MotorStatus()))
            board_session.run(0.05)
        frames = wire.frames(wire.emulator.trace_read())
        check_timing(frames)
        assert len(frames) >= 22
        assert status[0].dmx == 1
        assert status[-1].dmx == 0
        for start, _, _, slots, _ in frames:
            assert slots[0] == 0
            line = 250 * min(1.0, max(0.0, (start * 1e-9 - begin) / 0.5))
            assert all(
                abs(level - line) <= 250 * 0.040 / 0.5 for level in (min(slots[1:]), max(slots[1:]))
            )
        assert frames[-1][3] == b"\0" + bytes([250] * 512)
        board_session.wait_idle()
        assert board_session.positions == dict.fromkeys(EIGHT, 20_000)


@on_pico2
def test_dmx_beside_eleven_motors(chip):
    """All that the pins of a Pico 2 leave room for: a twelfth motor takes the UART's pins."""
    board_session, board = session(chip, {"motor_count": 11})
    eleven = tuple(range(1, 12))
    levels = bytes(255 - channel & 0xFF for channel in range(512))
    with board:
        wire = Wire(board)
        board_session.accept(p.Dmx(0, 1, list(levels)))
        for motor in eleven:
            board_session.speed(motor, 50_000, 200_000).accept(p.MotorMove(motor, 10_000))
        board_session.run(0.1)
        wire.emulator.trace_read()
        board_session.run(0.1)
        frames = wire.frames(wire.emulator.trace_read())
        assert len(frames) >= 3
        check_timing(frames)
        assert {frame[3] for frame in frames} == {b"\0" + levels}
        board_session.wait_idle()
        assert board_session.positions == dict.fromkeys(eleven, 10_000)


def check_timing(frames):
    for _, low, mark, slots, gap in frames:
        assert 92_000 <= low <= 200_000, "break"
        assert 12_000 <= mark <= 40_000, "mark after break"
        assert len(slots) == 513
        assert gap < 1000
    periods = np.diff([frame[0] for frame in frames])
    assert periods.max() <= 25_000_000, "40 frames/s"
    assert 43.5 < 1e9 / periods.mean() < 44.5


def ramp_edges(chip, rig):
    """Return the times of the steps of four motors, and how late a tick came at worst meanwhile,
    microseconds."""
    board_session, board = session(chip, rig)
    motors = (1, 2, 3, 4)
    with board:
        for motor in motors:
            board_session.speed(motor, 50_000, 200_000)
        board_session.forget()
        if rig is None:
            board_session.accept(p.Dmx(1, 1, [250] * 512))
        board_session.accept(*(p.MotorMove(motor, 4000) for motor in motors)).wait_idle()
        look = (
            "import framestep.boot as b; "
            f"print(b.controller.axes.kernel.state[{stepper.WORST_LATE}])"
        )
        return [board_session.steps(motor)[0] for motor in motors], int(
            board.emulator.repl().exec(look)
        )


def test_ticks_are_not_delayed(chip):
    """The intervals are the same with DMX ramping on all channels as without any."""
    (with_dmx, late), (without, late_without) = (
        ramp_edges(chip, None),
        ramp_edges(chip, {"dmx": False}),
    )
    for a, b in zip(with_dmx, without, strict=True):
        assert len(a) == len(b) == 4000
        assert np.abs(np.diff(a) - np.diff(b)).max() < 100e-9
    # Planning a motion delays a tick by some 80 µs if the tick is due just then; edges move from
    # 1800 µs on.
    assert max(late, late_without) < 150


@on_both
def test_pins(chip):
    board_session, board = session(
        chip, {"outputs": [{"pin": 22, "on": "low"}, {"pin": 26}], "shutter_on": "low"}
    )
    with board:
        emulator = board.emulator

        def levels():
            return [emulator.pin(pin) for pin in (22, 26, 20, 21)]

        assert levels() == [1, 0, 1, 0]
        board_session.accept(p.GioOut(3), p.GioCam(3))
        assert levels() == [0, 1, 0, 1]
        assert board_session.ask(p.GioIn()).levels == 0
        board_session.forget()
        pressed = board_session.now
        for _ in range(5):
            for level in (0, 1):
                emulator.set_pin(27, level)
                board_session.run(0.003)
        emulator.set_pin(28, 0)
        board_session.run(0.1)
        ((reported, message),) = board_session.events(p.InputLevels)
        assert message.levels == 2
        assert reported - pressed - 0.030 < 0.030
        emulator.set_pin(28, None)
        board_session.run(0.05)
        assert board_session.events(p.InputLevels)[-1][1].levels == 0
        board_session.port.close()
        board.run_until(board.now_ns + 20_000_000)
        assert levels() == [1, 0, 1, 0]  # a lost host


@on_pico
@pytest.mark.repeats
def test_estop(chip):
    """Press it while eight motors cruise, and in the middle of a run of two."""
    board_session, board = session(chip, {"estop": "nc"})
    with board:
        board.emulator.set_pin(ESTOP_PIN, 0)
        for motor in EIGHT:
            board_session.speed(motor, 20_000, 100_000)
        board_session.run(0.05)
        start = begin(board_session)
        board_session.accept(*(p.MotorMove(motor, 100_000) for motor in EIGHT)).run(0.3)
        pressed = pull(board_session, board)
        last = []
        for motor in EIGHT:
            times, signs = stopped(board_session, motor, start)
            last.append(times[-1] - pressed)
            assert deceleration(times, signs, pressed + 0.004) == pytest.approx(400_000, rel=0.05)
            intervals = np.diff(times[times > pressed + 0.005])
            assert (np.diff(intervals) > -2e-6).all()  # slower and slower
        # two ticks of pulses are queued, and a ramp of 20 000 steps/s at 400 000 steps/s²
        assert max(last) < 0.050 + 0.004
        assert max(last) - min(last) < 10e-6  # all of them in the same tick
        assert not board_session.events(p.RtEnd)
        release(board_session, board)

        path = [0, 0, 0] + [round(2500 * (1 - np.cos(np.pi * k / 30))) for k in range(31)]
        board_session.upload({1: path, 2: path})
        board_session.accept(p.MotorMove(2, 0)).wait_idle()
        board_session.ready(run_request(end=len(path), pre=100))
        start = begin(board_session)
        board_session.accept(p.RtGo()).run(0.75)
        pressed = pull(board_session, board)
        for motor in (1, 2):
            times, _ = stopped(board_session, motor, start)
            assert 0 < times[-1] - pressed < 0.030
        assert len(board_session.events(p.RtEnd)) == 1
        release(board_session, board)


@on_pico
@pytest.mark.repeats
def test_estop_while_motors_set_off(chip):
    """Press it at many moments while a pass plans a jog, or eight motions. The host hears of the
    E-stop and of nothing else. Only motors that have begun by then make any pulses."""
    board_session, board = session(chip, {"estop": "nc", "dmx": False})
    with board:
        board.emulator.set_pin(ESTOP_PIN, 0)
        board_session.run(0.05)
        for motor in EIGHT:
            board_session.speed(motor, 20_000, 100_000)
        board_session.upload({motor: [0, 4000] for motor in EIGHT})
        for request, moments in (
            (p.MotorJog(2, 5000, -(2**31)), range(2600, 3400, 20)),
            (p.RtPositionFrame(2), range(1000, 19_000, 1500)),
        ):
            for us in moments:
                board_session.forget()
                frames = board_session.bytes_for(encode(request.TYPE, request.pack(), 9), us * 1e-6)
                pressed = board_session.now
                board.emulator.set_pin(ESTOP_PIN, 1)
                frames += board_session.bytes_for(b"", 0.06)
                stops = [frame.payload for frame in frames if frame.type == m.MSG_MOTOR_HARD_STOP]
                assert stops == [bytes((0,))], us
                for motor in EIGHT:
                    times, _ = board_session.steps(motor)
                    # two ticks of pulses were queued
                    assert not len(times) or times[0] < pressed + 0.0035, (us, motor)
                board.emulator.set_pin(ESTOP_PIN, 0)
                board_session.bytes_for(b"", 0.015)
                board_session.bytes_for(
                    encode(p.MotorStopAll.TYPE, p.MotorStopAll().pack(), 9), 0.025
                )


def begin(board_session):
    board_session.forget()
    return board_session.positions


def pull(board_session, board):
    """Press the E-stop and let half a second pass; return when it was pressed."""
    board_session.client.events.clear()
    pressed = board_session.now
    board.emulator.set_pin(ESTOP_PIN, 1)
    board_session.run(0.5)
    ((reported, message),) = board_session.events(p.HardStop)
    assert message == p.HardStop(0)
    assert reported - pressed < 0.03
    assert not board_session.moving
    return pressed


def stopped(board_session, motor, start):
    """Return times and directions of a motor's steps; the ramp down lost none."""
    times, signs = board_session.steps(motor)
    assert start[motor] + signs.sum() == board_session.position(motor)
    return times, signs


def release(board_session, board):
    board_session.refuse(m.ERR_GENERAL, p.MotorMove(1, 0), p.RtGo()).forget()
    board.emulator.set_pin(ESTOP_PIN, 0)
    board_session.run(0.2)
    assert not any(board_session.made(motor) for motor in EIGHT)  # nothing starts by itself
    assert board_session.ask(p.MotorMove(1, 0)).moving
    board_session.wait_idle()


@on_pico
def test_an_exception(chip):
    """It ends the main loop: motors ramp down, outputs go to their safe levels, and the host hears
    of it."""
    board_session, board = session(chip, {"outputs": [{"pin": 26}, {"pin": 22, "safe": "on"}]})
    with board:
        for motor in (1, 2):
            board_session.speed(motor, 10_000, 50_000)
        board_session.accept(
            p.GioOut(1), p.GioCam(1), p.MotorMove(1, 30_000), p.MotorMove(2, -30_000)
        )
        board_session.run(0.4)
        assert [board.emulator.pin(pin) for pin in (26, 22, 20)] == [1, 0, 1]
        board.emulator.repl().exec("import framestep.boot as b; b.controller.axes.feed = None")
        failed = board_session.now
        board_session.run(0.3)
        assert [message for _, message in board_session.events(p.HardStop)] == [p.HardStop(100)]
        assert [board.emulator.pin(pin) for pin in (26, 22, 20)] == [0, 1, 0]
        for motor in (1, 2):
            times, signs = board_session.steps(motor)
            assert deceleration(times, signs, times[-1] - 0.15) == pytest.approx(50_000, rel=0.1)
            assert times[-1] - failed < 0.25
        board_session.forget().run(0.3)
        assert not board_session.made(1)
        assert not board_session.made(2)
