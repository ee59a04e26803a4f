"""Each clock of the processor on the emulated board: everything that counts cycles keeps its time,
and the core's voltage is raised before the clock."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_emulator import Emulator
from framestep_tools.building import images
from framestep_tools.building.board_files import board_data
from framestep_tools.payloads import Ack, Dmx, GetCondition, HardStop, MotorMove, MotorSetSpeed
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.test_io import Wire, check_timing
from host_tests.end_to_end.runs.moves import FRAMES, MOVE, assert_played
from host_tests.end_to_end.session import Session, run_request
from host_tests.selection import sweep

STUCK = """
import framestep.hal.rp2.pins as pins
from machine import enable_irq
from time import ticks_diff, ticks_ms
pins.held = lambda: True
for _ in range(2):
    begun = ticks_ms()
    enable_irq(pins.free())
    print(ticks_diff(ticks_ms(), begun))
"""
VREG_1_15_V = 0xC1  # EN, and VSEL of 1.15 V: RP2040 datasheet 2.10.6


@pytest.mark.parametrize("mhz", sweep([125, 150, 200], 125))
def test_runs_and_lights_at_each_clock(mhz):
    with EmulatedBoard({"clock_mhz": mhz, "motors": [{}, {"pulse_us": 24}]}) as board:
        session = Session(board)
        assert board.emulator.cycles()["hz"] == mhz * 1e6
        for motor in range(1, 9):
            session.speed(motor, 20_000, 100_000)
        session.upload(MOVE)
        before = session.play(run_request(24, 1, FRAMES, 700, 300))
        assert_played(session, before, MOVE, 24)
        wire = Wire(board)
        levels = bytes((7 * c + 3) & 0xFF for c in range(512))
        session.accept(Dmx(0, 1, list(levels))).run(0.1)
        wire.emulator.trace_read()
        session.run(0.1)
        frames = wire.frames(wire.emulator.trace_read())
        check_timing(frames)
        for frame in frames:
            assert frame[3] == b"\0" + levels


@pytest.mark.parametrize("mhz", sweep([125, 150, 200], 200))
def test_pulses_and_pauses_are_no_shorter_than_asked(mhz):
    """A driver may miss a shorter one, and nothing would show that."""
    pulses = (0.25, 0.5, 1.0, 1.9, 4.0, 7.5, 30, 50)
    motors = [{"pulse_us": us, "setup_us": 3 * us, "hold_us": us} for us in pulses]
    with EmulatedBoard({"clock_mhz": mhz, "motors": motors}, trace=False) as board:
        emulator = board.emulator
        session = Session(board)
        emulator.trace_start(board.pins.pins)
        for target in (50, 0):
            session.accept(*(MotorMove(motor, target) for motor in range(1, 9)))
            session.run(0.03)  # it turns in motion
        session.wait_idle()
        edges = emulator.trace_read()
        for motor, us in enumerate(pulses):
            step = edges[edges["pin"] == board.pins.step[motor]][1:]
            high = step["t"][step["level"] == 0] - step["t"][step["level"] == 1]
            assert len(high) > 50
            assert us * 1000 - 1 <= high.min() <= high.max() < us * 1000 + 700, us
            turns = edges[edges["pin"] == board.pins.dir[motor]]["t"][1:]
            rises = step["t"][step["level"] == 1]
            pauses = [rises[rises > turn].min() - turn for turn in turns if turn < rises.max()]
            assert pauses
            assert min(pauses) >= 3 * us * 1000 - 1, us
            falls = step["t"][step["level"] == 0]
            held = [turn - falls[falls < turn].max() for turn in turns if turn > falls.min()]
            assert held
            assert min(held) >= us * 1000 - 1, us


def test_long_and_short_pulses_together():
    """Motors with pulses of 30 and 0.5 µs move at once, as fast as their pulses allow: no step is
    lost, and each edge is as even as those of the others."""
    pulses = (30.0, 0.5, 30.0, 0.5)
    speeds = (16_000, 300_000, 10_000, 16_000)
    with EmulatedBoard({"motors": [{"pulse_us": us} for us in pulses]}, trace=False) as board:
        emulator = board.emulator
        session = Session(board)
        for motor, speed in enumerate(speeds, 1):
            session.accept(MotorSetSpeed(motor, speed, 10 * speed))
        emulator.trace_start(board.pins.pins)
        ways = [speed * 3 // 10 for speed in speeds]
        session.accept(*(MotorMove(motor, way) for motor, way in enumerate(ways, 1))).wait_idle()
        edges = emulator.trace_read()
    for motor, (us, speed, way) in enumerate(zip(pulses, speeds, ways, strict=True)):
        step = edges[edges["pin"] == board.pins.step[motor]][1:]
        rises = step["t"][step["level"] == 1]
        assert len(rises) == way
        high = step["t"][step["level"] == 0] - rises
        assert us * 1000 <= high.min() <= high.max() < us * 1000 + 700
        even = np.diff(rises)[way * 4 // 10 : way * 6 // 10] / 1e9
        assert even.mean() == pytest.approx(1 / speed, rel=1e-4)
        assert np.abs(even - even.mean()).max() < 0.5e-6


def test_a_driver_gets_its_time_to_wake_up():
    """From the edge of its enable pin to its first step."""
    with EmulatedBoard({"motors": [{}, {"enable_ms": 200}]}, trace=False) as board:
        emulator = board.emulator
        session = Session(board)
        enable = board_data("pico")["enable"]
        emulator.trace_start([enable, *board.pins.step])
        session.accept(MotorMove(1, 50), MotorMove(2, 50)).wait_idle()
        edges = emulator.trace_read()
    on = edges["t"][(edges["pin"] == enable) & (edges["level"] == 0)][0]
    for motor in (0, 1):
        steps = edges[(edges["pin"] == board.pins.step[motor]) & (edges["level"] == 1)]["t"]
        assert len(steps) == 50
        assert 200e6 <= steps[0] - on < 230e6


def test_voltage_is_raised():
    """A Pico's own clock is 200 MHz."""
    with Emulator(images.frozen()) as emu:
        emu.wait_usb(ports=2)
        repl = emu.repl()
        assert emu.cycles()["hz"] == 200e6
        repl.exec("import machine; from framestep.hal.rp2.clock import set_clock")
        assert repl.eval("machine.mem32[0x40064000] & 0xFF") == VREG_1_15_V
        for mhz in (125, 150, 200, 200):
            repl.exec(f"set_clock({mhz})")
            assert emu.cycles()["hz"] == mhz * 1e6
        assert repl.eval("machine.mem32[0x40064000] & 0xFF") == VREG_1_15_V


