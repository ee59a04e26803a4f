"""`framestep flash`: copies edited modules onto a board that runs framestep's image.

The image lists a hash of each of its modules (framestep_image). Modules that this checkout compiles
to something else go to /overlay, where firmware/framestep_overlay.py finds them. /overlay/modules
is removed first and written last, in one step: in between, and if copying is interrupted, the board
starts with the image's own modules.
"""

from ast import literal_eval
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from framestep.protocol import messages

from .. import paths
from ..building.board_files import board_chip, board_data, board_modules, data_on_board
from ..building.images import beginnings, module_hash
from . import file_install, module_files
from .module_files import Files, Place
from .repl_device import RIG_FILE, Device, DeviceError
from .restart import condition, greeting, hello
from .rig_file import report_rig

FOLDER = "/overlay"
LIST = FOLDER + "/modules"
PLACE = Place(FOLDER, FOLDER, LIST)
FAILED = FOLDER + "/failed"  # why framestep_overlay has left the overlay out
MOST = 48 * 1024  # bytes of modules; more would leave room for too few frames
# Loaded before the overlay, or what tells a board from others
_FIXED = ("framestep/__init__.mpy", "framestep/soft_reset.mpy", "framestep/board.mpy")
_IMAGE = """
try:
    from framestep_image import ID, HASHES
    from framestep.board import FOLDER, BOARD
    print((ID, FOLDER, HASHES, BOARD))
except (ImportError, ValueError): pass
"""
_CLEAR = f"""
import os
def clear(folder):
    for name, kind, *_ in os.ilistdir(folder):
        if kind & 0x4000: clear(folder + "/" + name)
        else: os.remove(folder + "/" + name)
    os.rmdir(folder)
try: clear("{FOLDER}")
except OSError: pass
"""


class Image(NamedTuple):
    """What a board's image says about itself."""

    ident: str
    board: str
    hashes: bytes
    data: dict[str, Any]

    def has(self, name: str, content: bytes) -> bool:
        """Return whether the image contains exactly this module."""
        wanted = module_hash(name, content)
        return any(self.hashes[at : at + 4] == wanted for at in range(0, len(self.hashes), 4))


def image_of(board: Files) -> Image:
    """Ask a board for its image; DeviceError if it runs something else, or an older image."""
    found = board.run(_IMAGE).strip()
    if not found:
        raise DeviceError(
            "the board does not run an image of framestep, or an older one: framestep install puts "
            "the image on it, and rig.json stays"
        )
    return Image(*literal_eval(found))


def edited(image: Image, modules: Mapping[str, bytes]) -> dict[str, bytes]:
    """Select the modules that differ from the image's, {"framestep/motors/axis.mpy": content}.

    DeviceError if an overlay cannot replace them.
    """
    wanted = data_on_board(board_data(image.board))
    wanted.pop("hal")  # which a start takes out
    if {key: value for key, value in image.data.items() if key != "hal"} != wanted:
        raise DeviceError(
            f"boards/{image.board}/board.json differs from the data in the image: put a new image "
            f"on the board (framestep install --board {image.board})"
        )
    fixed = beginnings() | {name: modules[name] for name in _FIXED}
    if stale := [name for name, content in fixed.items() if not image.has(name, content)]:
        raise DeviceError(
            f"{', '.join(stale)}: an overlay cannot replace this; put a new image on the board "
            f"(framestep install --board {image.board})"
        )
    found = {name: content for name, content in modules.items() if not image.has(name, content)}
    if (size := sum(map(len, found.values()))) > MOST:
        raise DeviceError(
            f"{len(found)} modules ({size // 1024} kB) differ from the image on the board, too "
            f"much for an overlay: put a new image on it (framestep install --board {image.board})"
        )
    return found


def put(board: Files, ident: str, modules: Mapping[str, bytes], say: Callable[[str], None]) -> int:
    """Make these modules the overlay; return the number of files written and removed."""
    if not modules:
        there = board.files(FOLDER)
        board.run(_CLEAR)
        return len(there)
    return module_files.put(board, PLACE, ident, modules, say)


def flash(port: str | None, protocol: str | None, clean: bool, say: Callable[[str], None]) -> None:
    """Copy edited modules onto a board that runs framestep's image, or remove the overlay. A board
    that has framestep in its file system gets all modules that differ.

    port: of the REPL; without it the only board on USB. protocol: the port that Dragonframe will
    use, if it is not found by itself.
    """
    with Device(port, say) as device:
        if board := file_install.board_of(device):
            if clean:
                raise DeviceError(
                    "this board has no overlay: all of framestep is in its file system; "
                    f"framestep install --board {board} writes it"
                )
            modules = {}
            repl, ports = file_install.bring(device, file_install.package(board), say)
        else:
            repl = device.path
            modules, ports = _overlay(device, clean, say)
        say("restarting")
        device.restart()
    advice = "if it is the overlay's fault: framestep flash --clean" if modules else None
    path, info = hello(repl, protocol, ports, advice)
    if modules and not condition(path) & messages.CONDITION_OVERLAY:
        reason = b""
        if ports == 2:  # with one port, asking the REPL would end framestep
            with Device(device.path, say) as device:
                reason = device.read(FAILED) or b""
        raise DeviceError(
            f"the board runs without these modules, as it could not start with them ({FAILED}):\n"
            + reason.decode().partition("\n")[2].strip()
        )
    say(greeting(path, info))


def _overlay(
    device: Device, clean: bool, say: Callable[[str], None]
) -> tuple[dict[str, bytes], int]:
    """Bring the overlay up to date. Return its modules, and the ports that the rig file asks
    for."""
    image = image_of(device)
    if paths.INSTALLED and not clean:
        raise DeviceError(
            "the board runs an image, and there is no source to replace its modules: update it "
            f"with framestep install --board {image.board}, or take a checkout of framestep"
        )
    say(f"{board_data(image.board)['name']} on {device.path}, image {image.ident}")
    modules = (
        {}
        if clean
        else edited(image, board_modules(board_chip(image.board).processor, image.board))
    )
    device.halt()
    if not put(device, image.ident, modules, say):
        what = f"all of the overlay ({len(modules)} modules)" if modules else "no overlay"
        say(f"{what} is on the board")
    return modules, report_rig(device.read(RIG_FILE), image.board, say).ports
