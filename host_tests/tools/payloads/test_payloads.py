"""The typed messages: every request of the specification has a layout, and layouts read what they
write."""

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.protocol import messages
from framestep_tools import payloads as p
from framestep_tools.building.board_files import FIRMWARE, ROOT
from framestep_tools.client.wire import Frame
from framestep_tools.traffic.sniffer import describe

AXES = tuple(p.VirtualAxis(i, 1000 * i, -i) for i in range(1, 7))
NUMBERS = {
    "B": (0, 255), "H": (0, 0xFFFF), "h": (-0x8000, 0x7FFF), "I": (0, 2**32 - 1),
    "i": (-(2**31), 2**31 - 1),
}  # fmt: skip


def test_every_message_type_has_a_class():
    numbers = {value for name, value in vars(messages).items() if name.startswith("MSG_")}
    numbers.remove(messages.MSG_FLAG_ACK)
    assert numbers == p.REQUESTS.keys(), "a MSG_ without a class, or a class without a MSG_"


def test_what_the_device_sends_has_a_class():
    """Messages of writer.begin() leave without the acknowledgement flag."""
    sent = set()
    for path in (FIRMWARE / "framestep").rglob("*.py"):
        sent.update(re.findall(r"writer\.begin\(\s*m\.(MSG_\w+)", path.read_text()))
    assert len(sent) > 10
    missing = sorted(name for name in sent if getattr(messages, name) not in p.REPORTS)
    assert not missing, (
        "add a class to protocol/declared/device.py, and to REPORTS in "
        f"tools/framestep_tools/payloads.py, for {', '.join(missing)}"
    )


def test_every_request_is_tried_end_to_end():
    """realtime.py has only messages with answers."""
    names = set()
    for path in (ROOT / "host_tests" / "end_to_end").rglob("*.py"):
        if path.name != "realtime.py":
            names.update(re.findall(r"\b[A-Z]\w+\b", path.read_text()))
    untried = sorted({p.REQUESTS[kind].__name__ for kind in messages.SIZES} - names)
    assert not untried, f"add a test in host_tests/end_to_end of what it does: {untried}"


def values(code):
    if isinstance(code, type):
        return st.lists(instances(code), max_size=5).map(tuple)
    if code == "32s":
        return st.text(
            st.characters(blacklist_characters="\0", blacklist_categories=["Cs"]), max_size=8
        )
    if code[0] == "*":
        return st.lists(st.integers(*NUMBERS[code[1]]), max_size=9).map(tuple)
    return st.integers(*NUMBERS[code])


@st.composite
def instances(draw, cls):
    """Draw any value of a message, with the optional arguments up to some point."""
    layout = p.layout(cls)
    optional = [name for name, _, may in layout if may]
    left_out = optional[draw(st.integers(0, len(optional))) :]
    return cls(**{name: draw(values(code)) for name, code, _ in layout if name not in left_out})


plain = [cls for cls in {*p.REQUESTS.values(), *p.REPORTS.values()} if cls is not p.VirtConfig]


@pytest.mark.parametrize("cls", sorted(plain, key=lambda c: c.__name__), ids=lambda c: c.__name__)
@given(data=st.data())
def test_what_is_packed_is_unpacked(cls, data):
    said = data.draw(instances(cls))
    assert cls.unpack(said.pack()) == said
    half_given = cls is p.RtRunMove and said.open_angle is not None and said.close_angle is None
    if cls in p.REQUESTS.values() and cls.TYPE in messages.SIZES and not half_given:
        assert messages.payload_fits(cls.TYPE, len(said.pack()))


