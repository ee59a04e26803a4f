"""Stop inputs on fake pins, and motors that are only numbers."""

from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.io.requests import send_stops
from framestep.io.safety import RELEASE_MS, Safety
from framestep.motors.rates import ACCELERATION_LIMIT, kernel_rate
from framestep.protocol import messages as m
from framestep.protocol.frames import FrameWriter
from framestep.pulse import stepper
from host_tests.fakes import Motors
from host_tests.io.pins import Pins, rig

ESTOP, HIGH, LOW = 19, 22, 26


class Switches:
    """Stop inputs, motors that are only numbers, and time."""

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
        """Return the payloads of the HARD_STOPs sent."""
        send_stops(self.writer, self.safety, is_open)
        data = bytearray(4096)
        count = self.writer.take(data, len(data))
        found = []
        at = 0
        while at < count:
            assert data[at + 6] | data[at + 7] << 8 == m.MSG_MOTOR_HARD_STOP
            assert data[at + 2 : at + 6] == bytes(4)
            length = data[at + 8]
            found.append(tuple(data[at + 10 : at + 10 + length]))
            at += 12 + length
        return found


@pytest.fixture(params=["nc", "no"])
def estop(request):
    """Return Switches with a released E-stop, and a function that presses and releases it."""
    switches = Switches(estop=request.param)

    def press(on):
        switches.pins.put(ESTOP, on == (request.param == "nc"))

    press(False)
    assert not switches.poll(50)
    return switches, press


def test_a_released_estop_is_no_news(estop):
    switches, _ = estop
    assert not switches.safety.tripped
    assert switches.reports() == []


def test_a_pressed_estop_trips_at_once_and_is_reported_once(estop):
    switches, press = estop
    press(True)
    assert switches.poll()
    assert switches.safety.tripped
    assert switches.reports() == [(m.HARD_STOP_GENERAL,)]
    assert not switches.poll(100)
    assert switches.safety.tripped
    assert switches.reports() == []


def test_an_estop_counts_as_released_when_it_has_not_bounced_for_a_while(estop):
    switches, press = estop
    press(True)
    switches.poll()
    switches.reports()
    for _ in range(2):
        press(False)
        assert not switches.poll(RELEASE_MS)
        assert switches.safety.tripped
        press(True)  # it bounces: that is no other stop
        assert not switches.poll()
        assert switches.safety.tripped
        assert switches.reports() == []
    press(False)
    switches.poll(RELEASE_MS)
    assert switches.safety.tripped
    switches.poll()
    assert not switches.safety.tripped
    press(True)
    assert switches.poll()
    assert switches.reports() == [(m.HARD_STOP_GENERAL,)]


@pytest.mark.parametrize("factor", [1, 4])
def test_an_interrupt_halts_every_motor_at_once(factor):
    switches = Switches(estop="nc", hard_stop_factor=factor)
    switches.pins.put(ESTOP, 0)
    switches.poll(30)
    bits, catch = switches.pins.watched
    assert bits == 1 << ESTOP
    steepest = kernel_rate(ACCELERATION_LIMIT)
    for i in range(8):
        switches.motors[i].moves(500 - 100 * i)  # one of them is at rest
        switches.motors[i].block[stepper.BRAKE] = 1000 * (i + 1) if i < 7 else steepest - 1
    catch(None)  # a spike: it is over
    assert not switches.poll()
    assert all(motor.block[stepper.MODE] != stepper.STOP for motor in switches.motors)
    switches.pins.put(ESTOP, 1)
    catch(None)
    for i, motor in enumerate(switches.motors):
        if i == 5:
            assert motor.block[stepper.MODE] == stepper.IDLE
        else:
            rate = min(motor.block[stepper.BRAKE] * factor, steepest)
            assert (motor.block[stepper.MODE], motor.block[stepper.DECEL]) == (stepper.STOP, rate)
    switches.pins.put(ESTOP, 0)  # pressed for less than a pass of the main loop
    catch(None)
    assert switches.poll()
    assert switches.safety.tripped
    assert switches.reports() == [(0,)]
    assert not switches.poll(RELEASE_MS - 1)
    assert switches.safety.tripped
    switches.poll()
    assert not switches.safety.tripped


