"""The page that puts framestep onto a board, next to the page of `make try`.

Any plain web server can serve it. Images lie next to it, under their names in a release.
"""

import hashlib
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..board import bootsel_drive
from ..board.rig_file import read
from ..building.board_files import board_chip, board_data, board_names
from ..building.release_names import image_name
from ..chips import chips
from ..paths import BOARDS, ROOT, version
from .bundling import bundle

OUT = ROOT / "build" / "site" / "install"
NAME = "install"


def make(out: Path, images: Mapping[str, Path]) -> None:
    """Write the page into a folder, which is emptied first. images: {board: its UF2 file}."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    for board, path in images.items():
        shutil.copyfile(path, out / image_name(board, version()))
    bundle(NAME, out, _setup(images))


def _setup(images: Mapping[str, Path]) -> dict[str, Any]:
    """Return what the page needs to know of boards, chips and images."""
    return {
        "press": bootsel_drive.PRESS,
        "about": bootsel_drive.ABOUT,
        "chipOf": bootsel_drive.CHIPS,
        "chips": {key: chip.name for key, chip in chips().items()},
        "boards": sorted(
            (_board(name, images.get(name)) for name in board_names()),
            key=lambda board: (board["unfit"] is not None, not board["hasImage"]),
        ),
    }


def _board(board: str, image: Path | None) -> dict[str, Any]:
    """Return a board's entry: `hasImage` of its kind, `image` if there is one next to the page."""
    data = board_data(board)
    content = image.read_bytes() if image else b""
    return {
        "board": board,
        "name": data["name"],
        "chip": data["chip"],
        "motors": data["motors"],
        "unfit": data.get("page", {}).get("unfit"),
        "example": read(BOARDS / board / "rig.json"),
        "hasImage": board_chip(board).uf2_family is not None,
        "image": {
            "file": image_name(board, version()),
            "size": len(content),
            "sha256": hashlib.sha256(content).hexdigest(),
        }
        if image
        else None,
    }
