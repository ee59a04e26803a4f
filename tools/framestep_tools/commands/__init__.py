"""The commands of `framestep`, by subject. Each module's `add` puts its commands into the command
line (cli.py).

A command imports in its body what only that body needs, so `framestep --help` comes at once.
"""
