"""The firmware's own kinematics on this computer: its formulas, with double-precision numbers in
and out.

Its numbers are integers, the same on every runtime, so a pose leads to the same joints here and on
a board.
"""

import importlib
import math
from array import array

from framestep.base.results import ERR_RANGE
from framestep.motion import reals
from framestep.protocol import messages
from framestep.protocol.frames import FRAME, FrameReader
from framestep.virtual_axes.kinematics.kinematics import Configuration
from framestep.virtual_axes.registers import JOINT, POSE, REGISTERS
from framestep.virtual_axes.requests import read_configuration

from ..client import wire
from ..judge.virtual_reference import (
    BOOM_SWING_TRACK,
    SWING_PAN,
    X_Y_Z,
    Y_SWING_TRACK,
    Numbers,
    Rig,
)

MODULES = {
    BOOM_SWING_TRACK: "boom_swing_track",
    SWING_PAN: "swing_pan",
    Y_SWING_TRACK: "y_swing_track",
    X_Y_Z: "x_y_z",
}
MOTORS = 8  # of the configuration


class Refused(Exception):
    """The firmware has returned a code other than 0, the argument."""


def put(r: "array[int]", to: int, value: float) -> None:
    """Set r[to] to the nearest number that a register can hold."""
    mantissa, exponent = math.frexp(value)
    m = round(mantissa * 2**30)
    if abs(m) == 2**30:
        m //= 2
        exponent += 1
    r[to], r[to + 1] = (m, exponent - 30) if m else (0, 0)


def frame(payload: bytes) -> FrameReader:
    """Return a FrameReader that has read a VIRT_CONFIG."""
    reader = FrameReader()
    data = wire.encode(messages.MSG_VIRT_CONFIG, payload, 7)
    if reader.feed(data, 0, len(data)) != len(data) or reader.poll() != FRAME:
        raise ValueError("this payload is not a frame")
    return reader


class Firmware:
    """The firmware's Geometry of a type, with double-precision numbers in and out. Raises Refused
    for a code."""

    def __init__(self, kind: int):
        self.r = array("i", [0] * REGISTERS)
        module = importlib.import_module(f"framestep.virtual_axes.kinematics.{MODULES[kind]}")
        self.geometry = module.Geometry(self.r)
        self.kind = kind
        self.configuration = Configuration()
        self.present = array("i", [0] * MOTORS)

    @classmethod
    def of(cls, rig: Rig) -> "Firmware":
        """Make one configured as `rig`, with its motors at the steps of its axes."""
        firmware = cls(rig.kind)
        for axis in rig.axes:
            if axis.motor:
                firmware.present[axis.motor - 1] = axis.step
        firmware.configure(rig.payload())
        return firmware

    @staticmethod
    def _check(code: int) -> None:
        if code:
            raise Refused(code)

    def _six(self, at: int) -> list[float]:
        return [reals.value(self.r, at + 2 * i) for i in range(6)]

    def number(self, register: int) -> float:
        """Return a number in a register."""
        return reals.value(self.r, register)

    def configure(self, payload: bytes) -> None:
        """Configure it, as VIRT_CONFIG does."""
        if not read_configuration(frame(payload), self.kind, MOTORS, self.configuration):
            raise Refused(ERR_RANGE)
        self._check(self.geometry.configure(self.configuration, self.present))

    def pose(self) -> list[float]:
        """Return vTrack, vEW, vNS, vPan, vTilt, vRoll."""
        return self._six(POSE)

    def host_pose(self) -> list[float]:
        """Return the pose in the host's coordinates."""
        out = array("i", [0] * 6)
        for i in range(6):
            self.geometry.to_host(out, i, i)
        return [number / 100000 for number in out]

    def forward(self, joints: Numbers) -> list[float]:
        """Return the pose for joints."""
        for i, joint in enumerate(joints):
            put(self.r, JOINT + 2 * i, float(joint))
        self._check(self.geometry.forward())
        return self.pose()

    def inverse(self, pose: Numbers) -> list[float]:
        """Return the joints for a pose."""
        for i, number in enumerate(pose):
            put(self.r, POSE + 2 * i, float(number))
        self._check(self.geometry.inverse())
        return self._six(JOINT)

    def locate(self, steps: dict[int, int]) -> list[float]:
        """Return the pose at these steps, {motor: step}."""
        for motor, step in steps.items():
            self.present[motor - 1] = step
        self._check(self.geometry.locate(self.present))
        return self.pose()

    def steps(self) -> list[float]:
        """Return the target steps of the six axes' motors, as real numbers."""
        out = array("i", [0] * 12)
        self._check(self.geometry.motor_steps(out, 0))
        return [out[k] + out[k + 1] / 65536 for k in range(0, 12, 2)]
