"""Errors that the user of a tool can do something about, and commands that show them as one sentence."""

import sys
from typing import Any

import typer
from typer.exceptions import Abort, TyperException


class ToolError(Exception):
    """Something is wrong outside the tool: what was expected, what came, what to do."""


class Command(typer.Typer):
    """A command line that answers what is wrong with one sentence on standard error.

    Exit status: 2 for a wrong command line, 1 for a ToolError (or one of `expected`), 130 after Ctrl-C.
    """

    def __init__(self, name: str, expected: tuple[type[Exception], ...] = (), **options: Any):
        super().__init__(name=name, add_completion=False, pretty_exceptions_enable=False, **options)
        self.program = name
        self.expected: tuple[type[Exception], ...] = (ToolError, *expected)

    def __call__(self, args: list[str] | None = None) -> None:
        """Run with these arguments (default: the process's) and exit."""
        sys.exit(self.status(args))

    def status(self, args: list[str] | None = None) -> int:
        """Run with these arguments (default: the process's) and return the exit status."""
        try:
            result = typer.main.get_command(self)(args=args, prog_name=self.program, standalone_mode=False)
            return result if isinstance(result, int) else 0
        except TyperException as error:
            context = getattr(error, "ctx", None)
            asked = context.command_path if context else self.program
            return self._say(f"{error.format_message().rstrip('.')}; {asked} --help says what is expected", 2)
        except self.expected as error:
            return self._say(str(error), 1)
        except (Abort, KeyboardInterrupt):
            return 130

    def _say(self, text: str, status: int) -> int:
        print(f"{self.program}: {text}", file=sys.stderr)
        return status
