"""The drive of a board that is plugged in with BOOTSEL held, on Linux, macOS and Windows."""

import os
import re
import string
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from ..errors import NO_PORT, ToolError

ABOUT = "INFO_UF2.TXT"
CHIPS = {"RPI-RP2": "rp2040", "RP2350": "rp2350"}  # by Board-ID in the drive's file
_LABELS = ("RPI-RP2", "RP2350")
_LOOK_S = 0.5
_CHUNK = 64 * 1024
PRESS = (
    "hold the board's BOOTSEL button while you plug it in (or while you press its reset button), "
    "then let go: a drive named RPI-RP2 or RP2350 appears"
)


class DriveError(ToolError):
    """There is no board's drive, or it does not accept the image."""

    status = NO_PORT


class Drive(NamedTuple):
    """A board's drive; `chip` is a key of boards/chips.json."""

    path: Path
    chip: str


def look(folder: Path) -> Drive | None:
    """Return the drive at this path, or None if it is not a board's."""
    try:
        text = (folder / ABOUT).read_text(errors="replace")
    except OSError:
        return None
    found = re.search(r"^Board-ID:\s*(\S+)", text, re.MULTILINE)
    chip = CHIPS.get(found[1]) if found else None
    return Drive(folder, chip) if chip else None


def places(system: str = sys.platform, mounts: Path = Path("/proc/self/mounts")) -> Iterator[Path]:
    """Yield the folders in which a system may show such a drive."""
    if system == "win32":
        for letter in string.ascii_uppercase[
            3:
        ]:  # A and B were floppy disks, C is the system's disk
            yield Path(f"{letter}:\\")
    elif system == "darwin":
        yield from sorted(Path("/Volumes").glob("*"))
    else:
        try:
            lines = mounts.read_text().splitlines()
        except OSError:
            return
        for line in lines:
            _, place, kind, *_ = line.split(" ")
            if kind in ("vfat", "msdos"):
                yield Path(re.sub(r"\\(\d{3})", lambda code: chr(int(code[1], 8)), place))


def connected() -> list[Drive]:
    """List the boards' drives that are present."""
    return [drive for place in places() if (drive := look(place))]


def _not_mounted() -> str | None:
    """Return the device of a drive that Linux sees and has not mounted, or None."""
    for label in _LABELS:
        if os.path.exists(f"/dev/disk/by-label/{label}"):
            return f"/dev/disk/by-label/{label}"
    return None


def wait(
    say: Callable[[str], None], seconds: float, find: Callable[[], list[Drive]] = connected
) -> Drive:
    """Wait for the only board's drive, and say what to press. Raises DriveError if none or several
    appear."""
    end = time.monotonic() + seconds
    said = hinted = False
    while True:
        drives = find()
        if len(drives) > 1:
            names = " or ".join(str(drive.path) for drive in drives)
            raise DriveError(
                f"{len(drives)} boards show a drive: "
                f"leave one plugged in, or name it, --drive {names}"
            )
        if drives:
            return drives[0]
        if not said:
            say(PRESS)
            said = True
        if not hinted and (device := _not_mounted()):
            say(f"the drive is there, but not mounted; this does it: udisksctl mount -b {device}")
            hinted = True
        if time.monotonic() > end:
            raise DriveError(
                f"no board's drive has appeared in {seconds:g} s; --drive names its folder"
            )
        time.sleep(_LOOK_S)


def drop(
    drive: Drive, name: str, content: bytes, progress: Callable[[int], None] = lambda done: None
) -> None:
    """Copy a UF2 file onto a drive. Then the board restarts and the drive disappears.

    progress: called with the number of bytes written.
    """
    written = 0
    try:
        with open(drive.path / name, "wb", buffering=0) as file:
            while written < len(content):
                written += file.write(content[written : written + _CHUNK])
                os.fsync(file.fileno())
                progress(written)
    except OSError as error:
        # The drive is gone before the system has written all about the file
        if written < len(content) - _CHUNK or look(drive.path):
            raise DriveError(
                f"cannot write {name} onto {drive.path}: {error.strerror or error}"
            ) from None