def test_the_emulated_core_stops_at_a_clock_beyond_its_voltage():
    with Emulator(images.frozen(), files={"/rig.json": b'{"clock_mhz": 125}'}) as emu:
        emu.repl().start("import machine; machine.freq(200000000)")
        emu.advance(100)
        assert "200 MHz" in emu.halted


@pytest.mark.parametrize("disturb", ["machine.freq(125000000)", "machine.lightsleep(50)"])
def test_a_program_that_changes_the_clock_causes_one_fault(disturb):
    with EmulatedBoard() as board:
        session = Session(board, reply_s=0.1)
        repl = board.emulator.repl()
        repl.exec("import machine")
        for motor in (1, 2):
            session.accept(MotorMove(motor, 20_000))
        session.run(0.3)
        repl.exec(disturb)
        session.run(3)
        assert not session.moving
        assert [message for _, message in session.events(HardStop)] == [HardStop(100)]
        session.refuse(Ack.ERR_GENERAL, MotorMove(1, 0))
        assert session.ask(GetCondition()).bits & m.CONDITION_CLOCK
        said = repl.unasked()
        assert "framestep: a program changed the processor's clock; the motors were" in said
        assert "motor 1" in repl.exec("import framestep.repl; status()")
        repl.exec("machine.freq(200000000)")
        session.run(0.3)
        assert not session.ask(GetCondition()).bits & m.CONDITION_CLOCK
        session.forget()
        before = session.made(1)
        session.accept(MotorMove(1, session.position(1) + 500)).wait_idle()
        assert session.made(1) - before == 500
        assert session.events(HardStop) == []


def test_a_pin_that_usb_does_not_let_go_of_is_reported():
    with EmulatedBoard(trace=False) as board:
        said = board.emulator.repl().exec(STUCK)
        text, first, second = said.splitlines()
        assert text == "framestep: USB does not let go of GPIO 15, so do not use that pin"
        assert 50 <= int(first) < 60
        assert int(second) < 2, "it has given up"
