"""The board's USB serial ports, for clients."""

import base64
import contextlib
import os
import select
import socket
import threading
import time
import tty

from .errors import EmulatorError


class Serial:
    """The part of pyserial's interface that clients use; timeouts are in virtual seconds."""

    POLL_SECONDS = 0.001

    def __init__(self, emu, port=0, timeout=1.0):
        self.emu = emu
        self.port = port
        self.portstr = self.name = f"emu:{port}"
        self.timeout = timeout
        self.write_timeout = None
        self._buffer = bytearray()
        self.is_open = False
        self.open()

    def open(self):
        if not self.is_open:
            self.emu.cmd("open", port=self.port, on=True)
            self.is_open = True

    def close(self):
        if self.is_open:
            self.is_open = False
            with contextlib.suppress(EmulatorError, OSError, ValueError):
                self.emu.cmd("open", port=self.port, on=False)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def dtr(self):
        return self.is_open

    @dtr.setter
    def dtr(self, value):
        self.emu.cmd("open", port=self.port, on=bool(value))

    def clock(self):
        """Return the board's time in seconds, for a Client to count in."""
        return self.emu.ns * 1e-9

    def _fetch(self):
        self._buffer += self.emu.read(self.port)

    @property
    def in_waiting(self):
        self._fetch()
        return len(self._buffer)

    @property
    def out_waiting(self):
        return self.emu.cmd("ports")["ports"][self.port]["queued"]

    def _wait(self, missing, deadline):
        """Let time pass until `missing` more bytes are there. Return False after the deadline."""
        now = self.emu.ns
        if now >= deadline:
            return False
        if self.emu.lockstep:
            self.emu.run_until_ns(
                min(deadline, now + 10**10), until_rx=self.port, min_bytes=missing
            )
        else:
            time.sleep(self.POLL_SECONDS)
        return True

    def _deadline(self):
        """Return the time in ns at which a read that begins now times out."""
        if self.timeout is None:
            return float("inf")
        return self.emu.ns + round(self.timeout * 1e9)

    def read(self, size=1):
        deadline = self._deadline()
        self._fetch()
        while len(self._buffer) < size and self._wait(size - len(self._buffer), deadline):
            self._fetch()
        data = bytes(self._buffer[:size])
        del self._buffer[:size]
        return data

    def read_all(self):
        return self.read(self.in_waiting)

    def read_until(self, expected=b"\n", size=None):
        deadline = self._deadline()
        self._fetch()
        while expected not in self._buffer and (size is None or len(self._buffer) < size):
            if not self._wait(1, deadline):
                break
            self._fetch()
        at = self._buffer.find(expected)
        end = len(self._buffer) if at < 0 else at + len(expected)
        if size is not None:
            end = min(end, size)
        data = bytes(self._buffer[:end])
        del self._buffer[:end]
        return data

    def readline(self):
        return self.read_until(b"\n")

    def write(self, data):
        data = bytes(data)
        self.emu.cmd("write", port=self.port, data=base64.b64encode(data).decode())
        return len(data)

    def flush(self):
        """Wait until the board has taken everything."""
        while self.out_waiting:
            if self.emu.lockstep:
                self.emu.advance(1)
            else:
                time.sleep(self.POLL_SECONDS)

    def hold(self, on=True):
        """Stop reading what the board sends, like a program that has the port open but does not
        read; on=False: read again."""
        self.emu.cmd("hold", port=self.port, on=on)

    def reset_input_buffer(self):
        self._fetch()
        self._buffer.clear()

    def reset_output_buffer(self):
        pass


class PtyBridge:
    """A pseudo terminal copied to and from a TCP port by a thread.

    As with a real port, the board sees an open port (DTR) while a program has the terminal open:
    the TCP connection is made when the first program opens it, and ended when the last one closes
    it.
    """

    _LOOK_MS = 10  # between checks of a terminal that is not open

    def __init__(self, tcp_port):
        self.tcp_port = tcp_port
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        os.close(slave)  # now a hang-up on the master means that nobody has it open
        self.wake_read, self.wake_write = os.pipe()
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.thread.start()

    def _hung_up(self):
        poll = select.poll()
        poll.register(self.master, 0)
        return bool(poll.poll(0))

    def _serve(self):
        while not select.select([self.wake_read], [], [], self._LOOK_MS / 1000)[0]:
            if not self._hung_up():
                with (
                    contextlib.suppress(OSError),
                    socket.create_connection(("127.0.0.1", self.tcp_port)) as connection,
                ):
                    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    self._copy(connection)

    def _copy(self, connection):
        """Copy until the program closes the terminal (OSError from the master), the board's side
        ends, or close()."""
        while True:
            ready, _, _ = select.select([self.master, connection, self.wake_read], [], [])
            if self.wake_read in ready:
                return
            if self.master in ready:
                connection.sendall(os.read(self.master, 4096))
            if connection in ready:
                data = connection.recv(4096)
                if not data:
                    return
                while data:
                    data = data[os.write(self.master, data) :]

    def close(self):
        os.write(self.wake_write, b"x")
        self.thread.join(2)
        for fd in (self.master, self.wake_read, self.wake_write):
            os.close(fd)
