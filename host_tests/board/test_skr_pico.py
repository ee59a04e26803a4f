"""The firmware on the emulated RP2040 with the pins of the SKR Pico: steps, directions, enables,
stops, outputs."""

from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.end_to_end.session import Session

ENABLE = (12, 7, 2, 15)  # boards/skr_pico: low switches a driver on
STEP = (11, 6, 19, 14)
RIG = {"virtuals": 0, "estop": "nc", "limits": [{"low": 4}]}
ESTOP, X_STOP, PROBE = 16, 4, 22


def test_pins():
    with EmulatedBoard(RIG, board="skr_pico") as board:
        emulator = board.emulator

        def levels(*pins):
            return [emulator.pin(pin) for pin in pins]

        board.wire_switches()
        session = Session(board, motors=4, reply_s=0.1)
        session.run(0.1)
        assert session.ask(p.Hi()).motors == 4
        assert levels(*ENABLE) == [1, 1, 1, 1], "a driver is on before its motor is to move"
        session.forget()
        for motor, target in ((1, 400), (2, -300), (3, 200)):
            session.accept(p.MotorMove(motor, target))
        session.wait_idle()
        assert levels(*ENABLE) == [0, 0, 0, 1]
        assert [session.made(motor) for motor in (1, 2, 3, 4)] == [400, -300, 200, 0]
        assert [session.position(motor) for motor in (1, 2, 3, 4)] == [400, -300, 200, 0]
        session.accept(p.MotorConfigure(2, 0), p.MotorConfigure(4, m.MOTOR_ENABLED))
        assert levels(*ENABLE) == [0, 1, 0, 0]

        session.accept(p.GioOut(0b101), p.GioCam(1))
        assert levels(20, 21, 23, 17, 18) == [1, 0, 1, 1, 0]
        emulator.set_pin(PROBE, 0)
        session.run(0.05)
        assert session.ask(p.GioIn()).levels == 1

        session.accept(p.MotorSetLimits(1, 0, 0, 0, 0, 1))
        emulator.set_pin(X_STOP, 1)
        session.run(0.05).refuse(m.ERR_HARD_LOW, p.MotorMove(1, 0))
        session.accept(p.MotorMove(3, 20_000)).run(0.3)
        session.client.events.clear()
        emulator.set_pin(ESTOP, 1)
        session.run(0.3)
        assert [message for _, message in session.events(p.HardStop)] == [p.HardStop(0)]
        assert not session.moving
        assert levels(20, 21, 23, 17) == [0, 0, 0, 0]
        assert session.made(3) == session.position(3)
