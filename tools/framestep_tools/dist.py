"""`make dist`: framestep as packages for `mpremote mip install`, in build/dist.

A folder for each processor, with the .mpy files that boards with it share, in `boards` those that
differ, and a package per board: <board>.json. package.json is that of the plain board (Raspberry Pi
Pico, Pico 2).
"""

import json
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path

from .files import ROOT, board_chip, board_files, board_names, write_tree
from .home import version

DIST = ROOT / "build" / "dist"
_BOARD = "/lib/framestep/board.mpy"
_LIB = "/lib/"


def packages(say: Callable[[str], None] = lambda line: None) -> dict[str, bytes]:
    """{path below build/dist: content} of everything. say: told each board, which takes some
    seconds."""
    made: dict[str, bytes] = {}
    for board in board_names():
        say(f"compiling for {board}")
        chip = board_chip(board)
        processor = chip.processor
        urls = []
        for path, content in board_files(processor, board).items():
            # mip installs into /lib; boot.py and main.py belong beside it. It writes over what is
            # there, as README.md says
            target = path.removeprefix(_LIB) if path.startswith(_LIB) else f"..{path}"
            source = (
                f"boards/{board}.mpy"
                if path == _BOARD
                else Path(target).as_posix().removeprefix("../")
            )
            made[f"{processor}/{source}"] = content
            urls.append([target, source])
        package = json.dumps({"urls": urls, "version": version()}, indent=1).encode() + b"\n"
        made[f"{processor}/{board}.json"] = package
        if board == chip.plain_board:
            made[f"{processor}/package.json"] = package
    return made


@cache
def packaged(folder: Path, board: str) -> dict[str, bytes]:
    """{path on the board: content} of a board's package in a folder that `write` has made for its
    processor."""
    urls = json.loads((folder / f"{board}.json").read_text())["urls"]
    return {
        f"/{target.removeprefix('../')}" if target.startswith("../") else _LIB + target: (
            folder / source
        ).read_bytes()
        for target, source in urls
    }


def write(folder: Path, say: Callable[[str], None] = lambda line: None) -> None:
    """Write them; what was there before goes."""
    if folder.exists():
        shutil.rmtree(folder)
    write_tree(folder, packages(say))


if __name__ == "__main__":
    write(DIST, lambda line: print(line, flush=True))
    for folder in sorted(DIST.iterdir()):
        names = ", ".join(sorted(path.name for path in folder.glob("*.json")))
        print(f"{folder.relative_to(ROOT)}: {len(list(folder.rglob('*.mpy')))} .mpy files; {names}")
