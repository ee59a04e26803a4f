"""Reads protocol traffic: what each frame says, from a capture or between a host and a device."""

import re
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from .payloads import REPORTS, REQUESTS, Ack, Payload, type_name
from .wire import Frame, FrameDecoder

if TYPE_CHECKING:
    from .pty_link import PtyLink

_HEX = re.compile(rb"[0-9A-Fa-f\s:,]*")
_NEXT_LOOK_S = 0.002


def capture_bytes(content: bytes) -> bytes:
    """The traffic in a capture file: hexadecimal digits (with blanks, colons or commas) or the
    bytes themselves."""
    digits = re.sub(rb"[\s:,]|0[xX]", b"", content)
    if _HEX.fullmatch(content.replace(b"0x", b"").replace(b"0X", b"")) and len(digits) % 2 == 0:
        return bytes.fromhex(digits.decode())
    return content


def meaning(frame: Frame, from_host: bool | None = None) -> Payload | Ack | None:
    """What a frame says; None if its data fits no layout. `from_host` None: not known, a request
    where it fits one."""
    if frame.is_ack:
        try:
            return Ack.unpack(frame.payload)
        except ValueError:
            return None
    tables = {True: (REQUESTS,), False: (REPORTS,), None: (REQUESTS, REPORTS)}[from_host]
    for table in tables:
        try:
            return table[frame.type].unpack(frame.payload)
        except (KeyError, ValueError):
            continue
    if from_host is not False and frame.type in REQUESTS:
        try:
            # field note 1.8: what follows is ignored
            return REQUESTS[frame.type].unpack_known(frame.payload)[0]
        except ValueError:
            pass
    return None


def describe(frame: Frame, from_host: bool | None = None) -> str:
    """One line: ID, type, and the data field by field (in hexadecimal if it fits no layout)."""
    said = meaning(frame, from_host)
    if isinstance(said, Ack):
        text = f"{said.name} (0x{said:04X})"
    elif said is None:
        text = (
            f"{len(frame.payload)} bytes: "
            f"{frame.payload[:64].hex(' ')}{'…' if len(frame.payload) > 64 else ''}"
        )
    else:
        text = _fields(said)
    return (
        f"{frame.id:>10}  {type_name(frame.request_type):<22}{'ACK ' if frame.is_ack else ''}{text}"
    ).rstrip()


def _fields(payload: Payload) -> str:
    return "  ".join(
        f"{name}={_short(value)}" for name, value in vars(payload).items() if value is not None
    )


def _short(value: Any) -> str:
    if isinstance(value, tuple) and len(value) > 16:
        return f"[{', '.join(map(str, value[:8]))}, … {value[-1]}; {len(value)} values]"
    return str(list(value)) if isinstance(value, tuple) else repr(value)


def read_capture(content: bytes) -> Iterator[str]:
    """The frames of a capture line by line, then what was no frame."""
    decoder = FrameDecoder(max_payload=0xFFFF)
    count = 0
    for frame in decoder.feed(capture_bytes(content)):
        count += 1
        yield describe(frame)
    if decoder.skipped or decoder.pending or not count:
        yield (
            f"{count} frames; {decoder.skipped} bytes in no frame, {decoder.damaged} frames "
            f"with a wrong checksum, {decoder.pending} bytes of an unfinished frame at the end"
        )


def relay(
    device: Any, link: "PtyLink", say: Callable[[str], None], until: Callable[[], bool]
) -> None:
    """Copy between a device's port (pyserial) and a pseudo-terminal, telling of each frame, until
    that is True."""
    began = time.monotonic()
    decoders = {True: FrameDecoder(), False: FrameDecoder()}
    device.timeout = 0
    while not until():
        quiet = True
        for from_host in (True, False):
            data = link.read() if from_host else device.read(4096)
            if not data:
                continue
            quiet = False
            if from_host:
                device.write(data)
            else:
                link.write(data)
            decoder = decoders[from_host]
            skipped = decoder.skipped
            frames = decoder.feed(data)
            stamp = f"{time.monotonic() - began:10.4f} {'>' if from_host else '<'}"
            for frame in frames:
                say(f"{stamp} {describe(frame, from_host)}")
            if decoder.skipped > skipped:
                say(f"{stamp} {decoder.skipped - skipped} bytes in no frame")
        if quiet:
            time.sleep(_NEXT_LOOK_S)
