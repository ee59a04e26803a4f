"""Hosts after each other on the same port: nothing from one reaches the next."""

import pytest

from framestep_tools.client.wire import encode
from framestep_tools.payloads import DeviceInfo, MotorMove
from host_tests.end_to_end.session import simulated


@pytest.mark.needs("prompt")
@pytest.mark.parametrize("gap_ms", [0, 1, 100, 250])
def test_the_port_closes_at_each_byte_of_a_request(gap_ms):
    """It opens again: the next host is greeted and its first request answered; the incomplete
    request moves nothing."""
    session = simulated()
    move = MotorMove(1, 5000)
    request = encode(move.TYPE, move.pack(), 1)
    for part in range(2 * len(request)):
        session.port.write((request + request)[:part])
        if part % 3:
            session.run(0.0007 * (part % 3))
        session.leave()
        session.board.run_until(session.board.now_ns + gap_ms * 1_000_000)
        session.come_back()
        session.client.wait_event(DeviceInfo)
        place = session.position(1)
        moves = session.moving
        session.wait_idle()
        assert part >= len(request) or (not moves and session.position(1) == place == 0), part
        session.client.events.clear()
