"""`make prove`: the emulated board measures itself."""

from pathlib import Path
from typing import Annotated

import typer

from .. import builds
from ..errors import Command, ToolError
from ..files import ROOT
from . import report
from .board import emulated
from .work import Options, prove

app = Command("prove")


@app.command()
def main(
    renew: Annotated[
        bool, typer.Option("--renew", help="keep the figures as those to compare others with")
    ] = False,
    short: Annotated[bool, typer.Option("--short", help="fewer moves")] = False,
    chip: Annotated[str, typer.Option(help="stepping of the chip: B1 or B2")] = "B2",
    out: Annotated[Path, typer.Option(help="folder for the report", metavar="DIR")] = ROOT
    / "build"
    / "prove",
) -> None:
    """Measure the emulated board as `framestep prove` measures a real one."""
    builds.frozen()
    with emulated(("--chip", chip)) as board:
        beside = {} if renew else report.emulated_figures()
        found = prove(board, Options(short=short), beside, print)
    if renew:
        report.renew(found.figures)
        print(f"{report.EMULATED} has {len(found.figures)} figures")
        return
    report.show(found)
    print(*found.write(out), sep="\n")
    if found.complaints or found.worse:
        raise ToolError(f"worse than before: {', '.join(found.worse) or found.complaints[0]}")


if __name__ == "__main__":
    app()
