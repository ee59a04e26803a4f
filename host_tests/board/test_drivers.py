"""TMC2209 drivers on the emulated board's UART, with simulated chips at the other end: the firmware
sets them up before it enables them, and their faults stop it."""

import numpy as np
import pytest

from framestep.motors import positions
from framestep.protocol import messages as m
from framestep.pulse import stepper
from framestep_tools import payloads as p
from framestep_tools.building.board_files import board_data
from framestep_tools.simulator import driver_chips as chip
from framestep_tools.simulator.boards import EmulatedBoard
from framestep_tools.simulator.driver_chips import Chip, Chips
from host_tests.end_to_end.session import Session, deceleration

ENABLE = tuple(board_data("skr_pico")["enable"])
ADDRESSES = tuple(board_data("skr_pico")["drivers"]["address"])
UART = 1
SLICE_NS = 500_000
BYTE_NS = 1e10 / chip.BAUD
RIG = {
    "virtuals": 0,
    "motors": [
        {"driver": {"run_ma": 300 * motor, "microsteps": 2**motor}} for motor in (1, 2, 3, 4)
    ],
}


class DrivenBoard(EmulatedBoard):
    """A board whose driver UART leads to chips, after connect(); they answer within half a
    millisecond."""

    def __init__(self, **settings):
        self.connected = False
        self.bytes = []  # (ns, value) from the board
        super().__init__({**RIG, **settings}, board="skr_pico")
        self.chips = [Chip(address) for address in ADDRESSES]
        self.wire = Chips(self.chips, lambda: self.now_ns)
        self.emulator.uart_start(UART)
        if self.repl:
            self.repl.open_port(True)

    def run_until(self, ns, until_output=False):
        if not self.connected:
            super().run_until(ns, until_output)
        while self.connected and self.now_ns < ns:
            super().run_until(min(ns, self.now_ns + SLICE_NS), until_output)
            sent, _ = self.emulator.uart_read(UART)
            for at, value in sent:
                self.bytes.append((at, value))
                self.wire.byte(value, at)
            answers = self.wire.take_answers()
            if answers:
                self.emulator.uart_send(UART, answers)
            if until_output:
                return  # the caller asks again

    def connect(self):
        """Switch the drivers' supply on."""
        self.emulator.uart_read(UART)  # nobody has heard the requests so far
        self.connected = True

    def said(self):
        return self.repl.transmit().decode()


@pytest.fixture(scope="module")
def talk():
    with DrivenBoard() as board:
        yield Session(board, motors=4, reply_s=0.1)


@pytest.fixture
def moving(talk):
    """Yield the same, with drivers that are set up."""
    if not talk.board.connected:
        talk.board.connect()
        talk.run(2.0)
    return talk


def enables(talk):
    """Return [(motor, level, time in s)] of the enable pins since the last forget()."""
    found = []
    for motor in (1, 2, 3, 4):
        signal = talk.trace().signals.get(f"enable{motor}")
        if signal is not None:
            found += [(motor, int(value), t * 1e-9) for t, value in zip(*signal, strict=True)]
    return found


def test_nothing_moves_before_the_drivers_answer(talk):
    board = talk.board
    talk.run(1.3)
    said = board.said()
    assert said.count("gets no echo on the wire") == 4, said
    talk.refuse(m.ERR_GENERAL, p.MotorMove(1, 100))
    assert talk.ask(p.GetCondition()).bits & m.CONDITION_DRIVER
    assert [board.emulator.pin(pin) for pin in ENABLE] == [1, 1, 1, 1]


def test_set_up_then_enabled(talk):
    """With the supply on, every register arrives, complete and confirmed, and only then a driver is
    switched on."""
    board = talk.board
    talk.forget()
    board.connect()
    talk.run(2.0)
    assert not enables(talk)
    assert board.said().count("works again") == 4
    assert talk.ask(p.GetCondition()).bits & m.CONDITION_DRIVER == 0
    for motor, driver in enumerate(board.chips, 1):
        assert driver.damaged == 0
        assert len(driver.writes) == 12
        assert driver.gstat == 0
        assert driver.microsteps == 2**motor
        assert 300 * motor - 55 < driver.run_ma() <= 300 * motor  # 1/32 of 1740 mA
        assert driver.registers[chip.CHOPCONF] & 0xF == 3
        assert driver.registers[chip.GCONF] == 0x1C0
        assert driver.registers[chip.NODECONF] == 0x200
    starts = np.array([at for at, _ in board.bytes])
    within = np.diff(starts)[np.diff(starts) < 2 * BYTE_NS]
    assert within.size > 100
    assert within == pytest.approx(BYTE_NS, rel=0.01)
    talk.accept(p.MotorMove(1, 100)).run(0.3)
    assert [(motor, level) for motor, level, _ in enables(talk)] == [(1, 0)]
    assert talk.made(1) == 100


