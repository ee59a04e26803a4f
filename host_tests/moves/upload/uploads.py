"""Uploads as a host would send them, good and bad, and a dictionary that says what must come of
them.

`uploads()` draws steps, `answers()` gives what the store answers to them, `expected()` what it
must: text for each step.
"""

import itertools
import struct
from array import array

from hypothesis import strategies as st

from framestep.moves.upload.store import READY, UploadStore
from framestep.protocol.messages import LAST_SECTION

OK, ERR_RANGE, ERR_GENERAL = 0x10, 0x14, 0x15
FARTHEST = 1_000_000  # frame numbers, either way
LOWEST = -(2**31)


class Store:
    """The store, with steps of these names."""

    def __init__(self, motors, memory_bytes):
        self.store = UploadStore(motors, memory_bytes)
        self.limit = self.store.capacity_frames(motors)
        self.begin = self.store.begin
        self.finish = self.store.finish
        self.clear = self.store.clear

    def section(self, motor, index, last, positions):
        data = b"\7" + struct.pack(f"<{len(positions)}i", *positions)
        flag = LAST_SECTION if last else 0
        return self.store.section(motor, index, flag, data, 1, len(positions))

    def read(self, before, after):
        """Return each motor's positions, from `before` frames before the range to `after` frames
        after it."""
        store = self.store
        count = store.end - store.start + 1 + before + after
        found = []
        for motor in range(store.motors):
            if store.state == READY and store.has(motor):
                found.append(",".join(map(str, self._positions(motor, -before, count))))
            else:
                assert not store.positions(motor, 0, 1, array("i", [0]), 0)
                found.append("-")
        return " ".join(found)

    def _positions(self, motor, first, count):
        """Return positions, read in pieces of several sizes."""
        values, size = [], 1
        while count > 0:
            piece = min(size, count)
            words = array("i", [7] * 67)
            assert self.store.positions(motor, first, piece, words, 1)
            assert words[0] == words[piece + 1] == 7
            values += words[1 : piece + 1]
            first += piece
            count -= piece
            size = size * 3 % 65 + 1
        return values

    def one(self, motor, index):
        """Return a single position."""
        word = array("i", [0])
        return word[0] if self.store.position(motor, index, word, 0) else "-"


def _play(kind, steps):
    """Yield the answers of stores of a kind. A step is a tuple, or such text as `BEGIN 1 40`."""
    store = None
    for step in steps:
        if isinstance(step, str):
            name, *words = step.lower().split()
            step = (name, *map(int, words))
        name, *arguments = step
        if name == "new":
            store = kind(*arguments)
            yield str(store.limit)
        else:
            answer = getattr(store, name)(*arguments)
            yield "" if answer is None else str(answer)


def answers(*steps):
    """Return what the store answers."""
    return list(_play(Store, steps))


def expected(steps):
    """Return what it must answer."""
    return list(_play(Model, steps))


def axis(motor, index, last, positions):
    """Return the step of a section; `motor` from 1."""
    return "section", motor - 1, index, last, positions


FRAMES, CHUNK, UNIT, MOST_UNITS = 128, 69, 17, 12  # of a chunk; half words


def _units(chunk):
    """Return the units that a chunk, {frame: position}, takes."""
    positions = [position for _, position in sorted(chunk.items())]
    if len(set(positions)) > 1 and any(not -(2**29) <= position < 2**29 for position in positions):
        return MOST_UNITS
    steps = [after - before for before, after in itertools.pairwise(positions)]
    most = max((abs(after - before) for before, after in itertools.pairwise(steps)), default=0)
    return next((units for units in range(MOST_UNITS) if most < 2 ** (7 + 2 * units)), MOST_UNITS)


