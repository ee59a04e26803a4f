"""Pins that framestep has claimed stay its own, also on chips B0 and B1, whose USB takes GPIO 15 at
times.

Erratum RP2040-E5: after each bus reset the SDK's work-around switches GPIO 15 to a function of the
USB controller for a millisecond, and then restores what it had found there
(pico_fix/rp2040_usb_device_enumeration). On the emulated B1 the SDK's own code does it.
"""

import pytest

from framestep.motors.positions import KNOWN, LOST, SET, STEPS
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.modules import board_modules
from host_tests.end_to_end.session import Session, run_request
from host_tests.selection import sweep

STEP, DIRECTION = 14, 15  # of motor 7 on a Pico
B1 = ("--chip", "B1")
# After half a second, a call in C that takes a third of a second
AWAY = (
    "import machine; machine.Timer(-1, period=500, mode=machine.Timer.ONE_SHOT, "
    "callback=lambda _: sum(range(60000)))"
)
MODULES = (
    "__init__", "base/__init__", "base/native", "hal/__init__", "hal/rp2/__init__", "hal/rp2/pins",
    "hal/rp2/pin_guard", "hal/rp2/pulses",
)  # fmt: skip
# Claims pins as an engine does, some microseconds after a request
CLAIM = """
import time

import machine
import rp2

from framestep.hal.rp2 import pulses

STEP, DIRECTION = 14, 15


def forget():
    # the pins as after a reset
    rp2.PIO(1).remove_program()
    for pin in (STEP, DIRECTION):
        machine.mem32[0x40014004 + 8 * pin] = 31
        machine.mem32[0x4001C004 + 4 * pin] = 0x56


def claim():
    engine = pulses.PulseEngine(
        [STEP] * 5, [DIRECTION] * 5, machine.freq(), [(0, 625, False, 0, 0)] * 5
    )
    for command in (0, 1, 0, 1, 0):
        machine.mem32[engine.fifo(4)] = command | 1 << 1 | 5000 << 10


def try_after(us):
    begun = time.ticks_us()
    print("go")
    while time.ticks_diff(time.ticks_us(), begun) < us:
        pass
    claim()
    time.sleep_ms(30)
"""


@pytest.mark.parametrize("stepping", sweep(["B1", "B2"], "B2"))
def test_a_claim_at_any_time_around_a_bus_reset(emulator, stepping):
    """The direction pin follows its engine, whenever it was claimed, and USB starts again."""
    emu = emulator(files=board_modules(MODULES), args=["--chip", stepping])
    repl = emu.repl()
    repl.exec(CLAIM)
    dead = []
    held = 0
    for us in (*range(8500, 13000, 100), 1000, 20000):
        repl.start(f"forget()\ntry_after({us})", until="go")
        emu.cmd("usb_reset")
        begun = emu.ns
        emu.trace_start([STEP, DIRECTION])
        emu.advance(us / 1000)
        held += emu.pins()[DIRECTION]["function"] == 8
        emu.wait_usb(after=begun)
        repl.finish(1)
        trace = emu.trace_stop()
        made = [
            trace["level"][trace["pin"] == pin].astype(int).tolist() for pin in (STEP, DIRECTION)
        ]
        if made[0][1:] != [1, 0] * 5 or made[1][-4:] != [1, 0, 1, 0]:
            dead.append((us, made))
    assert dead == []
    is_held = stepping == "B1"
    assert (held > 5) == is_held, "the offsets do not hit the time in which the pin is held"


@pytest.fixture(scope="module")
def rig():
    """Yield framestep on a B1."""
    found = Session(EmulatedBoard(args=B1), motors=8, reply_s=0.1)
    with found.board:
        for motor in (1, 7):
            found.speed(motor, 2000, 200_000).accept(p.MotorResetPosition(motor, 0))
        yield found


def trust(found):
    return [(each.state, each.reason) for each in found.ask(p.GetCondition()).positions]


