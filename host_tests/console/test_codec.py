"""The page's codec, in the browser, against the tools' own: frames, checksum, payloads."""

import pytest

from framestep.protocol import messages
from framestep_tools import payloads as p
from framestep_tools.client.wire import FrameDecoder, encode

REQUESTS = [
    p.MotorMove(7, -500),
    p.MotorMove(1, -(2**31)),
    p.MotorJog(2, 10_000, 2**31 - 1),
    p.MotorSetLimits(3, 1, -5, 0, 99, 0x81),
    p.MotorStopAll(),
    p.MotorStopAll(1),
    p.Dmx(1, 512, (0, 128, 255)),
    p.RtUploadMoveBegin(-3, 1_000_000),
    p.RtUploadMoveAxis(4, 0x8000_0000, (1, -2, 2**31 - 1)),
    p.RtUploadMoveTriggers(5, (p.Trigger(0, 1), p.Trigger(9, 4))),
    p.RtRunMove(24_000, 1, 240, 1000, 1500),
    p.RtRunMove(23_976, 240, 1, 0, 0, 1, 2, 3, 4, 3, 90, 180),
    p.RtShootFrame2(12, 500, -90, 270, (p.BlurMotor(1, -5, 5), p.BlurMotor(2, 0, 7))),
    p.VirtJogOnLine(4, -10_000),
]
REPORTS = [
    p.DeviceInfo("Größe", 1, 2, 3, 8, 512, 4, 4, 2, 10_000, 0x07FF, 2),
    p.Status(0x8000_0001, 1),
    p.Positions(-1500, (0, -7, 2**31 - 1)),
    p.HardStop(0),
    p.HardStop(1, 3),
    p.InputLevels(0x8000_0000),
    p.Condition(6, (p.PositionTrust(0, 1), p.PositionTrust(2, 3))),
    p.Exceeded(1, 2, 30, 400, 2, 5000, 20_000, -9, 9, 7, 1, 2),
    p.Exceeded(0, 0, 0, 0),
    p.VirtPositions(1, -2, 3, -4, 5, -6),
    p.VirtPositions(1, 2, 3, 4, 5, 6, 1, -7, 8, 9),
]
VECTORS = [  # docs/internals/protocol-notes.md, 10
    "44 46 01 00 00 00 01 00 00 00 44 2F",
    "44 46 01 00 00 00 31 80 02 00 10 00 9C 14",
    "44 46 78 56 34 12 01 02 05 00 02 A0 86 01 00 DA 53",
]


def in_page(modules, body, argument):
    """Return the result of a function's body for an argument, with the codec as `codec`."""
    return modules.evaluate(
        f"async (given) => {{ const codec = await import('/codec.js'); {body} }}", argument
    )


def plain(value):
    """Return a payload's fields as in JSON, without those that are absent."""
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(field) for name, field in vars(value).items() if field is not None}
    return value


def test_requests_are_packed_as_the_tools_pack_them(modules):
    given = [[type(each).__name__, plain(each)] for each in REQUESTS]
    packed = in_page(modules, "return given.map((one) => [...codec.pack(...one)]);", given)
    for request, found in zip(REQUESTS, packed, strict=True):
        assert bytes(found) == request.pack(), request


def test_reports_are_read_as_the_tools_read_them(modules):
    given = [[each.TYPE, list(each.pack())] for each in REPORTS]
    read = in_page(
        modules, "return given.map(([type, b]) => codec.unpack(type, Uint8Array.from(b)));", given
    )
    for report, found in zip(REPORTS, read, strict=True):
        assert found == {"kind": type(report).__name__, **plain(report)}


@pytest.mark.parametrize(
    ("request_name", "values", "said"),
    [
        ("MotorMove", {"motor": 256, "position": 0}, "0 to 255 is allowed, found 256"),
        ("MotorMove", {"motor": 1, "position": 2**31}, "found 2147483648"),
        ("MotorMove", {"motor": 1, "position": 0.5}, "found 0.5"),
        ("RtUploadMoveAxis", {"motor": 1, "start_index": 0, "positions": [-(2**31) - 1]}, "found"),
    ],
)
def test_what_does_not_fit_is_refused(modules, request_name, values, said):
    found = in_page(
        modules,
        "try { codec.pack(...given); return ''; } catch (error) { return String(error); }",
        [request_name, values],
    )
    assert found.startswith("RangeError")
    assert said in found


def test_a_report_that_is_cut_short_is_none(modules):
    found = in_page(
        modules, "return codec.unpack(given[0], Uint8Array.from(given[1]));", [0x34, [1]]
    )
    assert found is None


def test_frames_are_those_of_the_tools(modules):
    given = [[messages.MSG_HI, [], 1], [0x31, [1, 12, 254, 255, 255], 0xFFFF_FFFF]]
    found = in_page(
        modules,
        "return given.map(([type, b, id]) => [...codec.encode(type, Uint8Array.from(b), id)]);",
        given,
    )
    assert [bytes(each) for each in found] == [
        encode(type, bytes(payload), id) for type, payload, id in given
    ]


def test_frames_are_found_however_the_stream_is_cut(modules):
    good = [bytes.fromhex(each) for each in VECTORS]
    damaged = bytearray(good[2])
    damaged[12] ^= 1
    inside = encode(0x31, good[0], 5)  # it finds a good frame inside a damaged one
    stream = b"DDx" + good[0] + bytes(damaged) + good[1] + inside[:-1] + b"\0" + good[2] + b"D"
    expected = [
        [frame.id, frame.request_type, frame.is_ack, list(frame.payload)]
        for frame in FrameDecoder().feed(stream)
    ]
    assert len(expected) == 4
    found = in_page(
        modules,
        """return [1, 2, 7, 1000].map((size) => {
            const decoder = new codec.Decoder();
            const frames = [];
            for (let at = 0; at < given.length; at += size) {
                frames.push(...decoder.feed(Uint8Array.from(given.slice(at, at + size))));
            }
            return frames.map((f) => [f.id, f.type, f.ack, [...f.payload]]);
        });""",
        list(stream),
    )
    assert found == [expected] * 4
