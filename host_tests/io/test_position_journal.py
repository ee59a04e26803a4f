"""Saved positions: what remains after a power cut, byte by byte, and how the flash wears."""

import binascii
import contextlib
from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.hal.host import HostFlash, HostHal
from framestep.hal.host_board import HostBoard
from framestep.io.position_journal import SLOT_BYTES, STILL_MS, PositionJournal, checksum
from framestep.io.position_restore import restore
from framestep.motors.axes import Axes
from framestep.motors.backlash import BACKLASH, LOAD
from framestep.motors.positions import (
    BEFORE,
    BROKEN_OFF,
    HELD,
    KNOWN,
    LOST,
    RESTORED,
    SET,
    STEPS,
    UNSET,
)
from framestep.protocol import messages as m
from framestep.pulse import stepper
from framestep_tools import payloads as p
from framestep_tools.simulator.boards import SimulatedBoard
from host_tests.end_to_end.session import Session, run_request
from host_tests.pulse.engine import Bench

RIG = {"remember_positions": True}
REMEMBERED = (HELD, RESTORED)
CUT_OFF = (LOST, BROKEN_OFF)
IS_SET = (KNOWN, SET)
NOT_SET = (LOST, UNSET)


class PowerCut(Exception):
    pass


class Brittle(HostFlash):
    """Fails after N bytes written or erased, midway through the last one."""

    def __init__(self, *args):
        super().__init__(*args)
        self.left = None

    def _one_byte(self):
        if self.left is not None:
            self.left -= 1
            return self.left >= 0
        return True

    def program(self, block, at, page):
        for i, byte in enumerate(bytes(page), at):
            if not self._one_byte():
                self.content[block][i] &= byte | 0x5A
                raise PowerCut
            self.content[block][i] &= byte
        return True

    def erase(self, block, page):
        for i in range(self.bytes):
            if not self._one_byte():
                self.content[block][i] |= 0x5A
                raise PowerCut
            self.content[block][i] = 0xFF
        return super().erase(block, page)


class PoweredUp:
    """A board from power-up on: motors at rest, and their saved positions."""

    def __init__(self, flash, motors=3):
        self.axes = Axes(Bench(motors))
        self.journal = PositionJournal(flash, self.axes)
        restore(self.journal)
        self.positions = self.axes.positions
        self.now = 2**30 - 500

    def poll(self, ms=STILL_MS + 2, busy=False):
        for wait in (1, ms - 1):
            self.now = (self.now + wait) & (2**30 - 1)
            self.journal.poll(self.now, busy)

    def put(self, *places):
        """Set the motors' positions as the host does."""
        for motor, place in enumerate(places):
            self.positions.set_known(motor)
            self.axes[motor].backlash[LOAD] = self.axes[motor].block[stepper.POSITION] = place

    def move(self, *places):
        """Move the motors there."""
        self.positions.about_to_change()
        for motor, place in enumerate(places):
            self.axes[motor].block[stepper.POSITION] = place

    @property
    def state(self):
        """Return ((positions), (state and reason of each))."""
        for axis in self.axes:
            axis.backlash.refresh()
        places = tuple(axis.backlash[LOAD] for axis in self.axes)
        return places, tuple(zip(self.positions.states, self.positions.reasons, strict=True))


def kept(*places):
    return places, (REMEMBERED,) * len(places)


def cut_off(*places):
    return places, (CUT_OFF,) * len(places)


@given(st.binary(max_size=130))
def test_checksum(data):
    out = array("i", [1, 2])
    checksum(data, len(data), out, 1)
    assert out[0] == 1
    assert out[1] & 0xFFFFFFFF == binascii.crc32(data)


def test_kept_at_rest_only():
    flash = HostFlash()
    powered = PoweredUp(flash)
    powered.put(5, -(2**31), 2**31 - 1)
    powered.poll(STILL_MS)
    assert PoweredUp(flash).state == ((0, 0, 0), (NOT_SET,) * 3)
    powered.poll(2)
    assert PoweredUp(flash).state == kept(5, -(2**31), 2**31 - 1)
    powered.move(6, 7, 8)
    assert PoweredUp(flash).state == cut_off(5, -(2**31), 2**31 - 1)
    powered.poll(10 * STILL_MS, busy=True)
    powered.poll(STILL_MS)
    assert PoweredUp(flash).state == cut_off(5, -(2**31), 2**31 - 1)
    powered.poll(2)
    assert PoweredUp(flash).state == kept(6, 7, 8)


