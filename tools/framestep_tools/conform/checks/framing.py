"""Frames, IDs, damage, unknown types, HI."""

import struct

from ...client.wire import encode
from .. import spec
from ..bench import Bench
from ..kit import MUST, READING, SHOULD, Check
from ..link import Failed

CHECKS: list[Check] = []
_FORMAT = "Message Format"
_ACK = "MSG_FLAG_ACK"
_SUM = "Computing and Validating the Checksum"


def _put(name, source, run, level=MUST, **more):
    CHECKS.append(Check("framing", name, source, run, level, **more))


def _id(id: int):
    def run(bench: Bench):
        bench.link.ask(spec.STATUS, id=id)

    return run


for _number in (1, 2, 0x7F, 0xFF, 0x100, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF):
    _put(f"the answer has the ID of its request: 0x{_number:X}", _ACK, _id(_number))


def _unknown(type: int):
    return lambda bench: bench.expect(spec.Request(type), spec.ERR_UNSUPPORTED)


for _number in (
    0x0002,
    0x001F,
    0x0024,
    0x003B,
    0x00FF,
    0x0105,
    0x0117,
    0x0121,
    0x0204,
    0x0300,
    0x7FFF,
):
    _put(f"type 0x{_number:04X} is answered with ERR_UNSUPPORTED", _ACK, _unknown(_number))


def _damaged(type: int, payload: bytes, at: int):
    def run(bench: Bench):
        link = bench.link
        link.id += 1
        data = bytearray(encode(type, payload, link.id))
        data[at] ^= 0x04
        link.write(bytes(data))
        reply = link.answer(int.from_bytes(data[2:6], "little"))
        if reply is None or reply.code != spec.ERR_CHECKSUM:
            raise Failed("a damaged message is not answered with ERR_CHECKSUM (0x0011)")
        bench.positions()

    return run


for _at, _what in (
    (2, "the ID"),
    (5, "the ID's last byte"),
    (-1, "the last check byte"),
    (-2, "the first check byte"),
):
    _put(f"a bit of {_what} is wrong: ERR_CHECKSUM", _SUM, _damaged(spec.STATUS, b"", _at))
for _type in (
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
):
    _put(
        f"{spec.NAMES[_type]} with a wrong checksum: ERR_CHECKSUM",
        _SUM,
        _damaged(_type, bytes(3), -1),
    )


def _no_effect(bench: Bench):
    before = bench.positions().steps
    data = bytearray(encode(*spec.move(1, bench.home[0] + 20), 77))
    data[-1] ^= 1
    bench.link.write(bytes(data))
    bench.link.pump(0.3)
    if bench.moving() or bench.positions().steps != before:
        raise Failed("a MOVE with a wrong checksum moved the motor")


_put("a MOVE with a wrong checksum moves nothing", _SUM, _no_effect)


def _between(noise: bytes):
    def run(bench: Bench):
        link = bench.link
        link.write(noise)
        link.pump(0.05)
        if link.answer(link.send(spec.STATUS)) is None:
            raise Failed("a good message after other bytes is not answered")

    return run


for _noise, _what in (
    (b"\0" * 20, "zeros"),
    (b"D", "half a marker"),
    (b"DDD", "half markers"),
    (b"\xff" * 40, "ones"),
    (b"hello\r\n", "text"),
    (b"FD", "a marker turned round"),
):
    _put(f"a message after {_what} is answered", _FORMAT, _between(_noise))
_put(
    "a message after a length beyond the buffer is answered",
    "note 1.6",
    _between(b"DF\1\0\0\0\x30\0\xff\xff"),
    SHOULD,
)


def _in_pieces(size: int):
    def run(bench: Bench):
        link = bench.link
        link.id += 1
        data = encode(spec.STATUS, b"", link.id)
        # complete well within the time after which a device may drop an unfinished frame
        for i in range(0, len(data), size):
            link.write(data[i : i + size])
            link.pump(0.003)
        if link.answer(link.id) is None:
            raise Failed(f"a message that comes {size} bytes at a time is not answered")

    return run


for _size in (1, 2, 5, 9):
    _put(f"a message may come {_size} bytes at a time", _FORMAT, _in_pieces(_size))


def _burst(count: int):
    def run(bench: Bench):
        link = bench.link
        ids = [link.id + 1 + i for i in range(count)]
        link.id = ids[-1]
        link.write(b"".join(encode(spec.STATUS, b"", id) for id in ids))
        answered = sum(link.answer(id) is not None for id in ids)
        link.pump(0.05)
        again = sum(report.frame.id in ids for report in link.answers)
        if answered != count or again:
            raise Failed(f"{count} requests at once got {answered + again} answers")

    return run


for _size in (2, 5, 20, 80):
    _put(
        f"{_size} requests at once are answered once each",
        "the device must respond to every message",
        _burst(_size),
    )


def _sound(bench: Bench):
    for _ in range(20):
        bench.positions()
    if bench.link.decoder.skipped:
        raise Failed(f"{bench.link.decoder.skipped} bytes came that belong to no good message")


_put("nothing but good messages comes from the device", _FORMAT, _sound)


def _dialect(bench: Bench):
    reply = bench.link.ask(*spec.Request(spec.STOP_ALL))
    size = len(reply.frame.payload)
    return f"response codes have {size} bytes" + (
        "" if size == 2 else ", the specification's WORD has 2"
    )


_put("width of a response code", "MSG_FLAG_ACK; note 1.4", _dialect, READING)


def _hello(test, text):
    def run(bench: Bench):
        if not test(bench):
            raise Failed(text)

    return run


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


for _title, _test in (
    ("NAME is UTF-8, filled with zeros", _name),
    ("MOTOR COUNT is 0 to 32", lambda b: b.hello.motors <= 32),
    ("DMX COUNT is 0 to 512", lambda b: b.hello.lights <= 512),
    ("GIO OUT COUNT is 0 to 32", lambda b: b.hello.outputs <= 32),
    ("GIO INPUT COUNT is 0 to 32", lambda b: b.hello.inputs <= 32),
    ("HW LIMIT COUNT is 0 to 32", lambda b: b.hello.limits <= 32),
    ("PROTOCOL VERSION is 2", _version),
    ("only known capabilities are advertised", lambda b: b.hello.can < 0x800),
    (
        "real-time moves come with memory for frames",
        lambda b: not b.hello.can & spec.CAN_RUN or b.hello.frames > 1,
    ),
    (
        "looping comes with real-time moves",
        lambda b: not b.hello.can & spec.CAN_LOOP or b.hello.can & spec.CAN_RUN,
    ),
    ("HI says the same each time", _same),
):
    _put(f"HI: {_title}", "MSG_HI", _hello(_test, "it does not hold"))
_put(
    "length of HI",
    "MSG_HI; PROTOCOL VERSION since 2020-10-02",
    lambda bench: f"HI has {bench.hello.size} bytes",
    READING,
)