def test_an_interrupt_halts_a_motor_at_its_limit():
    switches = Switches(limits=[{"high": HIGH, "contact": "no"}])
    leader, partner, other = (switches.motors[i] for i in (0, 1, 2))
    leader.couple(partner)
    switches.safety.assign(1, 1, False)
    for motor in (leader, partner, other):
        motor.moves(300)
        motor.block[stepper.BRAKE] = 1000
    switches.pins.put(HIGH, 0)
    switches.pins.watched[1](None)
    assert leader.block[stepper.MODE] == partner.block[stepper.MODE] == stepper.STOP
    assert other.block[stepper.MODE] == stepper.RUN
    for motor in (leader, partner):
        motor.moves(0)  # it has come to rest before the main loop looks
    switches.pins.put(HIGH, 1)
    assert switches.poll()
    assert switches.safety.motors_at_limit() == 1
    assert switches.reports() == [(m.HARD_STOP_UPPER, 2)]
    assert not switches.poll(50)
    assert switches.reports() == []


def test_a_wire_that_is_off_stops_a_normally_closed_one():
    switches = Switches(estop="nc")  # nothing but the pull-up
    assert switches.poll()
    assert switches.safety.tripped


def test_without_estop_its_pin_means_nothing():
    switches = Switches()
    switches.pins.put(ESTOP, 1)
    assert not switches.poll(5)
    assert not switches.safety.tripped


def test_a_spike_is_not_a_press():
    switches = Switches(estop="nc")
    switches.pins.put(ESTOP, 0)
    looks = []

    def levels():
        looks.append(None)
        return switches.pins.level  # low again at the next reading

    switches.pins.levels = levels
    assert not switches.safety.poll(0, switches.pins.level | 1 << ESTOP)
    assert not switches.safety.tripped
    assert looks


def test_an_estop_waits_for_a_host_while_it_is_held():
    switches = Switches(estop="nc")
    assert switches.poll()
    assert switches.reports(is_open=False) == []
    assert switches.reports() == [(0,)]
    switches.pins.put(ESTOP, 0)
    switches.poll(30)
    switches.pins.put(ESTOP, 1)
    switches.poll()
    assert switches.reports(is_open=False) == []
    switches.pins.put(ESTOP, 0)
    switches.poll(30)
    assert switches.reports() == []


# ------------------------------------------------------------------------------- limit switches


class Limited(Switches):
    """Motor 2, at 1000, has a switch at each end, of which one is looked at; motor 3 has none."""

    def __init__(self, contact, swap, end):
        super().__init__(limits=[{"high": 27}, {"high": HIGH, "low": LOW, "contact": contact}])
        self.pin = HIGH if end == "high" else LOW
        self.active = 1 if contact == "nc" else 0
        self.way = 1 if (end == "high") != swap else -1  # in which the motor reaches the switch
        self.pins.put(27, 0)
        self.pins.put(HIGH, 1 - self.active)
        self.pins.put(LOW, 1 - self.active)
        self.safety.assign(2, 2, swap)
        self.motors[2].block[stepper.POSITION] = 1000

    def press(self, pressed=True):
        self.pins.put(self.pin, self.active if pressed else 1 - self.active)

    def reach(self):
        """Both motors move until motor 2 is at its switch. Return the reports of that."""
        for motor in (2, 3):
            self.motors[motor].moves(500 * self.way)
        assert not self.poll(5)
        assert self.reports() == []
        self.press()
        assert self.poll()
        return self.reports()

    def rest_at_it(self):
        self.reach()
        self.motors[2].moves(0)
        assert not self.poll(10)

    def answer(self, motor, steps):
        """Return the answer to a target so many steps beyond 1000, towards the switch."""
        return self.safety.limit_blocking(motor, array("i", [1000 + steps * self.way]), 0)

    @property
    def refusal(self):
        return m.ERR_HARD_UP if self.way > 0 else m.ERR_HARD_LOW


@pytest.fixture(
    params=[(c, s, e) for e in ("high", "low") for s in (False, True) for c in ("nc", "no")],
    ids=lambda case: f"{case[0]}-{'swapped' if case[1] else 'straight'}-{case[2]}",
)
def limited(request):
    return Limited(*request.param)


def test_a_motor_at_its_limit_is_reported_and_trips_nothing_else(limited):
    upper_or_lower = m.HARD_STOP_UPPER if limited.way > 0 else m.HARD_STOP_LOWER
    assert limited.reach() == [(upper_or_lower, 3)]
    assert limited.safety.motors_at_limit() == 1 << 2
    assert not limited.safety.tripped


