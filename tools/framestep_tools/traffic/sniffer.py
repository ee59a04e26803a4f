"""Explains protocol traffic frame by frame, from a capture or between a host and a device."""

import re
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from ..client.wire import Frame, FrameDecoder
from ..payloads import REPORTS, REQUESTS, Ack, Payload, type_name
from .log import CLOSE, DEVICE, HOST, OPEN, Entry, Recorder, is_log, parse
from .text import in_words

if TYPE_CHECKING:
    from ..client.pty_port import PtyLink

_HEX = re.compile(rb"[0-9A-Fa-f\s:,]*")
_NEXT_LOOK_S = 0.002


def capture_bytes(content: bytes) -> bytes:
    """Return the bytes in a capture file: hexadecimal digits (with blanks, colons or commas) or the
    bytes themselves."""
    digits = re.sub(rb"[\s:,]|0[xX]", b"", content)
    if _HEX.fullmatch(content.replace(b"0x", b"").replace(b"0X", b"")) and len(digits) % 2 == 0:
        return bytes.fromhex(digits.decode())
    return content


def meaning(frame: Frame, from_host: bool | None = None) -> Payload | Ack | None:
    """Decode a frame; None if its data fits no layout.

    from_host: None if unknown; then it counts as a request if it fits one.
    """
    if frame.is_ack:
        try:
            return Ack.unpack(frame.payload)
        except ValueError:
            return None
    tables: list[Mapping[int, type[Payload]]] = []
    if from_host is not False:
        tables.append(REQUESTS)
    if not from_host:
        tables.append(REPORTS)
    for table in tables:
        try:
            return table[frame.type].unpack(frame.payload)
        except (KeyError, ValueError):
            continue
    if from_host is not False and frame.type in REQUESTS:
        try:
            # field note 1.8: ignore later bytes
            return REQUESTS[frame.type].unpack_known(frame.payload)[0]
        except ValueError:
            pass
    return None


def describe(frame: Frame, from_host: bool | None = None) -> str:
    """Return one line: ID, type, the data field by field (in hexadecimal if it fits no layout), and
    what numbers mean."""
    said = meaning(frame, from_host)
    words = ""
    if isinstance(said, Ack):
        text, words = f"{said.name} (0x{said:04X})", in_words(said)
    elif said is None:
        text = (
            f"{len(frame.payload)} bytes: "
            f"{frame.payload[:64].hex(' ')}{'…' if len(frame.payload) > 64 else ''}"
        )
    else:
        text, words = _fields(said), in_words(said)
    return (
        f"{frame.id:>10}  {type_name(frame.request_type):<22}{'ACK ' if frame.is_ack else ''}{text}"
        f"{words and f'  ({words})'}"
    ).rstrip()


def describe_entry(entry: Entry) -> str:
    """Return an entry of a log as a line without its time."""
    if entry.who in (OPEN, CLOSE):
        return "the host opens its port" if entry.who == OPEN else "the host closes its port"
    frame = entry.frame
    if frame:
        return describe(frame, entry.who == HOST)
    why = ", a frame with a wrong checksum among them" if entry.damaged else ""
    return f"{len(entry.data)} bytes outside frames{why}"


def timed(entry: Entry) -> str:
    """Return an entry as a line with its time and its direction."""
    arrow = entry.who if entry.who in (HOST, DEVICE) else " "
    return f"{entry.time_s:10.4f} {arrow} {describe_entry(entry)}"


def _fields(payload: Payload) -> str:
    return "  ".join(
        f"{name}={_short(value)}" for name, value in vars(payload).items() if value is not None
    )


def _short(value: Any) -> str:
    if isinstance(value, Payload):  # a repeated record: its values
        return "/".join(str(field) for field in vars(value).values())
    if not isinstance(value, tuple):
        return repr(value)
    texts = [_short(each) for each in value]
    if len(texts) > 16:
        return f"[{', '.join(texts[:8])}, … {texts[-1]}; {len(texts)} values]"
    return f"[{', '.join(texts)}]"


