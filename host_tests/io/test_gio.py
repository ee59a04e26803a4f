"""Outputs, inputs and the camera on fake pins."""

from hypothesis import given
from hypothesis import strategies as st

from framestep.io.camera import Camera
from framestep.io.gio import DEBOUNCE_MS, Gio
from host_tests.io.pins import Pins, rig

PINS = (22, 26, 27, 28)
LEVEL = st.sampled_from(("high", "low"))
OUTPUTS = st.lists(st.tuples(LEVEL, st.sampled_from(("off", "on", "hold"))), min_size=1, max_size=4)


def outputs_of(choices):
    return [
        {"pin": pin, "on": on, "safe": safe} for pin, (on, safe) in zip(PINS, choices, strict=False)
    ]


@given(OUTPUTS, st.lists(st.tuples(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF)), max_size=10))
def test_outputs(choices, puts):
    pins = Pins()
    gio = Gio(pins, rig(outputs=outputs_of(choices), inputs=[]))
    count = len(choices)
    values = sum(1 << i for i, (_, safe) in enumerate(choices) if safe == "on")

    def shown():
        return sum((pins.at(PINS[i]) == (on == "high")) << i for i, (on, _) in enumerate(choices))

    assert shown() == values  # at boot
    before = pins.level
    for mask, wanted in puts:
        pins.writes.clear()
        gio.put(mask, wanted)
        values = (values & ~mask | wanted & mask) & (1 << count) - 1
        assert shown() == values
        assert len(pins.writes) == 1  # all at the same time
    gio.safe()
    for i, (_, safe) in enumerate(choices):
        expected = values >> i & 1 if safe == "hold" else safe == "on"
        assert shown() >> i & 1 == expected
    assert (pins.level ^ before) & ~sum(1 << pin for pin in PINS) == 0


def test_pins_of_a_cue_change_nothing_yet():
    pins = Pins()
    gio = Gio(pins, rig(outputs=[{"pin": 22}, {"pin": 26, "on": "low"}, {"pin": 27}]))
    pins.writes.clear()
    assert gio.outputs.pins(0b11, 0b11) == 1 << 22
    assert gio.outputs.down == 1 << 26
    assert gio.outputs.pins(0b110, 0) == 1 << 26
    assert gio.outputs.down == 1 << 27
    assert pins.writes == []


def test_pins_by_default_are_the_board_s():
    pins = Pins()
    gio = Gio(pins, rig())
    assert (gio.outputs.count, gio.inputs.count) == (2, 2)
    assert pins.outputs == 1 << 22 | 1 << 26
    assert pins.pulls == {27: "up", 28: "up"}


# level, ms
SIGNAL = st.lists(st.tuples(st.integers(0, 1), st.integers(1, 60)), min_size=1, max_size=20)


@given(SIGNAL, SIGNAL, LEVEL, LEVEL, st.integers(0, 2**30 - 1))
def test_inputs(first, second, on1, on2, clock):
    """A level counts once it has lasted, each change is reported once, two inputs do not affect
    each other."""
    pins = Pins()
    gio = Gio(pins, rig(inputs=[{"pin": 27, "on": on1}, {"pin": 28, "on": on2, "pull": "down"}]))
    signals = [[level for level, ms in runs for _ in range(ms)] for runs in (first, second)]
    on = [on1 == "high", on2 == "high"]
    stable = [1, 0]  # by their pulls
    since = [0, 0]
    last = [1, 0]
    assert gio.inputs.values == (on[0] == 1) | (on[1] == 0) << 1
    for ms in range(max(map(len, signals))):
        changed = False
        for i, pin in enumerate((27, 28)):
            level = signals[i][min(ms, len(signals[i]) - 1)]
            pins.put(pin, level)
            if level != last[i]:
                last[i] = level
                since[i] = ms
            elif level != stable[i] and ms - since[i] >= DEBOUNCE_MS:
                stable[i] = level
                changed = True
        assert gio.poll((clock + ms) & 0x3FFFFFFF, pins.levels()) == changed
        assert gio.inputs.values == (stable[0] == on[0]) | (stable[1] == on[1]) << 1


@given(LEVEL, LEVEL, st.booleans(), st.booleans())
def test_camera(shutter_on, meter_on, shutter, meter):
    pins = Pins()
    camera = Camera(pins, rig(shutter_on=shutter_on, meter_on=meter_on))

    def shown():
        return pins.at(20) == (shutter_on == "high"), pins.at(21) == (meter_on == "high")

    assert shown() == (False, False)
    pins.writes.clear()
    camera.set(shutter, meter)
    assert shown() == (shutter, meter)
    assert len(pins.writes) == 1
    camera.set(True, False)
    assert shown() == (True, False)
    camera.safe()
    assert shown() == (False, False)
    pins.writes.clear()
    high = camera.pins(1, 0, shutter, True)
    assert high | camera.down == 1 << 20
    assert bool(high) == (shutter == (shutter_on == "high"))
    assert pins.writes == []


def test_a_board_without_camera_pins():
    pins = Pins({"gio": []})
    camera = Camera(pins, rig())
    camera.set(True, True)
    assert pins.outputs == 0
