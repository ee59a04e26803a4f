"""Lights, inputs and outputs on the host simulation: bytes in, levels and edges out.

E-stop and limit switches are in test_stop_inputs.py.
"""

import struct

import numpy as np
import pytest

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.client.wire import encode
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.session import SWITCHES, Session, inputs, run_request, simulated


def shown(session, signal):
    """Return (time in s, level) of every change of a signal so far."""
    times, values = session.trace().signals.get(signal, (np.array([]), np.array([])))
    return list(zip((times * 1e-9).tolist(), values.tolist(), strict=True))


# ---------------------------------------------------------------- lights


def test_what_hi_says():
    info = simulated().ask(p.Hi())
    assert (info.dmx_channels, info.outputs, info.inputs, info.limit_sets) == (512, 2, 2, 0)
    session = simulated({"dmx": False, **SWITCHES, "outputs": []})
    info = session.ask(p.Hi())
    assert (info.dmx_channels, info.outputs, info.inputs, info.limit_sets) == (0, 0, 0, 2)
    # not supported now, in any state and with any contents
    session.refuse(
        m.ERR_UNSUPPORTED, p.Dmx(0, 1, [5]), p.Dmx(7, 900, [5]), p.RtUploadMoveDmx(1, 0, [5])
    )
    session.accept(p.RtUploadMoveBegin(1, 5))
    session.refuse(m.ERR_UNSUPPORTED, p.RtUploadMoveDmx(1, 0, [5]))
    session.accept(p.RtUploadMoveEnd())


@pytest.mark.each_processor
@pytest.mark.needs("lights")
def test_lights_at_once():
    session = simulated()
    session.accept(p.Dmx(0, 17, [255, 0, 3]), p.Dmx(0, 512, [9]), p.Dmx(0, 18, [7]))
    assert [shown(session, f"dmx{c}")[-1][1] for c in (17, 18, 19, 512)] == [255, 7, 3, 9]
    assert session.ask(p.MotorStatus()).dmx == 0


@pytest.mark.each_processor
@pytest.mark.needs("lights")
def test_a_ramp_is_a_straight_line_of_half_a_second():
    session = simulated()
    session.accept(p.Dmx(0, 2, [200])).run(0.05).forget()
    begin = session.now
    session.accept(p.Dmx(1, 1, [255, 50]))
    while session.ask(p.MotorStatus()).dmx:
        session.run(0.01)
    assert session.now - begin == pytest.approx(0.5, abs=0.03)
    for channel, first, last in ((1, 0, 255), (2, 200, 50)):
        times, levels = map(np.array, zip(*shown(session, f"dmx{channel}"), strict=True))
        line = first + (last - first) * (times - begin) / 0.5
        assert levels[-1] == last
        assert times[-1] - begin == pytest.approx(0.5, abs=0.012)
        assert np.abs(levels - line).max() <= abs(last - first) * 0.012 / 0.5 + 1
    session.forget().run(0.6)
    assert not session.trace().signals


@pytest.mark.parametrize(
    "payload",
    [
        (0, 0, b"\1"), (1, 513, b"\1"), (0, 512, b"\1\1"), (1, 2, b"\1" * 512), (2, 1, b"\1"),
        (0, 513, b""),
    ],
)  # fmt: skip
def test_lights_that_are_not_there(payload):
    session = simulated()
    ramp, channel, levels = payload
    answer = session.answer_to(m.MSG_DMX, struct.pack("<BH", ramp, channel) + levels)
    assert answer.is_ack
    assert answer.payload == struct.pack("<H", m.ERR_RANGE)
    session.run(0.6)
    assert not any(signal.startswith("dmx") for signal in session.trace().signals)


# ---------------------------------------------------------------- inputs and outputs


@pytest.mark.each_processor
def test_outputs():
    session = simulated()
    session.accept(p.GioOut(2), p.GioOut(0xFFFFFFFF), p.GioOut(0), p.GioOut(0x80000001))
    assert [level for _, level in shown(session, "gio1")] == [1, 0, 1]
    assert [level for _, level in shown(session, "gio2")] == [1, 0]


def test_camera():
    session = simulated({"meter_on": "low"})
    session.forget()
    session.accept(
        p.GioCam(m.GIO_CAM_SHUTTER), p.GioCam(m.GIO_CAM_SHUTTER | m.GIO_CAM_METER), p.GioCam(0)
    )
    assert [level for _, level in shown(session, "shutter")] == [1, 0]
    assert [level for _, level in shown(session, "meter")] == [0, 1]


@pytest.mark.needs("boards")
def test_twelve_motors_have_the_pins_of_camera_and_dmx():
    session = Session(SimulatedBoard(board="pico2"), motors=12)
    said = session.ask(p.Hi())
    assert (said.motors, said.dmx_channels, said.capabilities & m.CAP_CAMERA) == (12, 0, 0)
    session.upload({1: [0, 100, 200]})
    for request in (
        p.GioCam(m.GIO_CAM_SHUTTER),
        p.Dmx(0, 1, [99]),
        run_request(3, flags=m.RUN_STILLS),
        run_request(3, flags=m.RUN_VIDEO),
    ):
        assert session.code(request) == p.Ack.ERR_UNSUPPORTED
    session.accept(run_request(3))