def test_lost_ones_stay_lost():
    flash = HostFlash()
    powered = PoweredUp(flash)
    powered.put(1, 2)
    powered.positions.set_lost(2, STEPS)
    powered.poll()
    assert PoweredUp(flash).state == ((1, 2, 0), (REMEMBERED, (LOST, BEFORE), (LOST, BEFORE)))
    powered = PoweredUp(flash)
    powered.put(0, 5)
    powered.poll()
    assert PoweredUp(flash).state == ((0, 5, 0), (REMEMBERED, REMEMBERED, (LOST, BEFORE)))


def test_the_play_of_the_gears_is_kept():
    flash = HostFlash()
    powered = PoweredUp(flash)
    powered.axes[1].backlash[BACKLASH] = 20
    powered.put(0, 100, 0)
    powered.axes[1].block[stepper.POSITION] = 92  # the load is where it was
    powered.poll()
    again = PoweredUp(flash)
    again.axes[1].backlash[BACKLASH] = 20
    assert again.state == kept(0, 100, 0)
    assert again.axes[1].block[stepper.POSITION] == 92


def test_a_rig_with_another_number_of_motors():
    flash = HostFlash()
    powered = PoweredUp(flash)
    powered.put(1, 2, 3)
    powered.poll()
    assert PoweredUp(flash, 2).state == ((0, 0), (NOT_SET,) * 2)


def cuts(prepare, act, step=1):
    """Act with the power cut after 0, step, … bytes, and restart. Yields what each start finds.
    prepare() -> (flash, powered)."""
    at = 0
    while True:
        flash, powered = prepare()
        flash.left = at
        try:
            act(powered)
        except PowerCut:
            flash.left = None
            yield PoweredUp(flash)
            at += step
            continue
        return


def moved(records):
    """Return a function that makes a board with so many records, whose motors have moved once more.
    The records have positions (n, -n, 0) for n up to `records`."""

    def prepare():
        flash = Brittle(2, 4 * SLOT_BYTES)
        powered = PoweredUp(flash)
        for n in range(1, records + 1):
            powered.put(n, -n, 0)
            powered.poll()
        powered.move(77, 88, 99)
        return flash, powered

    return prepare


@pytest.mark.parametrize("records", [1, 2, 8])
def test_power_cut_while_a_record_is_written(records):
    """Also if a block is erased before: after the eighth record."""
    found = [again.state for again in cuts(moved(records), PoweredUp.poll)]
    assert len(found) >= SLOT_BYTES
    assert set(found) <= {cut_off(records, -records, 0), kept(77, 88, 99)}
    assert found[0] == cut_off(records, -records, 0)
    # whatever remains, the next record finds its place
    for again in cuts(moved(records), PoweredUp.poll, 13):
        again.put(3, 2, 1)
        again.poll()
        assert again.journal.working
        assert PoweredUp(again.journal.flash).state == kept(3, 2, 1)


def test_power_cut_while_the_mark_is_cleared():
    """The motors have not moved yet. Either state is safe; the numbers are right."""

    def prepare():
        flash = Brittle(2, 4 * SLOT_BYTES)
        powered = PoweredUp(flash)
        powered.put(1, 2, 3)
        powered.poll()
        return flash, powered

    found = [
        again.state for again in cuts(prepare, lambda powered: powered.positions.about_to_change())
    ]
    assert set(found) == {cut_off(1, 2, 3), kept(1, 2, 3)}


@given(st.lists(st.tuples(st.integers(0, 7), st.integers(0, 2000)), max_size=30))
def test_power_cuts_at_any_time(steps):
    """Whatever has happened, positions reported as held are where the motors last rested."""
    flash = Brittle(3, 4 * SLOT_BYTES)
    powered = PoweredUp(flash)
    place = 0
    for what, number in steps:
        if what < 3:
            place = number
            powered.move(place, 0, 0)
        elif what == 3:
            place = number
            powered.put(place, 0, 0)
        elif what < 6:
            powered.poll()
        else:
            flash.left = number if what == 7 else None
            with contextlib.suppress(PowerCut):
                powered.move(place + 1, 0, 0)
                place += 1
                powered.poll()
            flash.left = None
            powered = PoweredUp(flash)
            places, states = powered.state
            if states[0] == REMEMBERED:
                assert places[0] == place
            place = places[0]


def test_wear():
    """Wear as in docs/use/safety.md: blocks take turns, and one erasure serves all slots of a
    block. 30 slots of a board with up to twelve motors take 4 kB."""
    flash = HostFlash(4, 30 * SLOT_BYTES)
    powered = PoweredUp(flash)
    powered.put(0, 0, 0)
    records = 4 * 30 * 5
    for n in range(records):
        powered.move(n, n, n)
        powered.journal._write()
        powered.positions.saved = True
    assert flash.erasures == [5] * 4
    assert records / sum(flash.erasures) == 30


