"""A servo on the emulated board: its pulses, judged from the edges on its pin."""

import json

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_emulator import Emulator
from framestep_tools import payloads as p
from framestep_tools.building import images
from framestep_tools.client.client import Client
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.session import Session, assert_follows, pulses, run_request

PIN = 22  # one of the board's general pins
RIG = {"motors": [{}, {"servo": {"pin": PIN}}, {}]}


def test_it_follows_the_path_that_a_step_motor_takes():
    """Both play the same move. Each pulse has the position at its time."""
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
        session.accept(p.MotorMove(2, 1000)).wait_idle().run(0.1)
        assert pulses(session)[1][-1] == pytest.approx(2000, abs=0.05)
        assert session.events(p.HardStop) == []


@pytest.mark.repeats
def test_a_soft_reset_in_mid_pulse():
    """A pulse that the reset cuts off ends before framestep starts again, because the pins of a
    program go low. Then no pulses come until the motor is to move."""
    servo = {"pin": PIN, "rate_hz": 333, "low_us": 500, "high_us": 2500, "low": 0, "high": 2000}
    rig = json.dumps({"motors": [{"servo": servo}]}).encode()
    with Emulator(images.frozen("pico"), files={"/rig.json": rig}) as emu:
        emu.wait_usb(20_000, ports=2)
        repl, port = emu.serial(0), emu.serial(1)
        client = Client(port)
        cut = []
        while not any(cut):  # a pulse is in progress five sixths of the time
            assert len(cut) < 5
            client.request(p.Hi())
            client.request(p.MotorMove(1, 2000 - len(cut)))
            emu.advance(1000)
            repl.write(b"\r\x03\r\x01")
            emu.advance(20 + len(cut))
            emu.trace_start([PIN])
            emu.advance(50)
            repl.write(b"\x04")
            emu.advance(3000)
            edges = emu.trace_read()
            emu.trace_stop()
            assert emu.pin(PIN) == 0
            rises, falls = (edges["t"][edges["level"] == level] * 1e-6 for level in (1, 0))
            widths = falls[falls > rises[0]] - rises
            assert widths[:-1].max() < 2.51
            assert widths[-1] < 60, "ms, where framestep takes 270 to start"
            cut.append(widths[-1] > 2.51)
            port.reset_input_buffer()
