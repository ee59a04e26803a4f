"""The firmware's geometry of a rig, driven with double-precision numbers: shared by the tests of the virtual axes."""

import importlib
import math
from array import array

from framestep.motion import reals
from framestep.protocol import messages
from framestep.protocol.frames import FRAME, FrameReader
from framestep.virtuals import geometry as g
from framestep_tools import virtual_reference as reference
from framestep_tools import wire

MODULES = {1: "boom_swing_track", 2: "swing_pan", 3: "y_swing_track", 4: "x_y_z"}
MOTORS = 8


class Refused(Exception):
    """A code other than 0; it is the argument."""


def put(r, to, value):
    """r[to] = the nearest number that a register holds."""
    mantissa, exponent = math.frexp(value)
    m = round(mantissa * 2**30)
    if abs(m) == 2**30:
        m //= 2
        exponent += 1
    r[to], r[to + 1] = (m, exponent - 30) if m else (0, 0)


def frame(payload):
    """A FrameReader that has read a VIRT_CONFIG."""
    reader = FrameReader()
    data = wire.encode(messages.MSG_VIRT_CONFIG, payload, 7)
    assert reader.feed(data, 0, len(data)) == len(data)
    assert reader.poll() == FRAME
    return reader


class Board:
    """A Geometry with numbers in and out. `configure` may be given a payload in place of the rig's own."""

    def __init__(self, kind):
        self.r = array("i", [0] * g.REGISTERS)
        module = importlib.import_module(f"framestep.virtuals.{MODULES[kind]}")
        self.geometry = module.Geometry(self.r)
        self.present = array("i", [0] * MOTORS)

    @classmethod
    def of(cls, rig: reference.Rig):
        board = cls(rig.kind)
        for axis in rig.axes:
            if axis.motor:
                board.present[axis.motor - 1] = axis.step
        board.configure(rig.payload())
        return board

    def configure(self, payload):
        self._check(self.geometry.configure(frame(payload), self.present))

    @staticmethod
    def _check(code):
        if code:
            raise Refused(code)

    def _six(self, at):
        return [reals.value(self.r, at + 2 * i) for i in range(6)]

    def pose(self):
        return self._six(g.POSE)

    def forward(self, joints):
        for i, joint in enumerate(joints):
            put(self.r, g.JOINT + 2 * i, joint)
        self._check(self.geometry.forward())
        return self.pose()

    def inverse(self, pose):
        for i, number in enumerate(pose):
            put(self.r, g.POSE + 2 * i, number)
        self._check(self.geometry.inverse())
        return self._six(g.JOINT)

    def locate(self, steps):
        """steps: {motor: step}"""
        for motor, step in steps.items():
            self.present[motor - 1] = step
        self._check(self.geometry.locate(self.present))
        return self.pose()

    def steps(self):
        """Motor steps of JOINT, as real numbers, for the axes that there are."""
        out = array("i", [0, 0])
        found = []
        for i in range(6):
            self._check(self.geometry.steps(i, out, 0))
            assert 0 <= out[1] < 65536
            found.append(out[0] + out[1] / 65536)
        return found
