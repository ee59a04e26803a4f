"""`make try`: a page that runs framestep in a browser tab, on an emulated board.

Any plain web server can serve it. A Web Worker runs the board with the image of `make image`; the
page of `framestep console` controls it. Nothing is loaded from other hosts. `?board=pico2` in its
address chooses a board.
"""

import json
import shutil
from pathlib import Path
from typing import Any

from flash_images import littlefs_image, uf2
from framestep.rig import Rig

from .. import demo
from ..building import images
from ..building.board_files import board_chip, board_data
from ..errors import Command
from ..move.move_file import CAMERA_MOVE
from ..paths import ROOT
from ..simulator.boards import closed_switches
from . import install_page
from .bundling import bundle

BOARDS = ("pico", "pico2")  # the first is the default
RIG = {"name": "crane on a track", "motor_count": 4, "estop": "nc"}
# Names and units of the example move's rig
AXES = [
    {"name": "track", "motor": 1, "steps_per_unit": 25, "unit": "mm"},
    {"name": "boom", "motor": 2, "steps_per_unit": 800, "unit": "deg"},
    {"name": "swing", "motor": 3, "steps_per_unit": 200, "unit": "deg"},
    {"name": "pan", "motor": 4, "steps_per_unit": 400, "unit": "deg"},
]
OUT = ROOT / "build" / "site" / "try"
NAME = "try"

app = Command("try", expected=(images.BuildError,))


@app.command()
def main() -> None:
    """Build the page, and the one that installs framestep."""
    make(OUT)
    install_page.make(install_page.OUT, images.images_ready())
    for out in (OUT, install_page.OUT):
        size = sum(path.stat().st_size for path in out.iterdir())
        shown = out.relative_to(ROOT)
        print(f"{shown}, {size // 1024} kB: to see it, python3 -m http.server -d {shown}")


def make(out: Path, rig: dict[str, Any] = RIG) -> None:
    """Write the page into a folder, which is emptied first. rig: the boards' rig file."""
    images_of = {name: images.frozen(name, show=True).with_suffix(".uf2") for name in BOARDS}
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    for name, image in images_of.items():
        shutil.copyfile(image, out / _image(name))
        (out / _file_system(name)).write_bytes(_files(image, rig))
    shutil.copyfile(CAMERA_MOVE, out / CAMERA_MOVE.name)
    bundle(NAME, out, _setup(rig), ("worker",))


def _image(board: str) -> str:
    return f"{board}.uf2"


def _file_system(board: str) -> str:
    return f"{board}.img"


def _setup(rig: dict[str, Any]) -> dict[str, Any]:
    """Return what the page needs to know."""
    return {
        "board": BOARDS[0],
        "boards": {name: _board(name, rig) for name in BOARDS},
        "example": CAMERA_MOVE.name,
        "speed": {"velocity": demo.VELOCITY, "acceleration": demo.ACCELERATION},
        "axes": AXES,
    }


def _board(name: str, rig: dict[str, Any]) -> dict[str, Any]:
    """Return a board's entry, with its wiring."""
    board = Rig(rig, board_data(name))
    return {
        "name": board.board["name"],
        "chip": board_chip(name).name,
        "image": _image(name),
        "files": _file_system(name),
        "closed": {pin: 0 for pin in closed_switches(board)},
        "pins": board.board,
    }


def _files(image: Path, rig: dict[str, Any]) -> bytes:
    """Return the beginning of a file system with the rig file. The rest of it is erased flash."""
    area = uf2.parse(image.read_bytes(), image.name).file_system()
    assert area
    content = littlefs_image.make_image(
        {"/rig.json": json.dumps(rig)}, area.size // littlefs_image.BLOCK_SIZE
    )
    return content.rstrip(b"\xff")


if __name__ == "__main__":
    app()
