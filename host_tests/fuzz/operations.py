"""Whole operations, and what a host does during them."""

import struct

from framestep.protocol import messages as m

from .host import ODD, WORD, Actions, signed


class Operations(Actions):
    """RUN_MOVE, SHOOT_FRAME, JOG_ALL."""

    def prepare_run(self):
        dice = self.dice
        begin, end = (
            (self.world.uploads.start, self.world.uploads.start + self.world.uploads.frames - 1)
            if dice.random() < 0.6
            else (self.world.uploads.number_of_frame(), self.world.uploads.number_of_frame())
        )
        fps = (
            self.world.uploads.fps
            if dice.random() < 0.8
            else self.world.uploads.fps * dice.choice((0.5, 0.9, 1.1, 2))
        )
        milli = round(fps * 1000)
        if dice.random() < 0.03:
            milli = dice.choice((0, 1, 200_000, 200_001, WORD))
        pre, post = (dice.choice((0, 0, 1, 50, 300, 500, 1000, 2000)) for _ in range(2))
        if dice.random() < 0.02:
            pre = dice.choice((600_000, 600_001, WORD))
        flags = (
            dice.choice((0, 0, 0, 0, 1, 2, 3, 0x10, 0x20, 0x30)) if dice.random() < 0.98 else 0x40
        )
        payload = struct.pack("<IiiII", milli, begin, end, pre, post)
        payload += struct.pack(
            "<BIHH",
            dice.choice((0, 1)),
            dice.choice((0, 1, 3, WORD)),
            dice.choice((0, 0, 7, 512)),
            dice.choice((0, 0, 200, 65535)),
        )
        form = dice.randrange(3)
        if form:
            payload += struct.pack("<H", flags)
        if form == 2:
            payload += struct.pack(
                "<HH",
                dice.choice((0, 90, 360, 360 + (dice.random() < 0.1))),
                dice.choice((0, 180, 360)),
            )
        return self.ask(m.MSG_RT_RUN_MOVE, payload)[0], flags if form else 0

    def prepare_shot(self):
        dice = self.dice
        exposure = (
            dice.choice((1, 20, 250, 500, 1000, 0, 60_000))
            if dice.random() < 0.9
            else dice.choice(ODD) & WORD
        )
        entries = b""
        if dice.random() < 0.7:
            for i in dice.sample(range(self.motors), dice.randint(1, self.motors)):
                here = self.here(i)
                reach = self.host.speeds[i] * exposure / 1000 * 0.7 + 1
                a = here + int(dice.uniform(-0.2, 0.2) * reach)
                b = a + int(dice.uniform(-1, 1) * min(reach, 10**8))
                if dice.random() < 0.05:
                    b = dice.choice(ODD)
                entries += struct.pack("<Bii", i + 1, signed(a), signed(b))
        if dice.random() < 0.5:
            blur = dice.choice((1, 500, 1000, 1000, 0, 1001))
            return self.ask(
                m.MSG_RT_SHOOT_FRAME,
                struct.pack(
                    "<iBIH",
                    self.world.uploads.number_of_frame(),
                    dice.randint(0, 1),
                    exposure,
                    blur,
                )
                + entries,
            )[0]
        angles = dice.choice(
            (
                (0, 360),
                (90, 270),
                (-30, 400),
                (0, 1),
                (-360, 720),
                (180, 180),
                (350, 10),
                (-32768, 32767),
            )
        )
        return self.ask(
            m.MSG_RT_SHOOT_FRAME2,
            struct.pack("<iIhh", self.world.uploads.number_of_frame(), exposure, *angles) + entries,
        )[0]

    def operate(self):
        """Carry out an operation, with events in between."""
        dice = self.dice
        if not self.world.uploads.uploaded or dice.random() < 0.15:
            self.world.uploads.upload()
        self.settle(1500) or self.halt()
        if dice.random() < 0.8:
            self.world.surroundings.release()  # releases pressed switches
        if dice.random() < 0.2:
            self.send(
                m.MSG_RT_POSITION_FRAME, struct.pack("<i", self.world.uploads.number_of_frame())
            )
            self.pause(300)
            self.settle()
        flags = 0
        if dice.random() < 0.65:
            code, flags = self.prepare_run()
        else:
            code = self.prepare_shot()
        if code != m.OK:
            return
        if dice.random() < 0.12:
            self.world.anything()
        if dice.random() < 0.9:
            self.settle(6000)
        if dice.random() < 0.2:
            dice.choice(
                (
                    self.world.bursts.burst,
                    self.world.virtuals.virtual_axes,
                    self.world.singles.speed,
                    self.world.singles.limits,
                    self.world.singles.configure,
                    self.query,
                    self.world.singles.move,
                    self.world.singles.reset,
                )
            )()
        self.send(m.MSG_RT_GO)
        self.tick(dice.choice((1, 2, 20)))
        looping = flags & 3
        x = dice.random()
        if looping:
            self.meanwhile(dice.choice((300, 2000, 5000)))
            if dice.random() < 0.6:
                self.send(m.MSG_RT_STOP_LOOP)
                self.meanwhile(1500)
                self.settle(6000) or self.halt()
            else:
                self.halt()
        elif x < 0.6:
            for _ in range(16):
                self.meanwhile(500)
                if self.trial.runs.going is None:
                    break
            self.settle(4000) or self.halt()
        else:
            self.meanwhile(int(dice.random() * 2500))
            y = dice.random()
            if y < 0.35:
                self.halt()
            elif y < 0.5:
                self.send(m.MSG_MOTOR_STOP, bytes((self.motor(),)))
                self.settle(6000)
            elif y < 0.65:
                self.close(dice.choice((1, 5, 300)))
                self.settle(6000)
            elif y < 0.8:
                self.world.surroundings.switch()
                self.settle(6000)
            else:
                self.world.anything()
                self.settle(3000) or self.halt()

    def meanwhile(self, ms):
        """Let time pass, with requests of the host in between."""
        end = self.trial.ms + ms
        while self.trial.ms < end:
            self.tick(self.dice.choice((5, 20, 60, 120)))
            if self.dice.random() < 0.3:
                self.query()
            elif self.dice.random() < 0.05:
                self.world.surroundings.side()

    def jog_all(self):
        dice = self.dice
        if not self.world.uploads.uploaded:
            self.world.uploads.upload()
        if dice.random() < 0.8:
            self.send(
                m.MSG_RT_POSITION_FRAME, struct.pack("<i", self.world.uploads.number_of_frame())
            )
            self.settle() or self.halt()
        for _ in range(dice.choice((1, 1, 2, 4))):
            fps = (
                round(self.world.uploads.fps * 1000 * dice.choice((1, 1, 0.5, 0.1, 2)))
                if dice.random() < 0.95
                else dice.choice((0, 1, 200_001))
            )
            self.send(
                m.MSG_RT_JOG_ALL, struct.pack("<Ii", fps, self.world.uploads.number_of_frame())
            )
            self.meanwhile(dice.choice((50, 400, 1500)))
        if dice.random() < 0.4:
            self.halt()
        else:
            self.settle(8000) or self.halt()
