"""Errors that a user can act on, and commands that show them as one sentence."""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer
from typer.exceptions import Abort, TyperException

from flash_images import FlashImageError

# Exit statuses of a command, as in docs/use/troubleshooting.md
DONE = 0
FAILED = 1
USAGE = 2
NO_PORT = 3
PORT_BUSY = 4
NO_CONTROLLER = 5
BROKEN_OFF = 6
REFUSED = 7
INTERRUPTED = 130

STATUSES = {
    DONE: "done",
    FAILED: "a file, a setting or a tool has a fault",
    USAGE: "the command line is wrong",
    NO_PORT: "no board is on USB, or the port does not exist or may not be opened",
    PORT_BUSY: "another program has the port",
    NO_CONTROLLER: "no motion controller answers there, or it answers wrongly",
    BROKEN_OFF: "the connection broke off: a pulled cable, a reset",
    REFUSED: "the controller refuses what was asked",
    INTERRUPTED: "Ctrl-C",
}


_PHRASES = [  # of the library that parses arguments, and plainer ones
    (r"^Invalid value for '([^']*)': ", r"\1: "),
    (r"^Invalid value: ", ""),
    ("Value error, ", ""),
    (r"Input should be a valid integer.*", "expected a whole number"),
    (r"Input should be a valid number.*", "expected a number"),
    (r"Input should be greater than or equal to", "expected at least"),
    (r"Input should be less than or equal to", "expected at most"),
    (r"Input should be", "expected a number"),
    (r" \(Possible options: (.*)\)", r"; did you mean \1?"),
    (r"Got unexpected extra argument\(s\) \((.*)\)", r"more than expected: \1"),
]


class ToolError(Exception):
    """Something is wrong outside the tool. The text says what was expected, what came, what to do.

    `status` is the command's exit status, one of STATUSES.
    """

    status = FAILED


@contextmanager
def extra(what: str) -> Iterator[None]:
    """Wrap imports of optional libraries. If one is missing, name the command that installs it."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = {"vcd": "pyvcd", "pxr": "usd-core"}.get(str(error.name), error.name)
        raise ToolError(
            f"{what} needs {package}: pipx inject framestep {package}, or without pipx "
            f"pip install {package}"
        ) from None


class Command(typer.Typer):
    """A command line that reports an error as one sentence on standard error.

    Its exit status is one of STATUSES; errors in `expected` give FAILED.
    """

    def __init__(self, name: str, expected: tuple[type[Exception], ...] = (), **options: Any):
        options.setdefault("add_completion", False)
        super().__init__(
            name=name,
            pretty_exceptions_enable=False,
            rich_markup_mode=None,
            context_settings={"help_option_names": ["--help", "-h"]},
            **options,
        )  # plain text: loading rich would double the time that a command takes to start
        self.program = name
        self.expected: tuple[type[Exception], ...] = (ToolError, FlashImageError, *expected)

    def __call__(self, args: list[str] | None = None) -> None:
        """Run with these arguments (default: the process's) and exit."""
        sys.exit(self.status(args))

    def status(self, args: list[str] | None = None) -> int:
        """Run with these arguments (default: the process's) and return the exit status."""
        try:
            result = typer.main.get_command(self)(
                args=args, prog_name=self.program, standalone_mode=False
            )
            sys.stdout.flush()
            return result if isinstance(result, int) else DONE
        except TyperException as error:
            context = getattr(error, "ctx", None)
            asked = context.command_path if context else self.program
            said = plain(error.format_message())
            return self._say(f"{said}; {asked} --help says what is expected", USAGE)
        except self.expected as error:
            return self._say(str(error), getattr(error, "status", FAILED))
        except (Abort, KeyboardInterrupt):
            return INTERRUPTED
        except BrokenPipeError:  # the reader of the output has closed it
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            return DONE
        except Exception as error:
            if _interrupted(error):
                return INTERRUPTED
            raise

    def _say(self, text: str, status: int) -> int:
        print(f"{self.program}: {text}", file=sys.stderr)
        return status


def plain(text: str) -> str:
    """Return a library's text about a wrong argument in this project's words."""
    for pattern, words in _PHRASES:
        text = re.sub(pattern, words, text)
    return text.rstrip(".")


def _interrupted(error: BaseException | None) -> bool:
    """Return whether a Ctrl-C caused an error. Some libraries turn it into an ImportError while
    they are being loaded."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False
