"""The commands of `framestep`, by subject. Each module's `add` puts its own into the command line
(cli.py).

A module imports what only a command's body needs in that body: `framestep --help` is to come at
once.
"""