@pytest.mark.parametrize(
    ("payload", "data"),
    [
        (p.MotorMove(3, -2), "03 FE FF FF FF"),
        (p.MotorJog(1, 10_000, -(2**31)), "01 10 27 00 00 00 80"),
        (p.MotorSetLimits(2, 1, -5, 0, 7, 0x81), "02 01 FB FF FF FF 00 07 00 00 00 81"),
        (p.MotorStopAll(), ""),
        (p.MotorStopAll(1), "01 00 00 00"),
        (p.Dmx(1, 512, [0, 255]), "01 00 02 00 FF"),
        (p.RtUploadMoveAxis(1, 2 | p.LAST_SECTION, np.array([5, -5])),
         "01 02 00 00 80 05 00 00 00 FB FF FF FF"),
        (p.RtUploadMoveTriggers(3, [p.Trigger(9, 1)]), "03 00 00 00 09 00 00 00 01 00 00 00"),
        (p.RtShootFrame2(4, 500, -90, 270, [p.BlurMotor(1, -1, 1)]),
         "04 00 00 00 F4 01 00 00 A6 FF 0E 01 01 FF FF FF FF 01 00 00 00"),
        (p.VirtJogOnLine(2, -10_000), "02 F0 D8"),
        (p.VirtAimPoint(1, 1000, 0, -1000), "01 E8 03 00 00 00 00 00 00 18 FC FF FF"),
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_known_data(payload, data):
    assert payload.pack() == bytes.fromhex(data)


@pytest.mark.parametrize(
    ("payload", "size"),
    [
        (p.VirtConfig(0), 1),
        (p.VirtConfig(2, AXES[:2]), 17),
        (p.VirtConfig(1, AXES, range(5)), 93),
        (p.VirtConfig(1, AXES, range(5), safe_distance=9), 97),
        (p.VirtConfig(1, AXES, range(5), range(121)), 577),
        (p.VirtConfig(1, AXES, range(5), range(121), 9), 581),
        (p.VirtConfig(3, AXES, range(5)), 93),
        (p.VirtConfig(4, AXES, range(3)), 85),
        (p.VirtConfig(4, AXES, range(3), safe_distance=9), 89),
    ],
    ids=lambda value: str(value)[:40],
)
def test_lengths_are_those_of_the_field_notes(payload, size):
    """Of the others, documents/test_protocol_notes.py compares the lengths with the notes."""
    data = payload.pack()
    assert len(data) == size
    assert type(payload).unpack(data).pack() == data


@pytest.mark.parametrize(
    "make",
    [
        lambda: p.MotorMove(256, 0).pack(),
        lambda: p.MotorMove(1, 2**31).pack(),
        lambda: p.RtUploadMoveAxis(1, 0, [2**31]).pack(),
        lambda: p.RtUploadMoveAxis(1, 0, [0.5]).pack(),
        lambda: p.Dmx(0, 1, [256]).pack(),
        lambda: p.DeviceInfo("ä" * 17, *[0] * 10).pack(),
        lambda: p.HardStop.unpack(b""),
        lambda: p.HardStop.unpack(b"\1\2\3"),
        lambda: p.Status.unpack(b"\0" * 4),
        lambda: p.Positions.unpack(b"\0" * 7),
        lambda: p.RtUploadMoveTriggers.unpack(b"\0" * 5),
        lambda: p.Hi.unpack(b"\0"),
        lambda: p.RtRunMove(24_000, 1, 2, open_angle=5).pack(),
        lambda: p.VirtConfig.unpack(b""),
        lambda: p.VirtConfig.unpack(b"\x09"),
        lambda: p.VirtConfig.unpack(b"\x01" + bytes(90)),
        lambda: p.Ack.unpack(b"\x10"),
        lambda: p.Ack.unpack(b"\x10\0\0"),
    ],
)
def test_what_does_not_fit_is_refused(make):
    with pytest.raises(ValueError):
        make()


def test_response_codes_of_both_dialects():
    assert p.Ack.unpack(b"\x12\0") is p.Ack.ERR_MOVING
    assert p.Ack.unpack(b"\x12\0\0\0") is p.Ack.ERR_MOVING
    assert p.Ack.unpack(b"\x42\0").name == "UNKNOWN_0x0042"
    assert len({code.description for code in (*p.Ack, p.Ack(0x42))}) == len(p.Ack) + 1


def test_requests_name_their_replies():
    assert p.Hi.REPLY is p.DeviceInfo
    assert p.MotorMove.REPLY is p.Moving
    assert p.GioIn.REPLY is p.InputLevels
    assert p.MotorJog.REPLY is p.Ack
    assert p.SetVirtAimPoint.REPLY is p.VirtAimPoint
    assert all(hasattr(cls, "REPLY") for cls in p.REQUESTS.values())


def test_an_answer_belongs_to_one_message():
    """It has the number of its request."""
    with pytest.raises(TypeError, match="Status is the answer to another message already"):

        class Other(p.Request[p.Status], number=0x4700):
            pass

    assert p.Status.TYPE == p.MotorStatus.TYPE


def test_status_names_the_motors():
    assert p.Status(0b1000_0101, 0).moving == [1, 3, 8]
    assert p.Status(0, 0).idle
    assert not p.Status(0, 1).idle
    assert not p.Status(1, 0).idle


def test_messages_cannot_be_changed():
    with pytest.raises(dataclasses.FrozenInstanceError):
        p.MotorMove(1, 2).motor = 3


def test_what_follows_is_ignored_when_asked_so():
    """Field note 1.8, for what a host sends: the result has the known fields, and the number of
    bytes after them."""
    assert p.MotorMove.unpack_known(p.MotorMove(3, -2).pack() + b"12") == (p.MotorMove(3, -2), 2)
    with pytest.raises(ValueError, match="left over"):
        p.MotorMove.unpack(p.MotorMove(3, -2).pack() + b"12")
    with pytest.raises(ValueError, match="too few"):
        p.MotorMove.unpack_known(b"1234")
    assert "motor=3  position=-2" in describe(
        Frame(5, p.MotorMove.TYPE, p.MotorMove(3, -2).pack() + b"12"), True
    )
