"""Images of a board's file system: littlefs, as MicroPython formats it."""

from collections.abc import Mapping

from littlefs import LittleFS, LittleFSError

from . import FlashImageError

BLOCK_SIZE = 4096
PROG_SIZE = 256  # as in the rp2 port's _boot.py


class DoesNotFit(FlashImageError, ValueError):
    """The files need more room than there is."""


def make_image(
    files: Mapping[str, bytes | str], block_count: int, prog_size: int = PROG_SIZE
) -> bytes:
    """Make the image of a file system with these files, {device path: content}.

    prog_size: bytes that are written at once, as the board's MicroPython has it. Raises DoesNotFit
    if there is too little room.
    """
    system = LittleFS(
        block_size=BLOCK_SIZE,
        block_count=block_count,
        prog_size=prog_size,
        read_size=prog_size,
        cache_size=4 * prog_size,
        lookahead_size=32,
        name_max=255,
        disk_version=0x00020000,
    )
    for path, data in sorted(files.items()):
        parts = path.strip("/").split("/")
        for i in range(1, len(parts)):
            system.makedirs("/".join(parts[:i]), exist_ok=True)
        try:
            with system.open("/".join(parts), "wb") as file:
                file.write(data.encode() if isinstance(data, str) else data)
        except (LittleFSError, OSError) as error:
            room = BLOCK_SIZE * block_count // 1024
            raise DoesNotFit(
                f"{path} ({len(data)} bytes) does not fit: the board has {room} KB: {error}"
            ) from error
    return bytes(system.context.buffer)


def read_image(data: bytes, prog_size: int = PROG_SIZE) -> dict[str, bytes]:
    """Return {device path: content} of all files in an image."""
    system = LittleFS(
        block_size=BLOCK_SIZE,
        block_count=len(data) // BLOCK_SIZE,
        prog_size=prog_size,
        read_size=prog_size,
        mount=False,
    )
    system.context.buffer = bytearray(data)
    system.mount()
    files = {}
    for folder, _, names in system.walk("/"):
        for name in names:
            path = folder.rstrip("/") + "/" + name
            with system.open(path, "rb") as file:
                files[path] = file.read()
    return files
