"""A host, a rig and a link that make everything happen: together they are a fuzzed session.

The host is mostly plausible: it uploads moves, prepares, waits, sends GO, jogs and stops in the
middle; nothing deep would be reached otherwise. Sometimes it is not: any message with any payload
may come in any state. Everything is drawn from one `random.Random`.

Each subject has its own file: rigs.py, host.py (the port and the clock), and what a host does:
motors.py, operations.py, bursts.py; Surroundings is here.
"""

import struct
from random import Random

from framestep.protocol import messages as m
from host_tests.fuzz.bursts import AnyPayload, Bursts
from host_tests.fuzz.host import WORD, Actions, Host, Over
from host_tests.fuzz.motors import Singles, Virtuals
from host_tests.fuzz.operations import Operations, Uploads
from host_tests.fuzz.trial import Trial


class World:
    """Makes one session happen. requests, ms: the most of each."""

    def __init__(self, dice: Random, trial: Trial, requests: int, ms: int):
        self.dice = dice
        self.trial = trial
        self.motors = trial.count
        self.rig = trial.rig
        self.wild = dice.random() < 0.25
        links = dice.random() < 0.2 and trial.player.links
        late = dice.random() < 0.15 and trial.player.pauses
        switches = dice.random() < 0.6
        works = trial.player.repl and dice.random() < 0.4
        self.host = Host(dice, trial, requests, ms, links, dice.random() < 0.4, works)
        self.singles = Singles(self)
        self.uploads = Uploads(self)
        self.operations = Operations(self)
        self.virtuals = Virtuals(self)
        self.bursts = Bursts(self)
        self.surroundings = Surroundings(self, switches, late)
        self.any_payload = AnyPayload(self)

    def anything(self):
        dice = self.dice
        dice.choice(
            (
                self.host.query, self.singles.move, self.any_payload.message, self.singles.speed,
                self.singles.limits, self.surroundings.side, self.host.halt, self.singles.configure,
                self.singles.reset, self.bursts.burst,
            )
        )()  # fmt: skip

    def run(self):
        dice, trial = self.dice, self.trial
        self.surroundings.release()
        if self.host.works:
            trial.do("repl", "")
        trial.do("open")
        self.host.tick(dice.choice((1, 3, 30)))
        try:
            for _ in range(dice.randint(1, self.motors + 1)):
                self.singles.speed()
            actions = [
                (self.singles.moves, 6),
                (self.operations.operate, 6),
                (self.operations.jog_all, 1.5),
                (self.virtuals.virtual_axes, 3),
                (self.bursts.bursts, 3),
                (self.singles.speed, 1.5),
                (self.singles.limits, 1.5),
            ]
            actions += [
                (self.singles.configure, 1),
                (self.host.query, 2),
                (self.surroundings.side, 1),
                (self.singles.reset, 0.7),
                (self.singles.enable_all, 0.5),
            ]
            if self.surroundings.switches:
                actions.append((self.surroundings.switch, 1))
            if any(motor.home for motor in trial.motors):
                actions.append((self.singles.home, 2))
            if self.rig.remember_positions:
                actions.append((self.surroundings.lull, 0.7))
            if self.wild:
                actions.append((self.any_payload.nonsense, 5))
            if self.host.links:
                actions.append((lambda: self.host.close(dice.choice((0, 1, 50, 300))), 0.7))
            doings, weights = zip(
                *((d, w * dice.choice((0.2, 1, 1, 3))) for d, w in actions), strict=True
            )
            while True:
                dice.choices(doings, weights)[0]()
        except Over:
            pass
        self.surroundings.release()
        self.host.finish()