def test_a_flash_that_does_not_take_it():
    class Worn(HostFlash):
        def program(self, block, at, page):
            return True

    powered = PoweredUp(Worn())
    powered.put(1, 2, 3)
    powered.poll()
    assert not powered.journal.working
    assert not powered.positions.saved
    flash = HostFlash()
    powered = PoweredUp(flash)
    powered.put(1, 2, 3)
    powered.poll()
    flash.program = lambda block, at, page: False
    powered.move(4, 5, 6)
    powered.poll()
    assert not powered.journal.working
    assert not powered.positions.saved


# ---------------------------------------------------------------- with a controller


class Guarded(HostFlash):
    """A flash that may be written to only while no motor moves."""

    board = None
    writes = 0

    def _at_rest(self):
        assert not any(block[stepper.MODE] for block in self.board.hal.kernel.blocks)

    def program(self, block, at, page):
        self.writes += 1
        self._at_rest()
        return super().program(block, at, page)

    def erase(self, block, page):
        self._at_rest()
        return super().erase(block, page)


def power_up(flash, rig=RIG):
    board = SimulatedBoard(rig)
    inside = flash.board = HostBoard(rig, flash=flash)
    inside.on_edge, board._board = board._board.on_edge, inside
    return Session(board)


def trust(session, *motors):
    found = session.ask(p.GetCondition()).positions
    return [(found[motor - 1].state, found[motor - 1].reason) for motor in motors]


def test_over_power_cuts():
    flash = Guarded()
    session = power_up(flash)
    assert session.ask(p.GetCondition()).bits == m.CONDITION_POSITIONS_PENDING
    session.run(10)
    assert flash.writes == 0  # nothing is known yet
    session.accept(p.MotorResetPosition(1, 1000), p.MotorResetPosition(2, -1000))
    session.accept(p.MotorMove(1, 3000)).wait_idle()
    assert session.ask(p.GetCondition()).bits == m.CONDITION_POSITIONS_PENDING
    session.run(2.1)
    assert session.ask(p.GetCondition()).bits == m.CONDITION_POSITIONS_SAVED
    writes = flash.writes
    session.run(20)
    assert flash.writes == writes

    session = power_up(flash)
    assert (session.position(1), session.position(2)) == (3000, -1000)
    assert trust(session, 1, 2, 3) == [REMEMBERED, REMEMBERED, (LOST, BEFORE)]
    session.accept(p.MotorMove(1, 0), p.MotorMove(2, 3000)).run(0.3)
    assert trust(session, 1, 2) == [REMEMBERED, REMEMBERED]

    session = power_up(flash)
    assert (session.position(1), session.position(2)) == (3000, -1000)
    assert trust(session, 1, 2, 3) == [CUT_OFF] * 3
    session.accept(p.MotorResetPosition(1, 7))
    assert trust(session, 1, 2) == [IS_SET, CUT_OFF]
    session.run(2.1)
    session = power_up(flash)
    assert trust(session, 1, 2) == [REMEMBERED, (LOST, BEFORE)]
    assert session.position(1) == 7


def test_not_while_a_run_waits_for_its_go():
    """Nothing must be written between GO and the first step."""
    flash = Guarded()
    session = power_up(flash)
    session.accept(p.MotorResetPosition(1, 0))
    session.upload({1: [5 * k for k in range(40)]})
    session.ready(run_request(end=40))
    writes = flash.writes
    session.run(5)
    assert flash.writes == writes
    session.accept(p.RtGo()).wait_idle()
    assert flash.writes == writes
    session.run(2.1)
    assert flash.writes == writes + 1
    assert power_up(flash).position(1) == session.position(1)


def test_a_driver_switched_off_needs_no_writing():
    flash = Guarded()
    session = power_up(flash)
    session.accept(p.MotorResetPosition(1, 5)).run(2.1)
    writes = flash.writes
    session.accept(p.MotorConfigure(1, 0)).run(2.1)
    assert flash.writes == writes
    assert trust(power_up(flash), 1) == [REMEMBERED]


def test_without_a_flash(capsys, monkeypatch):
    def flash(hal):
        raise OSError(28)

    monkeypatch.setattr(HostHal, "flash", flash)
    session = power_up(Guarded())
    assert "cannot be saved" in capsys.readouterr().out
    assert session.ask(p.GetCondition()).bits == m.CONDITION_POSITIONS_UNSAVABLE
    session.accept(p.MotorResetPosition(1, 5), p.MotorMove(1, 100)).wait_idle()
    assert session.position(1) == 100
