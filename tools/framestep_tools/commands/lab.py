"""`framestep lab`: look into traffic, traces and devices. To drive a rig, none is needed."""

import typer

from . import conform, demo, prove, traces, traffic

lab = typer.Typer(help="Look into it: traffic, traces of pins, checks of any device.")
for _subject in (traffic, traces, conform, prove, demo):
    _subject.add_lab(lab)
NAMES = [str(command.callback.__name__) for command in lab.registered_commands if command.callback]


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    app.add_typer(lab, name="lab")
