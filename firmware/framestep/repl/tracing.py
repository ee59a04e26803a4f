"""trace(): the last requests and answers, with their times."""

import struct

from framestep import boot
from framestep.base.native import CPYTHON
from framestep.protocol import messages as m
from framestep.repl import tracer
from framestep.repl.commands import between, dead
from framestep.repl.reasons import message, reason
from framestep.repl.tracer import BYTES, ENTRIES


def _fields(frame, length, codes):
    """Return the values of a payload, as far as they have been kept."""
    values = []
    at = 4
    end = min(4 + length, BYTES)
    for code in codes:
        size = struct.calcsize("<" + code)
        if at + size > end:
            break
        values.append(struct.unpack_from("<" + code, frame, at)[0])
        at += size
    text = ", ".join([str(value) for value in values])
    rest = 4 + length - at
    return text + (", and %d bytes" % rest if text else "%d bytes" % rest) if rest else text


def _line(time, frame):
    kind, length = struct.unpack_from("<HH", frame)
    sent = time & 1
    time >>= 1
    name, codes = message(kind & ~m.MSG_FLAG_ACK)
    if kind & m.MSG_FLAG_ACK:
        code = struct.unpack_from("<H", frame, 4)[0]
        name += ": ok" if code == m.OK else ": refused, as " + reason(code)
        text = ""
    else:
        # an answer has other fields than its request
        text = _fields(frame, length, "B" * min(length, 4) if sent else codes)
    return "%6d.%03d %s %s %s" % (time // 1000, time % 1000, "<" if sent else ">", name, text)


def trace(count):
    """Print the last frames. The first call begins tracing, trace(0) ends it."""
    why = dead()
    tracing = tracer.active
    if why:
        print(why)
    elif count < 1:
        if tracing:
            between(tracing.remove)
            tracer.active = None
        if not CPYTHON:
            boot.forget("framestep.repl.tracer")
    elif tracing:
        total = tracing.count
        for i in range(max(0, total - min(count, ENTRIES)), total):
            entry = between(tracing.copy, i)
            if entry:
                print(_line(*entry).rstrip())
    else:
        tracer.active = between(tracer.Tracer, boot.controller)
        print("tracing begins now: trace() prints the last requests and answers, trace(0) ends it")
