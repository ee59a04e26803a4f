"""What happens around the motors: lights, inputs, switches, a slow main loop, idle time."""

import struct

from framestep.protocol import messages as m

from .host import WORD, Actions


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
