"""Stop inputs on bare pins, and motors that are only numbers."""

from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.io import safety as module
from framestep.io.safety import RELEASE_MS, Safety
from framestep.motion import stepper
from framestep.motion.axes import STEEPEST, kernel_rate
from framestep.protocol import messages as m
from framestep.protocol.frames import FrameWriter
from host_tests.io.pins import Pins, rig

ESTOP, HIGH, LOW = 19, 22, 26


def test_words_are_those_of_the_kernel():
    assert (module.MODE, module.VELOCITY, module.DOWN) == (stepper.MODE, stepper.VELOCITY, stepper.DOWN)
    assert module.MOVES == stepper.RUN | stepper.STOP


class Motor:
    partner = leader = None
    turned = 0

    def __init__(self):
        self.block = array("i", [0] * stepper.BLOCK_WORDS)

    def moves(self, velocity, mode=stepper.RUN):
        self.block[stepper.MODE] = mode if velocity else stepper.IDLE
        self.block[stepper.VELOCITY] = velocity * 4194
        if velocity:
            self.block[stepper.DOWN] = -1 if velocity < 0 else 0

    def position_to(self, target, i):
        target[i] = self.block[stepper.POSITION]


class Motors:
    def __init__(self, count=8):
        self.motors = [Motor() for _ in range(count)]
        self.count = count

    def __getitem__(self, i):
        return self.motors[i]


class Bench:
    def __init__(self, **settings):
        self.pins = Pins()
        self.motors = Motors()
        self.safety = Safety(self.pins, rig(**settings), self.motors)
        self.now = 2**30 - 30
        self.writer = FrameWriter()

    def poll(self, ms=1):
        news = False
        for _ in range(ms):
            self.now = (self.now + 1) & 0x3FFFFFFF
            news |= self.safety.poll(self.now, self.pins.levels())
        return news

    def reports(self, is_open=True):
        """Payloads of the HARD_STOPs sent."""
        self.safety.report(self.writer, is_open)
        data = bytearray(4096)
        count = self.writer.take(data, len(data))
        found = []
        at = 0
        while at < count:
            assert data[at + 6] | data[at + 7] << 8 == m.MSG_MOTOR_HARD_STOP and data[at + 2 : at + 6] == bytes(4)
            length = data[at + 8]
            found.append(tuple(data[at + 10 : at + 10 + length]))
            at += 12 + length
        return found


@pytest.mark.parametrize(("contact", "pressed"), [("nc", 1), ("no", 0)])
def test_estop(contact, pressed):
    bench = Bench(estop=contact)
    safety = bench.safety
    bench.pins.put(ESTOP, 1 - pressed)
    assert not bench.poll(50) and not safety.tripped and bench.reports() == []
    bench.pins.put(ESTOP, pressed)
    assert bench.poll() and safety.tripped
    assert bench.reports() == [(m.HARD_STOP_GENERAL,)]
    assert not bench.poll(100) and safety.tripped and bench.reports() == []
    bench.pins.put(ESTOP, 1 - pressed)
    assert not bench.poll(RELEASE_MS) and safety.tripped
    bench.pins.put(ESTOP, pressed)  # it bounces
    assert not bench.poll() and safety.tripped and bench.reports() == []
    bench.pins.put(ESTOP, 1 - pressed)
    assert not bench.poll(RELEASE_MS) and safety.tripped
    assert not bench.poll() and not safety.tripped
    bench.pins.put(ESTOP, pressed)
    assert bench.poll() and safety.tripped and bench.reports() == [(m.HARD_STOP_GENERAL,)]


