"""`make prove`: the emulated board measures itself."""

from pathlib import Path
from typing import Annotated

import typer

from ..building import images
from ..building.board_files import ROOT, board_data, emulated_boards
from ..errors import Command, ToolError
from . import report
from .board import emulated
from .work import Options, prove

app = Command("prove")


@app.command()
def main(
    renew: Annotated[
        bool, typer.Option("--renew", help="store the figures for comparison with other boards")
    ] = False,
    short: Annotated[bool, typer.Option("--short", help="fewer moves")] = False,
    board: Annotated[str, typer.Option(help="folder in boards/ of the board")] = "pico",
    chip: Annotated[
        str | None, typer.Option(help="stepping of an RP2040: B1 or B2; by default B2")
    ] = None,
    out: Annotated[Path, typer.Option(help="folder for the report", metavar="DIR")] = ROOT
    / "build"
    / "prove",
) -> None:
    """Measure an emulated board as `framestep lab prove` measures a real one."""
    data = board_data(board)
    if board not in emulated_boards():
        raise ToolError(f"{data['name']} is not emulated: its chip is {data['chip']}")
    images.frozen(board)
    with emulated(("--chip", chip) if chip else (), board) as measured:
        beside = {} if renew else report.emulated_boards()
        found = prove(measured, Options(short=short), beside, print)
        count = len(measured.layout.measured)
    if renew:
        found.raise_broken_off()
        report.renew(board, count, found.figures)
        print(f"{report.EMULATED} has {len(found.figures)} figures of {board}")
        return
    report.show(found)
    paths = found.write(out)
    print(*paths, sep="\n")
    found.raise_broken_off(paths[1])
    if found.complaints or found.worse:
        raise ToolError(f"worse than before: {', '.join(found.worse) or found.complaints[0]}")


if __name__ == "__main__":
    app()
