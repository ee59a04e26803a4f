"""Talk to a motion controller from a shell.

The device is the only board on USB, or --device: a port's path (/dev/ttyACM1, COM5) or
socket://HOST:PORT, which may also come first after the command. The controller stops its motors
when its host disconnects, so a command that moves something waits until it is at rest.
"""

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

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
    stream,
    traces,
    traffic,
    virtual,
)
from .errors import STATUSES, Command

_EPILOG = "Exit status: " + "; ".join(f"{number} {text}" for number, text in STATUSES.items()) + "."

_SUBJECTS = {
    "Motors": (motors, virtual, stream),
    "Moves": (moves, check, move_files),
    "Board": (rig, board),
    "In the browser, and without a board": (console, sim, demo),
    "Ports, traffic and tests": (traffic, traces, conform, prove),
}


class _BySubject(TyperGroup):
    """Lists the commands under their subjects."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the lists, all with the same first column."""
        names = self.list_commands(ctx)
        longest = max(map(len, names))
        for title in _SUBJECTS:
            commands = [(n, self.commands[n]) for n in names]
            rows = [
                (name.ljust(longest), command.get_short_help_str(formatter.width - longest - 6))
                for name, command in commands
                if getattr(command, "rich_help_panel", None) == title
            ]
            with formatter.section(title):
                formatter.write_dl(rows)


app = Command(
    "framestep",
    cls=_BySubject,
    help=__doc__,
    epilog=_EPILOG,
    no_args_is_help=False,
    invoke_without_command=True,
    add_completion=True,
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
for _title, _subjects in _SUBJECTS.items():
    for _subject in _subjects:
        _subject.add(app)
    _added: list[Any] = [*app.registered_commands, *app.registered_groups]
    for _command in _added:
        _command.rich_help_panel = _command.rich_help_panel or _title

if __name__ == "__main__":
    app()
