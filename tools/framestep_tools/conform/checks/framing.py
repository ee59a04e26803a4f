"""Frames, IDs, damage, unknown types, HI."""

import struct
from collections.abc import Callable

from ...client.wire import encode
from .. import spec
from ..bench import Bench
from ..kit import Subject
from ..link import Failed

FRAMING = Subject("framing")
_FORMAT = "Message Format"
_ACK = "MSG_FLAG_ACK"
_SUM = "Computing and Validating the Checksum"


@FRAMING.must(
    "the answer has the ID of its request: 0x{id:X}",
    _ACK,
    id=(1, 2, 0x7F, 0xFF, 0x100, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF),
)
def _id(bench: Bench, id: int):
    bench.link.ask(spec.STATUS, id=id)


@FRAMING.must(
    "type 0x{type:04X} is answered with ERR_UNSUPPORTED",
    _ACK,
    type=(0x0002, 0x001F, 0x0024, 0x003B, 0x00FF, 0x0105, 0x0117, 0x0121, 0x0204, 0x0300, 0x7FFF),
)
def _unknown(bench: Bench, type: int):
    bench.expect(spec.Request(type), spec.ERR_UNSUPPORTED)


@FRAMING.must(
    "a bit of {at} is wrong: ERR_CHECKSUM",
    _SUM,
    at={
        "the ID": 2,
        "the ID's last byte": 5,
        "the last check byte": -1,
        "the first check byte": -2,
    },
)
def _damaged_at(bench: Bench, at: int):
    _damaged(bench, spec.STATUS, b"", at)


@FRAMING.must(
    "{type} with a wrong checksum: ERR_CHECKSUM",
    _SUM,
    type={
        spec.NAMES[type]: type
        for type in (
            spec.GIO_IN,
            spec.STOP,
            spec.STOP_ALL,
            spec.CONFIGURE,
            spec.SET_LIMITS,
            spec.BEGIN,
            spec.UPLOAD_END,
            spec.POSITION_FRAME,
            spec.GO,
            spec.VIRT_STOP,
        )
    },
)
def _damaged_type(bench: Bench, type: int):
    _damaged(bench, type, bytes(3), -1)


def _damaged(bench: Bench, type: int, payload: bytes, at: int):
    link = bench.link
    link.id += 1
    data = bytearray(encode(type, payload, link.id))
    data[at] ^= 0x04
    link.write(bytes(data))
    reply = link.answer(int.from_bytes(data[2:6], "little"))
    if reply is None or reply.code != spec.ERR_CHECKSUM:
        raise Failed("a damaged message is not answered with ERR_CHECKSUM (0x0011)")
    bench.positions()


@FRAMING.must("a MOVE with a wrong checksum moves nothing", _SUM)
def _no_effect(bench: Bench):
    before = bench.positions().steps
    data = bytearray(encode(*spec.move(1, bench.home[0] + 20), 77))
    data[-1] ^= 1
    bench.link.write(bytes(data))
    bench.link.pump(0.3)
    if bench.moving() or bench.positions().steps != before:
        raise Failed("a MOVE with a wrong checksum moved the motor")


@FRAMING.must(
    "a message after {noise} is answered",
    _FORMAT,
    noise={
        "zeros": b"\0" * 20,
        "half a marker": b"D",
        "half markers": b"DDD",
        "ones": b"\xff" * 40,
        "text": b"hello\r\n",
        "a marker turned round": b"FD",
    },
)
@FRAMING.should(
    "a message after {noise} is answered",
    "note 1.6",
    noise={"a length beyond the buffer": b"DF\1\0\0\0\x30\0\xff\xff"},
)
def _between(bench: Bench, noise: bytes):
    link = bench.link
    link.write(noise)
    link.pump(0.05)
    if link.answer(link.send(spec.STATUS)) is None:
        raise Failed("a good message after other bytes is not answered")


@FRAMING.must("a message may come {size} bytes at a time", _FORMAT, size=(1, 2, 5, 9))
def _in_pieces(bench: Bench, size: int):
    link = bench.link
    link.id += 1
    data = encode(spec.STATUS, b"", link.id)
    # complete well within the time after which a device may drop an unfinished frame
    for i in range(0, len(data), size):
        link.write(data[i : i + size])
        link.pump(0.003)
    if link.answer(link.id) is None:
        raise Failed(f"a message that comes {size} bytes at a time is not answered")


@FRAMING.must(
    "{count} requests at once are answered once each",
    "the device must respond to every message",
    count=(2, 5, 20, 80),
)
def _burst(bench: Bench, count: int):
    link = bench.link
    ids = [link.id + 1 + i for i in range(count)]
    link.id = ids[-1]
    link.write(b"".join(encode(spec.STATUS, b"", id) for id in ids))
    answered = sum(link.answer(id) is not None for id in ids)
    link.pump(0.05)
    again = sum(report.frame.id in ids for report in link.answers)
    if answered != count or again:
        raise Failed(f"{count} requests at once got {answered + again} answers")


@FRAMING.must("nothing but good messages comes from the device", _FORMAT)
def _sound(bench: Bench):
    for _ in range(20):
        bench.positions()
    if bench.link.decoder.skipped:
        raise Failed(f"{bench.link.decoder.skipped} bytes came that belong to no good message")


@FRAMING.reading("width of a response code", "MSG_FLAG_ACK; note 1.4")
def _dialect(bench: Bench):
    reply = bench.link.ask(*spec.Request(spec.STOP_ALL))
    size = len(reply.frame.payload)
    return f"response codes have {size} bytes" + (
        "" if size == 2 else ", the specification's WORD has 2"
    )


def _same(bench: Bench):
    return all(bench._hello() == bench.hello for _ in range(3))


def _name(bench: Bench):
    name = bench.hello.name.rstrip(b"\0")
    try:
        return bool(name.decode()) and b"\0" not in name
    except UnicodeDecodeError:
        return False


def _version(bench: Bench):
    data = bench.data(spec.HI)
    return len(data) < 51 or struct.unpack_from("<H", data, 49)[0] == 2


@FRAMING.must(
    "HI: {holds}",
    "MSG_HI",
    holds={
        "NAME is UTF-8, filled with zeros": _name,
        "MOTOR COUNT is 0 to 32": lambda b: b.hello.motors <= 32,
        "DMX COUNT is 0 to 512": lambda b: b.hello.lights <= 512,
        "GIO OUT COUNT is 0 to 32": lambda b: b.hello.outputs <= 32,
        "GIO INPUT COUNT is 0 to 32": lambda b: b.hello.inputs <= 32,
        "HW LIMIT COUNT is 0 to 32": lambda b: b.hello.limits <= 32,
        "PROTOCOL VERSION is 2": _version,
        "only known capabilities are advertised": lambda b: b.hello.can < 0x800,
        "real-time moves come with memory for frames": lambda b: (
            not b.hello.can & spec.CAN_RUN or b.hello.frames > 1
        ),
        "looping comes with real-time moves": lambda b: (
            not b.hello.can & spec.CAN_LOOP or b.hello.can & spec.CAN_RUN
        ),
        "HI says the same each time": _same,
    },
)
def _hello(bench: Bench, holds: Callable[[Bench], object]):
    if not holds(bench):
        raise Failed("it does not hold")


@FRAMING.reading("length of HI", "MSG_HI; PROTOCOL VERSION since 2020-10-02")
def _length(bench: Bench):
    return f"HI has {bench.hello.size} bytes"
