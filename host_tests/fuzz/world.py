"""A host, a rig and a link that make everything happen: what a fuzzed session consists of.

The host is plausible: it uploads moves, prepares, waits, says GO, jogs and stops in the middle; without that nothing
deep is reached. And it is not: any message with any payload comes in any state. All is drawn from one `random.Random`.
"""

import json
import math
import struct
from random import Random

from framestep.protocol import messages as m
from framestep.rig import Rig, RigError
from framestep_tools.files import board_data, board_names
from framestep_tools.script import Script
from framestep_tools.virtual_reference import Axis as VirtualAxis
from framestep_tools.virtual_reference import Rig as VirtualRig

from .trial import Trial, frame

ODD = (
    0,
    1,
    -1,
    2,
    -2,
    255,
    10_000,
    2**30 - 1,
    2**30,
    -(2**30),
    -(2**30) - 1,
    2**31 - 1,
    -(2**31),
    2**31 - 2,
    1 - 2**31,
)
WORD = 0xFFFFFFFF
QUESTIONS = (
    m.MSG_HI,
    m.MSG_MOTOR_STATUS,
    m.MSG_MOTOR_STATUS,
    m.MSG_MOTOR_GET_POSITION,
    m.MSG_GIO_IN,
    m.MSG_VIRT_GET_POSITION,
    m.MSG_CONDITION,
    0x300,
)


def signed(value):
    """Into the range of a word, from the other end where it is past one."""
    return (value + 2**31 & WORD) - 2**31


# ---- rigs ---------------------------------------------------------------------------------------------------


def draw_rig(dice: Random, board: str) -> dict:
    """What a rig file for this board may hold."""
    data = board_data(board)
    some = dice.random
    rig: dict = {}
    if some() < 0.85:
        rig["motor_count"] = min(data["motors"], dice.choice((1, 2, 2, 3, 3, 4, 6, data["motors"])))
    count = rig.get("motor_count", data["motors"])
    motors = []
    for _ in range(count):
        motor: dict = {}
        if some() < 0.3:
            motor["invert"] = True
        if some() < 0.2:
            motor["pulse_us"] = dice.choice((0.25, 2.0, 4.0))
        if some() < 0.2:
            motor["setup_us"] = dice.choice((0, 1, 50, 200))
        if some() < 0.2:
            motor["backlash"] = dice.choice((1, 2, 24, 200, 1000, dice.randint(1, 10000)))
        if some() < 0.3:
            motor["jerk"] = dice.choice((1, 20, 100, 500, 2000, 30000, 1000000))
        if some() < 0.1:
            motor["enable_high"] = True
        motors.append(motor)
    if some() < 0.8:
        rig["motors"] = motors
    for name, chance, values in (
        ("hard_stop_factor", 0.4, (1, 2, 8, 16)),
        ("jog_timeout_ms", 0.5, (0, 20, 100, 2000)),
        ("report_ms", 0.4, (20, 33, 250, 1000)),
        ("dialect", 0.4, ("dmc-lite",)),
        ("virtuals", 0.5, (0, 8, 60, 64, 124)),
        ("dmx_ramp_ms", 0.3, (0, 20, 60000)),
        ("shutter_on", 0.2, ("low",)),
        ("meter_on", 0.2, ("low",)),
        ("dmx", 0.2, (False,)),
        ("watchdog", 0.2, (False,)),
        ("remember_positions", 0.25, (True,)),
        ("estop_cuts_power", 0.2, (True,)),
        ("strict_moves", 0.3, (True,)),
        ("go_input", 0.15, (1, 2)),
    ):
        if some() < chance:
            rig[name] = dice.choice(values)
    if "estop" in data and some() < 0.5:
        rig["estop"] = dice.choice(("nc", "no"))
    pins = data.get("stops", []) + [22, 26, 27, 28]
    if some() < 0.4:
        dice.shuffle(pins)
        sets = []
        while len(pins) >= 2 and len(sets) < dice.randint(1, 2):
            sets.append(
                {"high": pins.pop(), "low": pins.pop() if some() < 0.8 else -1, "contact": dice.choice(("nc", "no"))}
            )
        if sets:
            rig["limits"] = sets
    if some() < 0.15:
        rig["outputs"] = [
            {"pin": pin, "safe": dice.choice(("off", "on", "hold")), "on": dice.choice(("high", "low"))}
            for pin in pins[:2]
        ]
    while True:
        try:
            Rig(rig, data)
            return rig
        except RigError:
            for key in ("go_input", "limits", "outputs", "estop", "motors"):
                if rig.pop(key, None) is not None:
                    break


