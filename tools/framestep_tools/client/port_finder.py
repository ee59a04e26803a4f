"""Find boards' serial ports, and the purpose of each, from the system's description of them.

This opens no port. A board with framestep has two ports, each with two USB interfaces: the REPL's
begins with interface 0, the protocol's with interface 2. Systems give that number in different
places (with pyserial 3.5):

* Linux: at the end of `location`, 1-1.2:1.2; the interface's name is in `interface` as well.
* Windows: at the end of `location` and so of `hwid`, LOCATION=1-2:x.2; names of interfaces are
  missing.
* macOS: in the device's name, which ends with the number of the port's second interface
  (…usbmodem…3 is 2); `location` and `interface` are the same for both ports, the latter one of the
  two names.
"""

import os
import re
from collections.abc import Iterable
from typing import Any, NamedTuple

from ..errors import NO_PORT, ToolError

PROTOCOL_PORT = "framestep DMC"  # the name that the firmware gives it (hal/ports/usb_port.py)
PROTOCOL, REPL, SINGLE, OTHER = "protocol", "REPL", "single", "other"
BAUD = 115200  # of a board whose port is a UART, unless its rig file says otherwise; USB ignores it
_RASPBERRY_PI = 0x2E8A  # USB vendor of MicroPython on RP2040 and RP2350
# USB vendors of an ESP32 board: Espressif, or of the bridge to its UART Silicon Labs, WCH, FTDI
_ESPRESSIF = 0x303A
_ESP32 = (_ESPRESSIF, 0x10C4, 0x1A86, 0x0403)
_MICROPYTHON_S3 = 0x4001  # its USB product on an ESP32-S3; the chip's own loader has another one
_NOT_MICROPYTHON = (0x0003, 0x0004, 0x000C, 0x000F)  # its BOOTSEL drives and debug probes
_INTERFACE = re.compile(r":(?:x|\d+)\.(\d+)$")
_MAC = re.compile(r"usbmodem.*?(\d{1,2})$")
GET = (
    "put framestep on one (framestep install; or hold BOOTSEL while plugging it in, and drop the "
    ".uf2 onto the drive that appears), take a cable that carries data, or name a port; "
    "without a board, framestep console --demo shows a simulated rig"
)


def split_rate(path: str) -> tuple[str, int]:
    """Return a serial port's path and rate: PORT@460800 is PORT at 460 800 baud."""
    name, sign, digits = path.rpartition("@")
    if sign and digits.isdecimal() and not os.path.exists(path):
        return name, int(digits)
    return path, BAUD


def at_rate(path: str, baud: int) -> str:
    """Return a serial port's path with another rate."""
    name = split_rate(path)[0]
    return name if baud == BAUD else f"{name}@{baud}"


class PortError(ToolError):
    """There is no such port, or more than one matches. The text lists the ports."""

    status = NO_PORT


class Port(NamedTuple):
    """A serial port. `board` is equal for the ports of one board; `use` is PROTOCOL, REPL, SINGLE
    or OTHER. foreground: framestep's passes end before somebody gets to the REPL."""

    path: str
    use: str
    board: str
    product: str
    serial: str
    interface: int | None
    foreground: bool = False


def interface_number(record: Any) -> int | None:
    """Return the number of a port's first USB interface, or None if the system does not know it."""
    for text in (record.location, getattr(record, "hwid", None)):
        if found := _INTERFACE.search(text or ""):
            return int(found[1])
    if found := _MAC.search(record.device):
        name, serial = os.path.basename(record.device), record.serial_number or ""
        at = name.rfind(serial) if serial else -1
        digits = name[at + len(serial) :] if at >= 0 else found[1][-1]
        return int(digits) - 1 if digits.isdigit() and int(digits) % 2 else None
    return None


def is_board(record: Any) -> bool:
    """Return whether a board with MicroPython is behind a port."""
    if record.manufacturer == "MicroPython" or record.interface == PROTOCOL_PORT:
        return True
    if _is_s3(record):
        return True
    return record.vid == _RASPBERRY_PI and getattr(record, "pid", None) not in _NOT_MICROPYTHON


def _is_s3(record: Any) -> bool:
    return record.vid == _ESPRESSIF and getattr(record, "pid", None) == _MICROPYTHON_S3


def _board_of(record: Any) -> str:
    return record.serial_number or _INTERFACE.sub("", record.location or "") or record.device


