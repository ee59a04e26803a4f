"""The stores of light levels and of triggers, against dictionaries.

`plots()` draws uploads as a host would send them, good and bad, as steps. `answers()` gives what
the stores answer to steps, `expected()` what they must: text for each.
"""

import itertools
import struct
from array import array

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from framestep.io.lights import MARK, Lights
from framestep.moves.upload.chunks import room
from framestep.moves.upload.light_levels import LightLevels
from framestep.moves.upload.store import UploadStore
from framestep.moves.upload.triggers import Triggers
from framestep.protocol import messages

PLENTY = 30_000  # bytes of memory that no plot fills
OK, ERR_RANGE, ERR_GENERAL = 0x10, 0x14, 0x15


class _Recorder:
    """Records the levels, and passes them on to real lights."""

    def __init__(self):
        self.lights = Lights(512, 500)
        self.levels = []

    def put(self, channel, source, at, count):
        self.lights.put(channel, source, at, count)
        self.levels += [(channel + i, source[at + i]) for i in range(count)]

    def put_marked(self, first, last, source, marks):
        channels = [each for each in range(first, last + 1) if marks[each] & MARK]
        self.levels += [(channel, source[channel]) for channel in channels]
        self.lights.put_marked(first, last, source, marks)

    def text(self):
        levels, self.levels = self.levels, []
        for channel, level in levels:
            assert self.lights.level(channel) == level
        return ",".join(f"{channel}={level}" for channel, level in levels)


class Stores:
    """The stores, which share their memory, with steps of these names."""

    def __init__(self, size):
        self.memory = UploadStore(1, size)
        self.light_levels = LightLevels(self.memory)
        self.outputs = Triggers(self.memory)
        self.lights = _Recorder()

    def begin(self, frames):
        self.memory.clear()
        self.light_levels.begin(frames)
        self.outputs.begin(frames)

    def finish(self):
        self.light_levels.finish()
        self.outputs.finish()

    def clear(self):
        self.memory.clear()
        self.light_levels.clear()
        self.outputs.clear()

    def levels(self, channel, index, last, values):
        flag = messages.LAST_SECTION if last else 0
        data = b"\7" + bytes(values)
        return self.light_levels.store(channel, index, flag, data, 1, len(values))

    def triggers(self, mask, pairs):
        data = b"\7" + b"".join(struct.pack("<II", *pair) for pair in pairs)
        return self.outputs.store(array("i", [signed(mask)]), data, 1, len(pairs))

    def has(self):
        """Return the channels with data, whether there are levels, whether there are triggers."""
        return (
            f"{self.light_levels.channels} {int(self.light_levels.ready)} {int(self.outputs.ready)}"
        )

    def free(self):
        """Return the free units of memory."""
        return room(self.memory.words)

    def seek(self, index):
        self.light_levels.seek(index, self.lights)
        return self.lights.text()

    def play(self, start, end):
        """Return what is set at the first frame, and by each step to the last."""
        answer = [self.seek(start)]
        way = 1 if end >= start else -1
        for index in range(start + way, end + way, way) if start != end else ():
            self.light_levels.step(index, self.lights)
            answer.append(self.lights.text())
        return ";".join(answer)

    def all_triggers(self, start, end):
        """Return the mask; then frame:values for each frame that has some."""
        words = array("i", [7, 7, 7, 7])
        self.outputs.mask_to(words, 1)
        answer = [str(words[1])]
        for index in range(start, end + 1):
            self.outputs.values_to(index, words, 2)
            if words[2]:
                answer.append(f"{index}:{words[2]}")
        assert words[0] == words[3] == 7
        return " ".join(answer)


_WORDS = {"TRIGGERS": "all_triggers"}


def _steps(steps):
    """Yield (name, arguments). A step is a tuple, or such text as `BEGIN 40`."""
    for step in steps:
        if isinstance(step, str):
            name, *words = step.split()
            step = (_WORDS.get(name, name.lower()), *map(int, words))
        yield step[0], step[1:]


def _text(answer):
    return "" if answer is None else str(answer)


def answers(*steps):
    """Return what the stores answer."""
    found, stores = [], None
    for name, arguments in _steps(steps):
        if name == "new":
            stores = Stores(*arguments)
            found.append("")
        else:
            found.append(_text(getattr(stores, name)(*arguments)))
    return found


def levels(channel, index, last, values):
    """Return the step of a section."""
    return "levels", channel, index, last, values


def triggers(mask, pairs):
    """Return the step of a list of triggers."""
    return "triggers", mask, pairs


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


