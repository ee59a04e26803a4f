"""Talk to a motion controller from a shell.

The device is the only board on USB, or --device: a port's path (/dev/ttyACM1, COM5) or
socket://HOST:PORT, which may also come first after the command. The controller stops its motors
when its host disconnects, so a command that moves something waits until it is at rest.
"""

from typing import Annotated

import typer

from .commands import (
    board,
    check,
    conform,
    console,
    demo,
    motors,
    move_files,
    moves,
    prove,
    rig,
    sim,
    traces,
    traffic,
    virtual,
)
from .errors import STATUSES, Command

_EPILOG = "Exit status: " + "; ".join(f"{number} {text}" for number, text in STATUSES.items()) + "."

app = Command(
    "framestep", help=__doc__, epilog=_EPILOG, no_args_is_help=False, invoke_without_command=True
)


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        print(f"framestep {version('framestep')}")
        raise typer.Exit


@app.callback()
def _framestep(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_version, is_eager=True, help="say which version this is"
        ),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())


_framestep.__doc__ = __doc__
for _subject in (
    motors,
    virtual,
    moves,
    check,
    move_files,
    traffic,
    traces,
    rig,
    board,
    sim,
    demo,
    console,
    conform,
    prove,
):
    _subject.add(app)

if __name__ == "__main__":
    app()
