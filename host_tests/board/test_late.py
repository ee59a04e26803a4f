"""A program on the REPL that switches interrupts off, as drivers of LED strips do: either no edge
moves, or there is a fault."""

import numpy as np
import pytest

from framestep_tools import payloads as p
from host_tests.end_to_end.session import Session
from host_tests.selection import sweep

VELOCITIES = {1: 333, 2: 700, 3: 1011, 4: 3700, 5: 20_000}
EDGE_US = 5
FREE_PIN = 1
HOLD = f"""
import machine, time
pin = machine.Pin({FREE_PIN}, machine.Pin.OUT)
def light(after, us):
    strip = bytearray(us // 10)
    time.sleep_us(after)
    machine.bitstream(pin, 0, (400, 850, 800, 450), strip)
"""


@pytest.fixture(scope="module")
def session(chip):
    with chip.emulated({"dmx": False}) as board:
        session = Session(board, reply_s=0.1)
        session.repl = board.emulator.repl()
        session.repl.exec(HOLD)
        yield session


@pytest.mark.parametrize("us", sweep([500, 900, 1200, 1500, 1700], 500, 1200, 1700))
def test_a_late_tick_moves_no_edge(session, us):
    session.repl.exec("import framestep.boot")
    for motor, velocity in VELOCITIES.items():
        session.speed(motor, velocity, 200_000)
    before = session.positions
    session.forget().accept(*(p.MotorMove(n, before[n] + v) for n, v in VELOCITIES.items()))
    for k in range(14):
        session.run(0.0437)
        session.repl.exec(f"light({k * 71}, {us})")
        session.board.run_until(session.board.emulator.ns)
    session.wait_idle()
    assert not session.events(p.HardStop)
    for motor, velocity in VELOCITIES.items():
        times, signs = session.steps(motor)
        assert signs.sum() == velocity
        cruise = times[len(times) // 20 : -len(times) // 20]
        behind = cruise - np.arange(len(cruise)) / velocity
        behind = (behind - np.median(behind)) * 1e6
        print(motor, us, f"{behind.min():.1f} to {behind.max():.1f} µs")
        assert np.abs(behind).max() < EDGE_US, motor