def expected(steps, answers):
    """Yield what the stores must answer, by their answers.

    If there is little memory, a store may refuse what would be valid: then the model leaves it out
    as well, and its later answers show whether the store did.
    """
    model = None
    for (name, arguments), said in zip(_steps(steps), answers, strict=True):
        if name == "new":
            model = Model(*arguments)
            yield ""
        else:
            model.refused = model.may_refuse and said == str(ERR_RANGE)
            yield _text(getattr(model, name)(*arguments))


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
    script = [("new", size)]

    def add(*step):
        script.append(step)

    def look():
        add("has")
        for start, end in ((-2, frames + 1), (frames + 1, -2)):
            add("play", start, end)
        add("all_triggers", -1, frames)

    def begin():
        add("begin", frames)

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
            add("clear")
        elif kind == "finish":
            add("finish")
            look()
        elif kind == "seek":
            index = draw(st.integers(-1, frames))
            add("seek", index)
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
            add("triggers", mask, pairs)
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
            add("levels", channel, index, last, values)
    add("finish")
    look()
    return script


def noise(count, seed=1):
    return [(seed * 7919 + i * i * 31 + (i * 2654435761 >> 7)) % 256 for i in range(count)]


# What few plots have: a section before what a row has left beyond its first 193 frames, and the
# last section before what was sent
BEFORE = [levels(1, 0, 1, [0]), levels(1, 1, 0, [0])]
LAST = [levels(1, 0, 0, [9] * 6), levels(1, 1, 1, [5, 6])]


@example([("new", 176), ("begin", 200), *BEFORE, ("finish",), ("play", 0, 199)])
@example([("new", 1000), ("begin", 6), *LAST, ("finish",), ("play", 0, 5), ("play", 5, 0)])
@given(plots())
@settings(max_examples=800, deadline=None)
def test_any_plot(script):
    answered = answers(*script)
    wanted = expected(script, answered)
    for step, answer, want in zip(script, answered, wanted, strict=True):
        assert answer == want, step[:4]


