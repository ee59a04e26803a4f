"""`make prove`: the emulated board measures itself."""

from pathlib import Path
from typing import Annotated

import typer

from ..building.board_files import ROOT, board_data, boards_that_see_steps
from ..errors import Command, ToolError
from . import measurement, report
from .board import emulated

app = Command("prove")


@app.command()
def main(
    renew: Annotated[
        bool, typer.Option("--renew", help="store the figures for comparison with other boards")
    ] = False,
    short: Annotated[bool, typer.Option("--short", help="fewer moves")] = False,
    board: Annotated[
        str, typer.Option(help="folder in boards/ of the board, or all that are emulated")
    ] = "pico",
    chip: Annotated[
        str | None, typer.Option(help="stepping of an RP2040: B1 or B2; by default B2")
    ] = None,
    out: Annotated[Path, typer.Option(help="folder for the report", metavar="DIR")] = ROOT
    / "build"
    / "prove",
) -> None:
    """Measure an emulated board as `framestep lab prove` measures a real one."""
    for each in boards_that_see_steps() if board == "all" else [board]:
        data = board_data(each)
        if each not in boards_that_see_steps():
            raise ToolError(
                f"{data['name']} is not emulated (its chip is {data['chip']}), or its chip does "
                "not see its motors' steps"
            )
        if renew:
            measurement.renew(each, print)
        else:
            compare(each, measurement.Options(short=short), ("--chip", chip) if chip else (), out)


def compare(board: str, options: measurement.Options, args: tuple[str, ...], out: Path) -> None:
    """Measure an emulated board. Raises ToolError if a figure is worse than the stored one. args:
    options of the emulator; out: folder for the report."""
    with emulated(args, board) as measured:
        found = measurement.prove(measured, options, report.emulated_boards(), print)
    report.show(found)
    paths = found.write(out)
    print(*paths, sep="\n")
    found.raise_broken_off(paths[1])
    if found.complaints or found.worse:
        raise ToolError(f"worse than before: {', '.join(found.worse) or found.complaints[0]}")


if __name__ == "__main__":
    app()
