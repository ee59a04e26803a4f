"""`make image`: build/<board>.uf2, MicroPython with framestep in it, for a board's drive."""

import shutil
from typing import Annotated

import typer

from ..errors import Command
from .board_files import ROOT, CompileError, board_data, image_boards
from .images import BuildError, flash_left, frozen

app = Command("image", expected=(BuildError, CompileError))


@app.command()
def main(
    board: Annotated[str, typer.Option(help="a folder of boards/, or all that have one")] = "pico",
    micropython: Annotated[
        str | None,
        typer.Option(
            help="a checkout of MicroPython, 1.26 or newer, to build; without it Debian's sources"
        ),
    ] = None,
) -> None:
    """Build the image of a board. Boards with the same chip share all but a last second of it."""
    for each in image_boards() if board == "all" else [board]:
        make(each, micropython)


def make(board: str, micropython: str | None) -> None:
    name = board_data(board)["name"]
    made = ROOT / "build" / f"{board}.uf2"
    made.parent.mkdir(exist_ok=True)
    print(f"building for the {name} (some minutes the first time for its chip)", flush=True)
    product = frozen(board, micropython, show=True)
    shutil.copyfile(product.with_suffix(".uf2"), made)
    print(
        f"{flash_left(product.with_name('firmware.bin').read_bytes())} bytes are free"
        " between the image and the files"
    )
    print(
        f"{made.relative_to(ROOT)}, {made.stat().st_size // 1024} kB: "
        f"hold BOOTSEL while plugging in the {name}, "
        "and drop the file onto the drive that appears; rig.json on the board stays"
    )


if __name__ == "__main__":
    app()
