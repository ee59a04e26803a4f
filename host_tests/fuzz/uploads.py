"""Random uploads: paths that a motor can mostly follow, lights and triggers."""

import math
import struct

from framestep.protocol import messages as m

from .host import ODD, WORD, Actions, signed


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
