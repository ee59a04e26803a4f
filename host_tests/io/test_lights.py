"""Light levels compared with a model that has a straight line for every channel."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.hal import CHANGED, CHANNELS
from framestep.io.lights import RAMPING, Lights

ROUND = 8  # passes in which every channel is updated


class Model:
    """The exact level of each channel."""

    def __init__(self, length):
        self.length = length
        self.lines = {}  # channel: (from, to, begin)

    def shows(self, channel, now):
        first, last, begin = self.lines.get(channel, (0, 0, 0))
        passed = now - begin
        if passed >= self.length:
            return last
        return first + math.trunc((last - first) * passed / self.length)


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("put"), st.integers(1, CHANNELS), st.binary(min_size=1, max_size=20)),
        st.tuples(st.just("ramp"), st.integers(1, CHANNELS), st.binary(min_size=1, max_size=20)),
        st.tuples(st.just("set"), st.integers(1, CHANNELS), st.binary(min_size=1, max_size=1)),
        st.tuples(st.just("wait"), st.integers(0, 700), st.just(b"")),
    ),
    max_size=30,
)


@given(STEPS, st.sampled_from((1, 33, 500)), st.integers(0, 2**30 - 1))
def test_follows_straight_lines(steps, length, clock):
    lights = Lights(512, length)
    shown = bytearray(CHANNELS + 1)  # at the last check, which lags by a round
    model = Model(length)
    now = 0

    def wait(ms):
        nonlocal now
        now += ms
        for _ in range(ROUND):
            lights.poll((clock + now) & 0x3FFFFFFF)
        for channel in range(1, CHANNELS + 1):
            shown[channel] = lights.level(channel)
            assert shown[channel] == model.shows(channel, now)
        ramping = sum(shown[c] != line[1] for c, line in model.lines.items())
        assert lights.words[RAMPING] == ramping
        assert lights.adjusting == (ramping > 0)

    for kind, number, data in steps:
        if kind == "wait":
            wait(number)
            continue
        data = data[: CHANNELS + 1 - number]
        for i, level in enumerate(data):
            channel = number + i
            here = lights.level(channel)
            if kind == "ramp" and level != here:
                model.lines[channel] = (here, level, now)
            else:
                model.lines[channel] = (level, level, now)
        if kind == "ramp":
            lights.ramp((clock + now) & 0x3FFFFFFF, number, b"\x07" + data, 1, len(data))
        elif kind == "put":
            lights.put(number, b"\x07" + data, 1, len(data))
        else:
            lights.set(number, data[0])
    wait(0)
    wait(length)
    assert not lights.adjusting
    assert lights.levels[0] == 0


def test_a_ramp_of_no_time_is_at_once():
    lights = Lights(512, 0)
    lights.ramp(5, 3, b"\x50\x60", 0, 2)
    assert (lights.level(3), lights.level(4), lights.adjusting) == (0x50, 0x60, False)


def test_changed_is_reported_only_for_a_change():
    lights = Lights(512, 500)
    assert lights.words[CHANGED] == 0
    lights.put(1, bytes(512), 0, 512)
    assert lights.words[CHANGED] == 0
    lights.ramp(0, 9, b"\xff", 0, 1)
    assert lights.words[CHANGED] == 0
    for _ in range(ROUND):
        lights.poll(100)
    assert lights.words[CHANGED] == 1


def test_a_pass_looks_at_an_eighth():
    """The cost of a pass is bounded: 512 ramping channels take eight passes."""
    lights = Lights(512, 500)
    lights.ramp(0, 1, b"\xff" * 512, 0, 512)
    for k in range(1, ROUND + 1):
        lights.poll(500)
        assert sum(level == 255 for level in lights.levels) == 64 * k
    assert not lights.adjusting


@pytest.mark.parametrize(
    ("count", "channel", "values", "fits"),
    [
        (512, 1, 512, True), (512, 512, 1, True), (512, 0, 1, False), (512, 512, 2, False),
        (512, 513, 0, False), (512, 65535, 1, False), (512, 7, 0, True), (0, 1, 1, False),
        (0, 1, 0, False),
    ],
)  # fmt: skip
def test_which_channels_there_are(count, channel, values, fits):
    assert Lights(count, 500).fits(channel, values) == fits
