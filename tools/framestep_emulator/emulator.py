"""Drive the emulated board from Python.

    from framestep_emulator import Emulator

    with Emulator("firmware.bin") as emu:         # lockstep: time moves only when told
        repl = emu.repl()
        print(repl.exec("print(1 + 1)"))
        emu.trace_start([2, 3])
        repl.exec("import machine; machine.Pin(2, machine.Pin.OUT).toggle()")
        edges = emu.trace_read()                  # numpy: t (ns), pin, level

Times are the board's own (virtual) unless a name says otherwise.
"""

import base64
import contextlib
import hashlib
import os
import tempfile
import time
from pathlib import Path

from . import image
from .errors import EmulatorError
from .node import Node
from .ports import PtyBridge, Serial
from .repl import Repl
from .trace import edges_from

HERE = Path(__file__).resolve().parent
# A Pico has its second port after 1.6 s; drivers that must be set up take longer.
BOOT_LIMIT_MS = 10_000
POLL_SECONDS = 0.005  # real time between looks at a board that runs freely


def device_file(name):
    """Return the text of a script in device/, which the emulator's own tests run on the board."""
    return (HERE / "device" / name).read_text()


class Emulator:
    """One emulated board in its own node process.

    firmware    path of the image in flash: the .bin of a build of MicroPython
    files       {device path: bytes or str} for a fresh file system
    put         {host path: device path} of further files and directories for it
    fs_image    a complete littlefs image instead of files
    flash       file that keeps the whole flash from one run to the next
    lockstep    time passes only in advance() and in reads that wait; otherwise it runs freely
                after the start
    boot        run until the USB serial port is there
    speed       when running freely: at most this many times real time
    tcp         TCP ports on 127.0.0.1 for the USB serial ports; 0 takes a free one, shown in
                tcp_ports after the start
    args        further arguments for emu.mjs, e.g. ["--xip-miss", "0"]
    """

    pool = None  # a Pool, for many boards one after the other

    def __init__(
        self,
        firmware,
        files=None,
        put=None,
        fs_image=None,
        flash=None,
        lockstep=True,
        boot=True,
        speed=None,
        tcp=(0, 0),
        args=(),
    ):
        self.firmware = firmware
        self.files = files
        self.put = put
        self.fs_image = fs_image
        self.flash = flash
        self.lockstep = lockstep
        self.boot = boot
        self.speed = speed
        self.tcp_ports = tuple(tcp)
        self.args = list(args)
        self._node = None
        self._pool = None  # pool from which the process came and to which it goes
        self._state = ""  # name of the board's state, in a pool
        self._as_kept = False  # the board has not been used since it was in that state
        self._temp = None

    # ------------------------------------------------------------ process

    def __enter__(self):
        return self.start()

    def __exit__(self, *_):
        self.close()

    def _image(self, firmware):
        """Return the path of the file system image for the board, or None."""
        if self.files is None and not self.put:
            return self.fs_image
        if self.fs_image:
            raise ValueError("fs_image is a whole file system: give either it, or files and put")
        files = {**image.collect(self.put or {}), **(self.files or {})}
        self._temp = tempfile.NamedTemporaryFile(suffix=".img")  # noqa: SIM115 -- lives as long as the emulator
        self._temp.write(image.make_image(files, firmware))
        self._temp.flush()
        return self._temp.name

    def start(self):
        firmware = self.firmware
        free, self.lockstep = not self.lockstep, True  # it starts in lockstep
        arguments = [*self.args, "--lockstep"]
        if "--chip" not in arguments and image.chip_of(Path(firmware).read_bytes()) == "RP2350":
            arguments += ["--chip", "RP2350"]  # a process of a pool keeps its chip
        if self.flash:
            arguments += ["--flash", self.flash]
        elif self.tcp_ports == (0, 0):
            self._pool = Emulator.pool
            self._failures = self._pool.failures if self._pool else 0
        arguments += ["--tcp", str(self.tcp_ports[0]), "--tcp2", str(self.tcp_ports[1])]
        self._arguments = arguments
        if self._pool:
            self._state = self._fingerprint(firmware)
            self._node = self._pool.take(arguments, self._state)
        try:
            if not (self._node and self._node.rewind(self._state)):
                self._load(firmware)
                if self.boot:
                    self.wait_usb()
                    if self._pool:
                        self._node.keep(self._state)
            self.tcp_ports = self._node.tcp_ports
            self._as_kept = True
            if free:
                self.set_lockstep(False, self.speed)
        except BaseException:
            self._pool = None
            self.close()
            raise
        return self

    def _load(self, firmware):
        """Load a board that has not begun, into the present process or a new one."""
        fs_image = self._image(firmware)
        if self._node:
            self._node.cmd(
                "renew", firmware=os.fspath(firmware), fs=fs_image and os.fspath(fs_image)
            )
        else:
            more = ["--fs", fs_image] if fs_image else []
            self._node = Node("--firmware", firmware, *self._arguments, *more)

    def _fingerprint(self, firmware):
        """Return a name for the state of all boards that boot alike."""
        files = {**image.collect(self.put or {}), **(self.files or {})}
        digest = hashlib.sha256(Path(firmware).read_bytes())
        digest.update(repr((self.boot, self.files is None, sorted(files.items()))).encode())
        if self.fs_image:
            digest.update(Path(self.fs_image).read_bytes())
        return digest.hexdigest()

    def once(self, name, action):
        """Run an action on a board that has just started, before anything else. A pool keeps the
        result by its name, so that the next board of the kind need not repeat it."""
        if not self._pool:
            action()
            return
        if not self._as_kept:
            raise ValueError(f"{name}: something else has been done with the board before")
        self._state += f" {name}"
        if not self._node.rewind(self._state):
            action()
            self._node.keep(self._state)
        self._as_kept = True

    def close(self):
        node, self._node = self._node, None
        if node is None:
            return
        if self._pool and node.process.poll() is None:
            self._pool.give(self._arguments, node, self._failures)
        else:
            node.close()
        if self._temp:
            self._temp.close()

    def cmd(self, name, /, **arguments):
        """Send a control command and return its answer."""
        if self._node is None:
            raise EmulatorError("the emulator has been closed")
        self._as_kept = False
        return self._node.cmd(name, **arguments)

    @property
    def _now(self):
        """The time, and how much there is to read, as of the last answer; None while time runs
        freely."""
        return self._node and self._node.now

    # ------------------------------------------------------------ time

    @property
    def ns(self):
        now = self._now
        return now["ns"] if now else self.cmd("time")["ns"]

    def advance(self, ms, **until):
        """Let virtual time pass; stop early with until_rx=port or until_event=type."""
        return self.cmd("advance", ms=ms, **until)

    def run_until_ns(self, ns, **until):
        """Let virtual time pass until this moment; see advance()."""
        return self.cmd("run_until_ns", ns=ns, **until)

    def wait_event(self, kind, ms):
        """Run until an event of this kind happens (reset, usb-configured, halt, ...); only in
        lockstep."""
        self.advance(ms, until_event=kind)
        if not any(event["type"] == kind for event in self.events()):
            raise EmulatorError(f"no {kind} within {ms} ms")

    def wait_usb(self, ms=BOOT_LIMIT_MS, after=0, ports=None):
        """Wait until the host has configured the board's USB device, at `after` ns or later, and
        with this number of ports.

        ms is a limit of virtual time.
        """

        def configured():
            return [
                e["ports"]
                for e in self.events()
                if e["type"] == "usb-configured" and e["t"] >= after
            ]

        deadline = self.ns / 1e6 + ms
        while not (seen := configured()) or ports not in (None, seen[-1]):
            left = deadline - self.ns / 1e6
            if left <= 0:
                raise EmulatorError(
                    f"no USB device with {ports or 'any'} serial ports within {ms} ms; seen: {seen}"
                )
            if self.lockstep:
                self.advance(left, until_event="usb-configured")
            else:
                time.sleep(POLL_SECONDS)

    def set_lockstep(self, on, speed=None):
        """Switch between lockstep and free running."""
        self.lockstep = on
        self.cmd("mode", lockstep=on, **({} if speed is None else {"speed": speed}))

    @contextlib.contextmanager
    def free_running(self, speed=None):
        """Run freely, for clients that do not know lockstep, such as mpremote."""
        self.set_lockstep(False, speed)
        try:
            yield self
        finally:
            self.set_lockstep(True)

    # ------------------------------------------------------------ board

    def events(self, clear=False):
        return self.cmd("events", clear=clear)["events"]

    @property
    def halted(self):
        return self.cmd("time")["halted"]

    def reset(self):
        """Switch power off and on; the flash is kept."""
        self.cmd("reset")
        if self.lockstep and self.boot:
            self.wait_usb(after=self.ns)

    def set_pin(self, pin, value):
        """Drive a pin from outside: 0, 1, or None to let go of it."""
        self.cmd("setpin", pin=pin, value=value)

    def press_bootsel(self, on=True):
        """Press or release the BOOTSEL button. The boot ROM's own loader does not check it here."""
        self.cmd("button", on=on)

    def pins(self):
        return self.cmd("getpins")["pins"]

    def pin(self, n):
        return self.pins()[n]["level"]

    def trace_start(self, pins=None, file=None):
        """Record the edges of these pins (default: all), in memory or in a file (read it with
        TraceFile)."""
        more = {} if pins is None else {"pins": list(pins)}
        if file:
            more["file"] = os.path.abspath(file)
        self.cmd("trace", on=True, **more)

    def trace_read(self):
        """Edges since the last call as a numpy array with the fields t (ns), pin and level."""
        return edges_from(base64.b64decode(self.cmd("trace_read").get("data") or ""))

    def trace_stop(self):
        return edges_from(base64.b64decode(self.cmd("trace", on=False).get("data") or ""))

    def uart_start(self, n):
        self.cmd(f"uart{n}", on=True)

    def uart_read(self, n):
        """Return bytes ([ns, value], ...) and breaks ([start, end], ...) since the last call."""
        now = self._now
        if now and not now["logged"][n]:
            return [], []
        answer = self.cmd(f"uart{n}")
        return answer["bytes"], answer["breaks"]

    def uart_send(self, n, data):
        """Let bytes arrive at a UART's RX."""
        self.cmd("uart_rx", uart=n, hex=bytes(data).hex())

    def cycles(self, clear=False):
        return self.cmd("cycles", clear=clear)

    @contextlib.contextmanager
    def measure(self):
        """Yield a dict that is filled at the end: ms, busy_cycles, load (0 to 1), exceptions."""
        before = self.cycles(clear=True)
        result = {}
        yield result
        after = self.cycles()
        ns = after["ns"] - before["ns"]
        result["ms"] = ns / 1e6
        result["busy_cycles"] = after["busy"] - before["busy"]
        result["load"] = 1 - (after["idle_ns"] - before["idle_ns"]) / ns if ns else 0.0
        result["xip_misses"] = after["xip_misses"] - before["xip_misses"]
        result["exceptions"] = after["exceptions"]

    # ------------------------------------------------------------ serial ports

    def read(self, port):
        """Return the bytes that have come out of a serial port since the last call."""
        now = self._now
        if now and not now["unread"][port]:
            return b""
        return base64.b64decode(self.cmd("read", port=port)["data"])

    def serial(self, port=0, timeout=1.0):
        """Return a pyserial-like object on the control connection; works in lockstep."""
        return Serial(self, port, timeout)

    def tcp_serial(self, port=0, **kwargs):
        """Return a real pyserial object on the TCP port; needs free running."""
        import serial

        return serial.serial_for_url(f"socket://127.0.0.1:{self.tcp_ports[port]}", **kwargs)

    def repl(self, port=0):
        return Repl(self.serial(port))

    @contextlib.contextmanager
    def pty(self, port=0):
        """Provide a pseudo terminal for the serial port, for programs that want a device path."""
        bridge = PtyBridge(self.tcp_ports[port])
        try:
            yield bridge.path
        finally:
            bridge.close()
