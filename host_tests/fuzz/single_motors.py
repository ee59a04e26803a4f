"""Requests about single motors."""

import struct

from framestep.protocol import messages as m

from .host import ODD, WORD, Actions, signed


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
