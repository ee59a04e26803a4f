"""A servo on the emulated board: its pulses, judged from the edges on its pin."""

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.boards import EmulatedBoard
from host_tests.end_to_end.servo_pulses import assert_follows, pulses
from host_tests.end_to_end.session import Session, run_request

PIN = 22  # one of the board's general pins
RIG = {"motors": [{}, {"servo": {"pin": PIN}}, {}]}


def test_it_follows_the_path_that_a_step_motor_takes():
    """Both play the same move. Each pulse has the position of its moment."""
    with EmulatedBoard(RIG) as board:
        session = Session(board, reply_s=0.1)
        assert board.pins.levels[PIN] == "servo2"
        session.run(0.1)
        assert not session.trace().signals["servo2"][1].any(), "pulses before the first move"
        frames = 24
        path = np.round(600 * np.sin(2 * np.pi * np.arange(frames) / frames)).astype(int).tolist()
        for motor in 1, 2:
            session.speed(motor, 30000, 300000)
        session.upload({1: path, 2: path})
        before = session.play(run_request(end=frames))
        session.run(0.1)
        rises, widths = pulses(session)
        assert len(widths) > 60
        assert np.diff(rises) == pytest.approx(0.02, abs=0.0015)
        assert widths.max() > 1790
        assert widths.min() < 1210
        assert_follows(session, before[1], 2, farthest=True)
        # its end, held by the range
        session.refuse(m.ERR_SOFT_UP, p.MotorMove(2, 1001))
        session.accept(p.MotorMove(2, 1000))
        session.wait_idle()
        session.run(0.1)
        assert pulses(session)[1][-1] == pytest.approx(2000, abs=0.05)
        assert session.events(p.HardStop) == []
