"""The page that puts framestep onto a board, next to the page of `make try`.

Any plain web server can serve it. Images, and the files of boards without one, lie next to it.
"""

import hashlib
import json
import shutil
from base64 import b64encode
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from framestep.rig.settings import SETTINGS

from ..board import bootsel_drive, esp32_flash, file_install
from ..board.file_install import Package, package
from ..board.rig_file import read
from ..building.board_files import board_chip, board_data, board_names, files_boards
from ..building.release_names import image_name, page_files_name
from ..chips import chips
from ..paths import BOARDS, ROOT, version
from . import files_scripts
from .bundling import bundle

OUT = ROOT / "build" / "site" / "install"
NAME = "install"


def make(
    out: Path, images: Mapping[str, Path], packages: Mapping[str, Package] | None = None
) -> None:
    """Write the page into a folder, which is emptied first. images: {board: its UF2 file};
    packages: {board: its files}, without it those of all boards that have no image."""
    if packages is None:
        packages = {name: package(name) for name in files_boards()}
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    for board, path in images.items():
        shutil.copyfile(path, out / image_name(board, version()))
    for board, wanted in packages.items():
        files = {f"/{path}": b64encode(data).decode() for path, data in wanted.files().items()}
        (out / page_files_name(board, version())).write_text(json.dumps(files))
    bundle(NAME, out, _setup(out, packages), html="frame.html")


def _setup(out: Path, packages: Mapping[str, Package]) -> dict[str, Any]:
    """Return what the page needs to know of boards, chips and the files next to it."""
    return {
        "press": bootsel_drive.PRESS,
        "rates": SETTINGS["uart_baud"][1],
        "about": bootsel_drive.ABOUT,
        "chipOf": bootsel_drive.CHIPS,
        "chips": {key: chip.name for key, chip in chips().items()},
        "files": {
            "scripts": files_scripts.FOR_THE_PAGE,
            "oldest": file_install.OLDEST,
            "ownPortFrom": file_install.OWN_PORT_FROM,
            "list": file_install.LIST,
            "main": file_install.MAIN,
        },
        "esp": {
            "magic": esp32_flash.MAGIC,
            "partitions": esp32_flash.PARTITIONS,
            "table": list(esp32_flash.TABLE),
            "baud": esp32_flash.BAUD,
        },
        "boards": sorted(
            (_board(name, out, packages.get(name)) for name in board_names()),
            key=lambda board: not board["hasImage"],
        ),
    }


def _board(board: str, out: Path, wanted: Package | None) -> dict[str, Any]:
    """Return a board's entry. `image` or `files` is what lies next to the page, or None."""
    data, chip = board_data(board), board_chip(board)
    return {
        "board": board,
        "name": data["name"],
        "chip": data["chip"],
        "motors": data["motors"],
        "ports": data["ports"],
        "printed": data["page"]["printed"],
        "foreground": chip.hal == "esp32",  # its REPL cannot be used while framestep runs
        "example": read(BOARDS / board / "rig.json"),
        "hasImage": chip.uf2_family is not None,
        "image": _file(out / image_name(board, version())),
        "files": _file(out / page_files_name(board, version())),
        "esp": chip.esp,
        "arch": file_install.PROCESSORS.index(wanted.processor) if wanted else None,
    }


def _file(path: Path) -> dict[str, Any] | None:
    """Return a file's name, size and sum, or None if it is not there."""
    if not path.exists():
        return None
    content = path.read_bytes()
    return {
        "file": path.name,
        "size": len(content),
        "sha256": hashlib.sha256(content).hexdigest(),
    }
