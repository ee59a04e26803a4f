"""Runs on MicroPython and on CPython: the motion core word by word, with the heap locked wherever a
board must not allocate.

    motion_replay.play(lines, write)            scripts of requests and ticks; write() gets all
                                                state after each tick
    motion_replay.numbers(seed, count, write)   the planner's numbers and the kernels of segments,
                                                on random words

A script consists of these lines:

    new motors           a new kernel and new axes; the state below covers all motors
    speed m v a          Axis.set_speed; jerk m j; place m x
    backlash m n; couple m turned (with motor m + 1); limits m low high
    travel m target share; stop m factor; smooth m; halt factor (all motors)
    tick n               n ticks, the main loop's part before each
    late us              the next interrupt is that late, and the missed ticks are replayed
    starve n             n ticks without the main loop

It writes the words of the header, and of each motor's block, cubic and place.
"""

import sys
from array import array

from framestep.base.native import addressof
from framestep.motion import reals, segments
from framestep.motion.compute import execute
from framestep.motors.axes import Axes
from framestep.pulse import stepper
from framestep.pulse.kernel import StepKernel

try:
    from micropython import heap_lock, heap_unlock
except ImportError:

    def heap_lock():
        pass

    heap_unlock = heap_lock

CYCLES = 125_000
ROOT = b"\x09\x0c\x00\x00\x00\x00\x00\x00"  # a formula: r[12] = √r[0]
AXIS = ("speed", "jerk", "place", "travel", "stop", "smooth", "couple", "limits")


class Rig:
    """Motors without an engine: their commands go to a word of memory. It is a HAL, as far as axes
    need one."""

    def __init__(self, motors):
        self.due = 0xFFFF0000  # microseconds; the counter wraps soon
        self.clock = array("i", [0])
        self.kernel = StepKernel(motors, CYCLES, addressof(self.clock))
        self.fifos = [array("i", [0]) for _ in range(motors)]
        for i in range(motors):
            self.kernel.configure(
                i, addressof(self.fifos[i]), i % 16, 625 * (1 + i % 3), i % 2 == 1
            )
        self.port = self
        self.axes = Axes(self)
        self.words = array("i", [0] * 2)
        self.tick = self.kernel.tick
        self.feed = self.axes.feed

    def glance(self):
        """As a port: no questions come."""

    look_for_stop = glance

    def irq_off(self):
        return 0

    def irq_on(self, state):
        pass

    def at(self, now):
        now &= 0xFFFFFFFF
        self.clock[0] = now - 0x100000000 if now & 0x80000000 else now

    def dump(self, write):
        write(self.kernel.state)
        for i in range(self.kernel.motors):
            axis = self.axes[i]
            write(self.kernel.blocks[i])
            write(axis.cubic)
            write(axis.backlash)
            write(self.fifos[i])


def travel(rig, axis, share):
    heap_lock()
    axis.move_to(rig, rig.words, 1, share)
    heap_unlock()


def couple(axis, partner, turned):
    heap_lock()
    axis.couple(partner, turned)
    heap_unlock()


def limits(rig, axis):
    heap_lock()
    axis.set_limits(True, True, rig.words, 0)
    heap_unlock()


def stop(rig, axis, factor, smooth):
    heap_lock()
    axis.stop(rig, factor, smooth)
    heap_unlock()


def stop_all(rig, factor):
    heap_lock()
    rig.axes.stop(factor)
    heap_unlock()


def place(rig, axis):
    heap_lock()
    axis.set_position(rig.words, 1)
    heap_unlock()


def tick(rig):
    heap_lock()
    rig.tick(None)
    heap_unlock()


def tick_and_feed(rig):
    heap_lock()
    rig.feed()
    rig.axes.moving_bits()
    rig.tick(None)
    heap_unlock()


def ticks(rig, count, fed, write):
    for i in range(count):
        rig.due += 1000
        rig.at(rig.due + i * 7 % 5)
        (tick_and_feed if fed else tick)(rig)
        rig.dump(write)


def play(lines, write):
    rig = None
    for line in lines:
        what, *numbers = line.split()
        numbers = [int(n) for n in numbers]
        axis = rig.axes[numbers[0]] if rig and what in AXIS else None
        if axis and len(numbers) > 1:
            rig.words[1] = numbers[1]
        if what == "new":
            rig = Rig(numbers[0])
        elif what == "speed":
            axis.set_speed(numbers[1], numbers[2])
        elif what == "jerk":
            axis.set_jerk(numbers[1])
        elif what == "place":
            place(rig, axis)
        elif what == "travel":
            travel(rig, axis, numbers[2])
        elif what == "backlash":
            rig.axes.set_backlash(*numbers)
        elif what == "couple":
            couple(axis, rig.axes[numbers[0] + 1], numbers[1])
        elif what == "limits":
            rig.words[0] = numbers[1]
            rig.words[1] = numbers[2]
            limits(rig, axis)
        elif what == "stop":
            stop(rig, axis, numbers[1], False)
        elif what == "smooth":
            stop(rig, axis, 1, True)
        elif what == "halt":
            stop_all(rig, numbers[0])
        elif what == "tick":
            ticks(rig, numbers[0], True, write)
        elif what == "starve":
            ticks(rig, numbers[0], False, write)
        elif what == "late":
            now = rig.due + 1000 + numbers[0]
            while rig.due + 1000 <= now:
                rig.due += 1000
                rig.at(now)
                tick(rig)
                rig.dump(write)
                now += 7
        else:
            raise ValueError(line)


