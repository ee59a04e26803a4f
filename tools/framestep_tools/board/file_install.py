"""framestep in the file system of a board with MicroPython's own program: an ESP32.

/framestep has the modules as .mpy files and /framestep/modules lists them; /main.py
(firmware/files_main.py) starts them if that list is there.
"""

from ast import literal_eval
from collections.abc import Callable, Iterable
from typing import NamedTuple

from .. import paths
from ..building.board_files import board_chip, board_data, board_modules
from ..client.port_finder import at_rate
from . import module_files
from .module_files import Files, Place
from .repl_device import RIG_FILE, Device, DeviceError
from .restart import greeting, hello
from .rig_file import report_rig

PLACE = Place("", "/framestep", "/framestep/modules")
LIST = PLACE.list
MAIN = "/main.py"
OURS = b"framestep.boot.start()"  # in every main.py of framestep
OLDEST = (1, 26)  # MicroPython
OWN_PORT_FROM = (1, 27)  # for a USB port of the protocol's own
# Names of mpy-cross in the order of sys.implementation._mpy >> 10 (MicroPython, tools/mpy-tool.py)
PROCESSORS = (
    "", "x86", "x64", "armv6", "armv6m", "armv7m", "armv7em", "armv7emsp", "armv7emdp", "xtensa",
    "xtensawin", "rv32imc", "rv64imc",
)  # fmt: skip
_WHO = """
import sys
i = sys.implementation
print((i.version[:2], i._mpy, i._machine))
"""


class Package(NamedTuple):
    """What goes onto a board: its name in boards/, the modules, main.py; and its chip's name and
    processor, as mpy-cross calls it."""

    board: str
    modules: dict[str, bytes]
    main: bytes
    chip: str
    processor: str

    def files(self) -> dict[str, bytes]:
        """Return {path: content} of everything, with the list: framestep/motors/axis.mpy."""
        return self.modules | {
            LIST[1:]: listing(self.board, self.modules),
            MAIN[1:]: self.main,
        }


def listing(board: str, modules: Iterable[str]) -> bytes:
    """Return the content of /framestep/modules."""
    return module_files.listing(board, modules)


def main_py() -> bytes:
    """Return main.py."""
    return (paths.FIRMWARE / "files_main.py").read_bytes()


def package(board: str) -> Package:
    """Return what goes onto a board: from this package's files, or in a checkout compiled."""
    chip = board_chip(board)
    if not paths.INSTALLED:
        return Package(
            board, board_modules(chip.processor, board), main_py(), chip.name, chip.processor
        )
    folder = paths.FILES / board
    modules = {
        path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*.mpy")
    }
    return Package(board, modules, (folder / "main.py").read_bytes(), chip.name, chip.processor)


def board_of(board: Files) -> str | None:
    """Return the board's name in boards/; None if framestep is not complete in this file system."""
    words = (board.read(LIST) or b"").decode(errors="replace").split()
    return words[0] if words else None


def check(board: Device, wanted: Package, ports: int) -> None:
    """Raise DeviceError if this board's MicroPython cannot run the package with this number of
    ports, or if it has another main.py."""
    version, mpy, machine = literal_eval(board.run(_WHO))
    if version < OLDEST:
        raise DeviceError(
            f"the board has MicroPython {'.'.join(map(str, version))}, framestep needs "
            f"{'.'.join(map(str, OLDEST))} or newer: framestep install --board {wanted.board} "
            "--micropython FILE.bin"
        )
    processor = PROCESSORS[mpy >> 10] if mpy >> 10 < len(PROCESSORS) else "unknown"
    chip = machine.rsplit(" with ", 1)[-1]
    if processor != wanted.processor or chip != wanted.chip.replace("-", ""):
        raise DeviceError(
            f"the board is a {machine}, but {wanted.board} has an {wanted.chip}: name the right "
            "board"
        )
    if ports == 2 and version < OWN_PORT_FROM:
        raise DeviceError(
            f"with MicroPython {'.'.join(map(str, version))} the protocol has no port of its own: "
            f"put {'.'.join(map(str, OWN_PORT_FROM))} or newer on the board (framestep install "
            f'--board {wanted.board} --micropython FILE.bin), or "ports": 1 into its rig file'
        )
    found = board.read(MAIN)
    if found is not None and OURS not in found:
        raise DeviceError(
            f"the board has a {MAIN} of its own, which would run instead of framestep: save it and "
            f"remove it (mpremote fs rm :main.py)"
        )


def put(board: Files, wanted: Package, say: Callable[[str], None]) -> int:
    """Put framestep on the board; return the number of files written and removed."""
    return module_files.put(board, PLACE, wanted.board, wanted.modules, say, {MAIN: wanted.main})


def bring(device: Device, wanted: Package, say: Callable[[str], None]) -> tuple[str, int]:
    """Put framestep on a board with MicroPython, if its MicroPython can run it. Return the REPL's
    port at the rate that it has after a restart, and the number of ports then."""
    found = report_rig(device.read(RIG_FILE), wanted.board, say)
    check(device, wanted, found.ports)
    say(f"{board_data(wanted.board)['name']} on {device.path}")
    device.halt()
    if not put(device, wanted, say):
        say(f"all of framestep ({len(wanted.modules)} modules) is on the board")
    return at_rate(device.path, found.settings["uart_baud"]), found.ports


def install(wanted: Package, path: str, say: Callable[[str], None]) -> None:
    """Put framestep on a board with MicroPython, restart it, and print its greeting. path: of its
    serial port."""
    with Device(path, say) as device:
        port, ports = bring(device, wanted, say)
        say("restarting")
        device.restart()
    port, info = hello(port, None, ports)
    say(greeting(port, info))