@pytest.mark.parametrize("factor", [1, 4])
def test_an_interrupt_halts_every_motor_at_once(factor):
    bench = Bench(estop="nc", hard_stop_factor=factor)
    bench.pins.put(ESTOP, 0)
    bench.poll(30)
    bits, catch = bench.pins.watched
    assert bits == 1 << ESTOP
    steepest = kernel_rate(STEEPEST)
    for i in range(8):
        bench.motors[i].moves(500 - 100 * i)  # one of them stands still
        bench.motors[i].block[stepper.BRAKE] = 1000 * (i + 1) if i < 7 else steepest - 1
    catch(None)  # a spike: it is over
    assert not bench.poll() and all(motor.block[stepper.MODE] != stepper.STOP for motor in bench.motors.motors)
    bench.pins.put(ESTOP, 1)
    catch(None)
    for i, motor in enumerate(bench.motors.motors):
        if i == 5:
            assert motor.block[stepper.MODE] == stepper.IDLE
        else:
            rate = min(motor.block[stepper.BRAKE] * factor, steepest)
            assert (motor.block[stepper.MODE], motor.block[stepper.DECEL]) == (stepper.STOP, rate)
    bench.pins.put(ESTOP, 0)  # pressed for less than a pass of the main loop
    catch(None)
    assert bench.poll() and bench.safety.tripped and bench.reports() == [(0,)]
    assert not bench.poll(RELEASE_MS - 1) and bench.safety.tripped
    bench.poll()
    assert not bench.safety.tripped


def test_an_interrupt_halts_a_motor_at_its_limit():
    bench = Bench(limits=[{"high": HIGH, "contact": "no"}])
    leader, partner, other = (bench.motors[i] for i in (0, 1, 2))
    leader.partner, partner.leader = partner, leader
    bench.safety.assign(1, 1)
    for motor in (leader, partner, other):
        motor.moves(300)
        motor.block[stepper.BRAKE] = 1000
    bench.pins.put(HIGH, 0)
    bench.pins.watched[1](None)
    assert leader.block[stepper.MODE] == partner.block[stepper.MODE] == stepper.STOP
    assert other.block[stepper.MODE] == stepper.RUN
    for motor in (leader, partner):
        motor.moves(0)  # it has come to rest before the main loop looks
    bench.pins.put(HIGH, 1)
    assert bench.poll() and bench.safety.struck_motors() == 1
    assert bench.reports() == [(m.HARD_STOP_UPPER, 2)]
    assert not bench.poll(50) and bench.reports() == []


def test_a_wire_that_is_off_stops_a_normally_closed_one():
    bench = Bench(estop="nc")  # the pull-up is all there is
    assert bench.poll() and bench.safety.tripped


def test_without_estop_its_pin_means_nothing():
    bench = Bench()
    bench.pins.put(ESTOP, 1)
    assert not bench.poll(5) and not bench.safety.tripped


def test_a_spike_is_not_a_press():
    bench = Bench(estop="nc")
    bench.pins.put(ESTOP, 0)
    looks = []

    def levels():
        looks.append(None)
        return bench.pins.level  # low again by the time it is read once more

    bench.pins.levels = levels
    assert not bench.safety.poll(0, bench.pins.level | 1 << ESTOP)
    assert not bench.safety.tripped and looks


def test_an_estop_waits_for_a_host_while_it_is_held():
    bench = Bench(estop="nc")
    assert bench.poll()
    assert bench.reports(is_open=False) == []
    assert bench.reports() == [(0,)]
    bench.pins.put(ESTOP, 0)
    bench.poll(30)
    bench.pins.put(ESTOP, 1)
    bench.poll()
    assert bench.reports(is_open=False) == []
    bench.pins.put(ESTOP, 0)
    bench.poll(30)
    assert bench.reports() == []


