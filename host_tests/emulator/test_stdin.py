"""Binary data over the builtin USB serial port: what a program can do, and what Ctrl-C does
then."""

import ast
import struct

import pytest

from framestep_emulator import ReplError


def test_poll_then_readinto(emulator):
    """Frames of all byte values, read without blocking for long: poll, then read exactly the bytes
    that must follow."""
    emu = emulator()
    repl = emu.repl()
    repl.start(
        "import sys, select, micropython, time\n"
        "micropython.kbd_intr(-1)\n"
        "poll = select.poll(); poll.register(sys.stdin, select.POLLIN)\n"
        "print('ready')\n"
        "head = bytearray(4); body = bytearray(1100); view = memoryview(body)\n"
        "read = sys.stdin.buffer.readinto\n"
        "seen = idle = 0\n"
        "while seen < 3:\n"
        "    if not poll.poll(0):\n"
        "        idle += 1\n"
        "        continue\n"
        "    read(head)\n"
        "    n = head[2] | head[3] << 8\n"
        "    read(view[:n])\n"
        "    seen += 1\n"
        "    sys.stdout.buffer.write(bytes([seen, sum(view[:n]) & 255]))\n"
        "print(idle > 0)\n",
        until="ready",
    )
    payload = bytes(range(256)) * 4 + b"\x03\x04\x00\x01"
    for i in range(3):
        emu.advance(5)
        repl.serial.write(struct.pack("<BBH", 0xA5, i, len(payload)) + payload)
    emu.advance(50)
    out = repl.finish()
    assert out.encode("latin-1")[:6] == b"".join(
        bytes([i + 1, sum(payload) & 255]) for i in range(3)
    ), repr(out)


def test_readinto_and_ctrl_c(emulator):
    """readinto blocks until its buffer is full; Ctrl-C breaks it only while kbd_intr is not -1."""
    emu = emulator()
    repl = emu.repl()
    repl.start(
        "import sys\nb = bytearray(1000)\nprint('ready')\nprint(sys.stdin.buffer.readinto(b))",
        until="ready",
    )
    repl.serial.write(b"x" * 10)
    emu.advance(200)
    assert repl.serial.in_waiting == 0, "readinto came back early"
    repl.serial.write(b"\x03")
    with pytest.raises(ReplError, match="KeyboardInterrupt"):
        repl.finish(2)
    repl.start(
        "import sys, micropython\nmicropython.kbd_intr(-1)\nb = bytearray(4)\nprint('ready')\n"
        "print(sys.stdin.buffer.readinto(b), b)",
        until="ready",
    )
    repl.serial.write(b"\x03\x03\x03")
    emu.advance(200)
    assert repl.serial.in_waiting == 0, "Ctrl-C got through"
    repl.serial.write(b"\x03")
    assert "4 bytearray" in repl.finish(2), "the fourth byte"
    # after the program the REPL takes Ctrl-C again
    repl.start("print('ready')\nwhile True: pass", until="ready")
    repl.serial.write(b"\x03")
    with pytest.raises(ReplError, match="KeyboardInterrupt"):
        repl.finish(2)


def test_readinto_with_a_time_limit(emulator):
    """os.dupterm with a stream that supplies filler bytes once a deadline has passed."""
    repl = emulator().repl()
    repl.start(
        "import sys, os, io, time, machine, micropython\n"
        "micropython.kbd_intr(-1)\n"
        "class Filler(io.IOBase):\n"
        "    deadline = None\n"
        "    expired = 0\n"
        "    def readinto(self, b):\n"
        "        if self.deadline is None or time.ticks_diff(time.ticks_ms(), self.deadline) < 0:\n"
        "            return None\n"
        "        self.expired += 1\n"
        "        b[0] = 0\n"
        "        return 1\n"
        "    def write(self, b): return len(b)\n"
        "    def ioctl(self, request, argument): return 0\n"
        "filler = Filler()\n"
        "os.dupterm(filler)\n"
        "wake = machine.Timer(period=2, callback=lambda t: None)\n"
        "b = bytearray(64)\n"
        "print('ready')\n"
        "filler.deadline = time.ticks_add(time.ticks_ms(), 30)\n"
        "t = time.ticks_us()\n"
        "n = sys.stdin.buffer.readinto(b)\n"
        "t = time.ticks_diff(time.ticks_us(), t)\n"
        "os.dupterm(None); wake.deinit()\n"
        "print((n - filler.expired, t, bytes(b[:12])))\n",
        until="ready",
    )
    repl.serial.write(b"0123456789")
    count, us, data = ast.literal_eval(repl.finish(3))
    assert count == 10, f"{count} {us} {data}"
    assert us < 40_000, f"{count} {us} {data}"
    assert data == b"0123456789\0\0", f"{count} {us} {data}"
