"""Drivers that step on both edges, on the emulated board: what each of them counts, from the levels
at its pins and from what it has been set up to, is what the board reports."""

import numpy as np
import pytest

from framestep.motors import positions
from framestep.protocol import messages as m
from framestep_tools import payloads as p
from framestep_tools.building.board_files import board_data
from framestep_tools.simulator import driver_chips as chip
from host_tests.board.test_drivers import DrivenBoard
from host_tests.end_to_end.session import Session

STEP, DIRECTION = board_data("skr_pico")["step"], board_data("skr_pico")["dir"]
SET_UP_S = 2.0
AGAIN_S = 1.8  # from a soft reset until framestep is back
DEDGE = 1 << 29
MOTORS = [{"driver": {"run_ma": 500, "both_edges": both}} for both in (True, True, False, True)]


class CountingBoard(DrivenBoard):
    """Keeps the levels at all pins."""

    def __init__(self, **settings):
        self.records = []
        super().__init__(motors=MOTORS, **settings)

    def edges(self):
        records = self.emulator.trace_read()
        self.records.append(records)
        return self._decoder.feed(records)

    def counts(self, motor):
        """Return the steps that a motor's driver has counted, whether it was on or not."""
        self.edges()
        records = np.concatenate(self.records)
        step = records[records["pin"] == STEP[motor - 1]]
        turn = records[records["pin"] == DIRECTION[motor - 1]]
        changed = np.flatnonzero(np.diff(step["level"])) + 1
        times, levels = step["t"][changed], step["level"][changed]
        set_up = [(0, 0)]  # (time, whether both edges count)
        for at, telegram in self.wire.telegrams:
            address = self.chips[motor - 1].address
            if telegram[1:3] == bytes((address, chip.CHOPCONF | chip.WRITE)):
                set_up.append((at, int.from_bytes(telegram[3:7], "big") & DEDGE))
        begun, both = np.array(set_up).T
        counted = (levels == 1) | (both[np.searchsorted(begun, times) - 1] != 0)
        up = turn["level"][np.searchsorted(turn["t"], times[counted], side="right") - 1] == 1
        return int(np.count_nonzero(up)) - int(np.count_nonzero(~up))


@pytest.fixture(scope="module")
def talk():
    with CountingBoard() as board:
        talk = Session(board, motors=4, reply_s=0.1)
        board.connect()
        talk.run(SET_UP_S)
        yield talk


def test_set_up_while_the_level_is_low(talk):
    assert [bool(each.registers[chip.CHOPCONF] & DEDGE) for each in talk.board.chips] == [
        True, True, False, True,
    ]  # fmt: skip
    filters = [each.registers[chip.GCONF] >> 8 & 1 for each in talk.board.chips]
    assert filters == [0, 0, 1, 0]
    assert [talk.board.counts(motor) for motor in (1, 2, 3, 4)] == [0] * 4
    assert [talk.board.emulator.pin(pin) for pin in STEP] == [0] * 4


def test_the_driver_counts_what_the_board_reports(talk):
    """To and fro, by odd and even numbers of steps, turned and stopped in motion."""
    board = talk.board
    for motor in (1, 2, 3, 4):
        talk.speed(motor, 20_000, 200_000)
    for places in ((1, 1, 1, -1), (0, 2, 5, -800), (2001, -1000, 2000, 777), (3, 3, 3, 3)):
        talk.accept(*(p.MotorMove(motor, at) for motor, at in enumerate(places, 1))).wait_idle()
        assert [board.counts(motor) for motor in (1, 2, 3, 4)] == list(places)
        assert [board.emulator.pin(STEP[i]) for i in (0, 1, 3)] == [
            places[i] & 1 for i in (0, 1, 3)
        ]
    for after in (0.011, 0.083):
        talk.accept(*(p.MotorMove(motor, 20_000) for motor in (1, 2, 3, 4))).run(0.15)
        talk.accept(*(p.MotorMove(motor, -20_000) for motor in (1, 2, 3, 4))).run(after)
        talk.accept(p.MotorStopAll()).wait_idle()
        for motor in (1, 2, 3, 4):
            assert talk.position(motor) == board.counts(motor)


def test_a_soft_reset_is_no_step(talk):
    """At rest with a high level the pin keeps it, and so it does while framestep starts."""
    board = talk.board
    for motor in (1, 2, 3, 4):
        talk.accept(p.MotorMove(motor, 101 - motor // 4))
    talk.wait_idle()
    before = [board.counts(motor) for motor in (1, 2, 3, 4)]
    assert before == [101, 101, 101, 100]
    board.repl.receive(b"\r\x03\r\x02\x04")
    talk.run(AGAIN_S).leave().run(0.1)
    talk.client.events.clear()
    talk.come_back().until(p.DeviceInfo).run(SET_UP_S)
    assert [board.counts(motor) for motor in (1, 2, 3, 4)] == before
    assert [board.emulator.pin(pin) for pin in STEP] == [1, 1, 0, 0]
    for motor in (1, 2, 3, 4):
        talk.accept(p.MotorResetPosition(motor, 0), p.MotorMove(motor, 5 * motor))
    talk.wait_idle()
    counts = [board.counts(motor) for motor in (1, 2, 3, 4)]
    assert [now - was for now, was in zip(counts, before, strict=True)] == [5, 10, 15, 20]


def test_a_driver_that_forgets_its_setting_stops_its_motor(talk):
    """Its supply broke down: it would make half the steps until it is set up again."""
    board = talk.board
    talk.accept(*(p.MotorResetPosition(motor, 0) for motor in (1, 2)))
    talk.accept(p.MotorMove(1, 30_000)).run(0.3)
    board.chips[0].reset()
    talk.run(0.5)
    assert [message for _, message in talk.events(p.HardStop)] == [p.HardStop(m.HARD_STOP_FAULT)]
    trust = talk.ask(p.GetCondition()).positions[0]
    assert (trust.state, trust.reason) == (positions.LOST, positions.DRIVER)
    talk.refuse(m.ERR_GENERAL, p.MotorMove(1, 0)).run(1.5)
    assert board.chips[0].registers[chip.CHOPCONF] & DEDGE
    before = board.counts(1)
    talk.accept(p.MotorResetPosition(1, 0), p.MotorMove(1, 7)).wait_idle()
    assert board.counts(1) - before == 7