def comes_back(found):
    """Wait until the host has enumerated the board again; open its port."""
    emulator = found.board.emulator
    emulator.wait_event("usb-configured", 2000)
    found.leave()
    found.board.run_until(emulator.ns + 30_000_000)
    found.client.events.clear()
    found.come_back().until(p.DeviceInfo)


@pytest.mark.parametrize("late", sweep([True, False], False))
def test_a_bus_reset_in_motion(rig, late):
    """Motor 7 turns every 17 ms when the bus is reset. It ramps down before the chip releases its
    direction pin, even while a long call holds the main loop up (late): every step that was made
    counts."""
    emulator = rig.board.emulator
    frames = 120
    rig.upload({7: [3 * (i & 1) for i in range(frames)]})
    for after_ms in range(0, 17, 5 if late else 9):
        rig.accept(p.MotorResetPosition(7, 0))
        rig.ready(run_request(fps=60, end=frames, pre=100)).forget()
        place = rig.position(7)
        if late:
            emulator.repl().exec(AWAY)
        rig.accept(p.RtGo()).run(0.55)
        emulator.advance(after_ms)
        begun = emulator.ns
        emulator.cmd("usb_reset")
        emulator.advance(9)
        held = 0
        while emulator.ns < begun + 13_000_000:
            held += emulator.pins()[DIRECTION]["function"] == 8
            emulator.advance(0.5)
        assert held
        comes_back(rig)
        assert not rig.moving
        assert trust(rig)[6] == (KNOWN, SET)
        assert rig.position(7) == place + rig.made(7), after_ms
        assert rig.steps(7)[0][-1] * 1e9 < begun + 9e6, after_ms


@pytest.mark.parametrize("asked", [True, False])
def test_a_pin_that_something_else_takes(rig, asked):
    """The pin is restored before the motor moves again, at its next request or soon after; its
    position is lost, because pulses may be missing."""
    emulator = rig.board.emulator
    rig.accept(p.MotorResetPosition(1, 0), p.MotorResetPosition(7, 0)).forget()
    repl = emulator.repl()
    if asked:
        # The call in C after it holds the main loop up until the request is there
        repl.start("from machine import Pin\nPin(15, Pin.IN), sum(range(60000))")
        rig.refuse(m.ERR_GENERAL, p.MotorMove(7, 50))
        repl.finish()
    else:
        repl.exec("from machine import Pin\nPin(15, Pin.IN)")
    rig.run(0.2)
    assert [message for _, message in rig.events(p.HardStop)] == [p.HardStop(100)]
    assert trust(rig)[6] == (LOST, STEPS)
    assert trust(rig)[0] == (KNOWN, SET)
    assert emulator.pins()[DIRECTION]["function"] == 7
    rig.forget().accept(p.MotorResetPosition(7, 0), p.MotorMove(7, 50)).wait_idle()
    assert rig.position(7) == 50
    assert rig.made(7) == 50


@pytest.mark.repeats
def test_a_bus_reset_in_motion_with_one_port():
    """That port is the REPL's, and gets no message: the motors ramp down all the same, as for a
    lost host."""
    found = Session(EmulatedBoard({"ports": 1, "motor_count": 7}, args=B1), motors=7, reply_s=0.1)
    with found.board:
        emulator = found.board.emulator
        found.speed(7, 2000, 20_000).accept(p.MotorResetPosition(7, 0), p.MotorMove(7, 20_000))
        found.run(0.5)
        failed = emulator.ns
        emulator.cmd("usb_reset")
        emulator.wait_event("usb-configured", 2000)
        found.board.run_until(emulator.ns + 300_000_000)
        found.client.events.clear()
        assert found.steps(7)[0][-1] * 1e9 - failed < 130e6
        assert found.position(7) == found.made(7)
        assert not found.moving
        assert not found.events(p.HardStop)
        assert trust(found)[6] == (KNOWN, SET)
