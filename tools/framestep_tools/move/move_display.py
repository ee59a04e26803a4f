"""Display of a playing move: a progress bar and the motors' positions, live on a terminal."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from ..axes.rig_axes import Axes
from ..client.client import Event
from ..payloads import Positions

LINE_EVERY_S = 1.0  # of the device's time, if the output is not a terminal


class MoveDisplay:
    """The play head between frame `first` and frame `last`, and a line per motor.

    names: names of the motors to show; quiet: without a terminal print nothing, instead of a line
    now and then; axes: units of the motors' positions.
    """

    def __init__(
        self,
        names: Mapping[int, str],
        first: int,
        last: int,
        console: Console,
        quiet: bool = False,
        axes: Axes | None = None,
    ):
        self.names, self.first, self.last = names, first, last
        self.axes = axes or Axes()
        self.console = console
        self.quiet = quiet
        self.live: Live | None = None
        self.progress = Progress(
            TextColumn("{task.description:<16}"), BarColumn(), TextColumn("{task.fields[text]}")
        )
        self.task = self.progress.add_task(
            "", total=abs(last - first) or 1, completed=0, text=f"of frames {first} to {last}"
        )
        self._last_line_s = float("-inf")

    @contextmanager
    def running(self) -> Iterator[None]:
        """Draw during this context."""
        if not self.console.is_terminal:
            yield
            return
        with Live(self.progress, console=self.console, refresh_per_second=12) as self.live:
            yield
        self.live = None

    def phase(self, text: str) -> None:
        """Show what happens now."""
        if self.live:
            self.progress.update(self.task, description=text)
        elif not self.quiet:
            self.console.print(text)

    def warn(self, text: str) -> None:
        """Print a warning above the drawing, or on standard error."""
        if self.live:
            self.console.print(text)
        else:
            print(text, file=sys.stderr, flush=True)

    def show(self, event: Event) -> None:
        """Show an event from the device; positions are drawn."""
        report = event.message
        if not isinstance(report, Positions):
            return
        frame = report.move_time / 1000
        if self.live:
            self.advance(frame)
            self.live.update(self._table(report))
        elif not self.quiet and event.time_s - self._last_line_s >= LINE_EVERY_S:
            self._last_line_s = event.time_s
            steps = "  ".join(
                f"{name} {report.steps[motor - 1]}" for motor, name in self.names.items()
            )
            self.console.print(f"  frame {frame:6.1f}  {steps}")

    def advance(self, frame: float) -> None:
        """Draw the play head at a frame."""
        way = (frame - self.first) * (1 if self.last >= self.first else -1)
        self.progress.update(
            self.task,
            completed=min(max(way, 0), abs(self.last - self.first)),
            text=f"frame {frame:.1f} of {self.first} to {self.last}",
        )

    def _table(self, report: Positions) -> Any:
        table = Table.grid(padding=(0, 2))
        table.add_row(self.progress)
        table.add_row(motor_table(self.names, report, self.axes))
        return table


class ShotDisplay(MoveDisplay):
    """Frames that are shot one by one, and how many of `count` are done. names, axes: as above."""

    def __init__(
        self, names: Mapping[int, str], count: int, console: Console, axes: Axes | None = None
    ):
        super().__init__(names, 0, count, console, quiet=True, axes=axes)
        self.progress.update(self.task, text=f"0 of {count} frames")

    def shot(self, done: int, frame: int) -> None:
        """Show that `done` frames are shot; `frame` is the present or last one."""
        self.progress.update(
            self.task,
            completed=done,
            description=f"frame {frame}",
            text=f"{done} of {self.last} frames",
        )

    def advance(self, frame: float) -> None:
        """Ignore the play head: it does not show how many frames are shot."""


def motor_table(names: Mapping[int, str], report: Positions, axes: Axes) -> Table:
    """Return a table of positions, without motors that the device does not have."""
    motors = Table(box=None)
    for title in ("motor", "axis", "steps", ""):
        motors.add_column(title, justify="right")
    for motor, name in names.items():
        if motor <= len(report.steps):
            steps = report.steps[motor - 1]
            motors.add_row(str(motor), name, str(steps), axes.value(motor, steps))
    return motors
