"""Requests about single motors, and about virtual axes of motors that were not used before."""

import struct

from framestep.protocol import messages as m
from framestep_tools.judge.virtual_reference import Axis as VirtualAxis
from framestep_tools.judge.virtual_reference import Rig as VirtualRig
from host_tests.fuzz.host import ODD, WORD, Actions, signed


class Singles(Actions):
    """Settings, moves and jogs."""

    def speed(self):
        dice, i = self.dice, self.motor()
        velocity = int(10 ** dice.uniform(1, 4.2 if dice.random() < 0.9 else 5.7))
        acceleration = int(velocity * 10 ** dice.uniform(-0.1, 2))
        if dice.random() < 0.05:
            velocity = dice.choice((0, 1, 10, 500_000, 500_001, 2**31, WORD))
        if dice.random() < 0.05:
            acceleration = dice.choice((0, 1, 4_000_000, 4_000_001, WORD, 2**31))
        code, _ = self.ask(m.MSG_MOTOR_SET_SPEED, struct.pack("<BII", i, velocity, acceleration))
        if code == m.OK:
            self.host.speeds[i - 1], self.host.steep[i - 1] = (
                velocity,
                acceleration or velocity // 2,
            )

    def limits(self):
        dice, i = self.dice, self.motor()
        here = self.here(i - 1)
        reach = self.host.speeds[i - 1] if 0 < i <= self.motors else 1000
        lower, upper = (signed(here + int(s * dice.random() ** 2 * reach)) for s in (-1, 1))
        if dice.random() < 0.1:
            lower, upper = (
                signed(here + dice.randint(-500, 500)),
                signed(here + dice.randint(-500, 500)),
            )
        if dice.random() < 0.08:
            lower = dice.choice(ODD)
        if dice.random() < 0.08:
            upper = dice.choice(ODD)
        sets = dice.choice((0, 0, 1, 2, 0x81, 0x82, 3, 0xFF)) if self.rig.limits else 0
        on = (dice.randint(0, 1), dice.randint(0, 1)) if dice.random() < 0.97 else (2, 1)
        self.send(
            m.MSG_MOTOR_SET_LIMITS, struct.pack("<BBiBiB", i, on[0], lower, on[1], upper, sets)
        )
        self.pause(5)

    def configure(self):
        dice = self.dice
        flags = dice.choice((1, 1, 1, 1, 3, 3, 9, 0, 0x11, 0x21, 0x31, 0x13, 2, 5))
        self.send(m.MSG_MOTOR_CONFIGURE, bytes((self.motor(), flags)))
        self.pause(5)

    def enable_all(self):
        for i in range(self.motors):
            flags = self.trial.motors[i].flags
            if not flags & 1:
                self.send(m.MSG_MOTOR_CONFIGURE, bytes((i + 1, 1)))
        self.tick(2)

    def move(self):
        dice = self.dice
        for _ in range(dice.choice((1, 1, 2, 3, 6))):
            i = self.motor()
            if dice.random() < 0.55:
                self.send(m.MSG_MOTOR_MOVE, struct.pack("<Bi", i, self.target(i - 1)))
            else:
                speed = dice.choice((1, 50, 1000, 5000, 10000, 10000, 0, 10001))
                to = dice.choice((-(2**31), 2**31 - 1, self.target(i - 1), self.target(i - 1)))
                self.send(m.MSG_MOTOR_JOG, struct.pack("<BHi", i, speed, to))
            self.pause(400)
            x = dice.random()
            if x < 0.12:
                self.send(m.MSG_MOTOR_STOP, bytes((i,)))
                self.pause(60)
            elif x < 0.22:
                self.halt() if dice.random() < 0.5 else self.send(m.MSG_MOTOR_STOP_ALL)
                self.pause(100)
            elif x < 0.3:
                self.send(m.MSG_MOTOR_STOP_ALL)
                self.pause(60)
                self.send(m.MSG_MOTOR_STOP_ALL)
                self.pause(60)
            elif x < 0.4:
                self.world.surroundings.side()

    def home(self):
        """Home motors, with their switches at their places, or pressed and released at any
        time."""
        dice, trial = self.dice, self.trial
        there = [motor for motor in trial.motors if motor.home]
        self.settle(1500) or self.halt()
        if dice.random() < 0.8:
            self.world.surroundings.release()
            self.tick(30)
        asked = dice.sample(there, dice.randint(1, len(there))) if dice.random() < 0.6 else []
        self.send(m.MSG_HOME, bytes(motor.index + 1 for motor in asked))
        if dice.random() < 0.7:
            self.switches_follow(asked or there)
        else:
            self.switches_anyhow(asked or there)
        self.settle(dice.choice((100, 3000))) or self.halt()
        self.send(m.MSG_MOTOR_GET_POSITION)
        self.tick(5)

    def switches_follow(self, motors):
        """Place each motor's home switch somewhere on its way; it bounces."""
        dice, trial = self.dice, self.trial
        switches = {}
        for motor in motors:
            limit = self.rig.limits[motor.home["limit"] - 1]
            downward = motor.home["toward"] == "low"
            way = int(dice.uniform(-0.1, 1.1) * motor.home["travel"])
            at = motor.at - way if downward else motor.at + way
            switches[limit[motor.home["toward"]]] = motor, at, downward, limit["contact"] == "nc"
        levels = {}
        for _ in range(dice.choice((300, 3000, 12_000))):
            for pin, (motor, at, downward, closed) in switches.items():
                place = motor.at + sum(1 if edge & 1 else -1 for edge in motor.edges)
                hit = place <= at if downward else place >= at
                level = int(hit == closed)
                if levels.get(pin) != level:
                    levels[pin] = level
                    for bounce in (level, *dice.choice(((), (1 - level, level)))):
                        trial.do("pin", (pin, bounce))
            self.tick()
            if dice.random() < 0.0005:
                self.world.anything()
            if trial.ms % 200 == 0:
                self.send(m.MSG_MOTOR_STATUS)
                self.tick(2)
                if trial.last_status == 0:
                    return

    def switches_anyhow(self, motors):
        """Press and release switches at random."""
        dice = self.dice
        self.pause(20)
        for _ in range(dice.choice((0, 2, 4, 4, 8))):
            self.tick(dice.choice((1, 5, 60, 300, 800)))
            home = dice.choice(motors).home
            pin = self.rig.limits[home["limit"] - 1][home["toward"]]
            self.trial.do("pin", (pin, dice.randint(0, 1)))
            if dice.random() < 0.1:
                self.world.anything()

    def moves(self):
        self.move()
        if self.dice.random() < 0.7 and not self.settle(self.dice.choice((500, 3000))):
            self.halt()

    def reset(self):
        dice, i = self.dice, self.motor()
        value = dice.choice((0, 0, dice.randint(-5000, 5000), *ODD)) if dice.random() < 0.5 else 0
        self.send(m.MSG_MOTOR_RESET_POSITION, struct.pack("<Bi", i, value))
        self.pause(5)


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
                    kind, tuple(axes), length=dice.choice((600.0, 857.7)),
                    extension=dice.choice((0.0, 78.0)), nodal=nodal,
                ).payload()  # fmt: skip
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
