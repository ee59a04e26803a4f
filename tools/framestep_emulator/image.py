"""littlefs images for the file system of a MicroPython, and the chip that a firmware is for.

python -m framestep_emulator.image FIRMWARE IMAGE [HOST:DEVICE ...]

A host directory is included with all its files.
"""

import os
import sys
from pathlib import Path

from flash_images import littlefs_image, uf2
from flash_images.littlefs_image import read_image

__all__ = ["chip_of", "collect", "make_image", "read_image"]

# A block for the boot ROM of an RP2350 begins so, in the first 4 kB (its datasheet, 5.9.5)
_BLOCK_MARKER = b"\xd3\xde\xff\xff"
_BLOCK_WITHIN = 4096


def chip_of(firmware):
    """Return the name of the chip that a firmware (bytes of the .bin) is for: RP2040 or RP2350."""
    return "RP2350" if _BLOCK_MARKER in firmware[:_BLOCK_WITHIN] else "RP2040"


def make_image(files, firmware):
    """Return a littlefs image. files: {device path: bytes or str}; firmware: path of the .bin that
    will mount it.

    Raises ValueError if they do not fit.
    """
    content = Path(firmware).read_bytes()
    families = {"RP2040": uf2.RP2040, "RP2350": uf2.RP2350}
    area = uf2.from_flash(content, families[chip_of(content)]).file_system()
    return littlefs_image.make_image(files, area.size // littlefs_image.BLOCK_SIZE)


def collect(put):
    """Convert {host path: device path} to {device path: bytes}.

    A directory is included with all its files except __pycache__. A device path that ends in "/"
    (or is empty) keeps the name of the file.
    """
    files = {}
    for host, device in put.items():
        host = Path(host)
        device = os.fspath(device)
        if host.is_dir():
            for path in sorted(host.rglob("*")):
                if path.is_file() and "__pycache__" not in path.parts:
                    files[device.rstrip("/") + "/" + path.relative_to(host).as_posix()] = (
                        path.read_bytes()
                    )
        else:
            if not device or device.endswith("/"):
                device += host.name
            files[device] = host.read_bytes()
    return files


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    pairs = (argument.partition(":") for argument in sys.argv[3:])
    files = collect({host: device for host, _, device in pairs})
    Path(sys.argv[2]).write_bytes(make_image(files, sys.argv[1]))
