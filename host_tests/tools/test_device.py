"""A board on the REPL that cannot be reached, or does not come up."""

import pytest

from framestep_tools import device, restart
from framestep_tools.device import DeviceError


@pytest.fixture(autouse=True)
def no_ports(monkeypatch):
    monkeypatch.setattr("serial.tools.list_ports.comports", list)


def test_a_port_that_cannot_be_opened():
    with pytest.raises(DeviceError, match="cannot open /dev/not-there"):
        device.Device("/dev/not-there").connect()


def test_a_board_that_does_not_come_up(monkeypatch):
    monkeypatch.setattr(restart, "_START_S", 0.0)
    monkeypatch.setattr(restart, "_LOOK_S", 0.0)
    for protocol, count, why in ((None, 2, "no port named framestep DMC"), ("/dev/none", 2, "cannot open /dev/none")):
        with pytest.raises(DeviceError, match=f"does not come up .*{why}.* mpremote connect /dev/x1 exec"):
            restart.hello("/dev/x1", protocol, count)
    with pytest.raises(DeviceError, match="cannot open /dev/x1"):
        restart.hello("/dev/x1", "/dev/none", 1)
