"""Conversion of traces (--trace of `make sim` and `make emu`) to waveforms and pictures."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import extra
from .common import put

if TYPE_CHECKING:
    from ..judge.trace import Trace

_ENDINGS = (".png", ".svg", ".pdf")

File = Annotated[
    Path,
    typer.Argument(
        help="a trace: CSV with time_ns,signal,value", metavar="TRACE", show_default=False
    ),
]


def _read(trace: Path) -> "Trace":
    from ..errors import ToolError
    from ..judge.trace import Trace

    try:
        return Trace.read(trace)
    except OSError as error:
        raise ToolError(f"cannot read the trace {trace}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ToolError(f"{trace}: expected a trace, CSV in text, found other bytes") from None


@contextmanager
def _written(path: Path) -> Iterator[None]:
    from ..errors import ToolError

    try:
        yield
    except OSError as error:
        raise ToolError(f"cannot write {path}: {error.strerror}") from None


def vcd(
    trace: File,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="file to write; by default next to the trace", metavar="FILE"
        ),
    ] = None,
    pulse_us: Annotated[
        float, typer.Option(help="how long a step's pulse is drawn at most", min=0.01, max=1000)
    ] = 1,
) -> None:
    """Convert a trace to a VCD file, for GTKWave and PulseView."""
    with extra("a VCD file"):
        from ..judge.vcd import write

    read = _read(trace)
    target = out or trace.with_suffix(".vcd")
    with _written(target), open(target, "w") as file:
        changes = write(read, file, round(pulse_us * 1000))
    print(f"{target}: {changes} changes of {len(read.signals)} signals")


def plot(
    trace: File,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="picture to write (png, svg, pdf); by default next to the trace",
            metavar="FILE",
        ),
    ] = None,
) -> None:  # fmt: skip
    """Draw a trace as a picture.

    It shows positions and velocities from the edges, and the levels of all other pins.
    """
    from ..errors import ToolError

    target = out or trace.with_suffix(".png")
    if target.suffix.lower() not in _ENDINGS:
        raise ToolError(f"{target}: a picture is one of {', '.join(_ENDINGS)}")
    with extra("a picture"):
        import matplotlib  # noqa: F401

        from ..judge.plots import plot_trace

    read = _read(trace)
    if not read.signals:
        raise ToolError(f"{trace}: nothing has happened in this trace")

    with _written(target):
        plot_trace(read, target)
    print(target)


def add_lab(app: typer.Typer) -> None:
    """Put these commands into the laboratory."""
    put(app, vcd, plot)
