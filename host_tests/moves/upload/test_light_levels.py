"""The stores of light levels and of triggers, against dictionaries."""

import itertools

import pytest
from hypothesis import given, settings

from host_tests.moves.upload import lightplots
from host_tests.moves.upload.lightplots import ERR_GENERAL, ERR_RANGE, OK, answers, levels, triggers


@given(lightplots.plots())
@settings(max_examples=120, deadline=None)
def test_any_plot(script):
    answered = list(lightplots.replay(line for line, _ in script))
    wanted = lightplots.expected(script, answered)
    for (line, step), answer, want in zip(script, answered, wanted, strict=True):
        assert answer == want, (line[:60], step[:4])


def test_a_section_that_fills_the_largest_frame():
    answered = answers(*(line for line, _ in lightplots.FULL))
    assert answered == list(lightplots.expected(lightplots.FULL, answered))


def test_sections_in_any_order_and_again():
    answered = answers(
        *(
            "NEW 1000",
            "BEGIN 6",
            levels(7, 4, 0, [40, 50]),
            levels(7, 0, 0, [1, 1]),
            levels(7, 1, 0, [10, 20, 30]),
        ),
        *("FINISH", "PLAY 0 5", "PLAY 5 0"),
    )
    assert answered[-2:] == ["7=1;7=10;7=20;7=30;7=40;7=50", "7=50;7=40;7=30;7=20;7=10;7=1"]


def test_the_last_section_repeats_its_final_level():
    answered = answers(
        "NEW 1000",
        "BEGIN 6",
        levels(1, 0, 0, [9] * 6),
        levels(1, 1, 1, [5, 6]),
        "FINISH",
        "PLAY 0 5",
        "PLAY 5 0",
    )
    assert answered[-2:] == ["1=9;1=5;1=6;;;", "1=6;;;;1=5;1=9"]


def test_frames_never_sent_hold_the_level_before_and_the_first_ones_the_first():
    lines = ["NEW 1000", "BEGIN 8", levels(1, 5, 0, [7]), levels(1, 2, 0, [3]), "FINISH"]
    assert answers(*lines, "PLAY 0 7", "PLAY 7 0")[-2:] == ["1=3;;;;;1=7;;", "1=7;;;1=3;;;;"]
    # a gap follows what the host sends again before it
    lines.insert(4, levels(1, 1, 0, [4, 4]))  # 4 at frames 1 to 4 now
    assert answers(*lines, "PLAY 0 7")[-1] == "1=4;;;;;1=7;;"
    lines.insert(5, levels(1, 2, 0, [6, 6]))
    assert answers(*lines, "PLAY 0 7")[-1] == "1=4;;1=6;;;1=7;;"


def test_channels_are_set_together_and_others_left_alone():
    calls = []

    class Lights:
        def put(self, channel, source, at, count):
            calls.append((channel, bytes(source[at : at + count])))

        def put_marked(self, first, last, source, marks):
            calls.append({c: source[c] for c in range(first, last + 1) if marks[c] & MARK})
            for channel in range(first, last + 1):
                marks[channel] &= ~MARK

    from framestep.io.lights import MARK
    from framestep.moves.upload.light_levels import LightLevels
    from framestep.moves.upload.store import UploadStore
    from framestep.protocol.frames import FrameReader

    store = LightLevels(UploadStore(1, 1000))
    reader = FrameReader()
    store.begin(2)
    for channel, values in {1: [1, 2], 2: [1, 3], 4: [1, 4], 511: [1, 1], 512: [1, 5]}.items():
        data = bytes.fromhex(levels(channel, 0, 0, values))
        assert reader.feed(data, 0, len(data))
        assert reader.poll()
        assert store.store(channel, 0, 0, reader.buffer, reader.payload + 6, 2) == OK
    store.finish()
    store.seek(0, Lights())
    assert calls == [(1, b"\1\1"), (4, b"\1"), (511, b"\1\1")]
    del calls[:]
    store.step(1, Lights())
    assert calls == [{1: 2, 2: 3, 4: 4, 512: 5}]
    del calls[:]
    store.step(0, Lights())
    assert calls == [{1: 1, 2: 1, 4: 1, 512: 1}]


