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
    console,
    lab,
    motors,
    move_files,
    moves,
    rig,
    sim,
    stream,
    traffic,
    virtual,
)
from .errors import STATUSES, Command

_EPILOG = "Exit status: " + "; ".join(f"{number} {text}" for number, text in STATUSES.items()) + "."

_FIRST = """\
No board yet? framestep console --demo shows a simulated rig in your browser.
A new board?  framestep install puts framestep onto it."""

_SUBJECTS = {
    "Motors": (motors, virtual, stream),
    "Moves": (moves, check, move_files),
    "Board": (rig, board),
    "In the browser, and without a board": (console, sim),
    "Ports, and looking into it": (traffic, lab),
}


class _BySubject(TyperGroup):
    """Lists the commands under their subjects."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find a command; of one that is in the laboratory, say where it is."""
        if args and args[0] in lab.NAMES:
            raise typer.BadParameter(f"{args[0]} is one of the lab: framestep lab {args[0]}")
        return super().resolve_command(ctx, args)

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
        print(context.get_help(), _FIRST, sep="\n\n")


_framestep.__doc__ = __doc__
for _title, _subjects in _SUBJECTS.items():
    for _subject in _subjects:
        _subject.add(app)
    _added: list[Any] = [*app.registered_commands, *app.registered_groups]
    for _command in _added:
        _command.rich_help_panel = _command.rich_help_panel or _title

if __name__ == "__main__":
    app()
