"""What a host does with its port: it sends, waits for answers, lets time pass, and stops
everything."""

import struct
from random import Random

from framestep.protocol import messages as m

from .link import frame
from .repl_work import WORK
from .trial import Trial

ODD = (
    0, 1, -1, 2, -2, 255, 10_000, 2**30 - 1, 2**30, -(2**30), -(2**30) - 1, 2**31 - 1, -(2**31),
    2**31 - 2, 1 - 2**31,
)  # fmt: skip
WORD = 0xFFFFFFFF
QUESTIONS = (
    m.MSG_HI, m.MSG_MOTOR_STATUS, m.MSG_MOTOR_STATUS, m.MSG_MOTOR_GET_POSITION, m.MSG_GIO_IN,
    m.MSG_VIRT_GET_POSITION, m.MSG_CONDITION, 0x300,
)  # fmt: skip


def signed(value):
    """Return the number wrapped into a signed word."""
    return (value + 2**31 & WORD) - 2**31


class Over(Exception):
    """The session has used up its requests or its time."""


class Host:
    """A host with its port and a clock. requests, ms: the most of each. links: with faults of the
    link.

    talks: it asks many questions, which leaves fewer requests for motion. works: somebody works on
    the REPL.
    """

    def __init__(
        self,
        dice: Random,
        trial: Trial,
        requests: int,
        ms: int,
        links: bool,
        talks: bool,
        works: bool,
    ):
        self.dice = dice
        self.trial = trial
        self.requests = requests
        self.end = ms
        self.links = links
        self.talks = talks
        self.works = works
        self.number = 0
        self.motors = trial.count
        self.speeds = [5000] * self.motors  # as set by this host
        self.steep = [20000] * self.motors

    def tick(self, ms=1):
        trial = self.trial
        for _ in range(ms):
            if self.works:
                self.work()
            trial.step()
        if trial.ms >= self.end:
            raise Over

    def work(self):
        """Begin something on the REPL, now and then, or press Ctrl-C."""
        trial = self.trial
        if self.dice.random() < (0.003 if trial.player.working else 0.05):
            key = "Ctrl-C" if trial.player.working else "REPL"
            trial.counts[key] += 1
            trial.do("repl", "" if trial.player.working else self.dice.choice(WORK))

    def pause(self, most=300):
        """Let some time pass, mostly little."""
        self.tick(int(self.dice.random() ** 3 * most))

    def send(self, kind, payload=b"") -> int:
        self.number += 1
        # any word may be an ID, each once
        number = self.number * 0x9E3779B1 & WORD or 1
        data = frame(kind, payload, number)
        if self.links and self.dice.random() < 0.06:
            self.spoil(data)
        else:
            self.trial.do("rx", data)
        if self.number % 3:
            self.trial.do("prompt")
        if self.trial.counts["requests"] >= self.requests:
            raise Over
        return number

    def ask(self, kind, payload=b""):
        """Send a request and return (code, payload) of its answer; (None, b"") if none comes
        soon."""
        number = self.send(kind, payload)
        self.chatter()
        for _ in range(40):
            self.tick()
            for request, code, data in self.trial.answers:
                if request is not None and request.number == number:
                    return code, data
        return None, b""

    def spoil(self, data):
        """Add a fault of the link: bytes dropped, doubled, flipped or late, or the port closed in
        the middle."""
        dice, do = self.dice, self.trial.do
        at = dice.randrange(len(data))
        kind = dice.randrange(7)
        if kind == 0:
            do("rx", data[:at] + data[at + 1 :])
        elif kind == 1:
            do("rx", data[:at] + data[at : at + 1] + data[at:])
        elif kind == 2:
            do("rx", data[:at] + bytes((data[at] ^ 1 << dice.randrange(8),)) + data[at + 1 :])
        elif kind == 3:
            do("rx", data[:at]) if at else None
            self.tick(dice.choice((1, 5, 150, 199, 201, 250)))
            do("rx", data[at:])
        elif kind == 4:
            do("rx", data[:at]) if at else None
            self.close(dice.choice((0, 0, 1, 5, 100)))
            do("rx", data[at:])
        elif kind == 5:
            do("rx", dice.randbytes(dice.randint(1, 30)) + data)
        else:
            do("rx", data + data[: at + 1])

    def close(self, ms):
        do = self.trial.do
        do("close")
        self.tick(ms)
        do("open")
        self.tick(self.dice.choice((0, 1, 5)))

    def settle(self, most=4000):
        """Wait until everything rests, and ask for the positions."""
        trial = self.trial
        end = trial.ms + most
        while trial.ms < end:
            self.ask(m.MSG_MOTOR_STATUS)
            if trial.last_status == 0 and trial.idle_since is not None:
                self.tick(self.dice.choice((1, 2, 5, 30)))
                self.ask(m.MSG_MOTOR_GET_POSITION)
                return True
            self.tick(self.dice.choice((1, 5, 20, 50) if self.talks else (5, 40, 100, 100)))
        return False

    def halt(self):
        """Stop everything, and wait until it rests."""
        self.send(
            m.MSG_MOTOR_STOP_ALL,
            b"" if self.dice.random() < 0.6 else struct.pack("<I", self.dice.choice((0, 1))),
        )
        if self.dice.random() < 0.3:
            self.pause(600)
            self.send(m.MSG_MOTOR_STOP_ALL)
        self.settle(9000)

    def finish(self):
        """End the session: everything comes to rest, and every report is true."""
        trial = self.trial
        self.end = 10**9
        self.requests = 10**9
        self.links = self.works = False
        if trial.player.full:
            trial.do("drain")
        if not trial.hal.port.open:
            trial.do("open")
        if trial.player.working:
            trial.do("repl", "")
        for _ in range(60):
            trial.step()
        self.send(m.MSG_MOTOR_STOP_ALL)
        for _ in range(400):
            if self.settle(500):
                break
        self.ask(m.MSG_HI)
        for motor in trial.motors:
            trial.judge(motor)

    def motor(self):
        """Return the number of a motor, rarely an invalid one."""
        if self.dice.random() < 0.02:
            return self.dice.choice((0, self.motors + 1, 255))
        return self.dice.randint(1, self.motors)

    def here(self, i):
        return self.trial.motors[i].load if 0 <= i < self.motors else 0

    def target(self, i):
        """Return a target for motor i (from 0), mostly a near one."""
        dice = self.dice
        if not 0 <= i < self.motors:
            return dice.choice(ODD)
        x = dice.random()
        if x < 0.08:
            return dice.choice(ODD)
        if x < 0.2:
            limits = [limit for limit in self.trial.motors[i].limits if limit is not None]
            if limits:
                return signed(dice.choice(limits) + dice.choice((-2, -1, 0, 1, 2)))
        if x < 0.3:
            return signed(self.here(i) + dice.choice((-2, -1, 0, 1, 2, 3)))
        reach = self.speeds[i] * dice.choice((0.02, 0.1, 0.5, 2))
        return signed(self.here(i) + int(dice.uniform(-reach, reach)))

    def chatter(self):
        """Ask questions together with another request, as a host with several windows does."""
        dice = self.dice
        if dice.random() < (0.5 if self.talks else 0.02):
            for _ in range(dice.choice((1, 2, 4, 8, 12))):
                self.send(dice.choice(QUESTIONS))

    def query(self):
        dice = self.dice
        for _ in range(dice.choice((1, 1, 3, 20) if self.talks else (1, 1, 2))):
            self.send(dice.choice(QUESTIONS))
        self.tick()


class Actions:
    """Some of what happens in a session: the base of the classes that do it. They find each other
    through `world`."""

    def __init__(self, world):
        self.world = world
        self.host = host = world.host
        self.dice, self.trial, self.rig, self.motors = (
            world.dice, world.trial, world.rig, world.motors,
        )  # fmt: skip
        self.send, self.ask, self.query, self.close = host.send, host.ask, host.query, host.close
        self.tick, self.pause, self.settle, self.halt = (
            host.tick, host.pause, host.settle, host.halt,
        )  # fmt: skip
        self.motor, self.here, self.target = host.motor, host.here, host.target
