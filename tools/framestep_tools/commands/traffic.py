"""Protocol traffic in words."""

from pathlib import Path
from typing import Annotated

import typer


def sniff(
    capture: Annotated[
        Path | None, typer.Argument(help="a capture: hexadecimal digits or the bytes themselves")
    ] = None,
    device: Annotated[str | None, typer.Option(help="listen between a new pseudo-terminal and this device")] = None,
) -> None:
    """Show protocol traffic frame by frame, from a capture or live."""
    from ..client import Client
    from ..errors import ToolError
    from ..serve import PtyLink
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
        with Client.open(device) as client:
            link = PtyLink()
            try:
                print(link.path, "ready", sep="\n", flush=True)
                relay(client.port, link, lambda line: print(line, flush=True), until=lambda: False)
            finally:
                link.close()


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    app.command()(sniff)