class Random:
    """The same numbers everywhere."""

    def __init__(self, seed):
        self.seed = seed

    def bits(self, count):
        """Return a number of that many bits."""
        result = 0
        for _ in range((count + 14) // 15):
            self.seed = (self.seed * 1103515245 + 12345) & 0x7FFFFFFF
            result = result << 15 | self.seed >> 16
        return result & ((1 << count) - 1)

    def word(self):
        """Return a signed word of any size."""
        value = self.bits(self.bits(5) + 1)
        if value >= 1 << 31:
            value -= 1 << 32
        return -value if self.bits(1) and value != -(1 << 31) else value


def number(random, r, a):
    """Write a planner's number to r[a]."""
    reals.put(r, a, random.word(), 0)
    if r[a]:
        r[a + 1] += random.bits(5) - 24


def calculate(r, words, out, fraction, powers, limit):
    """Do every operation on r[0], r[2] and two words; the results come after these."""
    heap_lock()
    reals.add(r, 4, 0, 2)
    reals.subtract(r, 6, 0, 2)
    reals.multiply(r, 8, 0, 2)
    if r[2]:
        reals.divide(r, 10, 0, 2)
    execute(0, 0, r, ROOT)
    reals.negate(r, 16, 0)
    reals.double(r, 18, 2, powers)
    r[20] = reals.compare(r, 0, 2)
    r[21] = reals.sign(r, 0)
    r[22] = reals.floor(r, 0, limit)
    reals.split(r, 2, out)
    reals.put_difference(r, 24, words, 0, words, 1)
    reals.copy(r, 26, 24)
    reals.fetch(r, 28, r, 12)
    heap_unlock()


def cut(cubic, block, state, r, words, fraction, powers, back, ticks, at):
    heap_lock()
    segments.distance(r, 0, words, 1, cubic)
    segments.velocity(r, 2, cubic, segments.G1)
    segments.velocity(r, 4, cubic, segments.G2)
    segments.cut(cubic, block, ticks)
    segments.mark(state, cubic)
    segments.shift(cubic, fraction, 0, 0)
    reals.copy_word(at, stepper.AT_STEP, cubic, segments.WHOLE)
    at[stepper.AT_PART] = cubic[segments.P] if back else 0
    segments.knot(state, at, fraction)
    segments.shift(cubic, fraction, powers, back)
    segments.bridge(state, cubic, block, fraction)
    segments.coefficient(cubic, segments.G1, r, 2)
    segments.coefficient(cubic, segments.G2, r, 4)
    heap_unlock()


def numbers(seed, count, write):
    random = Random(seed)
    r = array("i", [0] * 32)
    out = array("i", [0] * 2)
    words = array("i", [0] * 2)
    rig = Rig(1)
    block = rig.kernel.blocks[0]
    queue = rig.kernel.queues[0]
    cubic = array("i", [0] * segments.CUBIC_WORDS)
    state = array("i", [0] * segments.OPEN_WORDS)
    at = array("i", [0] * stepper.AT_WORDS)
    for _ in range(count):
        number(random, r, 0)
        number(random, r, 2)
        words[0] = random.word()
        words[1] = random.word()
        calculate(
            r, words, out, random.bits(30), random.bits(5) - 16, random.bits(1 + random.bits(4))
        )
        write(r)
        write(out)
        # anywhere, just below 0, or at the end of the range
        near = random.bits(4)
        cubic[segments.WHOLE] = (random.word() >> 1, -near, near - 2**31)[random.bits(8) % 3]
        cubic[segments.P] = random.bits(16)
        # at most 500 steps within shift()
        for k, bits in (segments.G1, 22), (segments.G2, 17), (segments.G3, 25):
            cubic[k] = random.bits(1 + random.bits(4) * bits // 16) * (1 - 2 * random.bits(1))
        for k in segments.P, segments.G1, segments.G2, segments.G3:
            cubic[k + 1] = random.bits(30)
        cut(
            cubic, block, state, r, words, random.bits(30), random.bits(2), random.bits(1),
            1 + random.bits(5), at,
        )  # fmt: skip
        write(cubic)
        write(state)
        write(queue)


def main():
    """Run with the arguments: a file for the words, and for numbers() a seed and a count."""
    with open(sys.argv[1], "wb") as out:
        if len(sys.argv) > 2:
            numbers(int(sys.argv[2]), int(sys.argv[3]), out.write)
        else:
            play(sys.stdin, out.write)


if __name__ == "__main__":
    main()
