"""Any requests in any order on the emulated board, while a person works on its REPL: memory used to
the last byte, long C calls, Ctrl-C, files read, prints, bench commands.

    make strain ARGS="--requests 20000 --seed 1"
    make strain BOARD=pico2
    ... --overlay framestep.pulse.tick framestep.motors.axis

Every valid request gets one answer in time, whatever stops the motors gets an answer, the motors
end where their edges say, no tick in motion comes late, interrupts are not off for long, and the
firmware runs at the end. HARD_STOP 100 may come if the REPL prevents passes for longer than queues
last; the report says how often it came, and why. Without a REPL there is `make fuzz TARGET=rp2040`.
overlay: these modules replace the image's, in RAM, as `framestep flash` does it with edited ones.
"""

import argparse
import collections
import contextlib
import random
import struct
import time
from pathlib import Path

from framestep.protocol import messages as m
from framestep_emulator import ReplError
from framestep_tools.building.board_files import emulated_boards
from framestep_tools.client.wire import FrameDecoder, encode
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.modules import edited, ident_of, on_board
from host_tests.observers.timing import LATE_US, MASKED_US, Timing
from host_tests.script import parse

SCRIPTS = Path(__file__).parents[1] / "fuzz" / "scripts"
ODD = (0, 1, -1, 2, 255, 10_000, 2**30 - 1, 2**30, -(2**30) - 1, 2**31 - 1, -(2**31))
RIG = {"estop": "nc", "outputs": [{"pin": 22}], "motor_count": 4, "dmx": False}
ESTOP = 19
ANSWER_S = 3  # a long C call, a collection and a frame that never ends may come together
REST_S = 40
CHUNK = 250
REPLY = 0x8000

# What a person does on the REPL. A function holds the memory that it takes, so that it is always
# free again; in small pieces, because any word in memory that looks like a pointer to one keeps
# it.
HELPERS = """
import gc, os, time
def take(ms, size=1024):
    kept = [None] * 100
    count = 0
    while size >= 8 and count < 100:
        try:
            kept[count] = bytearray(size)
            count += 1
        except MemoryError:
            size //= 2
    time.sleep_ms(ms)
def hold(ms):
    x = bytearray(12000)
    time.sleep_ms(ms)
def read(path):
    with open(path, "rb") as file:
        while file.read(200):
            pass
with open("/data.bin", "wb") as file:
    for _ in range(80):
        file.write(bytes(range(256)))
"""
WORK = (
    "take(60)",
    "take(300)",
    "hold(200)",
    "sum(range(20000))",
    "len(str(7**700))",
    "read('/rig.json')",
    "read('/data.bin')",
    "os.listdir('/'); os.stat('/rig.json'); os.statvfs('/')",
    "print('x' * 300)",
    "for i in range(40): print(i, i / 7)",
    "gc.collect()",
    "[i * i for i in range(400)]",
    "time.sleep_ms(100)",
    "import framestep.repl; framestep.repl.status()",
    "import framestep.repl; framestep.repl.io(1, True)",
    "import framestep.repl; framestep.repl.move(2, 300)",
    "import framestep.repl; framestep.repl.stop()",
    "import framestep.repl; framestep.repl.timing()",
)
ENDLESS = (
    "while True: pass",
    "while True: take(5)",
    "while True: gc.collect()",
    "while True: read('/rig.json')",
)
BEARABLE = ("MemoryError", "KeyboardInterrupt")


class Broken(AssertionError):
    """Something forbidden has happened; the text says what and when."""


def pool():
    """Return (type, payload) of every request in the fuzzer's scripts."""
    found = []
    for path in sorted(SCRIPTS.glob("*.txt")):
        decoder = FrameDecoder()
        with path.open() as file:
            sent = [data for _, verb, data in parse(file).events if verb == "rx"]
        found += [(f.type, f.payload) for data in sent for f in decoder.feed(data)]
    return found


def words(*values):
    return struct.pack(f"<{len(values)}i", *values)


