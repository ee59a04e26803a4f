"""Requests of all kinds at once, or a millisecond or two apart: each comes before the
effects of the one before are over. And any message with any payload."""

import struct

from framestep.protocol import messages as m

from .host import ODD, QUESTIONS, Actions, signed


class Bursts(Actions):
    """A few valid requests in one packet, a question among them."""

    def __init__(self, world):
        super().__init__(world)
        self.drawn = (
            (m.MSG_MOTOR_MOVE, self._to, 2),
            (m.MSG_MOTOR_JOG, self._jog, 3),
            (m.MSG_MOTOR_STOP, self._motor, 2),
            (m.MSG_MOTOR_STOP_ALL, self._nothing, 1),
            (m.MSG_MOTOR_CONFIGURE, self._flags, 0.6),
            (m.MSG_MOTOR_RESET_POSITION, self._to, 0.3),
            (m.MSG_RT_RUN_MOVE, self._run, 3),
            (m.MSG_RT_SHOOT_FRAME2, self._shot, 1),
            (m.MSG_RT_GO, self._nothing, 3),
            (m.MSG_RT_POSITION_FRAME, self._frame, 2),
            (m.MSG_RT_JOG_ALL, self._jog_all, 2),
            (m.MSG_RT_STOP_LOOP, self._nothing, 0.5),
            (m.MSG_VIRT_MOVE, self._line, 2),
            (m.MSG_VIRT_JOG, self._virtual_jog, 2),
            (m.MSG_VIRT_JOG_ON_LINE, self._on_line, 2),
            (m.MSG_VIRT_STOP, self._virtual, 1),
            (m.MSG_VIRT_AIM_POINT, self._aim, 0.4),
        )

    def burst(self):
        dice = self.dice
        weights = [weight for _, _, weight in self.drawn]
        chosen = dice.choices(self.drawn, weights, k=dice.choice((2, 3, 4, 6)))
        question = (dice.choice(QUESTIONS), self._nothing, 0)
        chosen.insert(dice.randint(0, len(chosen)), question)
        for kind, payload, _ in chosen:
            if kind in (m.MSG_RT_RUN_MOVE, m.MSG_RT_SHOOT_FRAME2) and dice.random() < 0.7:
                self.send(m.MSG_MOTOR_STATUS)
            self.send(kind, payload())
            if dice.random() < 0.3:
                self.tick(dice.choice((1, 1, 2, 4, 15, 60)))
        self.tick(dice.choice((1, 1, 5, 40, 400)))

    def bursts(self):
        for _ in range(self.dice.choice((1, 2, 5))):
            self.burst()
        if not self.settle(self.dice.choice((300, 3000))):
            self.halt()

    def _nothing(self):
        return b""

    def _motor(self):
        return bytes((self.motor(),))

    def _flags(self):
        return bytes((self.motor(), self.dice.choice((1, 1, 3, 9, 0, 0x11))))

    def _to(self):
        i = self.motor()
        return struct.pack("<Bi", i, self.target(i - 1))

    def _jog(self):
        dice, i = self.dice, self.motor()
        return struct.pack(
            "<BHi", i, dice.choice((50, 5000, 10000)), dice.choice((-(2**31), 2**31 - 1))
        )

    def _frame(self):
        return struct.pack("<i", self.world.uploads.number_of_frame())

    def _run(self):
        uploads, dice = self.world.uploads, self.dice
        end = uploads.start + uploads.frames - 1
        roll = (dice.choice((0, 50, 300)) for _ in range(2))
        flags = dice.choice((0, 0, 1, 2))
        return struct.pack(
            "<IiiIIBIHHH", round(uploads.fps * 1000), uploads.start, end, *roll, 0, 0, 0, 0, flags
        )

    def _shot(self):
        i = self.dice.randint(1, self.motors)
        here = self.here(i - 1)
        reach = int(self.host.speeds[i - 1] * 0.2)
        return struct.pack(
            "<iIhhBii", self.world.uploads.start, 500, 0, 180, i, signed(here), signed(here + reach)
        )

    def _jog_all(self):
        return struct.pack(
            "<Ii", round(self.world.uploads.fps * 1000), self.world.uploads.number_of_frame()
        )

    def _virtual(self):
        return bytes((self.dice.randint(1, 6),))

    def _line(self):
        return struct.pack("<Bi", self.dice.randint(1, 6), self.dice.randint(-500_000, 500_000))

    def _virtual_jog(self):
        dice = self.dice
        return struct.pack(
            "<BHi",
            dice.randint(1, 6),
            dice.choice((500, 10000)),
            dice.choice((2**31 - 1, -(2**31))),
        )

    def _on_line(self):
        return struct.pack("<Bh", self.dice.randint(0, 4), self.dice.choice((1000, -10000, 10000)))

    def _aim(self):
        return struct.pack(
            "<Biii",
            self.dice.randint(0, 1),
            *(self.dice.randint(-100_000, 100_000) for _ in range(3)),
        )


class AnyPayload(Actions):
    """What no host would send."""

    def message(self):
        """Send any message with any payload."""
        dice = self.dice
        kind = dice.choice(list(m.SIZES)) if dice.random() < 0.97 else dice.randrange(0x8000)
        sizes = m.SIZES.get(kind, (0, 1))
        length = dice.choice((sizes[0], *sizes[2:])) + sizes[1] * dice.choice((0, 1, 2, 20))
        if dice.random() < 0.15:
            length = max(0, length + dice.choice((-1, 1, 2, 8)))
        payload = bytearray(dice.randbytes(length) if dice.random() < 0.5 else bytes(length))
        if length and dice.random() < 0.9:
            payload[0] = self.motor()
        for _ in range(dice.randint(0, 3)):
            if length >= 4:
                struct.pack_into(
                    "<i",
                    payload,
                    dice.randrange(length - 3),
                    dice.choice((*ODD, dice.randint(-300, 300))),
                )
        self.send(kind, bytes(payload[:1036]))
        self.pause(50)

    def nonsense(self):
        for _ in range(self.dice.choice((1, 3, 10))):
            self.message()
        self.world.virtuals.virtual = self.trial.virtual
