"""Uploads as a host would send them, good and bad, and a dictionary that says what must come of them.

`uploads()` makes scripts for host_tests/runtime/store_replay.py, `expected()` gives the answers.
"""

import struct

from hypothesis import strategies as st

from framestep.protocol import messages
from framestep_tools import wire

OK, ERR_RANGE, ERR_GENERAL = 0x10, 0x14, 0x15
LOWEST = -(2**31)


def axis(motor, index, last, positions):
    """An MSG_RT_UPLOAD_MOVE_AXIS; `motor` from 1."""
    head = struct.pack("<BI", motor, index | last << 31)
    return wire.encode(messages.MSG_RT_UPLOAD_MOVE_AXIS, head + struct.pack(f"<{len(positions)}i", *positions), 5).hex()


def _is_whole(chunk):
    """Whether a chunk, {frame: position}, has differences that 16 bits do not hold."""
    before = None
    for _, position in sorted(chunk.items()):
        if before is not None and abs(position - before) > 32767:
            return True
        before = position
    return False


class Model:
    """What an UploadStore must do: dictionaries for the positions, and for the memory the count of its chunks."""

    def __init__(self, motors, memory_bytes):
        self.motors = motors
        self.halves = (memory_bytes // 2 - 66) // 64 * 64
        self.limit = (self.halves - self.halves // 64) // (motors * 66) * 64
        self.clear()

    def clear(self):
        self.state = "EMPTY"
        self.sent = {}
        self.start = self.end = self.count = 0
        self.top = self.halves
        self.free = 0

    def begin(self, start, end):
        if not -(2**29) < start <= end < 2**29 or end - start >= self.limit:
            return ERR_RANGE
        self.clear()
        self.state, self.start, self.end, self.count = "LOADING", start, end, end - start + 1
        return OK

    def section(self, motor, index, last, positions):
        if self.state != "LOADING":
            return ERR_GENERAL
        stop = index + len(positions)
        if not 0 <= motor < self.motors or index >= self.count or stop > self.count or LOWEST in positions:
            return ERR_RANGE
        if not positions:
            return ERR_RANGE if last else OK
        regions = len(self.sent.keys() | {motor})
        if regions * self.region() > self.top:
            return ERR_RANGE
        changed = dict(self.sent.get(motor, {}))
        changed.update(zip(range(index, stop), positions, strict=True))
        if last:
            changed.update(dict.fromkeys(range(stop, self.count), positions[-1]))
        return OK if self.change([(motor, changed)], regions) else ERR_RANGE

    def finish(self):
        if self.state == "EMPTY":
            return ERR_GENERAL
        if self.state == "LOADING":
            changes = []
            for motor, sent in sorted(self.sent.items()):
                held = sent[min(sent)]
                changes.append((motor, {frame: (held := sent.get(frame, held)) for frame in range(self.count)}))
            if not self.change(changes, len(self.sent)):
                return ERR_RANGE
            self.state = "READY"
        return OK

    def region(self):
        """Half words of a motor's region."""
        return (self.count + 63) // 64 * 66

    def change(self, changes, regions):
        """Put new dictionaries in the place of old ones if at any moment the pool has an entry for each whole chunk."""
        room = self.free + (self.top - regions * self.region()) // 64
        top, free, need = self.top, self.free, 0
        for motor, new in changes:
            old = self.sent.get(motor, {})
            for chunk in range((self.count + 63) // 64):
                frames = range(64 * chunk, 64 * chunk + 64)
                was, now = (_is_whole({f: sent[f] for f in frames if f in sent}) for sent in (old, new))
                need += now - was
                if now > was:
                    if need > room:
                        return False
                    if free:
                        free -= 1
                    else:
                        top -= 64
                free += was > now
        self.top, self.free = top, free
        self.sent.update(changes)
        return True

    def read(self, before, after):
        motors = []
        for motor in range(self.motors):
            sent = self.sent.get(motor)
            if self.state != "READY" or sent is None:
                motors.append("-")
            else:
                frames = range(-before, self.count + after)
                motors.append(",".join(str(sent[min(max(frame, 0), self.count - 1)]) for frame in frames))
        return " ".join(motors)


def expected(script):
    """The answers to a script, a list of (line, step of the model)."""
    model = None
    for _, (name, *arguments) in script:
        if name == "new":
            model = Model(*arguments)
            yield str(model.limit)
        else:
            answer = getattr(model, name)(*arguments)
            yield "" if answer is None else str(answer)


# Positions stay clear of a difference of 2^32, which 32 bits take for none: the memory used, and only it, would differ.
_far = st.integers(-(2**31) + 2**17, 2**31 - 2**17)
_near = st.integers(-100_000, 100_000)


@st.composite
def _positions(draw, index, count, before):
    """A section's worth from frame `index` on: still, moving evenly, wandering or jumping."""
    start = draw(st.one_of(_near, _far, st.just(before), st.just(before)))
    kind = draw(st.sampled_from(["still", "even", "even", "wave", "jumps", "alternate", "edge", "lowest"]))
    limit = 2**31 - 2**17
    if kind == "still":
        return [start] * count
    if kind == "even":
        slope = draw(
            st.one_of(
                st.integers(-1000, 1000), st.integers(-40_000, 40_000), st.sampled_from([32767, -32767, 32768, -32768])
            )
        )
        return [max(-limit, min(limit, start + slope * i)) for i in range(count)]
    if kind == "wave":
        period = draw(st.integers(2, 50))
        return [max(-limit, min(limit, start + (i % period) * 3000)) for i in range(count)]
    if kind == "jumps":
        jumps = draw(st.dictionaries(st.integers(0, max(0, count - 1)), _far, max_size=3))
        return [jumps.get(i, start) for i in range(count)]
    if kind == "alternate":
        other = draw(st.one_of(_near, _far))
        return [other if i % 2 else start for i in range(count)]
    positions = [start] * count
    if kind == "lowest" and count:
        boundary = min(-index % 64, count - 1)  # the first frame of a chunk
        positions[draw(st.one_of(st.sampled_from([0, boundary, count - 1]), st.integers(0, count - 1)))] = LOWEST
    if kind == "edge" and count:
        positions = [draw(st.sampled_from([2**31 - 1, LOWEST + 1, LOWEST + 32768]))] * count
    return positions


@st.composite
def uploads(draw, steps=25, memories=(2000, 3000, 5000, 8000, 20_000)):
    """A store that is a little too small or large enough, and some uploads into it."""
    motors = draw(st.integers(1, 4))
    memory = draw(st.sampled_from(memories))
    model = Model(motors, memory)
    if model.limit == 0:
        memory = 3000
        model = Model(motors, memory)
    script = [(f"NEW {motors} {memory}", ("new", motors, memory))]

    def add(line, *step):
        script.append((line, step))

    def begin():
        start = draw(
            st.one_of(st.integers(-10, 10), st.sampled_from([-(2**29), 1 - 2**29, 2**29 - 300, 2**29 - 1, -(2**30)]))
        )
        most = model.limit
        count = draw(st.one_of(st.integers(1, most), st.just(most), st.sampled_from([0, -1, 63, 64, 65, most + 1])))
        end = max(-(2**30), min(start + count - 1, 2**30 - 1))
        add(f"BEGIN {start} {end}", "begin", start, end)
        model.begin(start, end)

    if draw(st.integers(0, 9)):
        begin()
    in_order, before = {}, {}
    for _ in range(draw(st.integers(0, steps))):
        kind = draw(st.sampled_from(["section"] * 14 + ["begin", "finish", "clear", "stray"]))
        if kind == "begin":
            begin()
            in_order = {}
        elif kind == "finish":
            add("FINISH", "finish")
            add("READ 3 3", "read", 3, 3)
        elif kind == "clear":
            add("CLEAR", "clear")
            in_order = {}
        else:
            motor = draw(st.integers(0, motors - 1))
            size = draw(
                st.one_of(st.integers(1, 257), st.sampled_from([1, 63, 64, 65, 128, 255, 257]), st.integers(0, 2))
            )
            at = in_order.get(motor, 0)
            index = draw(st.sampled_from([at, at, at, max(0, at - size), at + draw(st.integers(0, 80)), -1]))
            if index < 0:
                index = draw(st.integers(0, max(0, model.count - 1)))
            if kind == "section":
                index = min(index, max(0, model.count - 1))
                size = min(size, max(0, model.count - index))
            else:
                motor = draw(st.integers(-1, motors))
                index = draw(st.one_of(st.integers(0, model.count + 3), st.integers(0, 2**31 - 1)))
            in_order[motor] = index + size
            last = draw(st.integers(0, 7)) == 0
            positions = draw(_positions(index, size, before.get(motor, 0)))
            if positions and abs(positions[-1]) < 2**31 - 2**17:
                before[motor] = positions[-1]
            add(axis(motor + 1, index, last, positions), "section", motor, index, last, positions)
    add("FINISH", "finish")
    add("READ 2 2", "read", 2, 2)
    return script
