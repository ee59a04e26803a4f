"""Whole moves: upload and play."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .common import Url, moving, put, talking

if TYPE_CHECKING:
    from ..client import Event

UPLOAD_WINDOW = 4


def upload(
    file: Annotated[
        Path,
        typer.Argument(
            help="CSV: frame, then a column per motor; camera_move.csv is an example to try",
            metavar="CSV",
            show_default=False,
        ),
    ],
    device: Url = None,
) -> None:
    """Upload a move."""
    from ..move_file import or_example, read_move

    content = read_move(or_example(file))
    with talking(device) as client:
        client.upload_move(content.start_frame, content.end_frame, content.positions, UPLOAD_WINDOW)
    print(
        f"frames {content.start_frame} to {content.end_frame} for {len(content.positions)} motors"
    )


def run(
    start: Annotated[int, typer.Argument(help="first scene frame", show_default=False)],
    end: Annotated[
        int, typer.Argument(help="last scene frame; before the first: backward", show_default=False)
    ],
    device: Url = None,
    fps: Annotated[float, typer.Option(help="frames per second", min=0.001)] = 24,
    preroll_ms: Annotated[int, typer.Option(help="time to get up to speed", min=0)] = 1000,
    postroll_ms: Annotated[int, typer.Option(help="time to slow down", min=0)] = 1000,
) -> None:
    """Play the uploaded move, from the pre-roll to rest."""
    from ..payloads import Positions, RtEnd, RtGo, RtRunMove
    from ..state import Stopped, why_stopped

    live = sys.stdout.isatty()
    reached = start * 1000

    def show(event: "Event") -> None:
        nonlocal reached
        if isinstance(event.message, Positions):
            reached = event.message.move_time
            if live:
                print(f"\rframe {reached / 1000:9.3f}", end="", flush=True)

    with moving(device) as client:
        client.request(RtRunMove(round(fps * 1000), start, end, preroll_ms, postroll_ms))
        client.wait_idle(timeout_s=float("inf"))
        client.on_event = show
        client.request(RtGo())
        client.wait_event(RtEnd, timeout_s=float("inf"))
        client.on_event = None
        client.wait_idle(timeout_s=float("inf"))  # on the end frame again
        if reached != end * 1000:
            before = "\n" if live else ""
            raise Stopped(
                f"{before}the run ended at frame {reached / 1000:.3f}, before {end}: "
                f"{why_stopped(client)}"
            )
    print(f"{chr(13) if live else ''}frames {start} to {end} played")


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, upload, run)