def test_watching_delays_neither_tick_nor_reply(moving):
    """While the firmware checks the drivers, edges are as even as without: a constant velocity has
    constant intervals. Answers come within the 10 ms allowed in motion."""
    talk = moving
    for motor in (2, 3):
        talk.speed(motor, 10_000, 100_000).accept(p.MotorResetPosition(motor, 0))
    talk.forget()
    asked = len(talk.board.bytes)
    talk.accept(p.MotorMove(2, 4000), p.MotorMove(3, 4000))
    took = []
    while not took or talk.moving:
        before = talk.now
        talk.ask(p.MotorStatus())
        took.append(talk.now - before)
        talk.run(0.003)
    talk.run(0.05)
    assert len(took) > 30
    assert max(took) < 0.010
    assert len(talk.board.bytes) - asked >= 8 * 8  # bytes of a check
    for motor in (2, 3):
        times, _ = talk.steps(motor)
        assert len(times) == 4000
        cruise = times[(times > times[0] + 0.15) & (times < times[-1] - 0.15)]
        assert np.abs(np.diff(cruise) - 1e-4).max() < 1e-6
    look = (
        f"import framestep.boot as b; print(b.controller.axes.kernel.state[{stepper.WORST_LATE}])"
    )
    assert int(talk.board.emulator.repl().exec(look)) < 150
    talk.board.repl.open_port(True)
    talk.board.repl.receive(b"\r\x02")  # nothing unasked is printed in raw mode


def test_a_fault_in_motion(moving):
    talk, board = moving, moving.board
    for motor in (2, 3):
        talk.speed(motor, 10_000, 100_000).accept(p.MotorResetPosition(motor, 0))
    board.said()
    talk.forget().accept(p.MotorMove(2, 30_000), p.MotorMove(3, 30_000)).run(0.4)
    at = talk.now
    board.chips[1].status |= 0x02
    board.chips[1].gstat |= 0x02
    talk.run(0.8)
    assert not talk.moving
    assert [message for _, message in talk.events(p.HardStop)] == [p.HardStop(m.HARD_STOP_FAULT)]
    assert "framestep: driver of motor 2 has switched off, too hot" in board.said()
    times, signs = talk.steps(3)
    assert times[-1] - at < 0.25 + 0.1 + 0.02
    assert deceleration(times, signs, times[-1] - 0.09) == pytest.approx(100_000, rel=0.1)
    assert [(motor, level) for motor, level, t in enables(talk) if t > at] == [(2, 1)]
    trust = [(each.state, each.reason) for each in talk.ask(p.GetCondition()).positions]
    assert trust[1] == (positions.LOST, positions.DRIVER)
    assert trust[2] == (positions.KNOWN, positions.SET)
    assert talk.position(3) == talk.made(3)
    talk.refuse(m.ERR_GENERAL, p.MotorMove(2, 0))
    # cooled down: set up again, and at rest until the next request
    talk.forget()
    board.chips[1].status &= ~0x02
    talk.run(1.5)
    assert board.chips[1].gstat == 0
    assert len(board.chips[1].writes) >= 24
    assert not enables(talk)
    assert not talk.made(2)
    talk.accept(p.MotorMove(2, talk.position(2) + 10)).run(0.2)
    assert talk.made(2) == 10
    assert [(motor, level) for motor, level, _ in enables(talk)] == [(2, 0)]


@pytest.mark.repeats
def test_one_port_prints_it_with_ctrl_c():
    """`ports: 1`: the host gets only messages; the firmware's texts come with the REPL's
    prompt."""
    with DrivenBoard(ports=1) as board:
        talk = Session(board, motors=4, reply_s=0.1)
        talk.run(1.3)
        board.connect()
        talk.run(2.0).accept(p.MotorMove(2, 30_000)).run(0.3)
        board.chips[1].status |= 0x02
        board.chips[1].gstat |= 0x02
        talk.run(0.8)
        assert [message for _, message in talk.events(p.HardStop)] == [
            p.HardStop(m.HARD_STOP_FAULT)
        ]
        assert talk.ask(p.GetCondition()).bits & m.CONDITION_DRIVER
        talk.accept(p.MotorMove(1, 100))  # the LED no longer shows the fault
        talk.run(0.3)
        assert talk.bytes_for(b"", 0.1) == []
        talk.port.write(b"\r\x03")
        board.run_until(board.now_ns + 500_000_000)
        said = board.protocol.transmit().decode()
        assert "framestep: a driver failed; the motors were ramped down\r\n" in said
        reported = [
            line for line in said.splitlines() if line.startswith("framestep: driver of motor")
        ]
        motors = [int(line.split()[4]) for line in reported]
        assert motors[:4] == sorted(motors[4:8]) == [1, 2, 3, 4], said
        assert motors[8:] == [2], said
        assert reported[-1].endswith("has switched off, too hot")
        assert said.endswith(">>> ")
