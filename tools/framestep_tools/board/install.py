"""Put an image on a board's BOOTSEL drive, without a compiler."""

from collections.abc import Callable
from pathlib import Path

from flash_images import uf2

from .. import paths
from ..building.board_files import board_chip, board_data, board_names
from ..chips import chips
from ..client.port_finder import OTHER, PROTOCOL, listed
from ..errors import ToolError
from . import bootsel_drive
from .bootsel_drive import Drive, DriveError
from .restart import answer, greeting

DRIVE_S = 300.0  # time to find BOOTSEL and plug the board in


def image_of(board: str) -> bytes:
    """Return a board's UF2 image: the package's own, or in a checkout a built one."""
    board_data(board)  # raises ToolError for an unknown name
    if not paths.INSTALLED:
        from ..building.images import frozen

        return frozen(board, show=True).with_suffix(".uf2").read_bytes()
    path = paths.IMAGES / f"{board}.uf2"
    if not path.exists():
        raise ToolError(
            f"this installation of framestep brings no image for {board}: "
            "it was installed from sources. "
            "Take the release's package or its .uf2 file (--image FILE)"
        )
    return path.read_bytes()


def board_on(drive: Drive, board: str | None) -> str:
    """Return the board to install for: the requested one, if the drive belongs to its chip, else
    the chip's plain board."""
    if board is None:
        return chips()[drive.chip].plain_board
    wanted = board_chip(board).name
    if drive.chip != board_data(board)["chip"]:
        fitting = " or ".join(
            name for name in board_names() if board_data(name)["chip"] == drive.chip
        )
        raise DriveError(
            f"the board on {drive.path} has an {chips()[drive.chip].name}, "
            f"{board} an {wanted}: --board {fitting}"
        )
    return board


def onto_drive(
    board: str, content: bytes, drive: Drive, device: str | None, say: Callable[[str], None]
) -> None:
    """Copy an image onto a board's drive, wait until the board is up, and print its greeting.

    device: the protocol's port, if it cannot be found.
    """
    image = uf2.parse(content, "the image")
    if image.chip != drive.chip:
        raise DriveError(
            f"the image is for an {chips()[image.chip].name}, "
            f"the board has an {chips()[drive.chip].name}"
        )
    before = {port.board for port in listed()} if device is None else set()
    last = 0

    def progress(done: int) -> None:
        nonlocal last
        percent = 100 * done // len(content)
        if percent - last >= 25 or percent == 100:
            last = percent
            say(f"  {percent} %")

    say(f"copying {len(content) // 1024} kB for the {board_data(board)['name']} onto {drive.path}")
    bootsel_drive.drop(drive, f"framestep-{board}.uf2", content, progress)
    say("the board starts")

    def find() -> str | None:
        if device:
            return device
        new = [port for port in listed() if port.use != OTHER and port.board not in before]
        return next((port.path for port in new if port.use == PROTOCOL), None)

    path, info = answer(
        find, "it shows no port named framestep DMC; if its rig file says ports: 1, name its port"
    )
    say(greeting(path, info))
    if f"{info.major}.{info.minor}.{info.revision}" != paths.version():
        say(f"this is not the version that was copied, {paths.version()}: is it another board?")


def read(path: Path) -> bytes:
    """Return a file's content. Raises ToolError if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise ToolError(f"cannot read {path}: {error.strerror}") from None
