"""Pins for tests of io/: a HAL that has only pins, and records what was driven."""

from framestep.hal.absent import NoDmx
from framestep.hal.host import BOARD
from framestep.rig import Rig


class Pins:
    """The part of the HAL contract that io/ uses. `level` is the word of all pins; tests may set
    it."""

    def __init__(self, board=BOARD):
        self.board = board
        self.level = 0
        self.outputs = 0
        self.pulls = {}
        self.writes = []  # (high, low)
        self.dmx = NoDmx()

    def output(self, pin, level):
        self.outputs |= 1 << pin
        self.put(pin, level)
        return 1 << pin

    def input(self, pin, pull):
        self.pulls[pin] = pull
        self.put(pin, 1 if pull == "up" else 0)
        return 1 << pin

    def drive(self, high, low):
        assert high & low == 0
        assert (high | low) & ~self.outputs == 0
        self.writes.append((high, low))
        self.level = (self.level | high) & ~low

    def levels(self):
        return self.level

    def watch(self, bits, handler):
        self.watched = (bits, handler)

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass

    def put(self, pin, level):
        """Set a pin to a level from outside."""
        self.level = self.level & ~(1 << pin) | level << pin

    def at(self, pin):
        return self.level >> pin & 1


def rig(**settings):
    return Rig(settings, BOARD)
