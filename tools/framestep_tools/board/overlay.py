"""`framestep flash`: copies edited modules onto a board that runs framestep's image.

The image lists a hash of each of its modules (framestep_image). Modules that this checkout compiles
to something else go to /overlay, where firmware/framestep_overlay.py finds them. /overlay/modules
is removed first and written last, in one step: in between, and if copying is interrupted, the board
starts with the image's own modules.
"""

from ast import literal_eval
from collections.abc import Callable, Iterable, Mapping
from hashlib import sha256
from typing import NamedTuple, Protocol

from framestep.protocol import messages

from .. import paths
from ..building.board_files import board_chip, board_data, board_modules
from ..building.images import beginnings, module_hash
from .repl_device import RIG_FILE, Device, DeviceError
from .restart import condition, greeting, hello
from .rig_file import RigFileError, check, parse

FOLDER = "/overlay"
LIST = FOLDER + "/modules"
FAILED = FOLDER + "/failed"  # why framestep_overlay has left the overlay out
MOST = 48 * 1024  # bytes of modules; more would leave room for too few frames
_FIXED = ("framestep/__init__.mpy", "framestep/leftovers.mpy")  # loaded before the overlay
_IMAGE = """
try:
    from framestep_image import ID, BOARD, HASHES
    print((ID, BOARD, HASHES))
except ImportError: pass
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


class Files(Protocol):
    """A board's file system."""

    def files(self, folder: str) -> list[str]: ...
    def hashes(self, names: Iterable[str]) -> dict[str, bytes]: ...
    def read(self, name: str) -> bytes | None: ...
    def write(self, name: str, data: bytes) -> None: ...
    def replace(self, name: str, data: bytes) -> None: ...
    def remove(self, name: str) -> None: ...
    def run(self, script: str) -> str: ...


class Image(NamedTuple):
    """What a board's image says about itself."""

    ident: str
    board: str
    hashes: bytes

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


def dotted(name: str) -> str:
    """Convert a module's path to its name: framestep.motors.axis."""
    return name.removesuffix(".mpy").removesuffix("/__init__").replace("/", ".")


def put(board: Files, ident: str, modules: Mapping[str, bytes], say: Callable[[str], None]) -> int:
    """Make these modules the overlay; return the number of files written and removed."""
    there = board.files(FOLDER)
    if not modules:
        board.run(_CLEAR)
        return len(there)
    wanted = {f"{FOLDER}/{name}": content for name, content in modules.items()}
    listing = " ".join([ident, *sorted(map(dotted, modules))]).encode() + b"\n"
    hashes = {path: sha256(content).digest() for path, content in wanted.items()}
    present = board.hashes(path for path in there if path in wanted)
    changed = [path for path in sorted(wanted) if present.get(path) != hashes[path]]
    stale = [path for path in there if path not in wanted and path != LIST]
    if not changed and not stale and LIST in there and board.read(LIST) == listing:
        return 0
    if LIST in there:
        board.remove(LIST)
    for path in stale:
        board.remove(path)
    for i, path in enumerate(changed, 1):
        say(f"copying {i}/{len(changed)} {path} ({len(wanted[path])} bytes)")
        board.write(path, wanted[path])
    found = board.hashes(sorted(wanted))
    if damaged := [path for path in wanted if found.get(path) != hashes[path]]:
        raise DeviceError(
            f"{', '.join(damaged)} did not arrive as sent; try again, perhaps with another cable"
        )
    board.replace(LIST, listing)
    return len(changed) + len(stale) + 1


def tell_rig(content: bytes | None, board: str, say: Callable[[str], None]) -> int:
    """Say what is wrong with the board's rig file; return the number of ports that it asks for."""
    if content is None:
        return 2
    try:
        return check(parse(content, RIG_FILE), board_data(board), RIG_FILE).ports
    except RigFileError as error:
        say(f"{error}")
        say("nothing moves until it is corrected: framestep rig edit")
        return 2


def flash_overlay(
    port: str | None, protocol: str | None, clean: bool, say: Callable[[str], None]
) -> None:
    """Copy edited modules onto a board that runs framestep's image, or remove the overlay.

    port: of the REPL; without it the only board on USB. protocol: the port that Dragonframe will
    use, if it is not found by itself.
    """
    with Device(port, say) as device:
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
        ports = tell_rig(device.read(RIG_FILE), image.board, say)
        say("restarting")
        device.restart()
    path, info = hello(
        device.path, protocol, ports, "if it is the overlay's fault: framestep flash --clean"
    )
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
