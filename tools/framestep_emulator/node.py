"""The process that emulates a board, and a pool of processes for one board after another."""

import atexit
import contextlib
import json
import os
import socket
import subprocess
import threading
from pathlib import Path

from .errors import EmulatorError

_SCRIPT = Path(__file__).resolve().parent / "board" / "emu.mjs"


class Node:
    """A process and its control connection."""

    def __init__(self, *arguments):
        command = ["node", _SCRIPT, "--ctl", "0", "--exit-with-stdin", *arguments]
        # If this process is killed, its closed standard input ends the emulator.
        self.process = subprocess.Popen(
            list(map(os.fspath, command)), stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self.kept = set()  # names of its kept states
        self.in_step = True  # each command has been answered
        self.now = None  # in lockstep: the time, and how much there is to read
        self._ctl = None
        self._lock = threading.Lock()
        atexit.register(self.close)
        try:
            line = self.process.stdout.readline()
            if not line:
                raise EmulatorError(
                    f"the emulator did not start (exit status {self.process.wait()})"
                )
            ready = json.loads(line)
            self.tcp_ports = (ready["tcp"], ready["tcp2"])
            self._ctl = socket.create_connection(("127.0.0.1", ready["ctl"]))
            self._ctl.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._ctl_file = self._ctl.makefile("rwb")
        except BaseException:
            self.close()
            raise

    def cmd(self, name, /, **arguments):
        """Send a control command and return its answer."""
        with self._lock:
            self.in_step = False
            self._ctl_file.write(json.dumps({"cmd": name, **arguments}).encode() + b"\n")
            self._ctl_file.flush()
            line = self._ctl_file.readline()
            if not line:
                raise EmulatorError("the emulator has ended")
            self.in_step = True
        answer = json.loads(line)
        self.now = answer.pop("now", None)
        if not answer.pop("ok"):
            raise EmulatorError(f"{name}: {answer['error']}")
        return answer

    def keep(self, name):
        """Keep the board's whole state under this name."""
        self.cmd("keep", name=name)
        self.kept.add(name)

    def rewind(self, name):
        """Restore the state of this name. Return whether there is one."""
        return name in self.kept and self.cmd("rewind", name=name)["known"]

    def close(self):
        """End the process."""
        atexit.unregister(self.close)
        with contextlib.suppress(Exception):
            if self._ctl:
                self._ctl.settimeout(5)
                self.cmd("quit")
        with contextlib.suppress(Exception):
            self.process.stdin.close()
        try:
            self.process.wait(5)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()
        if self._ctl:
            self._ctl_file.close()
            self._ctl.close()


class Pool:
    """Processes that boards no longer use. The next board takes one over; if it has had a board
    with the same files, that one is booted already."""

    LARGEST = 3  # waiting processes

    def __init__(self):
        self.idle = []  # [its arguments, process], the one used last at the end
        self.failures = 0

    def take(self, arguments, state):
        """Return a process that was started with these arguments, preferably one with this state;
        None if there is none."""
        fitting = [entry for entry in reversed(self.idle) if entry[0] == arguments]
        if not fitting:
            return None
        entry = next((entry for entry in fitting if state in entry[1].kept), fitting[0])
        self.idle.remove(entry)
        return entry[1]

    def give(self, arguments, node, failures):
        """Take back a process. failures: the pool's count when the board got it."""
        if failures != self.failures or not node.in_step:
            node.close()
            return
        node.cmd("mode", lockstep=True)  # an unused board runs no further
        self.idle.append((arguments, node))
        if len(self.idle) > self.LARGEST:
            self.idle.pop(0)[1].close()

    def fail(self):
        """Note a failure: no present process is used by another board."""
        self.failures += 1
        self.close()

    def close(self):
        """End the waiting processes."""
        while self.idle:
            self.idle.pop()[1].close()
