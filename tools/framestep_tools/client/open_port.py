"""Open a device's port exclusively. An error says in one sentence why that is not possible.

A port has `read`, `write`, `timeout` and `close`, as Client needs. TCP only needs the standard
library, a serial port needs pyserial.
"""

import contextlib
import errno
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from ..errors import NO_PORT, PORT_BUSY, ToolError
from .port_finder import split_rate
from .tcp_port import SCHEME, TcpPort, is_socket

_TAKE_S = 10.0  # a device that accepts nothing for this long is gone


class NoPort(ToolError):
    """There is no such port, or it may not be opened."""

    status = NO_PORT


class PortBusy(ToolError):
    """Another program has the port. `path` is the port's."""

    status = PORT_BUSY

    def __init__(self, path: str, holders: list[str]):
        who = " and ".join(holders) or "another program"
        super().__init__(
            f"{who} has {path} open: end it there first, "
            "the protocol's port is for one program at a time"
        )
        self.path = path


def open_port(url: str, timeout: float) -> Any:
    """Open a device path (with @RATE for another rate than 115 200 baud), socket://HOST:PORT or
    another URL of pyserial. Raises NoPort, PortBusy."""
    if is_socket(url):
        return _open_socket(url, timeout)
    import serial

    try:
        if "://" in url:
            return serial.serial_for_url(url, timeout=timeout)
        url, baud = split_rate(url)
        port = serial.Serial(
            url, baudrate=baud, timeout=timeout, write_timeout=_TAKE_S, exclusive=True
        )
    except (OSError, ValueError) as error:  # SerialException is an OSError
        raise _why(url, error) from error
    except Exception as error:
        if type(error).__name__ != "error":  # termios.error, on systems with termios
            raise
        raise NoPort(f"cannot open {url}: it is not a serial port") from error
    try:
        others = holders(url)
        if others:  # programs that have not opened the port exclusively
            raise PortBusy(url, others)
        _exclude(port, True)
    except BaseException:
        port.close()
        raise
    return port


def close_port(port: Any) -> None:
    """Close a port, whatever its state."""
    with contextlib.suppress(Exception):
        _exclude(port, False)
    with contextlib.suppress(OSError):
        port.close()


def _open_socket(url: str, timeout: float) -> TcpPort:
    try:
        return TcpPort(url, timeout)
    except ValueError:
        raise NoPort(
            f"cannot open {url}: expected {SCHEME}HOST:PORT such as {SCHEME}127.0.0.1:7000"
        ) from None
    except OSError as error:
        why = error.strerror or str(error)
        raise NoPort(f"cannot open {url}: {why}; is the program that offers it running?") from error


def _why(url: str, error: Exception) -> ToolError:
    """Turn pyserial's error into one that says what to do. On Windows the number and the reason are
    only in its text."""
    number = getattr(error, "errno", None)
    text = str(error)
    busy = (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK)
    if number in busy or "exclusively lock" in text or "PermissionError(13" in text:
        return PortBusy(url, holders(url))
    if number == errno.EACCES:
        ask = (
            "; sudo usermod -aG dialout $USER, then a new login, allows it"
            if sys.platform == "linux"
            else ""
        )
        return NoPort(f"cannot open {url}: this user may not{ask}")
    why = (
        os.strerror(number) if number else text
    )  # pyserial's own text repeats everything three times
    if "Could not configure port" in text:
        why = "it is not a serial port"
    if "FileNotFoundError(2" in text:
        why = os.strerror(errno.ENOENT)
    return NoPort(f"cannot open {url}: {why}; framestep ports lists all ports")


def _exclude(port: Any, on: bool) -> None:
    """Keep other programs from opening the port, or allow it again. Windows never allows it."""
    try:
        import fcntl
        import termios
    except ImportError:
        return
    with contextlib.suppress(OSError, AttributeError):
        fcntl.ioctl(port.fileno(), termios.TIOCEXCL if on else termios.TIOCNXCL)


def holders(path: str) -> list[str]:
    """List other programs that have a port open, such as "screen (process 4711)", as far as the
    system knows."""
    if sys.platform == "linux":
        return _holders_linux(path)
    if sys.platform == "darwin":
        return _holders_macos(path)
    return []


def _holders_linux(path: str) -> list[str]:
    real = os.path.realpath(path)
    found = []
    for process in Path("/proc").iterdir():
        if not process.name.isdecimal() or int(process.name) == os.getpid():
            continue
        with contextlib.suppress(OSError):  # the process has ended, or is another user's
            if any(_leads_to(entry, real) for entry in (process / "fd").iterdir()):
                found.append(f"{(process / 'comm').read_text().strip()} (process {process.name})")
    return found


def _leads_to(entry: Path, real: str) -> bool:
    try:
        return os.readlink(entry) == real
    except OSError:
        return False


def _holders_macos(path: str) -> list[str]:
    try:
        said = subprocess.run(
            ["lsof", "-F", "pc", path], capture_output=True, text=True, timeout=5
        ).stdout
    except (OSError, subprocess.TimeoutExpired):
        return []
    found, process = [], ""
    for line in said.splitlines():
        if line.startswith("p"):
            process = line[1:]
        elif line.startswith("c") and process != str(os.getpid()):
            found.append(f"{line[1:]} (process {process})")
    return found