@pytest.mark.each_processor
def test_inputs_are_reported_once_per_change():
    session = simulated()
    assert inputs(session) == 0
    session.input("gio3", 0)
    pressed = session.now
    session.run(0.015)
    assert inputs(session) == 0
    assert not session.events(p.InputLevels)
    session.run(0.1)
    ((reported, message),) = session.events(p.InputLevels)
    assert message.levels == 1
    assert 0.020 <= reported - pressed <= 0.023
    assert inputs(session) == 1
    session.forget()
    for _ in range(9):  # bounces
        session.input("gio3", 1).run(0.004).input("gio3", 0).run(0.004)
    session.input("gio4", 0).run(0.1)
    assert [message.levels for _, message in session.events(p.InputLevels)] == [3]


def test_inputs_that_change_with_no_host_are_not_reported_later():
    session = simulated()
    session.port.close()
    session.input("gio3", 0)
    session.board.run_until(session.board.now_ns + 100_000_000)
    session.board.open_port(True)
    session.run(0.1)
    assert not session.events(p.InputLevels)
    assert inputs(session) == 1


# ---------------------------------------------------------------- safe levels

SAFE = {
    "outputs": [{"pin": 22}, {"pin": 26, "safe": "on"}, {"pin": 27, "safe": "hold"}],
    "inputs": [],
    "estop": "nc",
}


def levels(session):
    return [shown(session, f"gio{i}")[-1:] and shown(session, f"gio{i}")[-1][1] for i in (1, 2, 3)]


@pytest.mark.needs("lights")
@pytest.mark.inside
@pytest.mark.parametrize("cause", ["lost host", "E-stop", "fault"])
def test_outputs_go_to_their_safe_levels(cause):
    session = simulated(SAFE)
    session.input("estop", 0).run(0.1).accept(p.GioOut(0b101), p.Dmx(0, 1, [99]), p.GioCam(3))
    assert levels(session) == [1, 0, 1]
    if cause == "lost host":
        session.port.close()
    elif cause == "E-stop":
        session.input("estop", 1)
    else:
        session.client.events.clear()
        session.board._board.controller.stops.fault_stop()
    session.board.run_until(session.board.now_ns + 5_000_000)
    assert levels(session) == [0, 1, 1]
    assert [shown(session, name)[-1][1] for name in ("shutter", "meter")] == [0, 0]
    assert shown(session, "dmx1")[-1][1] == 99  # lights stay
    if cause == "fault":
        session.run(0.01)
        assert [message for _, message in session.events(p.HardStop)] == [p.HardStop(100)]


# --------------------------------------------------------------- GO from an input (field note 6.13)


@pytest.mark.parametrize("dialect", ["spec", "dmc-lite"])
def test_go_from_an_input(dialect):
    """It counts after debouncing, and only when GO would be accepted; RT_GO comes unasked, once,
    before the first frame."""
    session = simulated({"go_input": 1, "dialect": dialect})
    board = session.board._board
    session.upload({1: 20 * np.arange(25)})
    pin = board.controller.rig.inputs[0]["pin"]

    def press(seconds=0.1):
        session.input(pin, 0).run(seconds).input(pin, 1).run(0.1)

    press()  # nothing waits
    session.accept(run_request(24, 1, 25, 300, 300))
    press(0.021)
    assert not session.events(p.RtGo)
    assert not session.events(p.RtEnd)
    session.wait_idle()
    press(0.01)  # too short to count
    assert not session.events(p.RtGo)
    assert not session.moving
    session.forget()
    pressed = session.now
    press(0.2)
    ((reported, _),) = session.events(p.RtGo)
    assert 0.02 <= reported - pressed < 0.03
    press()  # in progress: no effect
    session.until(p.RtEnd, 10).wait_idle()
    assert len(session.events(p.RtGo)) == 1
    assert not session.events(p.RtEnd)
    assert session.steps(1)[0][0] >= pressed + 0.02
    assert session.position(1) == 480


@pytest.mark.needs("inside")
@pytest.mark.inside
def test_go_from_an_input_is_reported_once_the_host_listens():
    """A host that read nothing until there was no room gets RT_GO later, and after it the rest in
    its order."""
    session = simulated({"go_input": 1})
    board = session.board._board
    session.upload({1: 20 * np.arange(25)})
    session.ready(run_request(24, 1, 25, 300, 300)).forget()
    port, send = board.hal.port, board.hal.port.send
    port.send = lambda writer: True
    session.port.write(b"".join(encode(m.MSG_MOTOR_GET_POSITION, b"", n) for n in range(1, 100)))
    go, other = (item["pin"] for item in board.controller.rig.inputs[:2])
    for level in (0, 1) * 4:
        session.input(other, level).run(0.05)
    assert board.controller.writer.room() < 12
    session.input(go, 0).run(3.0)
    port.send = send
    session.run(0.2)
    assert [
        type(event.message)
        for event in session.client.events
        if isinstance(event.message, p.RtGo | p.RtEnd)
    ] == [
        p.RtGo,
        p.RtEnd,
    ]


@pytest.mark.needs("inside")  # a board says it on the REPL
def test_go_from_an_input_that_is_not_there():
    with pytest.raises(ValueError, match="go_input: found 9"):
        simulated({"go_input": 9})


def test_no_go_from_an_input_by_default():
    session = simulated()
    board = session.board._board
    session.upload({1: 20 * np.arange(25)})
    session.ready(run_request(24, 1, 25, 300, 300))
    session.input(board.controller.rig.inputs[0]["pin"], 0).run(0.3)
    assert not session.events(p.RtGo)
    assert not session.moving
