"""Light levels and triggers as a host would upload them, good and bad, and a dictionary that says
what must come of them.

`plots()` makes scripts for host_tests/runtime/lightplots_replay.py, `expected()` gives the answers.
"""

import runpy
import struct
from pathlib import Path

from hypothesis import strategies as st

from framestep.protocol import messages
from framestep_tools.client import wire

PLENTY = 30_000  # bytes of memory that no plot fills
OK, ERR_RANGE, ERR_GENERAL = 0x10, 0x14, 0x15
replay = runpy.run_path(str(Path(__file__).parents[2] / "runtime" / "lightplots_replay.py"))[
    "replay"
]


def answers(*lines):
    """Return what lightplots_replay.py answers to these lines."""
    return list(replay(lines))


def levels(channel, index, last, values):
    """Return an MSG_RT_UPLOAD_MOVE_DMX."""
    head = struct.pack("<HI", channel, index | bool(last) << 31)
    return wire.encode(messages.MSG_RT_UPLOAD_MOVE_DMX, head + bytes(values), 5).hex()


def triggers(mask, pairs):
    """Return an MSG_RT_UPLOAD_MOVE_TRIGGERS."""
    data = struct.pack("<I", mask) + b"".join(struct.pack("<II", *pair) for pair in pairs)
    return wire.encode(messages.MSG_RT_UPLOAD_MOVE_TRIGGERS, data, 6).hex()


def signed(word):
    return word - 2**32 if word >= 2**31 else word


class Model:
    """What LightLevels and Triggers must do: a dictionary {frame: level} for each channel, one for
    the triggers."""

    def __init__(self, size):
        """size: of the memory, bytes. `refused` says whether the store had no room for a line."""
        self.may_refuse = size < PLENTY
        self.refused = False
        self.clear()

    def clear(self):
        self.state = "EMPTY"
        self.frames = 0
        self.sent = {}
        self.outputs = {}
        self.mask = 0
        self.any_triggers = False

    def begin(self, frames):
        self.clear()
        self.frames = frames
        self.state = "LOADING"

    def finish(self):
        if self.state == "LOADING":
            self.state = "READY"

    def levels(self, channel, index, last, values):
        if self.state != "LOADING":
            return ERR_GENERAL
        values = values[: max(0, self.frames - index)]
        stop = index + len(values)
        if not 1 <= channel <= 512 or index >= self.frames:
            return ERR_RANGE
        if not values:
            return ERR_RANGE if last else OK
        new = dict(self.sent.get(channel, {}))
        new.update(zip(range(index, stop), values, strict=True))
        if last:
            new.update(dict.fromkeys(range(stop, self.frames), values[-1]))
        if self.refused:
            return ERR_RANGE
        self.sent[channel] = new
        return OK

    def triggers(self, mask, pairs):
        if self.state != "LOADING":
            return ERR_GENERAL
        inside = {frame: values for frame, values in pairs if frame < self.frames}
        new = {**self.outputs, **inside}
        if (pairs and pairs[0][0] >= self.frames) or any(frame >= 2**31 for frame, _ in pairs):
            return ERR_RANGE
        if self.refused:
            return ERR_RANGE
        self.outputs = new
        self.mask = mask
        self.any_triggers = True
        return OK

    def has(self):
        ready = self.state == "READY"
        return (
            f"{len(self.sent)} {int(ready and self.sent != {})} {int(ready and self.any_triggers)}"
        )

    def table(self, index):
        """Return every channel's level at a frame."""
        if self.state != "READY":
            return {}
        levels = {}
        for channel, sent in sorted(self.sent.items()):
            held = [frame for frame in sent if frame <= index]
            levels[channel] = sent[max(held) if held else min(sent)]
        return levels

    def seek(self, index):
        return ",".join(f"{channel}={level}" for channel, level in self.table(index).items())

    def play(self, start, end):
        shown = self.table(start)
        answer = [self.seek(start)]
        way = 1 if end >= start else -1
        while start != end:
            start += way
            table = self.table(start)
            answer.append(
                ",".join(f"{c}={level}" for c, level in table.items() if shown[c] != level)
            )
            shown = table
        return ";".join(answer)

    def all_triggers(self, start, end):
        ready = self.state == "READY"
        values = {frame: value for frame, value in self.outputs.items() if ready and value}
        parts = [
            f"{frame}:{signed(values[frame])}" for frame in range(start, end + 1) if frame in values
        ]
        return " ".join([str(signed(self.mask) if ready else 0), *parts])


def expected(script, answers):
    """Yield the answers to a script, a list of (line, step of the model), by the store's answers.

    If there is little memory, a store may refuse what would be valid: then the model leaves it out
    as well, and its later answers show whether the store did.
    """
    model = None
    for (_, (name, *arguments)), given in zip(script, answers, strict=True):
        if name == "new":
            model = Model(*arguments)
            yield ""
        else:
            model.refused = model.may_refuse and given.strip() == str(ERR_RANGE)
            answer = getattr(model, name)(*arguments)
            yield "" if answer is None else str(answer)


# A range longer than the store can hold, and indexes that exceed 32 bits when they become keys;
# with the answers
_FAR = 2**20
FAR = [
    ("NEW 1000", ""),
    (f"BEGIN {2**25}", ""),
    (levels(1, _FAR, 0, [1]), str(ERR_RANGE)),
    (levels(1, _FAR - 2, 0, [1, 2]), str(OK)),
    (levels(1, _FAR - 1, 0, [2, 4]), str(OK)),
    (triggers(1, [(_FAR, 1)]), str(ERR_RANGE)),
    (triggers(1, [(_FAR - 1, 1), (_FAR, 1)]), str(OK)),
    ("FINISH", ""),
    (f"PLAY {_FAR - 3} {_FAR + 2}", "1=1;;1=2;;;"),
    (f"PLAY {2**22} {2**22 + 2}", "1=2;;"),
    (f"PLAY {2**29} {2**29 - 1}", "1=2;"),
    (f"SEEK {2**30 - 1}", "1=2"),
    (f"SEEK {-(2**30)}", "1=1"),
    (f"TRIGGERS {_FAR - 2} {_FAR}", f"1 {_FAR - 1}:1"),
    (f"TRIGGERS {2**30 - 2} {2**30 - 1}", "1"),
]

