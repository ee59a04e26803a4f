"""Virtual axes: rigs of each type, their moves and jogs."""

import struct

from framestep.protocol import messages as m
from framestep_tools.judge.virtual_reference import Axis as VirtualAxis
from framestep_tools.judge.virtual_reference import Rig as VirtualRig

from .host import ODD, Actions, signed


class Virtuals(Actions):
    """A virtual rig of motors that were not used before."""

    def __init__(self, world):
        super().__init__(world)
        self.virtual = False  # there is a virtual rig

    def paced(self, number):
        """Set a motor so that it brakes for some time, and soon reaches its soft limits."""
        dice, i = self.dice, number - 1
        velocity = dice.choice((300, 1000, 3000))
        self.host.speeds[i], self.host.steep[i] = velocity, int(velocity * dice.choice((1, 2, 5)))
        self.ask(m.MSG_MOTOR_SET_SPEED, struct.pack("<BII", number, velocity, self.host.steep[i]))
        if dice.random() < 0.5:
            here = self.here(i)
            lower, upper = (
                here - int(velocity * dice.uniform(0, 1.5)),
                here + int(velocity * dice.uniform(0, 1.5)),
            )
            self.ask(
                m.MSG_MOTOR_SET_LIMITS,
                struct.pack("<BBiBiB", number, 1, signed(lower), 1, signed(upper), 0),
            )

    def virtual_axes(self):
        dice = self.dice
        if not self.rig.virtuals or self.motors < 2:
            return
        if not self.virtual or dice.random() < 0.3:
            self.settle(1000) or self.halt()
            kind = dice.choice((1, 2, 3, 4, 4, 0))
            axes = []
            motors = list(range(1, self.motors + 1))
            dice.shuffle(motors)
            for _ in range(2 if kind == 2 else 6):
                motor = motors.pop() if motors and dice.random() < 0.85 else 0
                axes.append(
                    VirtualAxis(
                        motor, dice.choice((10.0, 100.0, 250.0, 1000.0)), dice.uniform(-20, 20)
                    )
                )
            if kind == 0:
                payload = b"\x00"
            else:
                nodal = tuple(dice.choice((0.0, 20.0, -35.5)) for _ in range(3))
                payload = VirtualRig(
                    kind,
                    tuple(axes),
                    length=dice.choice((600.0, 857.7)),
                    extension=dice.choice((0.0, 78.0)),
                    nodal=nodal,
                ).payload()
            code, _ = self.ask(m.MSG_VIRT_CONFIG, payload)
            self.virtual = code == m.OK and kind != 0
            if not self.virtual:
                return
            for axis in axes:
                if axis.motor and dice.random() < 0.7:
                    self.paced(axis.motor)
        for _ in range(dice.choice((1, 2, 4))):
            x = dice.random()
            if x < 0.35:
                self.send(
                    m.MSG_VIRT_MOVE,
                    struct.pack(
                        "<Bi",
                        dice.randint(1, 6),
                        dice.choice(
                            (
                                dice.randint(-3_000_000, 3_000_000),
                                dice.randint(-100_000, 100_000),
                                *ODD[:4],
                            )
                        ),
                    ),
                )
            elif x < 0.6:
                self.send(
                    m.MSG_VIRT_JOG,
                    struct.pack(
                        "<BHi",
                        dice.randint(1, 6),
                        dice.choice((1, 500, 10000)),
                        dice.choice((2**31 - 1, -(2**31), dice.randint(-3000, 3000))),
                    ),
                )
            elif x < 0.8:
                self.send(
                    m.MSG_VIRT_JOG_ON_LINE,
                    struct.pack(
                        "<Bh", dice.randint(0, 4), dice.choice((1, -1, 10000, -10000, 700))
                    ),
                )
            else:
                self.send(
                    m.MSG_VIRT_AIM_POINT,
                    struct.pack(
                        "<Biii",
                        dice.randint(0, 1),
                        *(dice.randint(-100_000, 100_000) for _ in range(3)),
                    ),
                )
            self.pause(1200)
            y = dice.random()
            if y < 0.3:
                for number in range(1, 7) if dice.random() < 0.5 else (dice.randint(1, 6),):
                    self.send(m.MSG_VIRT_STOP, bytes((number,)))
            elif y < 0.45:
                self.halt()
            elif y < 0.6:
                self.world.anything()
        if not self.settle(dice.choice((500, 4000))):
            self.halt()
