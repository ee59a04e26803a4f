"""Any message with any payload."""

import struct

from framestep.protocol import messages as m

from .host import ODD, Actions


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
