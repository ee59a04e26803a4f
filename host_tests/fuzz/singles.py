"""Requests about single motors."""

import struct

from framestep.protocol import messages as m

from .host import ODD, WORD, Deeds, signed


class Singles(Deeds):
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

    def moves(self):
        self.move()
        if self.dice.random() < 0.7 and not self.settle(self.dice.choice((500, 3000))):
            self.halt()

    def reset(self):
        dice, i = self.dice, self.motor()
        value = dice.choice((0, 0, dice.randint(-5000, 5000), *ODD)) if dice.random() < 0.5 else 0
        self.send(m.MSG_MOTOR_RESET_POSITION, struct.pack("<Bi", i, value))
        self.pause(5)
