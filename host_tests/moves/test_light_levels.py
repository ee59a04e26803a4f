"""The store of light levels against dictionaries, together with that of triggers."""

import pytest
from hypothesis import given, settings

from host_tests.moves import lightplots
from host_tests.moves.lightplots import ERR_GENERAL, ERR_RANGE, OK, answers, levels, triggers


@given(lightplots.plots())
@settings(max_examples=500, deadline=None)
def test_any_plot(script):
    wanted = lightplots.expected(script)
    for (line, step), answer, want in zip(
        script, lightplots.replay(line for line, _ in script), wanted, strict=True
    ):
        assert answer == want, (line[:60], step[:4])


def test_sections_in_any_order_and_again():
    answered = answers(
        *(
            "NEW 20 1",
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
        "NEW 20 1",
        "BEGIN 6",
        levels(1, 0, 0, [9] * 6),
        levels(1, 1, 1, [5, 6]),
        "FINISH",
        "PLAY 0 5",
        "PLAY 5 0",
    )
    assert answered[-2:] == ["1=9;1=5;1=6;;;", "1=6;;;;1=5;1=9"]


def test_frames_never_sent_hold_the_level_before_and_the_first_ones_the_first():
    lines = ["NEW 20 1", "BEGIN 8", levels(1, 5, 0, [7]), levels(1, 2, 0, [3]), "FINISH"]
    assert answers(*lines, "PLAY 0 7", "PLAY 7 0")[-2:] == ["1=3;;;;;1=7;;", "1=7;;;1=3;;;;"]
    # a gap follows what is sent again before it
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
    from framestep.moves.light_levels import LightLevels
    from framestep.protocol.frames import FrameReader

    store = LightLevels(20)
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
    store.step(1, False, Lights())
    assert calls == [{1: 2, 2: 3, 4: 4, 512: 5}]
    del calls[:]
    store.step(0, True, Lights())
    assert calls == [{1: 1, 2: 1, 4: 1, 512: 1}]


def test_a_full_store_keeps_what_it_has():
    fade = list(range(10))
    lines = ["NEW 11 2", "BEGIN 10", levels(3, 0, 1, fade), triggers(3, [(1, 1), (2, 2)])]
    refused = [
        levels(4, 0, 1, [1, 2]),  # two changes where there is room for one
        triggers(7, [(1, 3), (5, 1)]),  # mask and frame 1 stay as they were
        levels(4, 0, 0, [1]),  # one change, and the gap behind it
    ]
    answered = answers(
        *lines, *refused, levels(4, 0, 1, [1]), "FINISH", "HAS", "PLAY 0 9", "TRIGGERS 0 9"
    )
    assert answered[4:8] == [str(ERR_RANGE)] * 3 + [str(OK)]
    assert answered[-3:] == [
        "2 1 1",
        "3=0,4=1;" + ";".join(f"3={level}" for level in fade[1:]),
        "3 1:1 2:2",
    ]


def test_a_full_store_takes_what_needs_no_more_room():
    up, down = list(range(10)), list(range(9, -1, -1))
    answered = answers(
        "NEW 10 1", "BEGIN 10", levels(3, 0, 0, up), levels(3, 0, 0, down), "FINISH", "PLAY 9 0"
    )
    assert answered[2:4] == [str(OK)] * 2
    assert answered[-1] == ";".join(f"3={level}" for level in up)


def test_the_capacity_that_is_stated():
    """Eight channels that fade all the time, and 512 frames with triggers."""
    lines = ["NEW 4096 512", "BEGIN 512"]
    for channel in range(1, 9):
        lines.append(levels(channel, 0, 0, [i % 251 for i in range(512)]))
    pairs = [(frame, frame + 2**31) for frame in range(512)]
    lines += [triggers(2**32 - 1, pairs[at : at + 128]) for at in (256, 0, 384, 128)]
    answered = answers(*lines, levels(9, 0, 1, [0]), "FINISH", "SEEK 300", "TRIGGERS 0 511")
    assert answered[2:14] == [str(OK)] * 12
    assert answered[14] == str(ERR_RANGE)
    assert answered[-2] == ",".join(f"{channel}=49" for channel in range(1, 9))
    assert answered[-1] == "-1 " + " ".join(f"{frame}:{frame - 2**31}" for frame in range(512))


def test_a_range_longer_than_can_be_stored():
    answered = answers(*(line for line, _ in lightplots.FAR))
    assert answered == [answer for _, answer in lightplots.FAR]


def test_nothing_is_played_before_finish():
    lines = ["NEW 5 5", "BEGIN 5", levels(1, 0, 0, [1, 2]), triggers(3, [(0, 1)])]
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
        "NEW 5 5", line, "BEGIN 5", line, "HAS", "FINISH", line, "HAS", "CLEAR", line, "HAS"
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
    assert answers("NEW 5 5", "BEGIN 10", *lines)[2:] == [str(code) for code in codes]


def test_what_lies_past_the_end_is_ignored():
    """Field note 5.3: a section or a list of triggers that begins inside the range and reaches past
    its end."""
    lines = [
        levels(3, 8, 0, [1, 2, 3, 4]),
        levels(4, 0, 1, range(1, 13)),
        triggers(7, [(9, 1), (10, 2), (2**31 - 1, 3)]),
    ]
    answered = answers(
        "NEW 20 2",
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
    assert answers("NEW 20 2", "BEGIN 10", before_the_range, "FINISH", "HAS")[2:] == [
        str(ERR_RANGE),
        "",
        "0 0 0",
    ]
