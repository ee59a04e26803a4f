"""A board on the REPL's port, reached by mpremote: what is on it, its files, and a restart.

Nothing here soft-resets the board, because that would end pulses in the middle of a motion.
"""

import contextlib
import io
import os
import time
import zlib
from ast import literal_eval
from binascii import b2a_base64
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from mpremote.transport import TransportError, TransportExecError

from framestep.protocol import messages

from ..client import port_finder
from ..client.client import Client
from ..client.open_port import holders
from ..client.wire import FrameDecoder, encode
from ..errors import NO_PORT, PORT_BUSY, ToolError
from ..payloads import MotorStatus, Status

RIG_FILE = "/rig.json"
# Factor on the time after which a board counts as gone: for a computer that is very busy or
# emulates the board
PATIENCE = float(os.environ.get("FRAMESTEP_PATIENCE") or 1)
_READ_S = 10.0 * PATIENCE  # a board that is silent for this long is gone
_REPL_S = 10.0 * PATIENCE  # time to reach the raw REPL
_LOOK_S = 0.2
_ASK_S = 1.0  # time for an answer to MOTOR_STATUS on the REPL's port
_ASK_ID = 0x20202020  # spaces, in case a REPL receives the request
_CHUNK = 1024
# Small, as a board's memory may be in small pieces, and the REPL prints four times as much text
_SMALL_CHUNK = 128
_WINDOW_BITS = _CHUNK.bit_length() - 1  # of the decompressor: its window is as large as a chunk
_AT_ONCE = 16  # hashes in one request; a running controller leaves little memory for a script

# State of framestep on this board: (runs, a bit for each motor that moves or is about to, in the
# background)
STATE = """
import sys
b = sys.modules.get("framestep.boot")
c = b and b.controller
r = c and getattr(b, "runner", b.hal)
def moving():
    if not c: return 0
    o = getattr(c, "operations", None) or c.stage  # as older versions call them
    if not r.alive: return c.axes.moving_bits()  # without its passes the rest stays as it was
    return c.axes.moving_bits() | (o.owned if hasattr(o, "owned") else o.engaged)
print((bool(c), moving(), bool(c) and r.background))
"""
STOP = """
if moving(): print(1)
else:
    if c: r.stop()
    print(0)
"""
# The mistake that the board has found in its rig file at the start, or None
MISTAKE = """
import framestep.boot
print("\\x02")
print(framestep.boot.mistake)
"""
BOARD = """
try:
    from framestep.board import BOARD
    print(BOARD)
except ImportError: pass
"""
_LIST = """
import os
def walk(folder):
    for name, kind, *_ in os.ilistdir(folder):
        path = folder.rstrip("/") + "/" + name
        if kind & 0x4000: walk(path)
        else: print(repr(path) + ",")
try: walk(%r)
except OSError: pass
"""
_HASH = """
import hashlib
def digest(path):
    h = hashlib.sha256()
    n = 512
    b = bytearray(n)
    m = memoryview(b)
    try: f = open(path, "rb")
    except OSError: return
    while n == 512:
        n = f.readinto(b)
        h.update(m[:n])
    f.close()
    print(repr(path) + ":" + repr(h.digest()) + ",")
"""
# Compressed and in base64 a file is a third as long as its bytes as text, and sending text takes
# the time. Decompressing takes 1.3 kB of memory in one piece.
_WRITE_PACKED = """
from binascii import a2b_base64
from deflate import DeflateIO, RAW
from io import BytesIO
f = open(%r, "wb")
def w(b): f.write(DeflateIO(BytesIO(a2b_base64(b)), RAW, %d).read(%d))
"""
_WRITE = """
import gc
from binascii import a2b_base64
f = None
gc.collect()
f = open(%r, "wb")
def w(b): f.write(a2b_base64(b))
"""
_FOLDER = """
import os
try: os.mkdir(%r)
except OSError as e:
    if e.errno != 17: raise
"""


class DeviceError(ToolError):
    """The board cannot be reached or behaves wrongly. The text says what to do."""


class Moving(DeviceError):
    """Motors move, or are about to move."""


class State(NamedTuple):
    """Whether framestep's controller runs, a bit for each motor that moves, and whether it leaves
    the REPL free."""

    runs: bool
    moving: int
    background: bool


# ---- a board


def _packed(data: bytes) -> bytes:
    packer = zlib.compressobj(9, zlib.DEFLATED, -_WINDOW_BITS)
    return b2a_base64(packer.compress(data) + packer.flush(), newline=False)