def noise(count, seed=1):
    return [(seed * 7919 + i * i * 31 + (i * 2654435761 >> 7)) % 256 for i in range(count)]


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
    answered = answers(*(line for line, _ in lightplots.FAR))
    assert answered == [answer for _, answer in lightplots.FAR]


def test_nothing_is_played_before_finish():
    lines = ["NEW 1000", "BEGIN 5", levels(1, 0, 0, [1, 2]), triggers(3, [(0, 1)])]
    look = ["SEEK 0", "PLAY 0 1", "PLAY 1 0", "TRIGGERS 0 0"]
    assert answers(*lines, *look, "FINISH", *look)[4:] == [
        "",
        ";",
        ";",
        "0",
        "",
        "1=1",
        "1=1;1=2",
        "1=2;1=1",
        "3 0:1",
    ]


@pytest.mark.parametrize("line", [levels(1, 0, 0, [1]), triggers(1, [(0, 1)])])
def test_before_begin_and_after_finish(line):
    answered = answers(
        "NEW 1000", line, "BEGIN 5", line, "HAS", "FINISH", line, "HAS", "CLEAR", line, "HAS"
    )
    assert [answered[i] for i in (1, 3, 6, 9)] == [
        str(code) for code in (ERR_GENERAL, OK, ERR_GENERAL, ERR_GENERAL)
    ]
    assert answered[4] in ("1 0 0", "0 0 0")
    assert answered[7] in ("1 1 0", "0 0 1")
    assert answered[10] == "0 0 0"


def test_codes():
    lines = [
        levels(1, 0, 0, []),
        levels(1, 0, 1, []),
        levels(0, 0, 0, [1]),
        levels(513, 0, 0, [1]),
        levels(512, 9, 0, [1]),
        levels(512, 10, 0, [1, 2]),
        levels(512, 10, 0, [1]),
        levels(512, 2**30, 0, [1]),
        triggers(1, []),
        triggers(1, [(10, 0)]),
        *(triggers(1, [(far, 0)]) for far in (2**8, 2**16, 2**24, 2**31, 2**32 - 1)),
    ]
    codes = (
        OK,
        ERR_RANGE,
        ERR_RANGE,
        ERR_RANGE,
        OK,
        ERR_RANGE,
        ERR_RANGE,
        ERR_RANGE,
        OK,
        *[ERR_RANGE] * 6,
    )
    assert answers("NEW 1000", "BEGIN 10", *lines)[2:] == [str(code) for code in codes]


def test_what_lies_past_the_end_is_ignored():
    """Field note 5.3: a section or a list of triggers that begins inside the range and extends past
    its end."""
    lines = [
        levels(3, 8, 0, [1, 2, 3, 4]),
        levels(4, 0, 1, range(1, 13)),
        triggers(7, [(9, 1), (10, 2), (2**31 - 1, 3)]),
    ]
    answered = answers(
        "NEW 1000",
        "BEGIN 10",
        *lines,
        triggers(7, [(1, 4), (9, 5), (11, 6)]),
        "FINISH",
        "SEEK 9",
        "SEEK 20",
        "TRIGGERS 0 12",
    )
    assert answered[2:6] == [str(OK)] * 4
    assert answered[7:] == ["3=2,4=10", "3=2,4=10", "7 1:4 9:5"]
    before_the_range = triggers(7, [(1, 8), (2**32 - 1, 1)])
    assert answers("NEW 1000", "BEGIN 10", before_the_range, "FINISH", "HAS")[2:] == [
        str(ERR_RANGE),
        "",
        "0 0 0",
    ]


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
