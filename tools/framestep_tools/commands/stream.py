"""`framestep stream`: live positions for other programs."""

from typing import Annotated

import typer

from .common import AxesFile, Url, load_axes, note, put, talking

AGAIN_S = 1.0  # at rest, for a program that was started later


def _unit(name: str | None) -> str | None:
    from ..axes.units import UNITS

    lengths = [unit for unit, (kind, _) in UNITS.items() if kind == "length"]
    if name is not None and name not in lengths:
        raise typer.BadParameter(f"{name!r} is not one of {', '.join(lengths)}")
    return name


def stream(
    device: Url = None,
    freed: Annotated[
        str | None, typer.Option(help="send FreeD (message D1)", metavar="HOST:PORT")
    ] = None,
    osc: Annotated[str | None, typer.Option(help="send OSC 1.0", metavar="HOST:PORT")] = None,
    camera: Annotated[int, typer.Option(help="FreeD's number of the camera", min=0, max=255)] = 1,
    unit: Annotated[
        str | None,
        typer.Option(
            help="FreeD: unit of the virtual axes' lengths; without it that of the lengths in "
            "axes.toml, else mm",
            metavar="UNIT",
            callback=_unit,
        ),
    ] = None,
    axes: AxesFile = None,
) -> None:
    """Send live positions to other programs over UDP, until Ctrl-C.

    A packet for each report of the device, in units of axes.toml; at rest one a second.
    """
    from ..client.client import RequestRefused
    from ..client.live_positions import FreeD, Maker, Stream, Target
    from ..client.live_positions import osc as osc_packet
    from ..payloads import MotorGetPosition, VirtGetPosition

    if freed is None and osc is None:
        raise typer.BadParameter("name where to send: --freed HOST:PORT, --osc HOST:PORT or both")
    known = load_axes(axes)
    outputs: list[tuple[Target, Maker]] = []
    camera_pose = FreeD(known, unit, camera) if freed is not None else None
    try:
        if freed is not None and camera_pose:
            outputs.append((Target("--freed", freed), camera_pose.packet))
        if osc is not None:
            outputs.append(
                (Target("--osc", osc), lambda report, pose: osc_packet(known, report, pose))
            )
        with talking(device, known) as client:
            try:
                pose = client.request(VirtGetPosition())
            except RequestRefused:  # no virtual axes are configured
                pose = None
            if camera_pose:
                camera_pose.check(virtual=pose is not None)
            live = Stream(outputs, client.request(MotorGetPosition()), pose)
            client.on_event = live.hear
            note(f"sending to {' and '.join(target.name for target, _ in outputs)}; Ctrl-C ends it")
            before = -1
            while True:
                if live.sent == before:
                    live.send()
                before = live.sent
                client.pump(AGAIN_S)
                client.events.clear()
    except KeyboardInterrupt:
        return
    finally:
        for target, _ in outputs:
            target.close()
            if target.dropped:
                note(f"{target.name}: {target.dropped} packets could not be sent: {target.why}")


def add(app: typer.Typer) -> None:
    """Put these commands into the command line."""
    put(app, stream)