def test_a_limit_is_reported_once_while_its_motor_stops(limited):
    limited.reach()
    limited.motors[2].moves(300 * limited.way, stepper.STOP)
    assert not limited.poll(10)
    assert limited.reports() == []


def test_before_the_limit_each_target_is_free(limited):
    assert not limited.poll(5)
    assert limited.answer(2, 1) == m.OK


def test_at_the_limit_only_targets_beyond_it_are_refused(limited):
    limited.rest_at_it()
    assert limited.answer(2, 1) == limited.refusal
    assert limited.answer(2, -1) == m.OK
    assert limited.answer(2, 0) == m.OK
    assert limited.answer(3, 1) == m.OK


def test_a_motor_may_leave_its_limit(limited):
    limited.rest_at_it()
    limited.motors[2].moves(-500 * limited.way)
    assert not limited.poll(10)
    limited.motors[2].block[stepper.VELOCITY] *= -1  # at the end, before it has made a step
    assert not limited.poll(10)
    assert limited.reports() == []


def test_a_limit_is_released_for_a_while_before_it_is_off(limited):
    limited.rest_at_it()
    limited.press(False)
    assert not limited.poll(RELEASE_MS)
    assert limited.answer(2, 1) == limited.refusal
    limited.poll()
    assert limited.answer(2, 1) == m.OK


def test_a_limit_that_is_reached_again_is_reported_again(limited):
    limited.rest_at_it()
    limited.press(False)
    limited.poll(RELEASE_MS + 1)
    assert len(limited.reach()) == 1


def test_positions_that_are_no_small_integers():
    switches = Switches(limits=[{"high": HIGH, "low": LOW}])
    switches.safety.assign(0, 1, False)
    switches.poll()  # both open: both active
    switches.motors[0].block[stepper.POSITION] = 2**31 - 2
    assert switches.safety.limit_blocking(0, array("i", [2**31 - 1]), 0) == m.ERR_HARD_UP
    assert switches.safety.limit_blocking(0, array("i", [-(2**31)]), 0) == m.ERR_HARD_LOW


def test_coupled_motors_share_their_switches():
    switches = Switches(limits=[{"high": HIGH, "low": LOW}])
    safety = switches.safety
    leader, partner = switches.motors[0], switches.motors[1]
    leader.couple(partner)
    safety.assign(1, 1, False)
    switches.pins.put(LOW, 0)
    partner.moves(500)
    assert switches.poll()
    assert safety.motors_at_limit() == 1
    assert switches.reports() == [(m.HARD_STOP_UPPER, 2)]
    partner.moves(0)
    assert safety.limit_blocking(0, array("i", [5]), 0) == m.ERR_HARD_UP
    assert safety.limit_blocking(0, array("i", [-5]), 0) == m.OK
    leader.reversed = 1
    assert safety.limit_blocking(0, array("i", [5]), 0) == m.OK
    assert safety.limit_blocking(0, array("i", [-5]), 0) == m.ERR_HARD_LOW


@given(st.integers(0, 127))
def test_sets_there_are(number):
    switches = Switches(limits=[{"high": HIGH}, {"low": LOW}])
    assert switches.safety.has(number) == (number in (0, 1, 2))


def test_a_set_can_be_taken_away():
    switches = Switches(limits=[{"high": HIGH}])
    switches.safety.assign(0, 1, False)
    switches.safety.assign(0, 0, False)
    switches.motors[0].moves(500)
    assert not switches.poll(3)
    assert switches.safety.limit_blocking(0, array("i", [5]), 0) == m.OK


def test_reports_wait_for_room():
    switches = Switches(estop="nc", limits=[{"high": HIGH}])
    switches.safety.assign(4, 1, False)
    switches.motors[4].moves(500)
    switches.poll()
    while switches.writer.room() > 0:
        switches.writer.begin(m.MSG_HI, None)
        for _ in range(min(switches.writer.room(), 400)):
            switches.writer.u8(0)
        switches.writer.end()
    send_stops(switches.writer, switches.safety, True)
    switches.writer.clear()
    assert switches.reports() == [(0,), (1, 5)]
    assert switches.reports() == []
