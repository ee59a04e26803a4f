"""Which of the computer's serial ports are a board's, and for what. The ports are made up, as pyserial lists them."""

from types import SimpleNamespace

import pytest

from framestep_tools import device, restart
from framestep_tools.device import DeviceError, find_protocol, find_repl


def port(path, number="A", interface="Board CDC", vid=0x2E8A, maker="MicroPython"):
    return SimpleNamespace(
        device=path, serial_number=number, interface=interface, vid=vid, manufacturer=maker, location=f"1-1:{path[-1]}"
    )


@pytest.fixture
def ports(monkeypatch):
    there = []
    monkeypatch.setattr(device.list_ports, "comports", lambda: list(there))
    return there


def test_the_only_board(ports):
    ports += [port("/dev/x0", None, None, 0x0403, "FTDI"), port("/dev/x2", interface="framestep DMC"), port("/dev/x1")]
    assert find_repl() == "/dev/x1"
    assert find_protocol("/dev/x1") == "/dev/x2"


def test_ports_that_the_system_does_not_name(ports):
    ports += [port("COM4", interface=None, maker="Microsoft"), port("COM5", interface=None, maker="Microsoft")]
    assert find_repl() == "COM4"
    assert find_protocol("COM4") == "COM5"


def test_a_board_of_another_maker(ports):
    ports += [port("/dev/x1", vid=0x1B4F)]
    assert find_repl() == "/dev/x1"
    assert find_protocol("/dev/x1") is None


def test_several_boards(ports):
    ports += [port("/dev/x1"), port("/dev/x2", interface="framestep DMC"), port("/dev/x3", "B")]
    with pytest.raises(DeviceError, match="there are 2 boards: name the port of one of them, /dev/x1 or /dev/x3"):
        find_repl()
    assert find_protocol("/dev/x1") == "/dev/x2"
    assert find_protocol("/dev/x3") is None, "the other board's is not taken"


def test_no_board(ports):
    ports += [port("/dev/x0", None, None, 0x0403, "FTDI")]
    with pytest.raises(DeviceError, match=r"no board with MicroPython is on USB: .*micropython.org/download"):
        find_repl()
    assert find_protocol("/dev/x0") is None


def test_a_link_to_a_port(ports, tmp_path):
    real, link = tmp_path / "x1", tmp_path / "by-id"
    real.touch()
    link.symlink_to(real)
    ports += [port(str(real)), port("/dev/x2", interface="framestep DMC")]
    assert find_protocol(str(link)) == "/dev/x2"


def test_a_port_that_cannot_be_opened(ports):
    with pytest.raises(DeviceError, match="cannot open /dev/not-there"):
        device.Device("/dev/not-there").connect()


def test_a_board_that_does_not_come_up(ports, monkeypatch):
    monkeypatch.setattr(restart, "_START_S", 0.0)
    monkeypatch.setattr(restart, "_LOOK_S", 0.0)
    for protocol, count, why in ((None, 2, "no port named framestep DMC"), ("/dev/none", 2, "cannot open /dev/none")):
        with pytest.raises(DeviceError, match=f"does not come up .*{why}.* mpremote connect /dev/x1 exec"):
            restart.hello("/dev/x1", protocol, count)
    with pytest.raises(DeviceError, match="cannot open /dev/x1"):
        restart.hello("/dev/x1", "/dev/none", 1)