def _uses(records: list[Any]) -> list[str]:
    """Return the use of each port of one board."""
    if len(records) == 1:
        return [PROTOCOL if records[0].interface == PROTOCOL_PORT else SINGLE]
    named = [r.interface == PROTOCOL_PORT for r in records]
    if any(named) and not all(named):
        return [PROTOCOL if is_it else REPL for is_it in named]
    numbers = [interface_number(r) for r in records]
    if None in numbers or len(set(numbers)) < len(numbers):  # then the order of their names decides
        numbers = list(range(len(records)))
    repl = min(n for n in numbers if n is not None)
    return [REPL if n == repl else PROTOCOL for n in numbers]


def listed(records: Iterable[Any] | None = None) -> list[Port]:
    """List every serial port, boards' ports first. records: from
    serial.tools.list_ports.comports."""
    if records is None:
        from serial.tools import list_ports

        records = list_ports.comports()
    everything = sorted(
        records, key=lambda r: [int(x) if x.isdigit() else x for x in re.split(r"(\d+)", r.device)]
    )
    boards: dict[str, list[Any]] = {}
    for record in everything:
        if is_board(record):
            boards.setdefault(_board_of(record), []).append(record)
    found = []
    for board, mine in boards.items():
        for record, use in zip(mine, _uses(mine), strict=True):
            found.append(_port(record, use, board))
    return found + [_port(record, OTHER, "") for record in everything if not is_board(record)]


def _port(record: Any, use: str, board: str) -> Port:
    product = getattr(record, "product", None) or getattr(record, "description", None) or ""
    return Port(
        record.device,
        use,
        board,
        product,
        record.serial_number or "",
        interface_number(record),
        _is_s3(record),
    )


def _same(port: Port, path: str) -> bool:
    path = split_rate(path)[0]
    # it may be a link, such as in /dev/serial/by-id
    return port.path in (path, os.path.realpath(path))


def known(path: str) -> Port | None:
    """Return the system's entry for a path, or None if it is not a serial port."""
    return next((port for port in listed() if _same(port, path)), None)


def siblings(path: str) -> list[Port]:
    """Return all ports of the board with this port, or none if it is not a board's."""
    ports = listed()
    board = next((port.board for port in ports if _same(port, path)), "")
    return [port for port in ports if board and port.board == board]


def _only(ports: list[Port], what: str) -> str:
    if len(ports) > 1:
        raise PortError(
            f"there are {len(ports)} boards: name the port of one of them, "
            f"{' or '.join(p.path for p in ports)}"
        )
    if not ports:
        raise PortError(f"no board with {what} is on USB: {GET}")
    return ports[0].path


def protocol_port() -> str:
    """Return the protocol's port of the only board. Raises PortError for none or several."""
    ports = [port for port in listed() if port.use != OTHER]
    found = [port for port in ports if port.use == PROTOCOL]
    if not found and ports:
        raise PortError(
            f"the board on {ports[0].path} shows one port only: "
            "framestep is not running there (the REPL says why), "
            f'or its rig file says "ports": 1, then name the port: --device {ports[0].path}'
        )
    return _only(found, "framestep")


def repl_port() -> str:
    """Return the REPL's port of the only board. Raises PortError for none or several."""
    return _only([port for port in listed() if port.use in (REPL, SINGLE)], "MicroPython")


def esp32_port(records: Iterable[Any] | None = None) -> str:
    """Return the only port that may be an ESP32's. Raises PortError for none or several. records:
    from serial.tools.list_ports.comports."""
    if records is None:
        from serial.tools import list_ports

        records = list_ports.comports()
    mine = [record for record in records if record.vid in _ESP32]
    protocols = [port.path for port in listed(filter(_is_s3, mine)) if port.use == PROTOCOL]
    found = [record.device for record in mine if record.device not in protocols]
    if len(found) == 1:
        return found[0]
    if found:
        raise PortError(f"there are several: name the port, --port {' or '.join(sorted(found))}")
    raise PortError(
        "no ESP32 is on USB: take a cable that carries data, install the driver of the board's "
        "USB bridge, or name the port: --port PORT"
    )


def protocol_of(path: str) -> str | None:
    """Return the protocol's port of the board with this port, or None while it has no separate
    one."""
    return next((port.path for port in siblings(path) if port.use == PROTOCOL), None)


def protocol_behind(path: str) -> str | None:
    """Return the protocol's port of the board with this port. If this is the bridge to a UART of
    the board, it is the only one with framestep on an ESP32's USB."""
    port = known(path)
    if port and port.use != OTHER:
        return protocol_of(path)
    found = [port.path for port in listed() if port.use == PROTOCOL and port.foreground]
    return found[0] if len(found) == 1 else None


def is_repl(path: str) -> bool:
    """Return whether this is the REPL's port of a board with a separate one for the protocol."""
    return any(port.use == REPL and _same(port, path) for port in siblings(path))
