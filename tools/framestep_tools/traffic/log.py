"""A log of protocol traffic, to read, to attach to a report and to play again.

    # framestep sniff 1: seconds, who, bytes, and what they say
    # Dragonframe's side of /dev/ttyACM1, begun 2026-11-23 03:20:00, framestep 0.1.0
    0.000000 open
    0.001200 > 444601000000010000009f64  # 1  HI
    0.003100 < 4446...                   # 1  HI  name='framestep'  ...
    9.500000 close

`>` is the host, `<` the device; `open` and `close` are the host's port (DTR). Each line has one
frame, or bytes outside frames, exactly as they came. Text after a `#` is for people.
"""

import time
from collections.abc import Callable, Iterable, Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import NamedTuple, TextIO

from ..client.wire import Frame, FrameDecoder
from ..errors import ToolError

HOST, DEVICE, OPEN, CLOSE = ">", "<", "open", "close"
HEADING = "# framestep sniff 1"
REPLAY_IDS = range(0x7E00_0000, 0x7E01_0000)  # IDs of a replay's own requests
_LONGEST = 0xFFFF  # bytes of a payload, limited by the length field


class LogError(ToolError):
    """A file is not a traffic log. The text names the line."""


class Entry(NamedTuple):
    """One entry. `time_s`: seconds from the beginning; `who`: HOST, DEVICE, OPEN or CLOSE; `data`:
    one frame's bytes, or bytes outside frames."""

    time_s: float
    who: str
    data: bytes = b""

    @property
    def frame(self) -> Frame | None:
        """The frame, or None for bytes outside frames."""
        decoder = FrameDecoder(_LONGEST)
        found = decoder.feed(self.data)
        return found[0] if len(found) == 1 and not decoder.skipped else None

    @property
    def damaged(self) -> bool:
        """Whether these bytes are a frame with a wrong checksum."""
        decoder = FrameDecoder(_LONGEST)
        decoder.feed(self.data)
        return bool(decoder.damaged)


class Recorder:
    """Makes entries of passing bytes, however they are divided, and calls `report` with each.

    clock: returns seconds; the first entry is at 0.
    """

    def __init__(
        self, report: Callable[[Entry], None], clock: Callable[[], float] = time.monotonic
    ):
        self._report, self._clock = report, clock
        self._began: float | None = None
        self._decoders = {HOST: FrameDecoder(), DEVICE: FrameDecoder()}

    def _now(self) -> float:
        now = self._clock()
        if self._began is None:
            self._began = now
        return now - self._began

    def passed(self, who: str, data: bytes) -> None:
        """Record bytes of HOST or DEVICE."""
        now = self._now()
        loose = b""
        for raw, frame in self._decoders[who].pieces(data):
            if frame is None:
                loose += raw
                continue
            if loose:
                self._report(Entry(now, who, loose))
                loose = b""
            self._report(Entry(now, who, raw))
        if loose:
            self._report(Entry(now, who, loose))

    def port(self, is_open: bool) -> None:
        """Record that the host opens or closes its port."""
        now = self._now()
        if not is_open:
            self.end()
        self._report(Entry(now, OPEN if is_open else CLOSE))

    def end(self) -> None:
        """End the recording; an unfinished frame becomes bytes outside frames."""
        now = self._now()
        for who, decoder in self._decoders.items():
            if begun := decoder.reset():
                self._report(Entry(now, who, begun))


class LogWriter:
    """Writes entries to a file as they come, each with its meaning after it."""

    def __init__(self, file: TextIO, subject: str, describe: Callable[[Entry], str]):
        self._file, self._describe = file, describe
        try:
            ours = version("framestep")
        except PackageNotFoundError:
            ours = "from its sources"
        began = time.strftime("%Y-%m-%d %H:%M:%S")
        self._put(f"{HEADING}: seconds, who, bytes, and what they say")
        self._put(f"# {subject}, begun {began}, framestep {ours}")

    def _put(self, line: str) -> None:
        self._file.write(line + "\n")
        self._file.flush()  # so the entry survives a pulled cable or a crash

    def add(self, entry: Entry) -> None:
        """Write one entry."""
        self._put(line_of(entry, self._describe(entry) if entry.data else ""))

    def note(self, text: str) -> None:
        """Write a remark for people."""
        self._put(f"# {text}")


def line_of(entry: Entry, meaning: str = "") -> str:
    """Return an entry's line in a log."""
    parts = [f"{entry.time_s:.6f}", entry.who]
    if entry.data:
        parts.append(entry.data.hex())
    return " ".join(parts) + (f"  # {meaning}" if meaning else "")


def is_log(content: bytes) -> bool:
    """Return whether a file's content is a log rather than a bare capture."""
    return content.startswith(HEADING.encode())


def parse(lines: Iterable[str]) -> Iterator[Entry]:
    """Yield the entries of a log. Raises LogError for a wrong line."""
    last = 0.0
    for number, line in enumerate(lines, 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            time_s = float(words[0])
            if not last <= time_s < float("inf"):
                raise ValueError
            if words[1:] in ([OPEN], [CLOSE]):
                entry = Entry(time_s, words[1])
            elif len(words) == 3 and words[1] in (HOST, DEVICE):
                entry = Entry(time_s, words[1], bytes.fromhex(words[2]))
            else:
                raise ValueError
        except ValueError:
            raise LogError(
                f"line {number} of the log is none: expected ascending seconds, then open, close, "
                f"or > or < and bytes in hexadecimal, found {line.strip()[:80]!r}"
            ) from None
        last = time_s
        yield entry


def read(path: str) -> list[Entry]:
    """Return the entries of a log file. Raises LogError."""
    try:
        with open(path, "rb") as file:
            content = file.read()
    except OSError as error:
        raise LogError(f"cannot read the log {path}: {error.strerror}") from None
    if not is_log(content):
        raise LogError(f"{path} is not a traffic log: framestep lab sniff --log {path} writes one")
    return list(parse(content.decode(errors="replace").splitlines()))
