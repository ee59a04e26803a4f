"""Commands for protocol traffic in words, its logs, and the list of ports."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from .common import Json, Url, put, say_json


def sniff(
    capture: Annotated[
        Path | None,
        typer.Argument(help="a log, or a capture: hexadecimal digits or the bytes themselves"),
    ] = None,
    device: Annotated[
        str | None,
        typer.Option("--device", "-d", help="listen between a new pseudo-terminal and this device"),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(
            help="also write everything to this file, for a report and for replay",
            metavar="FILE",
        ),
    ] = None,
) -> None:
    """Show protocol traffic frame by frame.

    Traffic is live, from a log, or from a capture.
    """
    from ..errors import ToolError
    from ..traffic.sniffer import read_capture

    if (capture is None) == (device is None):
        raise typer.BadParameter("name either a capture file or a --device to listen to")
    if capture:
        if log:
            raise typer.BadParameter("--log is for listening to a --device")
        try:
            content = capture.read_bytes()
        except OSError as error:
            raise ToolError(f"cannot read the capture {capture}: {error.strerror}") from None
        for line in read_capture(content):
            print(line)
    elif device:
        _listen(device, log)


def _listen(device: str, log: Path | None) -> None:
    from ..client.client import DEFAULT_TIMEOUT_S, BrokenOff
    from ..client.open_port import close_port, open_port
    from ..client.pty_port import PtyLink
    from ..traffic.log import Entry, Recorder
    from ..traffic.sniffer import Relay, Tally, timed

    def open_device() -> Any:
        return open_port(device, DEFAULT_TIMEOUT_S)

    tally = Tally()
    tellers: list[Callable[[Entry], None]] = [
        tally.add,
        lambda entry: print(timed(entry), flush=True),
    ]
    port = open_device()
    try:
        link = PtyLink()
        if log:
            tellers.append(_log_writer(log, f"between a host and {device}").add)
    except BaseException:
        close_port(port)
        raise

    def show(entry: Entry) -> None:
        for each in tellers:
            each(entry)

    recorder = Recorder(show)
    relay = Relay(port, open_device, link, recorder)
    try:
        print(link.path, "ready", sep="\n", flush=True)
        relay.run(until=lambda: False)
    except OSError as error:
        raise BrokenOff(f"the connection to {device} broke off: {error}") from None
    finally:
        relay.close()
        link.close()
        print(tally)


def _log_writer(path: Path, subject: str) -> Any:
    from ..errors import ToolError
    from ..traffic.log import LogWriter
    from ..traffic.sniffer import describe_entry

    try:
        file = open(path, "w")  # noqa: SIM115 - written to until the program ends
    except OSError as error:
        raise ToolError(f"cannot write the log {path}: {error.strerror}") from None
    return LogWriter(file, subject, describe_entry)


def replay(
    log: Annotated[
        Path, typer.Argument(help="a log written by framestep lab sniff --log", show_default=False)
    ],
    target: Annotated[
        str | None,
        typer.Argument(help="the device, if not --device", metavar="[DEVICE]", show_default=False),
    ] = None,
    device: Url = None,
    speed: Annotated[
        float, typer.Option(help="times the log's own speed: for a simulator", min=0.01, max=1000)
    ] = 1.0,
    steps: Annotated[
        int, typer.Option(help="by how many steps positions at rest may differ", min=0)
    ] = 0,
    ignore: Annotated[
        list[str] | None,
        typer.Option(
            help="do not compare the answers to this message, such as HI; may be repeated",
            metavar="NAME",
        ),
    ] = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="also compare by value what depends on time")
    ] = False,
    patience: Annotated[
        float, typer.Option(help="seconds to wait for a motion to end", min=0, max=86400)
    ] = 10.0,
    record: Annotated[
        Path | None,
        typer.Option("--log", help="write a log of this replay", metavar="FILE"),
    ] = None,
) -> None:
    """Play a log against a device. Motors move!

    The log's host side is sent again, and the answers are compared with the log's. Compared by kind
    only: positions under way, MOTOR_STATUS, inputs, a device's name, version and memory. Ctrl-C
    closes the port, which stops all motors.
    """
    from ..client import port_finder
    from ..client.client import DEFAULT_TIMEOUT_S, BrokenOff, Client
    from ..client.open_port import open_port
    from ..errors import ToolError
    from ..traffic.compare import Rules, differences, names_known
    from ..traffic.log import HOST, read
    from ..traffic.replay import Replay

    entries = read(str(log))
    if not any(entry.who == HOST for entry in entries):
        raise ToolError(f"the log {log} contains nothing from a host")
    ignored = names_known(ignore or [])
    url = target or device or port_finder.protocol_port()
    with Client.open(
        url
    ) as client:  # checks that a device speaks this protocol before bytes are sent
        client.greet()
    writer = _log_writer(record, f"a replay of {log.name} on {url}") if record else None
    player = Replay(entries, lambda: open_port(url, DEFAULT_TIMEOUT_S), speed, patience)
    try:
        now = player.play()
    except OSError as error:
        raise BrokenOff(f"the connection to {url} broke off: {error}") from None
    finally:
        if writer:
            for entry in player.entries:
                writer.add(entry)
    found = list(differences(entries, now, Rules(steps, ignored, exact)))
    print(*found, sep="\n", end="\n" if found else "")
    count = sum(entry.who == HOST for entry in entries)
    if found:
        raise ToolError(f"{count} requests replayed: {len(found)} differences")
    print(f"{count} requests replayed: no difference")


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
    """List the boards' ports and their purposes, without opening any."""
    from ..client.port_finder import GET, OTHER, PortError, listed

    found = [port for port in listed() if everything or port.use != OTHER]
    if json:
        say_json(
            [
                {"port": p.path, **{k: v for k, v in p._asdict().items() if k != "path"}}
                for p in found
            ]
        )
    else:
        width = max((len(port.path) for port in found), default=0)
        for port in found:
            who = ", ".join(part for part in (port.product, port.serial) if part)
            print(f"{port.path:<{width}}  {_USES[port.use]}{f' ({who})' if who else ''}")
    if not found:
        raise PortError(f"no board with MicroPython is on USB: {GET}")


def add(app: typer.Typer) -> None:
    """Put this command into the command line."""
    put(app, ports)


def add_lab(app: typer.Typer) -> None:
    """Put these commands into the laboratory."""
    put(app, sniff, replay)
