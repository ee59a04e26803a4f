"""`framestep lab conform`: check a device against the protocol."""

from pathlib import Path
from typing import Annotated

import typer

from .common import Json, Url, put, say_json

_FASTEST = 100


def conform(
    device: Url = None,
    full: Annotated[
        bool,
        typer.Option(
            "--full", help="also checks for a bench without a load: far moves, lights, outputs"
        ),
    ] = False,
    subject: Annotated[
        list[str] | None, typer.Option(help="only this subject, such as framing", metavar="NAME")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="do not ask before motors move")] = False,
    trace: Annotated[
        Path | None,
        typer.Option(
            help="also judge edges, from the trace that a simulated or emulated device writes",
            metavar="FILE",
        ),
    ] = None,
    hands: Annotated[
        bool,
        typer.Option("--hands", help="ask for switches to be pressed: inputs, limits, E-stop"),
    ] = False,
    speed: Annotated[
        float,
        typer.Option(
            help="speed of the device's time, as given to `make sim` or `make emu`",
            metavar="FACTOR",
            min=0.01,
            max=1000,
        ),
    ] = 1,
    page: Annotated[
        Path | None, typer.Option("--html", help="write the report as a page", metavar="FILE")
    ] = None,
    baseline: Annotated[
        Path | None,
        typer.Option(help="compare with the --json report of an earlier run", metavar="FILE"),
    ] = None,
    json: Json = False,
) -> None:
    """Check a device against the protocol's specification. Motors move a little, slowly."""
    import json as files

    from ..board.repl_device import PATIENCE
    from ..client import port_finder
    from ..client.client import BrokenOff
    from ..client.open_port import close_port, open_port
    from ..conform import kit, report, spec
    from ..conform.bench import Bench
    from ..conform.checks import every_check
    from ..conform.link import Failed, Link
    from ..conform.pace import HoldUps, PacedPort
    from ..conform.trace_tail import TraceTail
    from ..errors import ToolError

    if not 0 < speed <= _FASTEST:
        raise typer.BadParameter(f"--speed is more than 0 and at most {_FASTEST}, found {speed:g}")
    checks = every_check()
    names = {check.subject for check in checks}
    if unknown := set(subject or ()) - names:
        raise typer.BadParameter(f"{unknown.pop()} is none of {', '.join(sorted(names))}")
    checks = [check for check in checks if not subject or check.subject in subject]
    try:
        before = files.loads(baseline.read_text()) if baseline else None
        if before is not None and not isinstance(before["checks"], list):
            raise ValueError
    except (OSError, ValueError, KeyError, TypeError):
        raise ToolError(f"{baseline} is not a report written by --json") from None
    url = device or port_finder.protocol_port()  # report a missing device first
    if not yes and not typer.confirm(
        "Motors will move, and velocities and limits will change. Is the rig clear?", err=True
    ):
        raise typer.Abort

    def show(result: kit.Result) -> None:
        results.append(result)
        if not json and result.verdict not in (kit.PASSED, kit.LEFT_OUT):
            print(report.line(result), flush=True)

    results: list[kit.Result] = []
    port = open_port(url, 1)
    link = Link(PacedPort(port, speed) if speed != 1 else port, PATIENCE)
    # nothing holds up the clock of a port in lockstep
    hold_ups = None if hasattr(port, "clock") else HoldUps(speed).start()
    tail = None
    try:
        tail = TraceTail(trace) if trace else None
        link.pump(0.3)
        bench = Bench(link, full, tail, _person() if hands else None, hold_ups)
        kit.run(bench, checks, show)
        bench.recover()
    except Failed as failed:
        at = f" after {len(results)} checks" if results else ""
        raise ToolError(f"{url} cannot be checked{at}: {failed}") from None
    except KeyboardInterrupt:
        link.send(spec.STOP_ALL)
        raise
    except Exception as error:
        # termios.error, from a terminal that has gone, is no OSError
        if not isinstance(error, OSError) and type(error).__module__ != "termios":
            raise
        raise BrokenOff(f"the connection to {url} broke off: {error}") from None
    finally:
        if hold_ups:
            hold_ups.stop()
        close_port(port)
        if tail:
            tail.close()
    if page:
        page.write_text(report.as_html(url, results), encoding="utf-8")
    if json:
        say_json(report.as_json(url, results))
    else:
        for change in report.changes(before, results) if before else ():
            print(change)
        print(f"{len(results)} checks: {report.counts(results)}")
    if faults := sum(result.verdict == kit.FAULT for result in results):
        raise ToolError(f"{faults} of {len(results)} checks show a fault")


def _person():
    from ..conform.operator import Operator

    def say(text: str) -> None:
        typer.prompt(text, default="", show_default=False, prompt_suffix=" ", err=True)

    return Operator(say, lambda text: typer.confirm(text, err=True))


def add_lab(app: typer.Typer) -> None:
    """Put this command into the laboratory."""
    put(app, conform)