@pytest.mark.parametrize("contact", ["nc", "no"])
@pytest.mark.parametrize("swap", [0, m.HW_SET_SWAP])
@pytest.mark.parametrize("end", ["high", "low"])
def test_limit(contact, swap, end):
    bench = Bench(limits=[{"high": 27}, {"high": HIGH, "low": LOW, "contact": contact}])
    safety = bench.safety
    active = 1 if contact == "nc" else 0
    for pin in (27, HIGH, LOW):
        bench.pins.put(pin, 0 if pin == 27 else 1 - active)
    safety.assign(2, 2 | swap)
    up = (end == "high") != bool(swap)  # which way the motor runs into this switch
    motor = bench.motors[2]
    motor.block[stepper.POSITION] = 1000
    further, back = array("i", [1001 if up else 999]), array("i", [999 if up else 1001])
    motor.moves(500 if up else -500)
    bench.motors[3].moves(500 if up else -500)  # has no limits
    assert not bench.poll(5)
    assert safety.bars(2, further, 0) == m.OK
    bench.pins.put(HIGH if end == "high" else LOW, active)
    assert bench.poll() and safety.struck_motors() == 1 << 2 and not safety.tripped
    assert bench.reports() == [(m.HARD_STOP_UPPER if up else m.HARD_STOP_LOWER, 3)]
    motor.moves(300 if up else -300, stepper.STOP)
    assert not bench.poll(10) and bench.reports() == []
    motor.moves(0)
    assert not bench.poll(10)
    refusal = m.ERR_HARD_UP if up else m.ERR_HARD_LOW
    assert safety.bars(2, further, 0) == refusal
    assert safety.bars(2, back, 0) == m.OK
    assert safety.bars(2, array("i", [1000]), 0) == m.OK
    assert safety.bars(3, further, 0) == m.OK
    motor.moves(-500 if up else 500)  # away
    assert not bench.poll(10) and bench.reports() == []
    motor.block[stepper.VELOCITY] *= -1  # at the end, before it has made a step
    assert not bench.poll(10) and bench.reports() == []
    bench.pins.put(HIGH if end == "high" else LOW, 1 - active)
    assert not bench.poll(RELEASE_MS) and safety.bars(2, further, 0) == refusal
    bench.poll()
    assert safety.bars(2, further, 0) == m.OK
    motor.moves(500 if up else -500)
    bench.poll()
    bench.pins.put(HIGH if end == "high" else LOW, active)
    assert bench.poll() and len(bench.reports()) == 1


def test_positions_that_are_no_small_integers():
    bench = Bench(limits=[{"high": HIGH, "low": LOW}])
    bench.safety.assign(0, 1)
    bench.poll()  # both open: both active
    bench.motors[0].block[stepper.POSITION] = 2**31 - 2
    assert bench.safety.bars(0, array("i", [2**31 - 1]), 0) == m.ERR_HARD_UP
    assert bench.safety.bars(0, array("i", [-(2**31)]), 0) == m.ERR_HARD_LOW


def test_coupled_motors_share_their_switches():
    bench = Bench(limits=[{"high": HIGH, "low": LOW}])
    safety = bench.safety
    leader, partner = bench.motors[0], bench.motors[1]
    leader.partner, partner.leader = partner, leader
    safety.assign(1, 1)
    bench.pins.put(LOW, 0)
    partner.moves(500)
    assert bench.poll() and safety.struck_motors() == 1
    assert bench.reports() == [(m.HARD_STOP_UPPER, 2)]
    partner.moves(0)
    assert safety.bars(0, array("i", [5]), 0) == m.ERR_HARD_UP
    assert safety.bars(0, array("i", [-5]), 0) == m.OK
    leader.turned = 1
    assert safety.bars(0, array("i", [5]), 0) == m.OK
    assert safety.bars(0, array("i", [-5]), 0) == m.ERR_HARD_LOW


@given(st.integers(0, 255))
def test_sets_there_are(hw_set):
    bench = Bench(limits=[{"high": HIGH}, {"low": LOW}])
    assert bench.safety.has(hw_set) == (hw_set & 0x7F in (0, 1, 2))


def test_a_set_can_be_taken_away():
    bench = Bench(limits=[{"high": HIGH}])
    bench.safety.assign(0, 1)
    bench.safety.assign(0, 0)
    bench.motors[0].moves(500)
    assert not bench.poll(3) and bench.safety.bars(0, array("i", [5]), 0) == m.OK


def test_reports_wait_for_room():
    bench = Bench(estop="nc", limits=[{"high": HIGH}])
    bench.safety.assign(4, 1)
    bench.motors[4].moves(500)
    bench.poll()
    while bench.writer.room() > 0:
        bench.writer.begin(m.MSG_HI, None)
        for _ in range(min(bench.writer.room(), 400)):
            bench.writer.u8(0)
        bench.writer.end()
    bench.safety.report(bench.writer, True)
    bench.writer.clear()
    assert bench.reports() == [(0,), (1, 5)]
    assert bench.reports() == []
