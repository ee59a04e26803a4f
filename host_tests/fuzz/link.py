"""The bytes between host and device: the valid frames from the host, and those from the
device."""

import struct
from itertools import accumulate

from framestep.protocol import messages as m
from framestep_tools.payloads import REQUESTS

from .findings import Part

SLOW_MS = 150  # the device may give up a frame that takes longer
HEAD = struct.Struct("<2sIHH")
MOTIONS = frozenset(kind for kind, cls in REQUESTS.items() if cls.MOVES)
LIGHTS = frozenset((m.MSG_GIO_OUT, m.MSG_GIO_CAM, m.MSG_RT_POSITION_FRAME)) | MOTIONS


def checksum(data: bytes) -> tuple[int, int]:
    """Return both sums of Fletcher-16."""
    return sum(data) % 255, sum(accumulate(data)) % 255


def frame(kind: int, payload: bytes, number: int) -> bytes:
    """Return the bytes of a message."""
    body = HEAD.pack(b"DF", number, kind, len(payload)) + payload
    a, b = checksum(body)
    first = 255 - (a + b) % 255
    return body + bytes((first, 255 - (a + first) % 255))


class Request:
    """A valid frame from the host. copies: how often it was sent, since a faulty link doubles."""

    __slots__ = ("copies", "deadline", "kind", "number", "order", "payload", "sent")

    def __init__(self, number, kind, payload, sent, deadline):
        self.number, self.kind, self.payload, self.sent, self.deadline = (
            number, kind, payload, sent, deadline,
        )  # fmt: skip
        self.copies = 1
        self.order = 0

    @property
    def motor(self):
        return self.payload[0] - 1 if self.payload else -1

    @property
    def moves(self):
        """Whether it may move something."""
        return self.kind in MOTIONS

    @property
    def lights(self):
        """Whether it may switch an output on."""
        return self.kind in LIGHTS

    def words(self, form):
        return struct.unpack_from("<" + form, self.payload)


class Link(Part):
    """Both directions of the port."""

    def __init__(self, trial):
        super().__init__(trial)
        self.opened()
        self.reply = bytearray()

    def opened(self):
        """Begin with an open port and no bytes."""
        self.stream = bytearray()
        self.since: dict[int, int] = {}  # when the byte at that place arrived, ms
        # places in the stream where an incomplete frame may begin
        self.begun: list[int] = []
        self.sound_to = 0  # where the last valid frame ends in it

    def sent(self, data):
        """Find the valid frames in the stream, wherever they begin."""
        stream = self.stream
        whole = len(data) >= 12 and int.from_bytes(data[8:10], "little") + m.FRAME_OVERHEAD == len(
            data
        )
        if whole and not self.begun and not stream and self._sound(data, 0) == len(data):
            return  # the usual case
        base = len(stream)
        stream += data
        begun, at = self.begun, max(base - 1, 0)
        while True:
            at = stream.find(b"DF", at)
            if at < 0:
                break
            if at not in begun:
                begun.append(at)
            at += 2
        left = []
        for at in begun:
            since = self.since.setdefault(at, self.ms)
            # a frame inside a valid one, as a damaged one may be by chance, does not count
            inside = at < self.sound_to
            got = self._sound(stream, at, inside or self.ms - since > SLOW_MS)
            self.sound_to = max(self.sound_to, at + got)
            if got == 0:
                left.append(at)
        self.trial.garbage = self.trial.passes
        self.begun = left
        if stream.endswith(b"D"):
            self.since.setdefault(len(stream) - 1, self.ms)
        if not left and not stream.endswith(b"D"):
            stream.clear()
            self.since.clear()
            self.sound_to = 0
        elif len(stream) > 20_000:
            stream.clear()
            left.clear()
            self.since.clear()
            self.sound_to = 0

    def _sound(self, stream, at, slow=False):
        """Return the length of the valid frame there; 0 if more must come, -1 if there is none."""
        if len(stream) - at < 10:
            return 0 if stream[at : at + 2] == b"DF" else -1
        mark, number, kind, length = HEAD.unpack_from(stream, at)
        if mark != b"DF" or length > m.LARGEST_PAYLOAD:
            return -1
        size = length + m.FRAME_OVERHEAD
        if len(stream) - at < size:
            return 0
        whole = bytes(stream[at : at + size])
        if checksum(whole) != (0, 0):
            return -1
        self.trial.asked(Request(number, kind, whole[10:-2], self.ms, 0), slow)
        return size

    def heard(self, data):
        """Take bytes from the device, which must be frames and nothing else."""
        reply = self.reply
        reply += data
        while len(reply) >= 12:
            mark, number, kind, length = HEAD.unpack_from(reply)
            if mark != b"DF":
                self.fail("bytes", f"something else than frames is sent: {bytes(reply[:20]).hex()}")
            if len(reply) < length + 12:
                return
            whole = bytes(reply[: length + 12])
            del reply[: length + 12]
            if checksum(whole) != (0, 0):
                self.fail("bytes", f"a frame with a wrong checksum is sent: {whole.hex()}")
            self.trial.replies.message(number, kind, whole[10:-2])