def read_capture(content: bytes) -> Iterator[str]:
    """Yield the frames of a capture or a log line by line, then a count of bytes outside frames."""
    if is_log(content):
        tally = Tally()
        for entry in parse(content.decode(errors="replace").splitlines()):
            tally.add(entry)
            yield timed(entry)
        yield str(tally)
        return
    decoder = FrameDecoder(max_payload=0xFFFF)
    count = 0
    for frame in decoder.feed(capture_bytes(content)):
        count += 1
        yield describe(frame)
    if decoder.skipped or decoder.pending or not count:
        yield (
            f"{count} frames; {decoder.skipped} bytes outside frames, {decoder.damaged} frames "
            f"with a wrong checksum, {decoder.pending} bytes of an unfinished frame at the end"
        )


class Tally:
    """Counts traffic for the line at the end."""

    def __init__(self) -> None:
        self.requests = self.unasked = self.loose = 0
        self.refused: Counter[str] = Counter()
        self.slowest: tuple[float, str] = (0.0, "")
        self._waiting: dict[tuple[int, int], float] = {}

    def add(self, entry: Entry) -> None:
        """Count one entry of a log."""
        if not entry.data:
            return
        frame = entry.frame
        if frame is None:
            self.loose += len(entry.data)
        elif entry.who == HOST:
            self.requests += 1
            self._waiting[frame.id, frame.type] = entry.time_s
        elif frame.id == 0 and not frame.is_ack:
            self.unasked += 1
        else:
            self._answer(entry.time_s, frame)

    def _answer(self, time_s: float, frame: Frame) -> None:
        name = type_name(frame.request_type)
        asked = self._waiting.pop((frame.id, frame.request_type), None)
        if asked is not None and time_s - asked > self.slowest[0]:
            self.slowest = (time_s - asked, name)
        code = meaning(frame, False)
        if isinstance(code, Ack) and code != Ack.OK:
            self.refused[f"{name} {code.name}"] += 1

    def __str__(self) -> str:
        parts = [f"{self.requests} requests, {len(self._waiting)} without an answer"]
        if self.slowest[1]:
            parts.append(
                f"the slowest answer after {self.slowest[0] * 1000:.1f} ms ({self.slowest[1]})"
            )
        parts += [f"{count} times {what}" for what, count in self.refused.most_common()]
        parts.append(f"{self.unasked} messages unasked, {self.loose} bytes outside frames")
        return "; ".join(parts)


class Relay:
    """Copies bytes between a device's port and a pseudo-terminal, and records them.

    The device sees its host come and go: once the first host has closed the pseudo-terminal, the
    port is closed while nobody has it open. open_device: opens the port again.
    """

    def __init__(
        self, device: Any, open_device: Callable[[], Any], link: "PtyLink", recorder: Recorder
    ):
        self.device = device
        self._open_device, self._link, self._recorder = open_device, link, recorder
        self._host = False
        self._to_host = b""  # bytes that the host has not read yet

    def run(self, until: Callable[[], bool]) -> None:
        """Copy until `until` returns True."""
        while not until():
            if not self.step():
                time.sleep(_NEXT_LOOK_S)

    def step(self) -> bool:
        """Copy all waiting bytes. Return whether there were any."""
        from_host = self._link.read()  # includes bytes that a host sent before it disconnected
        is_open = self._link.is_open(False)
        if (is_open or from_host) and not self._host:
            self._come()
        moved = False
        if from_host:
            self.device.write(from_host)
            self._recorder.passed(HOST, from_host)
            moved = True
        if self.device is not None and (data := self._from_device()):
            self._recorder.passed(DEVICE, data)
            self._to_host += data
            moved = True
        if self._to_host:  # there is no reader without a host
            taken = self._link.write(self._to_host) if self._host else len(self._to_host)
            self._to_host = self._to_host[taken:]
        if self._host and not is_open:
            self._leave()
        return moved

    def _from_device(self) -> bytes:
        self.device.timeout = 0
        return self.device.read(4096)

    def _come(self) -> None:
        self._host = True
        self._recorder.port(True)
        if self.device is None:
            self.device = self._open_device()

    def _leave(self) -> None:
        self._host = False
        self.device.close()
        self.device = None
        self._recorder.port(False)

    def close(self) -> None:
        """Close the device's port, and record an unfinished frame."""
        self._recorder.end()
        if self.device is not None:
            self.device.close()
            self.device = None