def test_a_section_that_fills_the_largest_frame():
    """Across units of 193 frames."""
    stairs = [(i * i // 7 + i) // 3 % 2 + i // 2 % 100 for i in range(2000)]
    most = messages.LARGEST_PAYLOAD - messages.RtUploadMoveDmx.levels
    steps = [
        f"NEW {PLENTY}",
        "BEGIN 2000",
        *(levels(7, at, 0, stairs[at : at + 1000]) for at in (0, 1000)),
        levels(7, 450, 0, noise(most, 0)),
        "FINISH",
        "PLAY 0 1999",
    ]
    answered = answers(*steps)
    assert answered == list(expected(steps, answered))


def test_channels_are_set_together_and_others_left_alone():
    calls = []

    class Lights:
        def put(self, channel, source, at, count):
            calls.append((channel, bytes(source[at : at + count])))

        def put_marked(self, first, last, source, marks):
            calls.append({c: source[c] for c in range(first, last + 1) if marks[c] & MARK})
            for channel in range(first, last + 1):
                marks[channel] &= ~MARK

    stores = Stores(1000)
    stores.begin(2)
    for channel, values in {1: [1, 2], 2: [1, 3], 4: [1, 4], 511: [1, 1], 512: [1, 5]}.items():
        assert stores.levels(channel, 0, 0, values) == OK
    store = stores.light_levels
    store.finish()
    store.seek(0, Lights())
    assert calls == [(1, b"\1\1"), (4, b"\1"), (511, b"\1\1")]
    del calls[:]
    store.step(1, Lights())
    assert calls == [{1: 2, 2: 3, 4: 4, 512: 5}]
    del calls[:]
    store.step(0, Lights())
    assert calls == [{1: 1, 2: 1, 4: 1, 512: 1}]


def test_a_full_store_keeps_what_it_has():
    """Memory of five units: two have the fade, two the triggers."""
    fade = list(range(10))
    lines = ["NEW 180", "BEGIN 200", levels(3, 0, 1, fade), triggers(3, [(1, 1), (2, 2)])]
    refused = [
        levels(4, 0, 1, noise(100)),
        levels(3, 50, 0, noise(80)),
        triggers(7, [(1, 3), (5, 28)]),  # the mask and frame 1 stay as they were
    ]
    answered = answers(
        *(*lines, "FREE", *refused, "FREE", levels(4, 0, 1, [1]), "FINISH", "HAS"),
        *("PLAY 0 9", "TRIGGERS 0 9"),
    )
    assert answered[4:10] == ["1", *[str(ERR_RANGE)] * 3, "1", str(OK)]
    assert answered[-3:] == [
        "2 1 1",
        "3=0,4=1;" + ";".join(f"3={level}" for level in fade[1:]),
        "3 1:1 2:2",
    ]


def test_a_full_store_takes_what_needs_no_more_room():
    up, down = noise(140, 1), noise(140, 2)
    answered = answers(
        *("NEW 180", "BEGIN 140", levels(3, 0, 0, up), "FREE", levels(3, 0, 0, down), "FREE"),
        *("FINISH", "PLAY 139 0"),
    )
    assert answered[2:6] == [str(OK), "0", str(OK), "0"]
    changed = [down[139]] + [
        level if level != before else None
        for before, level in zip(down[:0:-1], down[-2::-1], strict=True)
    ]
    assert answered[-1] == ";".join("" if level is None else f"3={level}" for level in changed)


FRAMES = 2000
UNITS = 3000  # of memory
_fade = [255 * min(i, 240) / 240 for i in range(FRAMES)]


@pytest.mark.parametrize(
    ("values", "most"),
    [
        ([77] * FRAMES, 1),
        ([round(level) for level in _fade], 3),
        ([int(level) for level in _fade], 3),
        ([int(i * 0.1) for i in range(FRAMES)], 11),
        ([255 * (i // 50 % 2) for i in range(FRAMES)], 11),
        (noise(FRAMES), 72),
    ],
    ids=["still", "rounded fade", "fade", "slow fade", "blinking", "noise"],
)
@pytest.mark.parametrize("section", [30, 101, 1000])
def test_what_levels_cost(values, most, section):
    lines = [
        levels(9, at, at + section >= FRAMES, values[at : at + section])
        for at in range(0, FRAMES, section)
    ]
    answered = answers(f"NEW {34 * UNITS}", f"BEGIN {FRAMES}", *lines, "FREE", "FINISH", "SEEK 777")
    assert set(answered[2:-3]) == {str(OK)}
    assert UNITS - int(answered[-3]) <= most + (2 if section == 30 else 0)
    assert answered[-1] == f"9={values[777]}"


def test_what_triggers_cost():
    """A unit for each output and 224 frames; the list may be in any order."""
    pairs = [(frame, 1 | 2**31 * (frame % 2)) for frame in range(FRAMES)]
    lines = [triggers(2**32 - 1, pairs[at : at + 100]) for at in range(FRAMES - 100, -1, -100)]
    answered = answers(f"NEW {34 * UNITS}", f"BEGIN {FRAMES}", *lines, "FREE")
    assert set(answered[2:-1]) == {str(OK)}
    assert UNITS - int(answered[-1]) == 2 * 9


def test_a_range_longer_than_can_be_stored():
    """And indexes that exceed 32 bits when they become keys."""
    far = 2**20
    steps = {
        "NEW 1000": "",
        f"BEGIN {2**25}": "",
        levels(1, far, 0, b"\1"): str(ERR_RANGE),
        levels(1, far - 2, 0, b"\1\2"): str(OK),
        levels(1, far - 1, 0, b"\2\4"): str(OK),
        triggers(1, ((far, 1),)): str(ERR_RANGE),
        triggers(1, ((far - 1, 1), (far, 1))): str(OK),
        "FINISH": "",
        f"PLAY {far - 3} {far + 2}": "1=1;;1=2;;;",
        f"PLAY {2**22} {2**22 + 2}": "1=2;;",
        f"PLAY {2**29} {2**29 - 1}": "1=2;",
        f"SEEK {2**30 - 1}": "1=2",
        f"SEEK {-(2**30)}": "1=1",
        f"TRIGGERS {far - 2} {far}": f"1 {far - 1}:1",
        f"TRIGGERS {2**30 - 2} {2**30 - 1}": "1",
    }
    assert answers(*steps) == list(steps.values())


def test_any_frame_of_levels_that_rise_slowly():
    """A frame's level is the sum of the codes before it, which have one bit each."""
    rises = [k * k // 7 % 2 for k in range(200)]
    wanted = list(itertools.accumulate(rises, initial=3))
    lines = ["NEW 1000", f"BEGIN {len(wanted)}", levels(1, 0, 1, wanted), "FINISH"]
    frames = [k * 89 % len(wanted) for k in range(len(wanted))]
    found = answers(*lines, *(f"PLAY {frame} {frame}" for frame in frames))[len(lines) :]
    shown = 0
    for frame, answer in zip(frames, found, strict=True):
        shown = int(answer.removeprefix("1=")) if answer else shown
        assert shown == wanted[frame], frame
