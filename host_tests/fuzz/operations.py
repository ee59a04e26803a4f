"""Whole operations, and what a host does during them, with random uploads: paths that a motor can
mostly follow, lights and triggers."""

import math
import struct

from framestep.protocol import messages as m
from host_tests.fuzz.host import ODD, WORD, Actions, signed


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
            "<BIHH", dice.choice((0, 1)), dice.choice((0, 1, 3, WORD)), dice.choice((0, 0, 7, 512)),
            dice.choice((0, 0, 200, 65535)),
        )  # fmt: skip
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
                    "<iBIH", self.world.uploads.number_of_frame(), dice.randint(0, 1), exposure,
                    blur,
                )
                + entries,
            )[0]  # fmt: skip
        angles = dice.choice(
            (
                (0, 360), (90, 270), (-30, 400), (0, 1), (-360, 720), (180, 180), (350, 10),
                (-32768, 32767),
            )
        )  # fmt: skip
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
                    self.world.bursts.burst, self.world.virtuals.virtual_axes,
                    self.world.singles.speed, self.world.singles.limits,
                    self.world.singles.configure, self.query, self.world.singles.move,
                    self.world.singles.reset,
                )
            )()  # fmt: skip
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


class Uploads(Actions):
    """The uploaded move: its first scene frame, how many, and its frame rate."""

    def __init__(self, world):
        super().__init__(world)
        self.start, self.frames, self.fps = 1, 0, 24.0
        self.uploaded = False

    def path(self, i, frames, fps):
        """Return uploaded positions of motor i."""
        dice = self.dice
        here = self.here(i)
        most = 0.95 * min(self.host.speeds[i] / fps, 2**19)
        kind = dice.random()
        if kind < 0.45:
            periods = dice.uniform(0.2, max(0.3, frames / 12))
            amplitude = dice.uniform(0.05, 1.0) * most * frames / max(2 * math.pi * periods, 0.3)
            start = dice.uniform(0, 6.3)
            values = [
                amplitude * math.sin(start + 2 * math.pi * periods * k / frames)
                for k in range(frames)
            ]
            values = [here + round(v - values[0]) for v in values]
        elif kind < 0.6:
            rate = dice.uniform(-1, 1) * most
            values = [here + round(rate * k) for k in range(frames)]
        elif kind < 0.8:
            x, values = float(here), []
            for _ in range(frames):
                values.append(round(x))
                if dice.random() < 0.8:
                    x += dice.uniform(-1, 1) * most * dice.choice((0.05, 0.5, 1.0))
        elif kind < 0.9:
            values = [here + dice.choice((0, 0, 1, 1, 2, 3)) for _ in range(frames)]
        elif kind < 0.99:
            values = [here] * frames
        else:
            edge = dice.choice((2**31 - 1, -(2**31), 2**30, -(2**30)))
            values = [
                edge - int(math.copysign(1, edge)) * dice.randint(0, 60) for _ in range(frames)
            ]
        if dice.random() < 0.05 / self.motors:
            values[dice.randrange(frames)] = dice.choice(ODD)
        return [signed(v) for v in values]

    def upload(self):
        dice = self.dice
        self.fps = fps = dice.choice((1, 5, 12, 23.976, 24, 24, 25, 30, 60, 120, 200))
        frames = dice.choice((1, 2, 3, 5, 12, 24, 24, 48, 48, 100, 250))
        if frames > 4 * fps and dice.random() < 0.8:
            frames = max(2, int(4 * fps))
        start = dice.choice((1, 1, 1, 0, -5, 100, 999_990, -1_000_000, 1_000_000 - frames))
        end = start + frames - 1
        if dice.random() < 0.04:
            start, end = dice.choice(ODD), dice.choice(ODD)
        code, _ = self.ask(m.MSG_RT_UPLOAD_MOVE_BEGIN, struct.pack("<ii", start, end))
        if code != m.OK:
            return
        self.uploaded = False
        self.start, self.frames = start, frames
        for i in range(self.motors):
            if dice.random() < 0.2 and self.motors > 1:
                continue
            values = self.path(i, frames, fps)
            at = 0
            sections = []
            while at < frames:
                n = min(dice.choice((3, 50, 250, 250)), frames - at, 257)
                last = at + n >= frames or dice.random() < 0.02
                sections.append((at | 0x80000000 * last, values[at : at + n]))
                at += n
            if dice.random() < 0.1:
                dice.shuffle(sections)
            for index, part in sections:
                if dice.random() < 0.01:
                    index = dice.choice(ODD) & WORD
                self.send(
                    m.MSG_RT_UPLOAD_MOVE_AXIS, struct.pack(f"<BI{len(part)}i", i + 1, index, *part)
                )
                if dice.random() < 0.5:
                    self.tick()
        if dice.random() < 0.3:
            levels = dice.randbytes(min(frames, 200))
            self.send(
                m.MSG_RT_UPLOAD_MOVE_DMX,
                struct.pack("<HI", dice.choice((1, 2, 512, 0, 513)), 0x80000000) + levels,
            )
        if dice.random() < 0.3:
            pairs = [
                (dice.randrange(frames), dice.randrange(16)) for _ in range(dice.randint(1, 8))
            ]
            if dice.random() < 0.8:
                pairs.sort()
            words = [w for pair in pairs for w in pair]
            self.send(m.MSG_RT_UPLOAD_MOVE_TRIGGERS, struct.pack(f"<I{len(words)}I", 15, *words))
        code, _ = self.ask(m.MSG_RT_UPLOAD_MOVE_END)
        self.uploaded = code == m.OK

    def number_of_frame(self):
        dice = self.dice
        if dice.random() < 0.06:
            return dice.choice((*ODD, self.start - 1, self.start + self.frames))
        return self.start + dice.choice((0, self.frames - 1, dice.randrange(max(self.frames, 1))))