class Model:
    """What an UploadStore must do: dictionaries for the positions, and the number of units for the
    memory."""

    def __init__(self, motors, memory_bytes):
        self.motors = motors
        self.halves = memory_bytes // 2
        self.limit = self.halves // (motors * (CHUNK + UNIT)) * FRAMES
        self.clear()

    def clear(self):
        self.state = "EMPTY"
        self.sent = {}
        self.start = self.end = self.count = 0
        self.in_use = self.used = 0  # units, now and at most

    def begin(self, start, end):
        if not -FARTHEST <= start <= end <= FARTHEST or end - start >= self.limit:
            return ERR_RANGE
        self.clear()
        self.state, self.start, self.end, self.count = "LOADING", start, end, end - start + 1
        return OK

    def section(self, motor, index, last, positions):
        if self.state != "LOADING":
            return ERR_GENERAL
        positions = positions[: max(0, self.count - index)]
        stop = index + len(positions)
        if not 0 <= motor < self.motors or index >= self.count or LOWEST in positions:
            return ERR_RANGE
        if not positions:
            return ERR_RANGE if last else OK
        regions = len(self.sent.keys() | {motor})
        if regions * self.region() > self.halves - self.used * UNIT:
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
                changes.append(
                    (motor, {frame: (held := sent.get(frame, held)) for frame in range(self.count)})
                )
            if not self.change(changes, len(self.sent)):
                return ERR_RANGE
            self.state = "READY"
        return OK

    def region(self):
        """Return the half words of a motor's region."""
        return -(-self.count // FRAMES) * CHUNK

    def change(self, changes, regions):
        """Replace old dictionaries by new ones if the pool has the units for it at every moment."""
        room = (self.halves - regions * self.region()) // UNIT
        in_use, used = self.in_use, self.used
        for motor, new in changes:
            old = self.sent.get(motor, {})
            for first in range(0, self.count, FRAMES):
                frames = range(first, first + FRAMES)
                was, now = (
                    _units({f: sent[f] for f in frames if f in sent}) for sent in (old, new)
                )
                in_use += now - was
                if in_use > room:
                    return False
                used = max(used, in_use)
        self.in_use, self.used = in_use, used
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
                motors.append(
                    ",".join(str(sent[min(max(frame, 0), self.count - 1)]) for frame in frames)
                )
        return " ".join(motors)


HIGHEST = 2**31 - 1
_far = st.integers(-HIGHEST, HIGHEST)
_near = st.integers(-100_000, 100_000)
_bend = st.one_of(
    st.integers(0, 600),
    st.builds(lambda bits, more: 2**bits + more, st.integers(7, 31), st.integers(-1, 1)),
)


def _clipped(position):
    return max(-HIGHEST, min(HIGHEST, position))


@st.composite
def _positions(draw, index, count, before):
    """Draw positions for a section from frame `index` on: still, even, bending, wandering or
    jumping."""
    start = draw(st.one_of(_near, _far, st.just(before), st.just(before)))
    kind = draw(
        st.sampled_from(
            [
                "still", "even", "even", "bends", "bends", "wave", "jumps", "alternate", "edge",
                "lowest",
            ]
        )
    )  # fmt: skip
    if kind == "still":
        return [start] * count
    if kind == "even":
        slope = draw(
            st.one_of(
                st.integers(-1000, 1000), st.integers(-40_000, 40_000), st.integers(-(2**25), 2**25)
            )
        )
        return [_clipped(start + slope * i) for i in range(count)]
    if kind == "bends":
        bend, turn = draw(_bend), draw(st.sampled_from([1, 2, 5, 1000]))
        position, slope, positions = start, 0, []
        for i in range(count):
            slope += -bend if i // turn % 2 else bend
            positions.append(_clipped(position := position + slope))
        return positions
    if kind == "wave":
        period = draw(st.integers(2, 50))
        return [_clipped(start + (i % period) * 3000) for i in range(count)]
    if kind == "jumps":
        jumps = draw(st.dictionaries(st.integers(0, max(0, count - 1)), _far, max_size=3))
        return [jumps.get(i, start) for i in range(count)]
    if kind == "alternate":
        other = draw(st.one_of(_near, _far))
        return [other if i % 2 else start for i in range(count)]
    positions = [start] * count
    if kind == "lowest" and count:
        boundary = min(-index % FRAMES, count - 1)  # the first frame of a chunk
        positions[
            draw(st.one_of(st.sampled_from([0, boundary, count - 1]), st.integers(0, count - 1)))
        ] = LOWEST
    if kind == "edge" and count:
        positions = [
            draw(st.sampled_from([HIGHEST, -HIGHEST, 2**29, 2**29 - 1, -(2**29), -(2**29) - 1]))
        ] * count
    return positions


@st.composite
def uploads(draw, steps=25, memories=(180, 380, 700, 1100, 2000, 3500, 20_000)):
    """Draw a store, slightly too small or large enough, and some uploads into it."""
    motors = draw(st.integers(1, 4))
    memory = draw(st.sampled_from(memories))
    model = Model(motors, memory)
    if model.limit == 0:
        memory = 1100
        model = Model(motors, memory)
    script = [("new", motors, memory)]

    def add(*step):
        script.append(step)

    def begin():
        start = draw(
            st.one_of(
                *[st.integers(-10, 10)] * 4,
                st.sampled_from([-FARTHEST - 1, -FARTHEST, FARTHEST - 300, FARTHEST, -(2**30)]),
            )
        )
        most = model.limit
        count = draw(
            st.one_of(
                *[st.integers(1, most)] * 4,
                *[st.just(most)] * 4,
                st.sampled_from([0, -1, 127, 128, 129, most + 1]),
            )
        )
        end = max(-(2**30), min(start + count - 1, 2**30 - 1))
        add("begin", start, end)
        model.begin(start, end)

    begin()
    in_order, before = {}, {}
    for _ in range(draw(st.integers(0, steps))):
        kind = draw(st.sampled_from(["section"] * 20 + ["begin", "finish", "clear", "stray"]))
        if kind == "begin":
            begin()
            in_order = {}
        elif kind == "finish":
            add("finish")
            add("read", 3, 3)
            if model.finish() == OK and draw(st.integers(0, 3)):
                begin()
                in_order = {}
        elif kind == "clear":
            add("clear")
            model.clear()
            in_order = {}
            if draw(st.integers(0, 3)):
                begin()
        else:
            motor = draw(st.integers(0, motors - 1))
            size = draw(
                st.one_of(
                    st.integers(1, 257),
                    st.sampled_from([1, 2, 127, 128, 129, 255, 257]),
                    st.integers(0, 2),
                )
            )
            at = in_order.get(motor, 0)
            index = draw(
                st.sampled_from([at, at, at, max(0, at - size), at + draw(st.integers(0, 80)), -1])
            )
            if index < 0:
                index = draw(st.integers(0, max(0, model.count - 1)))
            if kind == "section":
                index = min(index, max(0, model.count - 1))
                size = min(
                    size,
                    max(0, model.count - index) + draw(st.sampled_from([0, 0, 0, 1, 200])),
                    257,
                )
            else:
                motor = draw(st.integers(-1, motors))
                index = draw(st.one_of(st.integers(0, model.count + 3), st.integers(0, 2**31 - 1)))
            in_order[motor] = index + size
            last = draw(st.integers(0, 7)) == 0
            positions = draw(_positions(index, size, before.get(motor, 0)))
            if positions and positions[-1] != LOWEST:
                before[motor] = positions[-1]
            add("section", motor, index, last, positions)
            model.section(motor, index, last, positions)
    add("finish")
    add("read", 2, 2)
    return script