class Device:
    """A board's REPL. Paths of files begin with "/". Errors are DeviceErrors.

    say: called with a line of text before something that takes time.
    """

    def __init__(self, path: str | None = None, say: Callable[[str], None] = lambda line: None):
        self.path = path or port_finder.repl_port()
        ports = port_finder.siblings(self.path)
        # an ESP32's port for the protocol, which ends when somebody gets to the REPL
        self._own_port = next(
            (port.path for port in ports if port.foreground and port.use == port_finder.PROTOCOL),
            None,
        )
        self._say = say
        self._transport: Any = None
        self.state = State(False, 0, False)

    def __enter__(self) -> "Device":
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def connect(self) -> None:
        """Get to the REPL. Raises Moving if the protocol has the same port and motors move.

        framestep goes on, unless it shares its port with the REPL or runs on an ESP32: then Ctrl-C
        ends it here.
        """
        self._ask_own_port()
        self._open()
        self._ask_motors()
        self._enter()
        self.state = State(*literal_eval(self.run(STATE)))

    def close(self) -> None:
        """Leave the REPL as a terminal expects it."""
        transport, self._transport = self._transport, None
        if transport:
            with contextlib.suppress(OSError, TransportError):
                if transport.in_raw_repl:
                    transport.exit_raw_repl()
            with contextlib.suppress(OSError):
                transport.close()

    def _open(self) -> None:
        try:
            # also imports pyserial, which needs modules of the system
            from mpremote.transport_serial import SerialTransport

            name, baud = port_finder.split_rate(self.path)
            self._transport = SerialTransport(name, baud, timeout=_READ_S)
        except (OSError, TransportError) as error:
            others = holders(port_finder.split_rate(self.path)[0])
            hint = (
                f"{' and '.join(others)} has it open"
                if others
                else "is the board there, and no terminal open on it?"
            )
            failed = DeviceError(f"cannot open {self.path} ({error}): {hint}")
            failed.status = PORT_BUSY if others else NO_PORT
            raise failed from None

    @property
    def ports(self) -> int:
        """Number of ports: 1 if the protocol has the REPL's."""
        return 1 if self.state.runs and not (self.state.background or self._own_port) else 2

    def _ask_own_port(self) -> None:
        if not self._own_port:
            return
        try:
            client = Client.open(self._own_port, _ASK_S)
        except ToolError as error:
            failed = DeviceError(
                f"{error}; getting to the REPL would end framestep under the program that uses it"
            )
            failed.status = error.status
            raise failed from None
        moving: list[int] = []
        with client, contextlib.suppress(ToolError):  # nobody answers if framestep has ended
            moving = client.request(MotorStatus()).moving
        self._refuse_moving(moving)

    @staticmethod
    def _refuse_moving(moving: list[int]) -> None:
        if moving:
            raise Moving(f"motors move ({', '.join(map(str, moving))}); nothing has been changed")

    def _ask_motors(self) -> None:
        """Ask whether motors move: if the port is the protocol's too, a Ctrl-C would stop them."""
        port = self._transport.serial
        decoder = FrameDecoder()
        try:
            port.timeout = 0.05
            port.write(encode(messages.MSG_MOTOR_STATUS, b"", _ASK_ID))
            end = time.monotonic() + _ASK_S
            while time.monotonic() < end:
                for frame in decoder.feed(port.read(64)):
                    if (
                        frame.id == _ASK_ID
                        and frame.request_type == MotorStatus.TYPE
                        and not frame.is_ack
                    ):
                        self._refuse_moving(Status.unpack(frame.payload).moving)
                        return
            port.timeout = _READ_S
        except OSError as error:
            raise DeviceError(f"{self.path} does not take anything: {error}") from None

    def _enter(self, seconds: float = _REPL_S) -> None:
        try:
            try:
                self._ask_raw_repl(seconds / 4)
            except TransportError:
                # seen a few times on very busy computers; the cause is not known
                self._ask_raw_repl(seconds * 3 / 4)
        except (OSError, TransportError) as error:
            raise DeviceError(
                f"the REPL on {self.path} does not answer ({error}): close other programs "
                "that use the port, or press the board's reset button and try again"
            ) from None

    def _ask_raw_repl(self, seconds: float) -> None:
        port = self._transport.serial
        port.timeout = seconds  # on a pseudo-terminal mpremote waits this long for each byte
        with contextlib.redirect_stdout(io.StringIO()):
            self._transport.enter_raw_repl(soft_reset=False, timeout_overall=seconds)
        port.timeout = _READ_S

    def run(self, script: str) -> str:
        """Run a script on the REPL and return its output. Raises DeviceError with the traceback if
        it fails. Ctrl-C ends the script."""
        try:
            return self._transport.exec(script).decode()
        except KeyboardInterrupt:
            with contextlib.suppress(DeviceError):
                self._enter()  # for scripts that put the board back as it was
            raise
        except TransportExecError as error:
            raise DeviceError(
                f"the board reported an error:\n{error.error_output.strip()}"
            ) from None
        except (OSError, TransportError) as error:
            raise DeviceError(f"the board on {self.path} has gone: {error}") from None

    def board(self) -> dict[str, Any]:
        """Return the board's data (boards/<board>/board.json) from its framestep."""
        found = self.run(BOARD)
        if not found.strip():
            raise DeviceError(
                f"framestep is not on the board on {self.path}: framestep install puts it there"
            )
        return literal_eval(found)

    def halt(self) -> None:
        """Stop framestep, so no motor can start. Raises Moving, and changes nothing, if one
        moves."""
        self.run(STATE)
        if int(self.run(STOP)):
            raise Moving("motors move, or a run is prepared; nothing has been changed")

    # ---- files

    def files(self, folder: str) -> list[str]:
        """List all files below a folder; none if there is no such folder."""
        return list(literal_eval("[" + self.run(_LIST % folder) + "]"))

    def hashes(self, names: Iterable[str]) -> dict[str, bytes]:
        """Return {path: SHA-256} of those files that exist."""
        self.run(_HASH)
        found: dict[str, bytes] = {}
        wanted = list(names)
        for at in range(0, len(wanted), _AT_ONCE):
            found |= literal_eval(
                "{" + self.run(f"for n in {wanted[at : at + _AT_ONCE]}: digest(n)") + "}"
            )
        return found

    def read(self, name: str) -> bytes | None:
        """Return a file's content, or None if there is no such file."""
        for chunk in (_CHUNK, _SMALL_CHUNK):
            try:
                return bytes(self._transport.fs_readfile(name, chunk))
            except FileNotFoundError:
                return None
            except (OSError, TransportError) as error:
                failure = error
                if "MemoryError" not in str(error):
                    break
        raise DeviceError(f"cannot read {name} from the board: {failure}")

    def write(self, name: str, data: bytes) -> None:
        """Write a file, and make its folders. An existing file is emptied first."""
        for at, sign in enumerate(name):
            if sign == "/" and at:
                self.run(_FOLDER % name[:at])
        try:
            try:
                self._write(_WRITE_PACKED % (name, _WINDOW_BITS, _CHUNK), data, _CHUNK, _packed)
            except DeviceError as error:
                if "MemoryError" not in str(error):
                    raise
                self._write(_WRITE % name, data, _SMALL_CHUNK, b2a_base64)
        except DeviceError as error:
            raise DeviceError(f"cannot write {name} to the board: {error}") from None

    def _write(
        self, script: str, data: bytes, chunk: int, encoded: Callable[[bytes], bytes]
    ) -> None:
        self.run(script)
        for at in range(0, len(data), chunk):
            self.run(f"w({encoded(data[at : at + chunk])!r})")
        self.run("f.close()\nf = w = None")

    def replace(self, name: str, data: bytes) -> None:
        """Replace a file's content in one step at the end: it is the old or the new one, whatever
        happens."""
        new = name + ".new"
        self.write(new, data)
        if self.read(new) != data:
            raise DeviceError(f"{name} did not arrive as it was sent; try again")
        self.rename(new, name)

    def rename(self, name: str, new: str) -> None:
        """Rename a file, in one step that a power cut cannot divide."""
        self.run(f"import os\nos.rename({name!r}, {new!r})")

    def remove(self, name: str) -> None:
        """Delete a file."""
        self.run(f"import os\nos.remove({name!r})")

    # ---- restart

    def restart(self) -> None:
        """Reset the board as its button does. This ends the connection."""
        try:
            self._transport.exec_raw_no_follow("import machine\nmachine.reset()")
        except (OSError, TransportError) as error:
            raise DeviceError(f"the board on {self.path} has gone: {error}") from None
        self._transport.in_raw_repl = False
        self.close()
