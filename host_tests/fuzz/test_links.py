"""The port closed and opened again within a frame, at each of its bytes and in each state of a run.

The device forgets the part of the frame, answers what the next host sends, brings everything to
rest within its limits, and sends no RT_END to a host that does not know of the run.
"""

import struct

import pytest

from framestep.protocol import messages as m

from .link import frame
from .sessions import PATH, Host

RUN = struct.pack("<IiiIIBIHHHHH", 24_000, 1, 24, 300, 300, 0, 0, 0, 0, 0, 90, 180)
BYTES = len(frame(m.MSG_RT_RUN_MOVE, RUN, 1))


def brought_to(state) -> Host:
    host = Host({"motor_count": 2, "motors": [{"jerk": 200}, {"backlash": 20}]})
    host.speed(1, 3000, 20_000)
    host.speed(2, 3000, 20_000)
    host.upload(PATH, PATH[::-1])
    if state == "upload":
        host.send(m.MSG_RT_UPLOAD_MOVE_BEGIN, "ii", 1, 30)
    elif state == "move":
        host.move(1, 4000)
        host.wait(200)
    elif state != "idle":
        host.move(2, 900)
        host.rest()
        host.send(m.MSG_RT_RUN_MOVE, "IiiIIBIHH", 24_000, 1, 24, 300, 300, 0, 0, 0, 0)
        host.wait(60)
        if state != "way":
            host.rest()
        if state not in ("way", "ready"):
            host.send(m.MSG_RT_GO)
            host.wait(
                {"pre-roll": 150, "run": 700, "post-roll": 1500, "back": 1750}.get(state, 700)
            )
        if state == "stop":
            host.send(m.MSG_MOTOR_STOP_ALL)
    return host


def interrupted(host, at, away):
    """Send `at` bytes of a RUN_MOVE, then be another host."""
    data = frame(m.MSG_RT_RUN_MOVE, RUN, 0x4444_4646)
    trial = host.trial
    if at:
        trial.do("rx", data[:at])
    host.wait(away & 1)
    trial.do("close")
    host.wait(away)
    trial.do("open")
    trial.do("rx", data[at:])
    number = host.number + 1
    host.send(m.MSG_HI)
    # for a while the rest of the frame may look like the beginning of another
    for _ in range(400):
        if number not in trial.open:
            break
        trial.step()
    assert number not in trial.open
    host.rest()
    host.wait(300)
    host.rest()
    assert trial.last_status == 0
    assert not trial.open


@pytest.mark.parametrize("at", range(BYTES + 1))
def test_at_each_byte(at):
    interrupted(brought_to("idle"), at, at % 3)


@pytest.mark.parametrize("at", [0, 1, 9, BYTES - 1, BYTES])
@pytest.mark.parametrize(
    "state", ["upload", "move", "way", "ready", "pre-roll", "run", "post-roll", "back", "stop"]
)
def test_in_each_state(state, at):
    interrupted(brought_to(state), at, 1)
