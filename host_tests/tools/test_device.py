"""A board on the REPL that cannot be reached, or does not come up."""

import os
import time
import tty

import pytest

from framestep_tools import device, restart
from framestep_tools.device import DeviceError


@pytest.fixture(autouse=True)
def no_ports(monkeypatch):
    monkeypatch.setattr("serial.tools.list_ports.comports", list)


def test_a_port_that_cannot_be_opened():
    with pytest.raises(DeviceError, match="cannot open /dev/not-there"):
        device.Device("/dev/not-there").connect()


def test_a_terminal_that_says_nothing_is_left_in_time():
    """What was sent to a board that restarts is lost at a pseudo-terminal, which stays: so it is asked again soon."""
    master, slave = os.openpty()
    try:
        tty.setraw(slave)
        silent = device.Device(os.ttyname(slave))
        silent._open()
        begun = time.monotonic()
        with pytest.raises(DeviceError, match="does not answer"):
            silent._enter(0.5)
        assert time.monotonic() - begun < device._READ_S / 2
        silent.close()
    finally:
        os.close(master)
        os.close(slave)


def test_a_board_that_does_not_come_up(monkeypatch):
    monkeypatch.setattr(restart, "_START_S", 0.0)
    monkeypatch.setattr(restart, "_LOOK_S", 0.0)
    for protocol, count, why in ((None, 2, "no port named framestep DMC"), ("/dev/none", 2, "cannot open /dev/none")):
        with pytest.raises(DeviceError, match=f"does not come up .*{why}.* mpremote connect /dev/x1 exec"):
            restart.hello("/dev/x1", protocol, count)
    with pytest.raises(DeviceError, match="cannot open /dev/x1"):
        restart.hello("/dev/x1", "/dev/none", 1)
