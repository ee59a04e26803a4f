"""mpremote on a pseudo terminal of the board, running freely."""

import os
import random
import subprocess
import sys
import time

import pytest

LIMIT_S = 100


def mpremote(path, *arguments, cwd=None, timeout=300):
    """Return what mpremote printed."""
    command = [sys.executable, "-m", "mpremote", "connect", path, *arguments]
    result = subprocess.run(command, capture_output=True, text=True, timeout=timeout, cwd=cwd)
    assert result.returncode == 0, f"mpremote {arguments}: {result.stdout} {result.stderr}"
    return result.stdout


def test_files_and_resets(emulator, tmp_path):
    """ls, cp, run, soft-reset and reset; files survive resets."""
    emu = emulator(lockstep=False)
    data = random.Random(1).randbytes(20000)
    (tmp_path / "blob.bin").write_bytes(data)
    (tmp_path / "hello.py").write_text("print('hello from a file', 6 * 7)\n")
    with emu.pty() as path:
        emu.wait_usb()
        out = mpremote(path, "fs", "cp", "blob.bin", "hello.py", ":", "+", "fs", "ls", cwd=tmp_path)
        assert "20000 blob.bin" in out
        assert "hello from a file 42" in mpremote(path, "run", "hello.py", cwd=tmp_path)
        assert "hello from a file 42" in mpremote(path, "soft-reset", "exec", "import hello")
        resets = emu.cmd("time")["resets"]
        now = emu.ns
        mpremote(path, "reset")
        emu.wait_usb(after=now)
        assert emu.cmd("time")["resets"] == resets + 1
        now = emu.ns
        emu.reset()  # a power cycle
        emu.wait_usb(after=now)
        mpremote(path, "fs", "cp", ":blob.bin", "back.bin", cwd=tmp_path)
    assert (tmp_path / "back.bin").read_bytes() == data


def test_terminal_opens_and_closes_the_port(emulator):
    """The board sees an open port only while a program has the terminal open."""
    emu = emulator(lockstep=False)

    def wait_open(wanted):
        deadline = time.monotonic() + LIMIT_S
        while emu.cmd("ports")["ports"][0]["open"] != wanted:
            assert time.monotonic() < deadline, f"open is still {not wanted} after {LIMIT_S} s"
            time.sleep(0.01)

    with emu.pty() as path:
        emu.wait_usb()
        for _ in range(3):
            wait_open(False)
            terminal = os.open(path, os.O_RDWR | os.O_NOCTTY)
            wait_open(True)
            os.close(terminal)
        wait_open(False)


MAIN = """
import sys, select, micropython
micropython.kbd_intr({key})
poll = select.poll()
poll.register(sys.stdin, select.POLLIN)
while True:
    if poll.poll(10) and sys.stdin.buffer.read(1) == b"\\x03" and {leave}:
        break
"""


@pytest.mark.parametrize(
    "key, leave, works", [(3, False, True), (-1, False, False), (-1, True, True)]
)
def test_breaking_into_a_program(emulator, key, leave, works):
    """mpremote cannot break into a program that has switched Ctrl-C off, unless the program allows
    it."""
    emu = emulator(files={"/main.py": MAIN.format(key=key, leave=leave)}, lockstep=False)
    with emu.pty() as path:
        emu.wait_usb()
        emu.advance(200)  # until main.py runs
        if works:
            assert "in" in mpremote(path, "exec", "print('in')")
        else:
            with pytest.raises((subprocess.TimeoutExpired, AssertionError)):
                mpremote(path, "exec", "print('in')", timeout=4)
