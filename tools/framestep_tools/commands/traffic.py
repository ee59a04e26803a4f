"""Protocol traffic in words, and which ports there are."""

from pathlib import Path
from typing import Annotated

import typer

from .common import Json, put, say_json


def sniff(
    capture: Annotated[
        Path | None, typer.Argument(help="a capture: hexadecimal digits or the bytes themselves")
    ] = None,
    device: Annotated[
        str | None,
        typer.Option("--device", "-d", help="listen between a new pseudo-terminal and this device"),
    ] = None,
) -> None:
    """Show protocol traffic frame by frame, from a capture or live."""
    from ..client import Client
    from ..errors import ToolError
    from ..sniffer import read_capture, relay

    if (capture is None) == (device is None):
        raise typer.BadParameter("name either a capture file or a --device to listen to")
    if capture:
        try:
            content = capture.read_bytes()
        except OSError as error:
            raise ToolError(f"cannot read the capture {capture}: {error.strerror}") from None
        for line in read_capture(content):
            print(line)
    elif device:
        from ..pty_link import PtyLink

        with Client.open(device) as client:
            link = PtyLink()
            try:
                print(link.path, "ready", sep="\n", flush=True)
                relay(client.port, link, lambda line: print(line, flush=True), until=lambda: False)
            finally:
                link.close()


_USES = {
    "protocol": "framestep DMC: the port for Dragonframe and for these commands",
    "REPL": "MicroPython's REPL",
    "single": "MicroPython's REPL, or the protocol with \"ports\": 1",
    "other": "no board",
}  # fmt: skip


def ports(
    json: Json = False,
    everything: Annotated[
        bool, typer.Option("--all", help="ports of other devices as well")
    ] = False,
) -> None:
    """List the boards' ports, and what each is for; none is opened."""
    from ..ports import GET, OTHER, listed

    found = [port for port in listed() if everything or port.use != OTHER]
    if json:
        say_json(
            [
                {"port": p.path, **{k: v for k, v in p._asdict().items() if k != "path"}}
                for p in found
            ]
        )
        return
    if not found:
        print(f"no board with MicroPython is on USB: {GET}")
    width = max((len(port.path) for port in found), default=0)
    for port in found:
        who = ", ".join(part for part in (port.product, port.serial) if part)
        print(f"{port.path:<{width}}  {_USES[port.use]}{f' ({who})' if who else ''}")


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, ports, sniff)
