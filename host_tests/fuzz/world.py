"""A host, a rig and a link that make everything happen: together they are a fuzzed session.

The host is mostly plausible: it uploads moves, prepares, waits, sends GO, jogs and stops in the
middle; nothing deep would be reached otherwise. Sometimes it is not: any message with any payload
may come in any state. Everything is drawn from one `random.Random`.

Each subject has its own file: rigs.py, host.py (the port and the clock), and what a host does:
single_motors.py, uploads.py, operations.py, virtuals.py, bursts.py, outside.py.
"""

from random import Random

from .bursts import AnyPayload, Bursts
from .host import Host, Over
from .operations import Operations
from .outside import Surroundings
from .single_motors import Singles
from .trial import Trial
from .uploads import Uploads
from .virtuals import Virtuals


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
                self.host.query,
                self.singles.move,
                self.any_payload.message,
                self.singles.speed,
                self.singles.limits,
                self.surroundings.side,
                self.host.halt,
                self.singles.configure,
                self.singles.reset,
                self.bursts.burst,
            )
        )()

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
