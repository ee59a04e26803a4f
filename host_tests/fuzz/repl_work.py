"""What a person does on an emulated board's REPL: memory used to the last byte, long C calls,
Ctrl-C, files read, prints."""

from .findings import Finding

# A function holds the memory that it takes, so that it is always free again; in small pieces,
# because any word in memory that looks like a pointer to one keeps it.
_HELPERS = """
import gc, os, time
def take(ms, size=1024):
    kept = [None] * 100
    count = 0
    while size >= 8 and count < 100:
        try:
            kept[count] = bytearray(size)
            count += 1
        except MemoryError:
            size //= 2
    time.sleep_ms(ms)
def read(path):
    with open(path, "rb") as file:
        while file.read(200):
            pass
with open("/data.bin", "wb") as file:
    for _ in range(80):
        file.write(bytes(range(256)))
"""
WORK = (
    "take(60)",
    "take(300)",
    "sum(range(20000))",
    "len(str(7**700))",
    "read('/data.bin')",
    "os.listdir('/'); os.stat('/data.bin'); os.statvfs('/')",
    "print('x' * 300)",
    "for i in range(40): print(i, i / 7)",
    "gc.collect()",
    "[i * i for i in range(400)]",
    "time.sleep_ms(100)",
    "import framestep.repl; framestep.repl.status()",
    "import framestep.repl; framestep.repl.timing()",
    # until Ctrl-C
    "while True: pass",
    "while True: take(5)",
    "while True: gc.collect()",
    "while True: read('/data.bin')",
)
_BEARABLE = ("MemoryError", "KeyboardInterrupt")


class ReplWork:
    """The REPL of a board, with one piece of work at a time."""

    def __init__(self, emulator):
        self._repl = emulator.repl()
        self._repl.exec(_HELPERS)
        self.piece = ""  # under way
        self._heard = b""

    def do(self, piece: str) -> None:
        """Begin a piece of work, or press Ctrl-C if it is empty."""
        if not piece:
            self._repl.serial.write(b"\x03")
        elif not self.piece:
            self.piece, self._heard = piece, b""
            self._repl.start(piece)

    def look(self) -> bool:
        """Return whether a piece of work is under way. Raises Finding if one has ended badly."""
        if not self.piece:
            return False
        serial = self._repl.serial
        serial.timeout = 0
        self._heard += serial.read(100_000)
        out, *ended = self._heard.split(b"\x04", 2)
        if b"fault in the firmware" in self._heard:
            raise Finding("repl", f"the firmware has ended: {self._heard[-2000:]!r}")
        # the firmware may print something before or after the prompt
        if len(ended) < 2 or b">" not in ended[1]:
            return True
        error = ended[0].decode(errors="replace")
        if error and not any(name in error for name in _BEARABLE):
            raise Finding("repl", f"{self.piece!r} ended with {error!r}, after {out[-200:]!r}")
        self.piece = ""
        return False
