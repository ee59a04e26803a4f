"""Settings of the rig file whose effect is edges, on the emulated board: pulses of two lengths in
one run, drivers that go off at rest, a button for the next frame, a camera's delays."""

import numpy as np
import pytest

from framestep.motors.positions import DRIVER_OFF, HELD
from framestep_tools import payloads as p
from framestep_tools.building.board_files import board_data
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.motors.home_switches import trust
from host_tests.end_to_end.session import Session, run_request

BOARD = board_data("pico")
BUTTON = BOARD["gio"][2]  # general input 1
PULSES = (30.0, 0.5, 30.0, 0.5)
DELAY_MS, HOLD_MS, EXPOSURE_MS = 150, 60, 400
RIG = {
    "motors": [{"pulse_us": us, "off_after_s": 2} for us in PULSES],
    "motor_count": 4,
    "shoot_input": 1,
    "shutter_delay_ms": DELAY_MS,
    "shutter_hold_ms": HOLD_MS,
}
FRAMES = 24


@pytest.fixture(scope="module")
def session():
    with EmulatedBoard(RIG, trace=False) as board:
        yield Session(board, reply_s=0.1)


def at(edges, pin, level):
    """Return when a pin got this level, ns."""
    return edges["t"][(edges["pin"] == pin) & (edges["level"] == level)]


def upload(session):
    """Upload a path for each motor: as fast as its pulses allow, there and back."""
    paths = {}
    for motor, us in enumerate(PULSES, 1):
        fastest = 15_500 if us > 1 else 120_000
        session.speed(motor, 16_000 if us > 1 else 150_000, 2_000_000)
        swing = fastest / 24 * (FRAMES - 1) / (2 * np.pi) / 2
        turns = np.linspace(0, 2 * np.pi, FRAMES)
        paths[motor] = np.round(swing * (1 - np.cos(turns))).astype(int)
    session.upload(paths)
    return paths


def test_long_and_short_pulses_in_one_run(session):
    """Each motor makes its uploaded steps, and no pulse is too short."""
    paths = upload(session)
    session.ready(run_request(24, 1, FRAMES, 500, 500))
    before = session.positions
    emulator = session.board.emulator
    emulator.trace_start(session.board.pins.pins)
    session.accept(p.RtGo()).until(p.RtEnd, 20).wait_idle()
    edges = emulator.trace_read()
    for motor, us in enumerate(PULSES, 1):
        step, direction = session.board.pins.step[motor - 1], session.board.pins.dir[motor - 1]
        rises, falls = at(edges, step, 1), at(edges, step, 0)
        falls = falls[falls > rises[0]]
        assert (falls - rises).min() >= 1000 * us - 1
        way = edges[edges["pin"] == direction]
        ups = way["level"][np.searchsorted(way["t"], rises, side="right") - 1]
        ways = np.bincount(ups.astype(int), minlength=2)
        assert len(rises) >= np.abs(np.diff(paths[motor])).sum()
        net = session.position(motor) - before[motor]
        assert abs(ways[1] - ways[0]) == abs(net), "no step off"
        assert session.position(motor) == paths[motor][-1]


def test_drivers_go_off_at_rest(session):
    """All at once, as they share the pin; the next motion switches them on first."""
    emulator = session.board.emulator
    session.accept(p.MotorResetPosition(1, 0), p.MotorMove(1, 200))
    emulator.trace_start([BOARD["enable"], *session.board.pins.pins])
    session.wait_idle().run(2.5).accept(p.MotorMove(1, 0)).wait_idle()
    edges = emulator.trace_read()
    (off,), (on,) = at(edges, BOARD["enable"], 1), at(edges, BOARD["enable"], 0)[-1:]
    steps = at(edges, session.board.pins.step[0], 1)
    last = steps[steps < off][-1]
    assert 1.9e9 <= off - last <= 2.3e9
    assert off < on < steps[steps > off][0]
    assert trust(session) == (HELD, DRIVER_OFF)


def test_a_button_shoots_the_next_frame(session):
    """With the camera's delays: the output goes on earlier and off later than the exposure."""
    paths = upload(session)
    emulator = session.board.emulator
    session.ready(p.RtShootFrame2(7, EXPOSURE_MS, 0, 180, []))
    session.accept(p.RtGo()).until(p.RtEnd, 20).wait_idle()
    emulator.trace_start([BOARD["shutter"]])
    for frame in (8, 9):
        session.forget()
        emulator.set_pin(BUTTON, 0)
        session.run(0.1)
        emulator.set_pin(BUTTON, 1)
        session.until(p.RtEnd, 20).wait_idle()
        assert session.position(2) == paths[2][frame - 1]
    edges = emulator.trace_read()
    opened, closed = at(edges, BOARD["shutter"], 1), at(edges, BOARD["shutter"], 0)
    assert len(opened) == 2
    assert (closed[-2:] - opened) / 1e6 == pytest.approx(DELAY_MS + EXPOSURE_MS + HOLD_MS, abs=1)
