"""littlefs images for MicroPython's file system on the RP2040 (board RPI_PICO).

python -m framestep_emulator.image IMAGE [HOST:DEVICE ...]

A host directory is taken with everything in it.
"""

import os
import sys
from pathlib import Path

from littlefs import LittleFS, LittleFSError

BLOCK_SIZE = 4096
BLOCK_COUNT = 352  # 1408 KB
PROG_SIZE = 256  # as in the rp2 port's _boot.py


def make_image(files):
    """files: {device path: bytes or str}; returns the image. ValueError if they do not fit."""
    fs = LittleFS(
        block_size=BLOCK_SIZE,
        block_count=BLOCK_COUNT,
        prog_size=PROG_SIZE,
        read_size=PROG_SIZE,
        cache_size=4 * PROG_SIZE,
        lookahead_size=32,
        name_max=255,
        disk_version=0x00020000,
    )
    for path, data in sorted(files.items()):
        parts = path.strip("/").split("/")
        for i in range(1, len(parts)):
            fs.makedirs("/".join(parts[:i]), exist_ok=True)
        try:
            with fs.open("/".join(parts), "wb") as f:
                f.write(data.encode() if isinstance(data, str) else data)
        except (LittleFSError, OSError) as error:
            capacity = BLOCK_SIZE * BLOCK_COUNT // 1024
            raise ValueError(
                f"{path} ({len(data)} bytes) does not fit: the board has {capacity} KB: {error}"
            ) from error
    return bytes(fs.context.buffer)


def read_image(data):
    """{device path: bytes} of everything in an image, such as one that the command flash_dump wrote."""
    fs = LittleFS(block_size=BLOCK_SIZE, block_count=BLOCK_COUNT, prog_size=PROG_SIZE, read_size=PROG_SIZE, mount=False)
    fs.context.buffer = bytearray(data)
    fs.mount()
    files = {}
    for folder, _, names in fs.walk("/"):
        for name in names:
            path = folder.rstrip("/") + "/" + name
            with fs.open(path, "rb") as f:
                files[path] = f.read()
    return files


def collect(put):
    """{host path: device path} -> {device path: bytes}.

    A directory is taken with everything in it, __pycache__ left out; a device path that ends in "/" (or is empty) keeps
    the name of the file.
    """
    files = {}
    for host, device in put.items():
        host = Path(host)
        device = os.fspath(device)
        if host.is_dir():
            for path in sorted(host.rglob("*")):
                if path.is_file() and "__pycache__" not in path.parts:
                    files[device.rstrip("/") + "/" + path.relative_to(host).as_posix()] = path.read_bytes()
        else:
            if not device or device.endswith("/"):
                device += host.name
            files[device] = host.read_bytes()
    return files


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    pairs = (argument.partition(":") for argument in sys.argv[2:])
    Path(sys.argv[1]).write_bytes(make_image(collect({host: device for host, _, device in pairs})))
