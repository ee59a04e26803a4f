"""A board on the REPL that cannot be reached, or does not start."""

import os
import time
import tty
from types import SimpleNamespace

import pytest
from mpremote.transport import TransportError

from framestep_tools.board import repl_device, restart
from framestep_tools.board.repl_device import Device, DeviceError


@pytest.fixture(autouse=True)
def no_ports(monkeypatch):
    monkeypatch.setattr("serial.tools.list_ports.comports", list)


def test_a_port_that_cannot_be_opened():
    with pytest.raises(DeviceError, match="cannot open /dev/not-there"):
        repl_device.Device("/dev/not-there").connect()


def test_a_terminal_that_says_nothing_is_left_in_time():
    """A pseudo-terminal stays while a board restarts, and bytes sent are lost: so the tool soon
    asks again."""
    master, slave = os.openpty()
    try:
        tty.setraw(slave)
        silent = repl_device.Device(os.ttyname(slave))
        silent._open()
        begun = time.monotonic()
        with pytest.raises(DeviceError, match="does not answer"):
            silent._enter(0.5)
        assert time.monotonic() - begun < repl_device._READ_S / 2
        silent.close()
    finally:
        os.close(master)
        os.close(slave)


class HalfSent:
    """A transport whose first script is interrupted half-way: the REPL takes no other one before it
    has been entered again."""

    def __init__(self):
        self.serial = SimpleNamespace(timeout=1)
        self.ready = True

    def exec(self, script):
        if not self.ready:
            raise TransportError("could not exec command")
        self.ready = script != "interrupted"
        if not self.ready:
            raise KeyboardInterrupt
        return b"run"

    def enter_raw_repl(self, **_):
        self.ready = True


def test_scripts_can_be_run_after_ctrl_c():
    device = repl_device.Device("/dev/half")
    device._transport = HalfSent()
    with pytest.raises(KeyboardInterrupt):
        device.run("interrupted")
    assert device.run("put back") == "run"


class Deaf(HalfSent):
    """A transport whose board ignores the first `drops` attempts."""

    def __init__(self, drops):
        super().__init__()
        self.drops = drops

    def enter_raw_repl(self, **_):
        self.drops -= 1
        if self.drops >= 0:
            raise TransportError("could not enter raw repl")


def test_a_board_that_does_not_react_is_asked_again():
    device = repl_device.Device("/dev/deaf")
    device._transport = Deaf(drops=1)
    device._enter()
    assert device._transport.serial.timeout == repl_device._READ_S
    device._transport = Deaf(drops=2)
    with pytest.raises(DeviceError, match="does not answer"):
        device._enter()


def test_a_board_that_does_not_come_up(monkeypatch):
    monkeypatch.setattr(restart, "_START_S", 0.0)
    monkeypatch.setattr(restart, "_LOOK_S", 0.0)
    for protocol, count, why in (
        (None, 2, "no port named framestep DMC"),
        ("/dev/none", 2, "cannot open /dev/none"),
    ):
        with pytest.raises(
            DeviceError, match=f"does not come up .*{why}.* mpremote connect /dev/x1 exec"
        ):
            restart.hello("/dev/x1", protocol, count)
    with pytest.raises(DeviceError, match="cannot open /dev/x1"):
        restart.hello("/dev/x1", "/dev/none", 1)


def test_a_board_with_little_memory_gets_smaller_pieces(monkeypatch):
    scripts = []

    def run(device, script):
        scripts.append(script)
        if "DeflateIO" in script:  # it needs its own piece
            raise DeviceError("the board reported an error: MemoryError")
        return ""

    monkeypatch.setattr(Device, "run", run)
    silent = Device.__new__(Device)
    silent.write("x.bin", bytes(1200))
    pieces = [script for script in scripts if script.startswith("w(")]
    assert len(pieces) == 10
    assert max(map(len, pieces)) < 300

    def full(device, script):
        raise DeviceError("OSError: 28")

    monkeypatch.setattr(Device, "run", full)
    with pytest.raises(DeviceError, match=r"cannot write x\.bin to the board: OSError: 28"):
        silent.write("x.bin", b"")
