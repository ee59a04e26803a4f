"""The counter of a hand wheel, on fake pins."""

from framestep.hand_wheel import Wheel

A, B = 22, 26
UP = (1 << A, 1 << A | 1 << B, 1 << B, 0)  # levels after each quarter of a click


class Pins:
    """A HAL that has only pins; `level` is the word of all."""

    level = 0

    def input(self, pin, pull):
        return 1 << pin

    def levels(self):
        return self.level

    def watch(self, bits, handler):
        pass

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass


def at_rest():
    pins = Pins()
    wheel = Wheel(pins, A, B, "up")
    turn(wheel, pins, (1 << B, 0))
    wheel.rest()
    return wheel, pins


def turn(wheel, pins, levels):
    for level in levels:
        pins.level = level
        wheel.on_edge(None)


def test_ten_turns_a_second_for_an_hour():
    """24 clicks a turn. The main loop takes them every 24 ms, and at times not for a second."""
    wheel, pins = at_rest()
    clicks = 0
    for a_turn in range(36_000):
        turn(wheel, pins, UP * 24)
        if a_turn % 50 > 10:
            clicks += wheel.take()
    assert clicks + wheel.take() == 36_000 * 24


def test_directions_and_parts_of_clicks():
    wheel, pins = at_rest()
    turn(wheel, pins, UP * 3 + UP[:2])
    assert wheel.take() == 3
    turn(wheel, pins, UP[2:])
    assert wheel.take() == 1
    turn(wheel, pins, (UP[2], UP[1], UP[0]))
    assert wheel.take() == 0
    turn(wheel, pins, (UP[3],))
    assert wheel.take() == -1
    turn(wheel, pins, (UP[2], UP[1], UP[0], UP[3]) * 5)
    assert wheel.take() == -5


def test_an_edge_without_its_partner_counts_nothing():
    wheel, pins = at_rest()
    for level in UP[:3]:
        turn(wheel, pins, (level, 0) * 1000)
        assert wheel.take() == 0
    turn(wheel, pins, (UP[1], UP[3]) * 1000)  # both at once
    assert wheel.take() == 0