class Surroundings(Actions):
    """switches: use stop switches. late: let passes and ticks come late."""

    def __init__(self, world, switches, late):
        super().__init__(world)
        self.switches = switches
        self.late = late

    def side(self):
        """Do something to lights, outputs, the link or the main loop."""
        dice, do = self.dice, self.trial.do
        x = dice.random()
        if x < 0.2:
            levels = dice.randbytes(dice.choice((1, 10, 512)))
            self.send(
                m.MSG_DMX,
                struct.pack("<BH", dice.choice((0, 1, 2)), dice.choice((1, 5, 512, 0))) + levels,
            )
        elif x < 0.35:
            self.send(m.MSG_GIO_OUT, struct.pack("<I", dice.choice((0, 1, 3, 15, WORD))))
        elif x < 0.5:
            self.send(m.MSG_GIO_CAM, struct.pack("<I", dice.choice((0, 1, 2, 3, WORD))))
        elif x < 0.6 and self.switches:
            inputs = {item["pin"] for item in self.rig.inputs}
            names = [n for p, n in self.trial.hal.names.items() if p in inputs]
            if names:
                name = dice.choice(names)
                for _ in range(dice.choice((1, 2, 5))):
                    do("pin", (name, dice.randint(0, 1)))
                    self.tick(dice.choice((1, 3, 30)))
        elif x < 0.7 and self.host.links:
            # else nobody knows from then on which motors are coupled, and how fast they may be
            settings = m.MSG_MOTOR_CONFIGURE, m.MSG_MOTOR_SET_SPEED
            while any(r.kind in settings for r in self.trial.open.values()):
                self.tick()
            do("full")
            self.tick(dice.choice((5, 100, 400)) if dice.random() < 0.95 else 3500)
            do("drain")
        elif x < 0.85 and self.late:
            do("hold", dice.choice((2, 5, 7, 20, 60, 400)))
        elif self.late:
            do("skip", dice.choice((1, 1, 2, 5, 50)))
        self.tick()

    def switch(self):
        """Press a stop input, with bounce, and release it after a while."""
        dice, do, trial = self.dice, self.trial.do, self.trial
        pins = sorted(trial.stops.limit_pins)
        if trial.stops.estop_pin is not None and (not pins or dice.random() < 0.5):
            pin, active = trial.stops.estop_pin, trial.stops.estop_level
        elif pins:
            pin = dice.choice(pins)
            limit = next(limit for limit in self.rig.limits if pin in (limit["high"], limit["low"]))
            active = 1 if limit["contact"] == "nc" else 0
            if dice.random() < 0.7:
                self.toward(limit, pin)
        else:
            return
        for level in (
            active,
            *(dice.randint(0, 1) for _ in range(dice.choice((0, 0, 2, 6)))),
            active,
        ):
            do("pin", (pin, level))
            self.tick(dice.choice((0, 1, 2)))
        for _ in range(dice.choice((0, 1, 3))):
            self.world.anything()
        self.tick(dice.choice((1, 30, 300, 800)))
        if dice.random() < 0.7:
            self.settle(3000)
        do("pin", (pin, 1 - active))
        self.tick(dice.choice((1, 30)))

    def toward(self, limit, pin):
        """Move a motor toward this limit switch."""
        i, number = self.dice.randint(1, self.motors), self.rig.limits.index(limit) + 1
        self.send(m.MSG_MOTOR_SET_LIMITS, struct.pack("<BBiBiB", i, 0, 0, 0, 0, number))
        to = 2**31 - 1 if pin == limit["high"] else -(2**31)
        self.send(m.MSG_MOTOR_JOG, struct.pack("<BHi", i, 10000, to))
        self.pause(300)

    def lull(self):
        """Wait until the firmware saves its positions."""
        self.settle(1500) or self.halt()
        self.tick(self.dice.choice((1900, 2100, 2600)))

    def release(self):
        """Release all stop switches."""
        trial = self.trial
        if trial.stops.estop_pin is not None:
            trial.do("pin", (trial.stops.estop_pin, 1 - trial.stops.estop_level))
        for limit in self.rig.limits:
            for end in ("high", "low"):
                if limit[end] >= 0:
                    trial.do("pin", (limit[end], 0 if limit["contact"] == "nc" else 1))