def draw_script(dice: Random) -> Script:
    """A board and a rig, sometimes short of something."""
    board = dice.choice((*board_names(), "pico", "pico"))
    script = Script(board, draw_rig(dice, board))
    if dice.random() < 0.02:
        text = json.dumps(script.rig)
        script.rig, script.rig_text = None, text[: dice.randrange(1, max(2, len(text) - 1))]
    if dice.random() < 0.08:
        script.memory = dice.choice((0, 16, 200, 1000, 4096, 12000))
    if script.rig and script.rig.get("remember_positions"):
        if dice.random() < 0.15:
            script.flash = None
        else:
            for block in (0, 1):
                if dice.random() < 0.3:
                    script.flash[block] = dice.randbytes(dice.choice((1, 100, 128, 1024)))
    return script


# ---- the session --------------------------------------------------------------------------------------------


class Over(Exception):
    """The session has had its requests or its time."""


class World:
    """Makes one session happen. requests, ms: how much at most."""

    def __init__(self, dice: Random, trial: Trial, requests: int, ms: int):
        self.dice = dice
        self.trial = trial
        self.requests = requests
        self.end = ms
        self.number = 0
        self.motors = trial.count
        self.rig = trial.rig
        self.speeds = [5000] * self.motors
        self.steep = [20000] * self.motors
        self.start, self.frames, self.fps = 1, 0, 24.0
        self.uploaded = False
        self.wild = dice.random() < 0.25
        self.links = dice.random() < 0.2  # faults of the link
        self.late = dice.random() < 0.15  # late passes and ticks
        self.switches = dice.random() < 0.6
        self.virtual = False

    # ---- means

    def tick(self, ms=1):
        trial = self.trial
        for _ in range(ms):
            trial.step()
        if trial.ms >= self.end:
            raise Over

    def pause(self, most=300):
        """Some time, mostly little."""
        self.tick(int(self.dice.random() ** 3 * most))

    def send(self, kind, payload=b"") -> int:
        self.number += 1
        # every word as an ID, each once
        number = self.number * 0x9E3779B1 & WORD or 1
        data = frame(kind, payload, number)
        if self.links and self.dice.random() < 0.06:
            self.spoil(data)
        else:
            self.trial.do("rx", data)
        if self.trial.counts["requests"] >= self.requests:
            raise Over
        return number

    def ask(self, kind, payload=b""):
        """The code or the payload of the answer: (code, payload); (None, b"") where none comes soon."""
        number = self.send(kind, payload)
        self.chatter()
        for _ in range(40):
            self.tick()
            for request, code, data in self.trial.answers:
                if request is not None and request.number == number:
                    return code, data
        return None, b""

    def spoil(self, data):
        """A fault of the link: bytes dropped, doubled, flipped, late, the port closed in the middle."""
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
        self.tick(dice_small(self.dice))

    def settle(self, most=4000):
        """Wait until everything stands, and hear where."""
        trial = self.trial
        end = trial.ms + most
        while trial.ms < end:
            self.ask(m.MSG_MOTOR_STATUS)
            if trial.last_status == 0 and trial.idle_since is not None:
                self.tick(self.dice.choice((1, 2, 5, 30)))
                self.ask(m.MSG_MOTOR_GET_POSITION)
                return True
            self.tick(self.dice.choice((1, 5, 20, 50)))
        return False

    def halt(self):
        """Stop whatever there is, and see it stand."""
        self.send(
            m.MSG_MOTOR_STOP_ALL, b"" if self.dice.random() < 0.6 else struct.pack("<I", self.dice.choice((0, 1)))
        )
        if self.dice.random() < 0.3:
            self.pause(600)
            self.send(m.MSG_MOTOR_STOP_ALL)
        self.settle(9000)

    def finish(self):
        """The end of the session: everything comes to rest, and all is told truly."""
        trial = self.trial
        self.end = 10**9
        self.requests = 10**9
        self.links = False
        if trial.player.full:
            trial.do("drain")
        if not trial.hal.port.open:
            trial.do("open")
        for _ in range(60):
            trial.step()
        self.send(m.MSG_MOTOR_STOP_ALL)
        for _ in range(400):
            if self.settle(500):
                break
        self.ask(m.MSG_HI)
        for motor in trial.motors:
            trial.judge(motor)

    # ---- numbers

    def motor(self):
        """The number of a motor, seldom of none."""
        if self.dice.random() < 0.02:
            return self.dice.choice((0, self.motors + 1, 255))
        return self.dice.randint(1, self.motors)

    def here(self, i):
        return self.trial.motors[i].load if 0 <= i < self.motors else 0

    def target(self, i):
        """A place to send motor i (from 0) to: mostly reached soon."""
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

    # ---- what happens

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
            self.speeds[i - 1], self.steep[i - 1] = velocity, acceleration or velocity // 2

    def limits(self):
        dice, i = self.dice, self.motor()
        here = self.here(i - 1)
        reach = self.speeds[i - 1] if 0 < i <= self.motors else 1000
        lower, upper = (signed(here + int(s * dice.random() ** 2 * reach)) for s in (-1, 1))
        if dice.random() < 0.1:
            lower, upper = signed(here + dice.randint(-500, 500)), signed(here + dice.randint(-500, 500))
        if dice.random() < 0.08:
            lower = dice.choice(ODD)
        if dice.random() < 0.08:
            upper = dice.choice(ODD)
        sets = dice.choice((0, 0, 1, 2, 0x81, 0x82, 3, 0xFF)) if self.rig.limits else 0
        on = (dice.randint(0, 1), dice.randint(0, 1)) if dice.random() < 0.97 else (2, 1)
        self.send(m.MSG_MOTOR_SET_LIMITS, struct.pack("<BBiBiB", i, on[0], lower, on[1], upper, sets))
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
                self.side()

    def moves(self):
        self.move()
        if self.dice.random() < 0.7 and not self.settle(self.dice.choice((500, 3000))):
            self.halt()

    def reset(self):
        dice, i = self.dice, self.motor()
        value = dice.choice((0, 0, dice.randint(-5000, 5000), *ODD)) if dice.random() < 0.5 else 0
        self.send(m.MSG_MOTOR_RESET_POSITION, struct.pack("<Bi", i, value))
        self.pause(5)

    # uploads

    def path(self, i, frames, fps):
        """Uploaded positions of motor i."""
        dice = self.dice
        here = self.here(i)
        most = 0.95 * min(self.speeds[i] / fps, 2**19)
        kind = dice.random()
        if kind < 0.45:
            periods = dice.uniform(0.2, max(0.3, frames / 12))
            amplitude = dice.uniform(0.05, 1.0) * most * frames / max(2 * math.pi * periods, 0.3)
            start = dice.uniform(0, 6.3)
            values = [amplitude * math.sin(start + 2 * math.pi * periods * k / frames) for k in range(frames)]
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
            values = [edge - int(math.copysign(1, edge)) * dice.randint(0, 60) for _ in range(frames)]
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
                self.send(m.MSG_RT_UPLOAD_MOVE_AXIS, struct.pack(f"<BI{len(part)}i", i + 1, index, *part))
                if dice.random() < 0.5:
                    self.tick()
        if dice.random() < 0.3:
            levels = dice.randbytes(min(frames, 200))
            self.send(
                m.MSG_RT_UPLOAD_MOVE_DMX, struct.pack("<HI", dice.choice((1, 2, 512, 0, 513)), 0x80000000) + levels
            )
        if dice.random() < 0.3:
            pairs = [(dice.randrange(frames), dice.randrange(16)) for _ in range(dice.randint(1, 8))]
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

    def prepare_run(self):
        dice = self.dice
        begin, end = (
            (self.start, self.start + self.frames - 1)
            if dice.random() < 0.6
            else (self.number_of_frame(), self.number_of_frame())
        )
        fps = self.fps if dice.random() < 0.8 else self.fps * dice.choice((0.5, 0.9, 1.1, 2))
        milli = round(fps * 1000)
        if dice.random() < 0.03:
            milli = dice.choice((0, 1, 200_000, 200_001, WORD))
        pre, post = (dice.choice((0, 0, 1, 50, 300, 500, 1000, 2000)) for _ in range(2))
        if dice.random() < 0.02:
            pre = dice.choice((600_000, 600_001, WORD))
        flags = dice.choice((0, 0, 0, 0, 1, 2, 3, 0x10, 0x20, 0x30)) if dice.random() < 0.98 else 0x40
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
                "<HH", dice.choice((0, 90, 360, 360 + (dice.random() < 0.1))), dice.choice((0, 180, 360))
            )
        return self.ask(m.MSG_RT_RUN_MOVE, payload)[0], flags if form else 0

    def prepare_shot(self):
        dice = self.dice
        exposure = dice.choice((1, 20, 250, 500, 1000, 0, 60_000)) if dice.random() < 0.9 else dice.choice(ODD) & WORD
        entries = b""
        if dice.random() < 0.7:
            for i in dice.sample(range(self.motors), dice.randint(1, self.motors)):
                here = self.here(i)
                reach = self.speeds[i] * exposure / 1000 * 0.7 + 1
                a = here + int(dice.uniform(-0.2, 0.2) * reach)
                b = a + int(dice.uniform(-1, 1) * min(reach, 10**8))
                if dice.random() < 0.05:
                    b = dice.choice(ODD)
                entries += struct.pack("<Bii", i + 1, signed(a), signed(b))
        if dice.random() < 0.5:
            blur = dice.choice((1, 500, 1000, 1000, 0, 1001))
            return self.ask(
                m.MSG_RT_SHOOT_FRAME,
                struct.pack("<iBIH", self.number_of_frame(), dice.randint(0, 1), exposure, blur) + entries,
            )[0]
        angles = dice.choice(
            ((0, 360), (90, 270), (-30, 400), (0, 1), (-360, 720), (180, 180), (350, 10), (-32768, 32767))
        )
        return self.ask(
            m.MSG_RT_SHOOT_FRAME2, struct.pack("<iIhh", self.number_of_frame(), exposure, *angles) + entries
        )[0]

    def operate(self):
        """An operation, and what comes in between."""
        dice = self.dice
        if not self.uploaded or dice.random() < 0.15:
            self.upload()
        self.settle(1500) or self.halt()
        if dice.random() < 0.8:
            self.release()  # of what is still pressed
        if dice.random() < 0.2:
            self.send(m.MSG_RT_POSITION_FRAME, struct.pack("<i", self.number_of_frame()))
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
            self.anything()
        if dice.random() < 0.9:
            self.settle(6000)
        if dice.random() < 0.15:
            dice.choice((self.speed, self.limits, self.configure, self.query, self.move, self.reset))()
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
                if self.trial.going is None:
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
                self.switch()
                self.settle(6000)
            else:
                self.anything()
                self.settle(3000) or self.halt()

    def meanwhile(self, ms):
        """Time passes, with what a host asks in between."""
        end = self.trial.ms + ms
        while self.trial.ms < end:
            self.tick(self.dice.choice((5, 20, 60, 120)))
            if self.dice.random() < 0.3:
                self.query()
            elif self.dice.random() < 0.05:
                self.side()

    def jog_all(self):
        dice = self.dice
        if not self.uploaded:
            self.upload()
        if dice.random() < 0.8:
            self.send(m.MSG_RT_POSITION_FRAME, struct.pack("<i", self.number_of_frame()))
            self.settle() or self.halt()
        for _ in range(dice.choice((1, 1, 2, 4))):
            fps = (
                round(self.fps * 1000 * dice.choice((1, 1, 0.5, 0.1, 2)))
                if dice.random() < 0.95
                else dice.choice((0, 1, 200_001))
            )
            self.send(m.MSG_RT_JOG_ALL, struct.pack("<Ii", fps, self.number_of_frame()))
            self.meanwhile(dice.choice((50, 400, 1500)))
        if dice.random() < 0.4:
            self.halt()
        else:
            self.settle(8000) or self.halt()

    # lights, questions, switches

    def chatter(self):
        """Questions at once with another request, as from a host with several windows."""
        dice = self.dice
        if dice.random() < 0.5:
            for _ in range(dice.choice((1, 2, 4, 8, 12))):
                self.send(dice.choice(QUESTIONS))

    def query(self):
        dice = self.dice
        for _ in range(dice.choice((1, 1, 3, 20))):
            self.send(dice.choice(QUESTIONS))
        self.tick()

    def side(self):
        """Lights and outputs, the link, the main loop."""
        dice, do = self.dice, self.trial.do
        x = dice.random()
        if x < 0.2:
            levels = dice.randbytes(dice.choice((1, 10, 512)))
            self.send(m.MSG_DMX, struct.pack("<BH", dice.choice((0, 1, 2)), dice.choice((1, 5, 512, 0))) + levels)
        elif x < 0.35:
            self.send(m.MSG_GIO_OUT, struct.pack("<I", dice.choice((0, 1, 3, 15, WORD))))
        elif x < 0.5:
            self.send(m.MSG_GIO_CAM, struct.pack("<I", dice.choice((0, 1, 2, 3, WORD))))
        elif x < 0.6 and self.switches:
            names = [n for n in self.trial.hal.names.values() if n.startswith(("gio", "in"))]
            inputs = {item["pin"] for item in self.rig.inputs}
            names = [n for p, n in self.trial.hal.names.items() if p in inputs]
            if names:
                name = dice.choice(names)
                for _ in range(dice.choice((1, 2, 5))):
                    do("pin", (name, dice.randint(0, 1)))
                    self.tick(dice.choice((1, 3, 30)))
        elif x < 0.7 and self.links:
            do("full")
            self.tick(dice.choice((5, 100, 400)) if dice.random() < 0.95 else 3500)
            do("drain")
        elif x < 0.85 and self.late:
            do("hold", dice.choice((2, 5, 7, 20, 60, 400)))
        elif self.late:
            do("skip", dice.choice((1, 1, 2, 5, 50)))
        self.tick()

    def switch(self):
        """A stop input, with bounce; released again after a while."""
        dice, do, trial = self.dice, self.trial.do, self.trial
        pins = sorted(trial.limit_pins)
        if trial.estop_pin is not None and (not pins or dice.random() < 0.5):
            pin, active = trial.estop_pin, trial.estop_level
        elif pins:
            pin = dice.choice(pins)
            limit = next(limit for limit in self.rig.limits if pin in (limit["high"], limit["low"]))
            active = 1 if limit["contact"] == "nc" else 0
            if dice.random() < 0.7:
                self.toward(limit, pin)
        else:
            return
        for level in (active, *(dice.randint(0, 1) for _ in range(dice.choice((0, 0, 2, 6)))), active):
            do("pin", (pin, level))
            self.tick(dice.choice((0, 1, 2)))
        for _ in range(dice.choice((0, 1, 3))):
            self.anything()
        self.tick(dice.choice((1, 30, 300, 800)))
        if dice.random() < 0.7:
            self.settle(3000)
        do("pin", (pin, 1 - active))
        self.tick(dice.choice((1, 30)))

    def toward(self, limit, pin):
        """A motor moves toward this limit switch."""
        i, number = self.dice.randint(1, self.motors), self.rig.limits.index(limit) + 1
        self.send(m.MSG_MOTOR_SET_LIMITS, struct.pack("<BBiBiB", i, 0, 0, 0, 0, number))
        to = 2**31 - 1 if pin == limit["high"] else -(2**31)
        self.send(m.MSG_MOTOR_JOG, struct.pack("<BHi", i, 10000, to))
        self.pause(300)

    def lull(self):
        """Long enough for positions to be remembered."""
        self.settle(1500) or self.halt()
        self.tick(self.dice.choice((1900, 2100, 2600)))

    def release(self):
        """All stop switches as nobody touches them."""
        trial = self.trial
        if trial.estop_pin is not None:
            trial.do("pin", (trial.estop_pin, 1 - trial.estop_level))
        for limit in self.rig.limits:
            for end in ("high", "low"):
                if limit[end] >= 0:
                    trial.do("pin", (limit[end], 0 if limit["contact"] == "nc" else 1))

    def message(self):
        """Any message with any payload."""
        dice = self.dice
        kind = dice.choice(list(m.REQUESTS)) if dice.random() < 0.97 else dice.randrange(0x8000)
        sizes = m.REQUESTS.get(kind, (0, 1))
        length = dice.choice((sizes[0], *sizes[2:])) + sizes[1] * dice.choice((0, 1, 2, 20))
        if dice.random() < 0.15:
            length = max(0, length + dice.choice((-1, 1, 2, 8)))
        payload = bytearray(dice.randbytes(length) if dice.random() < 0.5 else bytes(length))
        if length and dice.random() < 0.9:
            payload[0] = self.motor()
        for _ in range(dice.randint(0, 3)):
            if length >= 4:
                struct.pack_into(
                    "<i", payload, dice.randrange(length - 3), dice.choice((*ODD, dice.randint(-300, 300)))
                )
        self.send(kind, bytes(payload[:1036]))
        self.pause(50)

    def nonsense(self):
        for _ in range(self.dice.choice((1, 3, 10))):
            self.message()
        self.virtual = self.trial.virtual

    def anything(self):
        dice = self.dice
        dice.choice(
            (
                self.query,
                self.move,
                self.message,
                self.speed,
                self.limits,
                self.side,
                self.halt,
                self.configure,
                self.reset,
            )
        )()

    # virtual axes

    def paced(self, number):
        """A motor that brakes for some time, and before soft limits that are soon reached."""
        dice, i = self.dice, number - 1
        velocity = dice.choice((300, 1000, 3000))
        self.speeds[i], self.steep[i] = velocity, int(velocity * dice.choice((1, 2, 5)))
        self.ask(m.MSG_MOTOR_SET_SPEED, struct.pack("<BII", number, velocity, self.steep[i]))
        if dice.random() < 0.5:
            here = self.here(i)
            lower, upper = here - int(velocity * dice.uniform(0, 1.5)), here + int(velocity * dice.uniform(0, 1.5))
            self.ask(m.MSG_MOTOR_SET_LIMITS, struct.pack("<BBiBiB", number, 1, signed(lower), 1, signed(upper), 0))

    def virtual_axes(self):
        dice = self.dice
        if not self.rig.virtuals or self.motors < 2:
            return
        if not self.virtual or dice.random() < 0.3:
            self.settle(1000) or self.halt()
            kind = dice.choice((1, 2, 3, 4, 4, 0))
            axes = []
            motors = list(range(1, self.motors + 1))
            dice.shuffle(motors)
            for k in range(2 if kind == 2 else 6):
                motor = motors.pop() if motors and dice.random() < 0.85 else 0
                axes.append(VirtualAxis(motor, dice.choice((10.0, 100.0, 250.0, 1000.0)), dice.uniform(-20, 20)))
                del k
            if kind == 0:
                payload = b"\x00"
            else:
                nodal = tuple(dice.choice((0.0, 20.0, -35.5)) for _ in range(3))
                payload = VirtualRig(
                    kind,
                    tuple(axes),
                    length=dice.choice((600.0, 857.7)),
                    extension=dice.choice((0.0, 78.0)),
                    nodal=nodal,
                ).payload()
            code, _ = self.ask(m.MSG_VIRT_CONFIG, payload)
            self.virtual = code == m.OK and kind != 0
            if not self.virtual:
                return
            for axis in axes:
                if axis.motor and dice.random() < 0.7:
                    self.paced(axis.motor)
        for _ in range(dice.choice((1, 2, 4))):
            x = dice.random()
            if x < 0.35:
                self.send(
                    m.MSG_VIRT_MOVE,
                    struct.pack(
                        "<Bi",
                        dice.randint(1, 6),
                        dice.choice((dice.randint(-3_000_000, 3_000_000), dice.randint(-100_000, 100_000), *ODD[:4])),
                    ),
                )
            elif x < 0.6:
                self.send(
                    m.MSG_VIRT_JOG,
                    struct.pack(
                        "<BHi",
                        dice.randint(1, 6),
                        dice.choice((1, 500, 10000)),
                        dice.choice((2**31 - 1, -(2**31), dice.randint(-3000, 3000))),
                    ),
                )
            elif x < 0.8:
                self.send(
                    m.MSG_VIRT_JOG_ON_LINE,
                    struct.pack("<Bh", dice.randint(0, 4), dice.choice((1, -1, 10000, -10000, 700))),
                )
            else:
                self.send(
                    m.MSG_VIRT_AIM_POINT,
                    struct.pack("<Biii", dice.randint(0, 1), *(dice.randint(-100_000, 100_000) for _ in range(3))),
                )
            self.pause(1200)
            y = dice.random()
            if y < 0.3:
                for number in range(1, 7) if dice.random() < 0.5 else (dice.randint(1, 6),):
                    self.send(m.MSG_VIRT_STOP, bytes((number,)))
            elif y < 0.45:
                self.halt()
            elif y < 0.6:
                self.anything()
        if not self.settle(dice.choice((500, 4000))):
            self.halt()

    # ---- the whole

    def run(self):
        dice, trial = self.dice, self.trial
        self.release()
        trial.do("open")
        self.tick(dice.choice((1, 3, 30)))
        try:
            for _ in range(dice.randint(1, self.motors + 1)):
                self.speed()
            deeds = [
                (self.moves, 6),
                (self.operate, 6),
                (self.jog_all, 1.5),
                (self.virtual_axes, 3),
                (self.speed, 1.5),
                (self.limits, 1.5),
            ]
            deeds += [(self.configure, 1), (self.query, 2), (self.side, 1), (self.reset, 0.7), (self.enable_all, 0.5)]
            if self.switches:
                deeds.append((self.switch, 1))
            if self.rig.remember_positions:
                deeds.append((self.lull, 0.7))
            if self.wild:
                deeds.append((self.nonsense, 5))
            if self.links:
                deeds.append((lambda: self.close(dice.choice((0, 1, 50, 300))), 0.7))
            doings, weights = zip(*((d, w * dice.choice((0.2, 1, 1, 3))) for d, w in deeds), strict=True)
            while True:
                dice.choices(doings, weights)[0]()
        except Over:
            pass
        self.release()
        self.finish()


def dice_small(dice: Random) -> int:
    return dice.choice((0, 1, 5))
