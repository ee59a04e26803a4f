"""`framestep lab demo`: a camera move on a simulated board, every edge checked."""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import extra
from .common import put


def demo(
    fps: Annotated[float, typer.Option(help="frames per second", min=0.1, max=120)] = 24,
    move: Annotated[
        Path | None, typer.Option(help="another move than the example, as CSV", metavar="FILE")
    ] = None,
    out: Annotated[Path, typer.Option(help="folder for edges and picture", metavar="DIR")] = Path(
        "framestep-demo"
    ),
) -> int:
    """Play a camera move on a simulated board and check every edge."""
    from ..move.move_file import CAMERA_MOVE

    with extra("the demo"):
        import matplotlib  # noqa: F401

        from ..demo import main
    return main(host=True, fps=fps, move_file=move or CAMERA_MOVE, out=out)


def add_lab(app: typer.Typer) -> None:
    """Put this command into the laboratory."""
    put(app, demo)
