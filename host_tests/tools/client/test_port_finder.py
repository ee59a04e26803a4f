"""Which of the computer's serial ports belong to a board, and their purpose, from records as
pyserial 3.5 makes them.

Linux: list_ports_linux.py, location is the interface's folder in /sys. Windows:
list_ports_windows.py, location ends with the number from &MI_02 of the instance's ID; names come
from Windows. macOS: list_ports_osx.py, location is the device's, and interface the first name found
there, so the same for both ports; the number is in /dev/cu.usbmodem….
"""

from types import SimpleNamespace

import pytest

from framestep_tools import cli
from framestep_tools.client import port_finder
from framestep_tools.client.port_finder import PROTOCOL, REPL, SINGLE, PortError

SERIAL = "E6614C775B5A4B2D"


def record(
    device, location, serial=SERIAL, vid=0x2E8A, pid=5, maker=None, product=None, interface=None
):
    hwid = f"USB VID:PID={vid:04X}:{pid:04X} SER={serial} LOCATION={location}" if vid else "n/a"
    return SimpleNamespace(
        device=device, location=location, hwid=hwid, serial_number=serial, vid=vid, pid=pid,
        manufacturer=maker, product=product, interface=interface, description=product or "n/a",
    )  # fmt: skip


def linux(device, number, bus="1-1.2", serial=SERIAL, name=""):
    return record(
        device, f"{bus}:1.{number}", serial, maker="MicroPython", product="Board in FS mode",
        interface=name,
    )  # fmt: skip


def windows(device, number, bus="1-2", serial=SERIAL):
    found = record(device, f"{bus}:x.{number}", serial, maker="Microsoft")
    found.description = f"USB Serial Device ({device})"
    return found


def macos(device, location="20-2", serial=SERIAL):
    return record(
        device, location, serial, maker="MicroPython", product="framestep",
        interface="framestep DMC",
    )  # fmt: skip


MAC = "/dev/cu.usbmodem"
# (the protocol's port, the REPL's): the finder gets them in this order and in the other one
BOARDS = {
    "Linux": (
        linux("/dev/ttyACM1", 2, name="framestep DMC"),
        linux("/dev/ttyACM0", 0, name="Board CDC"),
    ),
    "Linux, the other way round": (
        linux("/dev/ttyACM0", 2, name="framestep DMC"),
        linux("/dev/ttyACM1", 0),
    ),
    "Linux, without names": (linux("/dev/ttyACM3", 2), linux("/dev/ttyACM9", 0)),
    "Windows": (windows("COM5", 2), windows("COM4", 0)),
    "Windows, the other way round": (windows("COM3", 2), windows("COM11", 0)),
    "Windows, no serial number": (
        windows("COM3", 2, serial=None),
        windows("COM11", 0, serial=None),
    ),
    "macOS": (macos(f"{MAC}2023"), macos(f"{MAC}2021")),
    "macOS, by serial number": (macos(f"{MAC}{SERIAL}3"), macos(f"{MAC}{SERIAL}1")),
    "nothing told": (record("COM5", None), record("COM4", None)),
}
OTHERS = [
    record("/dev/ttyS0", None, None, None, None),
    record("/dev/ttyUSB0", "1-4", "A50285BI", 0x0403, 0x6001, "FTDI", "FT232R USB UART"),
    record("/dev/cu.Bluetooth-Incoming-Port", None, None, None, None),
    record(
        "/dev/ttyACM7", "1-3:1.1", "E66", 0x2E8A, 0x000C, "Raspberry Pi", "Debug Probe (CMSIS-DAP)"
    ),
]


@pytest.fixture
def there(monkeypatch):
    found = []
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: list(found))
    return found


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("system", BOARDS)
def test_the_only_board(there, system, order):
    there += [*OTHERS, *BOARDS[system][::order]]
    right, wrong = (found.device for found in BOARDS[system])
    assert port_finder.protocol_port() == right
    assert port_finder.repl_port() == wrong
    assert port_finder.protocol_of(wrong) == right
    assert port_finder.is_repl(wrong)
    assert not port_finder.is_repl(right)


def test_several_boards(there):
    there += [*BOARDS["Windows"], windows("COM8", 2, "1-3", "B"), windows("COM7", 0, "1-3", "B")]
    with pytest.raises(
        PortError, match="there are 2 boards: name the port of one of them, COM5 or COM8"
    ):
        port_finder.protocol_port()
    with pytest.raises(PortError, match="COM4 or COM7"):
        port_finder.repl_port()
    assert port_finder.protocol_of("COM4") == "COM5"
    assert port_finder.protocol_of("COM7") == "COM8"


def test_one_port(there):
    there += [record("/dev/ttyACM0", "1-1", maker="MicroPython", product="Board in FS mode")]
    assert port_finder.repl_port() == "/dev/ttyACM0"
    assert not port_finder.is_repl("/dev/ttyACM0"), "the protocol may be there"
    with pytest.raises(
        PortError, match=r'shows one port only: .*"ports": 1, then name .*--device /dev/ttyACM0'
    ):
        port_finder.protocol_port()
    assert [p.use for p in port_finder.listed()] == [SINGLE]


