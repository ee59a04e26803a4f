"""Each driver of the table gets what it needs on the emulated board: pulses, times around a change
of direction, time to wake up."""

import numpy as np
import pytest

from framestep.rig.drivers import TYPE_SETTINGS
from framestep_tools.building.board_files import board_data
from framestep_tools.payloads import MotorMove, MotorSetSpeed
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.session import Session

BOARD = board_data("pico")
GROUPS = [
    list(TYPE_SETTINGS)[at : at + BOARD["motors"]]
    for at in range(0, len(TYPE_SETTINGS), BOARD["motors"])
]


@pytest.mark.parametrize("names", GROUPS, ids=lambda names: names[0])
def test_edges(names):
    with EmulatedBoard({"motors": [{"type": name} for name in names]}, trace=False) as board:
        emulator = board.emulator
        session = Session(board)
        motors = range(1, len(names) + 1)
        for motor, name in zip(motors, names, strict=True):
            fastest = int(400_000 / max(1, TYPE_SETTINGS[name][0]))
            session.accept(MotorSetSpeed(motor, fastest, 20 * fastest))
        emulator.trace_start([BOARD["enable"], *board.pins.pins])
        session.accept(*(MotorMove(motor, 10) for motor in motors))  # they wake up
        session.wait_idle()
        for target in (400, 0, 400):
            session.accept(*(MotorMove(motor, target) for motor in motors))
            session.run(0.04)  # it turns in motion
        session.wait_idle()
        edges = emulator.trace_read()
    on = edges["t"][(edges["pin"] == BOARD["enable"]) & (edges["level"] == 0)][0]
    for motor, name in enumerate(names):
        pulse, setup, hold, enable_ms, *_ = TYPE_SETTINGS[name]
        step = edges[edges["pin"] == board.pins.step[motor]]
        step = step[step["t"] > on]
        rises, falls = (step["t"][step["level"] == level] for level in (1, 0))
        assert len(rises) == len(falls) >= 400
        assert (falls - rises).min() >= 1000 * pulse - 1, name
        assert (rises[1:] - falls[:-1]).min() >= 1000 * pulse - 1, name
        assert rises[0] - on >= 1e6 * enable_ms, name
        turns = edges["t"][(edges["pin"] == board.pins.dir[motor]) & (edges["t"] > on)]
        between = [turn for turn in turns if rises[0] < turn < rises[-1]]
        assert between
        assert min(rises[rises > turn].min() - turn for turn in turns) >= 1000 * setup - 1, name
        assert min(turn - falls[falls < turn].max() for turn in between) >= 1000 * hold - 1, name
        # up or down, by the direction pin at each step
        ways = np.bincount(np.searchsorted(turns, rises), minlength=len(turns) + 1)
        assert abs(ways[::2].sum() - ways[1::2].sum()) == 400, name