class Strain:
    """One board under strain. say: called with lines of the report."""

    def __init__(self, board, seed, say=print):
        self.timing: Timing | None = None
        self.recent: collections.deque[str] = collections.deque(maxlen=12)
        self.board = board
        self.say = say
        self.dice = random.Random(seed)
        self.sound = pool()
        self.decoder = FrameDecoder()
        self.waiting: dict[int, tuple[int, int]] = {}  # ID -> when it was sent (ns), its type
        self.left: set[int] = set()
        self.damaged: set[int] = set()
        self.number = 0
        self.counts: collections.Counter[str] = collections.Counter()
        self.slowest = 0  # ns
        self.slowest_of = ""  # that request, and what ran on the REPL
        self.reported: collections.Counter[str] = collections.Counter()
        self.edges: collections.Counter[int] = collections.Counter()
        self.positions: list[int] = []
        self.renumbered = True
        self.estop = False
        self.turns = 0
        self.busy = False  # the REPL runs something
        self.endless = False
        board.protocol.open_port(True)
        # this waits for the start of framestep: opening the REPL sends Ctrl-C, which would end it
        self.ask(m.MSG_HI)
        self.begin()

    def begin(self):
        """Open the REPL."""
        self.repl = self.board.emulator.repl()
        self.repl.exec(HELPERS)
        self.timing = Timing(self, self.repl)
        self.timing.begin()

    # ---- the protocol's end

    def pass_time(self, ms):
        board = self.board
        board.run_until(board.now_ns + round(ms * 1e6))
        for _, signal, value in board.edges():
            if signal[0] == "m" and signal[1:].isdigit():
                self.edges[int(signal[1:])] += value
        for frame in self.decoder.feed(board.protocol.transmit()):
            self.take(frame)
        if self.decoder.skipped:
            raise self.broken(f"{self.decoder.skipped} bytes came that are no frame")
        late = [
            kind for sent, kind in self.waiting.values() if board.now_ns - sent > ANSWER_S * 1e9
        ]
        if late:
            raise self.broken(f"no answer to {[hex(kind) for kind in late]}")
        if self.timing:
            self.judge()

    def judge(self):
        """Check that ticks are in time, and interrupts on."""
        self.late_us = max(self.late_us, self.timing.worst_late())
        if self.late_us > LATE_US:
            raise self.broken(f"a tick in motion was {self.late_us} µs late")
        self.masked_us = self.timing.masked()
        if self.masked_us > MASKED_US:
            raise self.broken(f"interrupts were off for {self.masked_us:.0f} µs")

    def take(self, frame):
        if frame.id == 0:
            self.counts[f"unasked 0x{frame.type:X}"] += 1
            if frame.type == m.MSG_MOTOR_HARD_STOP:
                self.counts[f"HARD_STOP {frame.payload[0]}"] += 1
            return
        if frame.id in self.damaged:
            return  # its error may come late
        if frame.id in self.left:
            raise self.broken(f"an answer for the client before, type 0x{frame.type:X}")
        sent = self.waiting.pop(frame.id, None)
        if sent is None or frame.type & ~REPLY != sent[1]:
            raise self.broken(f"an answer to nothing, type 0x{frame.type:X}, ID {frame.id}")
        waited = self.board.now_ns - sent[0]
        if waited > self.slowest:
            self.slowest = waited
            self.slowest_of = f"of 0x{sent[1]:X}, the REPL {self.piece if self.busy else 'at rest'}"
        code = struct.unpack_from("<H", frame.payload)[0] if frame.type & REPLY else 0
        self.counts["answers"] += 1
        self.counts["refused" if code not in (0, m.OK) else "taken"] += 1
        self.answer = frame

    def send(self, kind, payload):
        self.number += 1
        number = self.number * 0x9E3779B1 & 0xFFFFFFFF or 1
        self.waiting[number] = self.board.now_ns, kind
        self.recent.append(f"{self.board.now_ns * 1e-9:.3f} {kind:04X} {payload.hex()[:60]}")
        self.renumbered |= kind in (m.MSG_MOTOR_RESET_POSITION, m.MSG_MOTOR_CONFIGURE)
        self.board.protocol.receive(encode(kind, payload, number))
        self.counts["requests"] += 1

    def ask(self, kind, payload=b""):
        """Return the payload of the answer."""
        self.send(kind, payload)
        while self.waiting:
            self.pass_time(5)
        return self.answer.payload

    def broken(self, what):
        return Broken(
            f"{what} at {self.board.now_ns * 1e-9:.3f} s, after {self.counts['requests']} requests,"
            f" the last of which were\n" + "\n".join(self.recent)
        )

    # ---- what happens

    def spoilt(self, payload):
        dice, changed = self.dice, bytearray(payload)
        if len(changed) >= 4 and dice.random() < 0.6:
            struct.pack_into("<i", changed, dice.randrange(len(changed) - 3), dice.choice(ODD))
        else:
            for _ in range(dice.randint(1, 3)):
                changed[dice.randrange(len(changed))] = dice.randrange(256)
        return bytes(changed)

    def play(self):
        """Do an upload, a run and its GO, whatever else happens meanwhile."""
        dice = self.dice
        frames = dice.choice((2, 12, 40))
        self.send(m.MSG_MOTOR_STOP_ALL, b"")
        self.wander(300)
        self.send(m.MSG_RT_UPLOAD_MOVE_BEGIN, words(1, frames))
        for motor in (1, 2, 3):
            self.send(m.MSG_MOTOR_CONFIGURE, bytes((motor, 1)))
            self.send(m.MSG_MOTOR_SET_SPEED, bytes((motor,)) + words(20_000, 100_000))
            steps = [round(motor * 3 * k * k / 8) for k in range(frames)]
            for at in range(0, frames, 4):
                self.send(
                    m.MSG_RT_UPLOAD_MOVE_AXIS, bytes((motor,)) + words(at, *steps[at : at + 4])
                )
            self.work()
            self.pass_time(dice.choice((1, 5)))
        self.send(m.MSG_RT_UPLOAD_MOVE_END, b"")
        flags = struct.pack("<BIHHH", 0, 0, 0, 0, dice.choice((0, 1, 2, 0x10, 0x20)))
        self.send(m.MSG_RT_RUN_MOVE, struct.pack("<IiiII", 24_000, 1, frames, 300, 300) + flags)
        self.wander(dice.choice((30, 500)))
        self.send(m.MSG_RT_GO, b"")
        self.wander(dice.choice((20, 800)))

    def wander(self, ms):
        """Let time pass, with work on the REPL."""
        end = self.board.now_ns + ms * 1_000_000
        while self.board.now_ns < end:
            self.work()
            self.pass_time(self.dice.choice((2, 20, 60)))

    def anything(self):
        dice = self.dice
        kind, payload = dice.choice(self.sound)
        if payload and dice.random() < 0.35:
            payload = self.spoilt(payload)
        chance = dice.random()
        self.turns += 1
        # by count and not by chance, so that short runs have them too, whatever the answers
        if self.turns % 100 == 50:
            data = bytearray(encode(kind, payload, 0x7FFF0000))
            data[dice.randrange(2, len(data))] ^= 1 << dice.randrange(8)
            self.send(m.MSG_HI, b"")  # before it, because damage may swallow what follows
            while self.waiting:
                self.pass_time(5)
            self.damage(bytes(data))
        elif self.turns % 150 == 75:
            self.leave()
        elif chance < 0.005 or self.estop:
            if not self.estop:  # often in the middle of a pass that plans
                self.send(kind, payload)
                self.pass_time(dice.uniform(0, 10))
            self.estop = not self.estop
            self.press(self.estop)
        elif chance < 0.015:
            self.play()
        elif chance < 0.045:
            self.send(m.MSG_MOTOR_STOP_ALL, b"")
        else:
            self.send(kind, payload)

    def press(self, on):
        """Press the E-stop, or release it."""
        self.board.emulator.set_pin(ESTOP, int(on))

    def damage(self, data):
        """Send damaged bytes; ignore the answer, and expect no effect a while later."""
        self.counts["damaged"] += 1
        self.damaged.add(int.from_bytes(data[2:6], "little"))
        self.board.protocol.receive(data)
        self.board.run_until(self.board.now_ns + 250_000_000)
        self.decoder = FrameDecoder()
        self.board.protocol.transmit()

    def leave(self):
        """Close the host's port, and open it again."""
        self.counts["closed"] += 1
        self.board.protocol.open_port(False)
        self.board.run_until(self.board.now_ns + self.dice.choice((30, 300)) * 1_000_000)
        self.board.protocol.transmit()
        self.left |= set(self.waiting)
        self.counts["left unanswered"] += len(self.waiting)
        self.waiting.clear()
        self.decoder = FrameDecoder()
        self.board.protocol.open_port(True)
        self.pass_time(100)

    # ---- the REPL's end

    def work(self):
        """Start something on the REPL, or see whether it has ended; Ctrl-C ends endless work."""
        dice = self.dice
        serial = self.repl.serial
        if self.busy:
            if self.endless and dice.random() < 0.3:
                serial.write(b"\x03")
                self.counts["Ctrl-C"] += 1
            serial.timeout = 0
            self.heard += serial.read(100_000)
            out, *ended = self.heard.split(b"\x04", 2)
            # the firmware may print something before or after the prompt
            if len(ended) < 2 or b">" not in ended[1]:
                return
            self.busy = False
            err = ended[0]
            for line in out.decode(errors="replace").splitlines():
                if line.startswith("framestep: "):
                    self.reported[line] += 1
            if b"fault in the firmware" in self.heard:
                raise self.broken(f"the firmware has ended: {self.heard[-2000:]!r}")
            if err and not any(name in err.decode() for name in BEARABLE):
                raise self.broken(f"{self.piece!r} ended with {err!r}")
        elif dice.random() < 0.5:
            self.endless = dice.random() < 0.3
            self.piece = dice.choice(ENDLESS if self.endless else WORK)
            self.heard = b""
            self.repl.start(self.piece)
            self.busy = True
            self.counts["REPL"] += 1

    def calm(self):
        """Wait until the REPL is at its prompt."""
        for _ in range(400):
            if not self.busy:
                return
            self.work()
            self.pass_time(20)
        raise self.broken(f"{self.piece!r} on the REPL does not end")

    # ---- the whole

    def check(self):
        """Compare at rest: the motors' positions are those of their edges."""
        if self.estop:
            self.estop = False
            self.press(False)
        end = self.board.now_ns + REST_S * 1_000_000_000
        while struct.unpack_from("<I", self.ask(m.MSG_MOTOR_STATUS))[0]:
            if self.board.now_ns > end:
                raise self.broken("the motors do not come to rest")
            self.ask(m.MSG_MOTOR_STOP_ALL)
            self.pass_time(200)
        self.pass_time(60)
        payload = self.ask(m.MSG_MOTOR_GET_POSITION)
        positions = list(struct.unpack_from("<4i", payload, 4))
        made = [self.edges[motor] for motor in range(1, 5)]
        if self.positions and not self.renumbered and not self.lost:
            for motor, (before, now) in enumerate(zip(self.positions, positions, strict=True)):
                if (before + made[motor] - now) & 0xFFFFFFFF:
                    raise self.broken(
                        f"motor {motor + 1} is reported at {now}: was at {before}, "
                        f"{made[motor]} edges since"
                    )
        self.positions = positions
        self.edges.clear()
        self.renumbered = False
        self.faults = self.counts["HARD_STOP 100"]

    @property
    def lost(self):
        """Whether a fault may have lost steps since the last check."""
        return self.counts["HARD_STOP 100"] > self.faults

    faults = 0
    late_us = 0  # of the worst tick in motion
    masked_us = 0.0  # the longest time with interrupts off
    heard = b""
    piece = ""
    answer = None

    def run(self, requests):
        begun = time.monotonic()
        chunks = 0
        while self.counts["requests"] < requests:
            end = self.counts["requests"] + CHUNK
            while self.counts["requests"] < end:
                for _ in range(self.dice.choice((1, 2, 4, 8))):
                    self.anything()
                self.work()
                self.pass_time(self.dice.choice((1, 3, 10, 30)))
            self.check()
            chunks += 1
            if chunks % 20 == 0:
                self.say(
                    f"{self.counts['requests']} requests, "
                    f"{self.board.now_ns * 1e-9:.0f} s of the board's, "
                    f"{time.monotonic() - begun:.0f} s"
                )
        self.calm()
        self.check()
        return self.end()

    def end(self):
        """See that the firmware runs."""
        alive = "(lambda it: (it.alive, it.failure))(__import__('framestep.boot').boot.runner)"
        for _ in range(5):
            # memory that was full may not be free at once
            with contextlib.suppress(ReplError):
                if self.repl.eval(alive) != (True, None):
                    raise self.broken("the firmware is not alive")
                return self
        raise self.broken("the REPL finds no memory")

    def report(self):
        for name, count in sorted(self.counts.items()):
            self.say(f"{count:7} {name}")
        for line, count in self.reported.most_common():
            self.say(f"{count:7} × {line}")
        self.say(
            f"slowest answer {self.slowest / 1e6:.0f} ms {self.slowest_of}, "
            f"worst tick {self.late_us} µs late, "
            f"interrupts off for {self.masked_us:.0f} µs"
        )


def strain(seed, requests, say=print, modules=(), board="pico"):
    names = [module.replace(".", "/") + ".mpy" for module in modules]
    files = on_board(ident_of(board), {name: edited(name) for name in names}) if names else {}
    with EmulatedBoard(RIG, files=files, board=board) as emulated:
        emulated.wire_switches()
        found = Strain(emulated, seed, say)
        bits = struct.unpack_from("<I", found.ask(m.MSG_CONDITION))[0]
        if bool(names) != bool(bits & m.CONDITION_OVERLAY):
            raise found.broken(f"overlay of {names}, condition {bits:#x}")
        return found.run(requests)


def main():
    parser = argparse.ArgumentParser(description="requests and REPL work on the emulated board")
    parser.add_argument("--requests", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--overlay", nargs="+", default=(), metavar="MODULE", help="modules to run from RAM"
    )
    parser.add_argument("--board", default="pico", choices=emulated_boards())
    args = parser.parse_args()
    if args.requests < 1:
        parser.error("--requests has to be 1 or more")
    strain(args.seed, args.requests, modules=args.overlay, board=args.board).report()


if __name__ == "__main__":
    main()
