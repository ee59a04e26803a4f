"""The LED on the host simulation: its pattern and colour in each state, and when it no longer shows
a fault."""

import pytest

from framestep.pulse import stepper
from framestep_tools.payloads import MotorMove, MotorSetSpeed
from host_tests.end_to_end.session import simulated

pytestmark = pytest.mark.needs("inside")

WAITING, CONNECTED, MOVING, FAULT = (
    "*...............",
    "****************",
    "*.*.*.*.*.*.*.*.",
    "*.*.*...........",
)


BLUE, WHITE, GREEN, RED = {2}, {0, 1, 2}, {1}, {0}
COLOURS = {WAITING: BLUE, CONNECTED: WHITE, MOVING: GREEN, FAULT: RED}


def shown(session):
    """Return the LED's levels over its two seconds, 128 ms each, from the pattern's beginning; it
    must have one colour."""
    board = session.board
    colours = set()
    until = -(-board.now_ns // (2048 * 10**6)) * 2048 * 10**6
    levels = ""
    for i in range(16):
        board.run_until(until + i * 128 * 10**6 + 64 * 10**6)
        colour = board._board.hal.colour
        levels += "*" if colour else "."
        colours |= {colour} - {0}
    (colour,) = colours
    assert {i for i, part in enumerate(colour.to_bytes(3, "big")) if part} == COLOURS[levels]
    return levels


def test_patterns():
    session = simulated({"estop": "no"})
    assert shown(session) == CONNECTED
    session.leave()
    assert shown(session) == WAITING
    session.come_back()
    assert shown(session) == CONNECTED
    session.accept(MotorSetSpeed(1, 100, 1000), MotorMove(1, 1000))
    assert shown(session) == MOVING
    session.input("estop", 0).run(0.1)
    assert shown(session) == FAULT
    session.input("estop", 1).run(0.1)
    assert shown(session) == FAULT, "until motors are sent somewhere again"
    session.accept(MotorMove(1, 1000))
    assert shown(session) == MOVING


@pytest.mark.inside
def test_a_fault_of_the_kernel_shows():
    session = simulated()
    session.board._board.hal.kernel.state[stepper.FAULTS] = stepper.FAULT_DRY
    session.run(0.1)
    assert shown(session) == FAULT