# A section as long as the largest frame can carry, across units of 193 frames; with the steps of
# the model, as plots() has them
_stairs = [(i * i // 7 + i) // 3 % 2 + i // 2 % 100 for i in range(2000)]
_most = messages.LARGEST_PAYLOAD - messages.RtUploadMoveDmx.levels
_noise = [(i * i * 31 + (i * 2654435761 >> 7)) % 256 for i in range(_most)]
FULL = [
    (f"NEW {PLENTY}", ("new", PLENTY)),
    ("BEGIN 2000", ("begin", 2000)),
    *(
        (levels(7, at, 0, _stairs[at : at + 1000]), ("levels", 7, at, 0, _stairs[at : at + 1000]))
        for at in (0, 1000)
    ),
    (levels(7, 450, 0, _noise), ("levels", 7, 450, 0, _noise)),
    ("FINISH", ("finish",)),
    ("PLAY 0 1999", ("play", 0, 1999)),
]

_words = st.one_of(st.integers(0, 2**32 - 1), st.sampled_from([0, 1, 2**30, 2**31, 2**32 - 1]))


@st.composite
def _values(draw, count):
    """Draw the levels of a section: still, a fade, on and off, anything."""
    kind = draw(st.sampled_from(["still", "still", "fade", "blocks", "steps", "any"]))
    level = draw(st.sampled_from([0, 1, 127, 128, 255]))
    if kind == "still":
        return [level] * count
    if kind == "fade":
        slope = draw(st.integers(-20, 20))
        return [max(0, min(255, level + slope * i)) for i in range(count)]
    if kind == "steps":
        low, high = sorted(draw(st.tuples(st.integers(-9, 9), st.integers(-9, 9))))
        steps = draw(st.lists(st.integers(low, high), min_size=count, max_size=count))
        return [(level + sum(steps[:i])) % 256 for i in range(count)]
    if kind == "blocks":
        length = draw(st.integers(1, 9))
        return [level if i // length % 2 else 255 - level for i in range(count)]
    return list(draw(st.binary(min_size=count, max_size=count)))


@st.composite
def plots(draw, steps=30):
    """Draw a store, too small or large enough, with uploads to load and play."""
    size = draw(st.sampled_from([176, 240, 400, 1000, PLENTY, PLENTY]))
    frames = draw(st.one_of(st.integers(1, 60), st.sampled_from([1, 2, 200, 900])))
    channels = draw(
        st.lists(st.sampled_from([1, 2, 3, 4, 255, 256, 511, 512]), min_size=1, max_size=5)
    )
    script = [(f"NEW {size}", ("new", size))]

    def add(line, *step):
        script.append((line, step))

    def look():
        add("HAS", "has")
        for start, end in ((-2, frames + 1), (frames + 1, -2)):
            add(f"PLAY {start} {end}", "play", start, end)
        add(f"TRIGGERS -1 {frames}", "all_triggers", -1, frames)

    def begin():
        add(f"BEGIN {frames}", "begin", frames)

    if draw(st.integers(0, 9)):
        begin()
    at = {}
    for _ in range(draw(st.integers(0, steps))):
        kind = draw(
            st.sampled_from(
                ["levels"] * 12 + ["triggers"] * 4 + ["stray", "seek", "begin", "clear", "finish"]
            )
        )
        if kind == "begin":
            frames = draw(st.integers(1, 60))
            begin()
            at = {}
        elif kind == "clear":
            add("CLEAR", "clear")
        elif kind == "finish":
            add("FINISH", "finish")
            look()
        elif kind == "seek":
            index = draw(st.integers(-1, frames))
            add(f"SEEK {index}", "seek", index)
        elif kind == "triggers":
            frame = st.one_of(
                st.integers(0, frames - 1),
                st.integers(0, frames - 1),
                st.sampled_from([0, frames - 1]),
            )
            if draw(st.integers(0, 9)) == 0:
                frame = st.one_of(
                    frame,
                    st.sampled_from([frames, frames + 1, 2**20, 2**24, 2**30, 2**31, 2**32 - 1]),
                )
            pairs = draw(
                st.lists(st.tuples(frame, _words), max_size=draw(st.sampled_from([2, 6, 25])))
            )
            mask = draw(_words)
            add(triggers(mask, pairs), "triggers", mask, pairs)
        else:
            channel = draw(st.sampled_from(channels))
            index = draw(
                st.sampled_from(
                    [at.get(channel, 0), at.get(channel, 0), draw(st.integers(0, frames))]
                )
            )
            index = min(index, frames - 1)
            size = draw(st.one_of(st.integers(1, 20), st.integers(0, frames)))
            size = min(size, frames - index + draw(st.sampled_from([0, 0, 0, 1, 9])))
            if kind == "stray":
                channel = draw(st.sampled_from([0, 1, 512, 513, 65535]))
                index = draw(st.one_of(st.integers(0, frames + 2), st.integers(0, 2**31 - 1)))
            at[channel] = index + size
            last = draw(st.integers(0, 5)) == 0
            values = draw(_values(size))
            add(levels(channel, index, last, values), "levels", channel, index, last, values)
    add("FINISH", "finish")
    look()
    return script
