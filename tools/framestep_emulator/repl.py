"""MicroPython's raw REPL."""

import ast
import time

from .errors import EmulatorError, ReplError


class Repl:
    """MicroPython's raw REPL over a serial port."""

    def __init__(self, serial):
        self.serial = serial
        self.raw = False

    def expect(self, text, seconds=5.0):
        """Read up to and including text. Raises EmulatorError if it does not come in time."""
        self.serial.timeout = seconds
        data = self.serial.read_until(text)
        if not data.endswith(text):
            raise EmulatorError(f"expected {text!r}, got {data[-400:]!r}")
        return data

    def enter(self):
        """Stop whatever runs and go to the raw REPL."""
        self.serial.write(b"\r\x03\x03")
        if self.serial.emu.lockstep:
            self.serial.emu.advance(20)
        else:
            time.sleep(0.1)
        self.serial.reset_input_buffer()
        self.serial.write(b"\r\x01")
        self.expect(b"raw REPL; CTRL-B to exit\r\n>")
        self.raw = True

    def leave(self):
        self.serial.write(b"\r\x02")
        self.expect(b">>> ")
        self.raw = False

    def unasked(self, ms=150):
        """Return what the board prints at the friendly prompt by itself."""
        if self.raw:
            self.serial.write(b"\r\x02")
            self.raw = False
        self.serial.emu.advance(ms)
        lines = self.serial.read_all().decode(errors="replace").replace(">>> ", "").splitlines()
        banner = ("MicroPython v", 'Type "help()"')
        return "".join(f"{line}\n" for line in lines if line and not line.startswith(banner))

    def start(self, code, until=None):
        """Send code and return once the board runs it, or once it has printed the line `until`.

        Code that reads serial data prints such a line when it is ready for them, as compiling takes
        a while.
        """
        if not self.raw:
            self.enter()
        self.serial.write(code.encode() if isinstance(code, str) else code)
        self.serial.write(b"\x04")
        self.expect(b"OK", 30.0)
        if until is not None:
            self.expect(until.encode() + b"\r\n")

    def finish(self, timeout=60.0):
        """Wait for the code of start() to end. Return what it printed."""
        out = self.expect(b"\x04", timeout)[:-1]
        err = self.expect(b"\x04")[:-1]
        self.expect(b">")
        if err:
            raise ReplError(err.decode(errors="replace"))
        return out.decode(errors="replace").replace("\r\n", "\n")

    def exec(self, code, timeout=60.0):
        """Run code and return what it printed. Raises ReplError if it raised."""
        self.start(code)
        return self.finish(timeout)

    def eval(self, expression, timeout=60.0):
        return ast.literal_eval(self.exec(f"print(repr({expression}))", timeout).strip())

    def soft_reset(self, timeout=10.0):
        """Soft reset; boot.py and main.py run, then the friendly REPL comes up."""
        if self.raw:
            self.leave()
        self.serial.write(b"\x04")
        out = self.expect(b">>> ", timeout)
        self.raw = False
        return out.decode(errors="replace")