def test_no_board(there):
    there += OTHERS
    with pytest.raises(PortError, match="no board with framestep is on USB"):
        port_finder.protocol_port()
    with pytest.raises(PortError, match="no board with MicroPython is on USB"):
        port_finder.repl_port()
    assert port_finder.protocol_of("/dev/ttyUSB0") is None
    assert not port_finder.is_repl("/dev/ttyUSB0")


def test_another_makers_board(there):
    there += [
        record("/dev/ttyACM0", "1-1:1.0", vid=0x1B4F, pid=0x0025, maker="MicroPython"),
        record(
            "/dev/ttyACM1", "1-1:1.2", vid=0x1B4F, pid=0x0025, maker="MicroPython",
            interface="framestep DMC",
        ),
    ]  # fmt: skip
    assert port_finder.protocol_port() == "/dev/ttyACM1"


def test_a_link_to_a_port(there, tmp_path):
    real, link = tmp_path / "x1", tmp_path / "by-id"
    real.touch()
    link.symlink_to(real)
    there += [linux(str(real), 0), linux("/dev/x2", 2)]
    assert port_finder.protocol_of(str(link)) == "/dev/x2"
    assert port_finder.is_repl(str(link))


def test_a_rate_in_the_name(there, tmp_path):
    """PORT@RATE, unless there is a port of that name."""
    assert port_finder.split_rate("/dev/ttyUSB0@460800") == ("/dev/ttyUSB0", 460800)
    assert port_finder.split_rate("COM7") == ("COM7", 115200)
    assert port_finder.split_rate("/dev/tty@usb") == ("/dev/tty@usb", 115200)
    odd = tmp_path / "port@9600"
    odd.touch()
    assert port_finder.split_rate(str(odd)) == (str(odd), 115200)
    assert port_finder.at_rate("COM7@460800", 921600) == "COM7@921600"
    assert port_finder.at_rate("COM7@460800", 115200) == "COM7"


def test_the_list(there, capsys):
    there += [*OTHERS, *BOARDS["Windows"]]
    assert cli.app.status(["ports"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("COM4  MicroPython's REPL")
    assert second.startswith("COM5  framestep DMC: the port for")
    assert cli.app.status(["ports", "--json", "--all"]) == 0
    said = capsys.readouterr().out
    assert f'"port": "COM5", "use": "{PROTOCOL}"' in said
    assert f'"use": "{REPL}"' in said
    assert "FT232R" in said
    there.clear()
    assert cli.app.status(["ports"]) == 3
    assert "no board with MicroPython is on USB: put framestep on one" in capsys.readouterr().err
    assert cli.app.status(["ports", "--json"]) == 3
    assert capsys.readouterr().out == "[]\n"


def test_the_repl_named_by_mistake_is_not_even_opened(there, capsys):
    there += BOARDS["Windows"]
    assert cli.app.status(["status", "COM4"]) == 5
    said = capsys.readouterr().err
    assert "COM4 is the REPL of its board; the protocol's port is COM5" in said


S3 = {"vid": 0x303A, "pid": 0x4001}
BRIDGE = record("/dev/ttyUSB0", "1-4", "5A46", 0x1A86, 0x55D3, "wch.cn", "USB Single Serial")


def s3(name="framestep DMC"):
    """The two ports of an ESP32-S3, on Linux or, without the name, on Windows."""
    return [
        record("/dev/ttyACM0", "1-1:1.0", maker="MicroPython", interface="Board CDC", **S3),
        record("/dev/ttyACM1", "1-1:1.2", maker="MicroPython", interface=name, **S3),
    ]


@pytest.mark.parametrize("name", ["framestep DMC", None])
def test_an_esp32_s3(there, name):
    """Its ports are found like a Pico's; the REPL's is the one to install through."""
    there += [*OTHERS[:1], *s3(name)]
    assert port_finder.protocol_port() == "/dev/ttyACM1"
    assert port_finder.repl_port() == port_finder.esp32_port() == "/dev/ttyACM0"
    assert [port.foreground for port in port_finder.siblings("/dev/ttyACM0")] == [True, True]
    assert port_finder.protocol_behind("/dev/ttyACM0") == "/dev/ttyACM1"


def test_an_esp32_s3_with_micropython_only(there):
    there += [record("/dev/ttyACM0", "1-1:1.0", maker="Espressif Systems", **S3)]
    assert port_finder.repl_port() == port_finder.esp32_port() == "/dev/ttyACM0"
    assert port_finder.protocol_behind("/dev/ttyACM0") is None


def test_the_port_behind_a_bridge(there):
    """The bridge to a board's UART does not show which board that is."""
    there += [BRIDGE, *s3()]
    assert port_finder.protocol_behind("/dev/ttyUSB0") == "/dev/ttyACM1"
    there += [
        record("/dev/ttyACM8", "1-2:1.0", "B", **S3),
        record("/dev/ttyACM9", "1-2:1.2", "B", **S3),
    ]
    assert port_finder.protocol_behind("/dev/ttyUSB0") is None
    assert not port_finder.listed([record("/dev/ttyACM0", "1-1", vid=0x303A, pid=0x1001)])[0].board
