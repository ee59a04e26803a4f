"""`framestep console`: drive a device from the browser."""

import asyncio
import contextlib
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .common import AxesFile, Url, put

if TYPE_CHECKING:
    from ..console.demo_board import DemoBoard

_PORT = 7878
_OPEN_S = 1.0


def console(
    device: Url = None,
    port: Annotated[
        int,
        typer.Option(
            help="port of the page on this computer; 0 takes a free one", min=0, max=65535
        ),
    ] = _PORT,
    repl: Annotated[
        str | None, typer.Option(help="port of the board's REPL, if it is not found by itself")
    ] = None,
    demo: Annotated[bool, typer.Option("--demo", help="use a simulated crane")] = False,
    browser: Annotated[bool, typer.Option(help="open the page in the browser")] = True,
    save: Annotated[
        Path | None,
        typer.Option(
            help="only write the page into a folder, for your own web server", metavar="DIR"
        ),
    ] = None,
    lan: Annotated[
        bool,
        typer.Option(
            "--lan",
            help="serve the page in the local network too, and print a QR code for a phone",
        ),
    ] = False,
    axes: AxesFile = None,
) -> None:
    """Drive the device from a page in the browser, until Ctrl-C.

    The page is served on this computer alone, unless --lan is given.
    """
    if save:
        from ..console import page_files

        print(f"{page_files.save(save)} files are in {save}")
        return
    from ..client import port_finder
    from ..client.client import Client
    from ..console.demo_board import DemoBoard
    from ..console.server import lan_address

    address = lan_address() if lan else None
    if demo and device:
        raise typer.BadParameter("--demo simulates a device, so leave the other one out")
    with contextlib.ExitStack() as ending:
        simulated = ending.enter_context(DemoBoard()) if demo else None
        url = simulated.url if simulated else device or port_finder.protocol_port()
        if simulated and not axes:
            axes = ending.enter_context(_axes_of_demo())
        elif not simulated:
            with Client.open(url) as client:
                client.greet()  # reports a wrong port here instead of on the page
        # a second Ctrl-C while motors ramp down closes the port, and the controller stops them
        with contextlib.suppress(KeyboardInterrupt):
            work = _serve(url, repl or _repl_of(url), port, address, browser, axes, simulated)
            asyncio.run(work)


@contextlib.contextmanager
def _axes_of_demo() -> Iterator[Path]:
    """Yield an axes.toml for the demo's crane: the user's own is not changed."""
    from ..console.demo import axes_toml

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "axes.toml"
        path.write_text(axes_toml())
        yield path


def _repl_of(url: str) -> str | None:
    """Return the REPL's port of the board with this port, or None if the system does not know
    it."""
    from ..client import port_finder
    from ..client.tcp_port import is_socket

    if is_socket(url):
        return None
    return next(
        (each.path for each in port_finder.siblings(url) if each.use == port_finder.REPL), None
    )


def show_code(url: str) -> None:
    """Print an address of the local network, as text and as a QR code."""
    import io

    import segno

    drawn = io.StringIO()
    segno.make(url, micro=False).terminal(drawn, compact=True)
    print(f"{drawn.getvalue()}{url}", flush=True)
    print(
        "Whoever has this address can move the rig, and the link is not encrypted: "
        "use a network that you trust.",
        flush=True,
    )


async def _serve(
    url: str,
    repl: str | None,
    port: int,
    lan: str | None,
    browser: bool,
    axes: Path | None,
    simulated: "DemoBoard | None",
) -> None:
    from ..client.open_port import open_port
    from ..console.axes_text import AxesText
    from ..console.board_requests import BoardWork
    from ..console.device import ConsoleDevice
    from ..console.server import ConsoleServer

    work = BoardWork(repl, url)
    device = ConsoleDevice(lambda: open_port(url, _OPEN_S), url, work, AxesText(axes))
    if simulated:
        device.simulate(simulated)
    server = ConsoleServer(device)
    await server.start(port, lan)
    ending = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):  # Windows: Ctrl-C ends asyncio.run itself
            loop.add_signal_handler(number, ending.set)
    print(server.url, flush=True)
    if server.lan_url:
        show_code(server.lan_url)
    print("Ctrl-C ends it", flush=True)
    if browser:
        import webbrowser

        await asyncio.to_thread(webbrowser.open, server.url)
    try:
        await ending.wait()
    finally:
        await server.stop()


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, console)
