"""Find a board's protocol port after a restart, and greet the board there."""

import time
from collections.abc import Callable
from typing import TypeVar

from framestep.protocol import messages

from ..client.client import Client
from ..client.port_finder import protocol_behind
from ..errors import ToolError
from ..payloads import DeviceInfo, GetCondition, Hi, Request
from .repl_device import PATIENCE, DeviceError

_START_S = 60.0 * PATIENCE
_LOOK_S = 0.2
_ANSWER_S = 2.0
_Answer = TypeVar("_Answer")


def hello(
    repl: str, protocol: str | None, ports: int, advice: str | None = None
) -> tuple[str, DeviceInfo]:
    """Wait for a board that restarts. Return its port and its HI.

    repl: the REPL's port before; protocol: the protocol's port, if it is separate and known; ports:
    number of ports in the rig file; advice: what to do if nobody answers.
    """
    if advice is None:
        advice = f"mpremote connect {repl} exec 'import main' shows what it prints at its start"
    return answer(
        lambda: repl if ports == 1 else protocol or protocol_behind(repl),
        "it has no port named framestep DMC",
        f"; {advice}",
    )


def answer(
    find: Callable[[], str | None], otherwise: str, advice: str = ""
) -> tuple[str, DeviceInfo]:
    """Wait for a board that starts. Return its port and its HI.

    find: returns its port, or None while there is none; otherwise: error text if none appears.
    """
    return _asked(Hi(), find, otherwise, advice)


def takes_rig(path: str) -> bool:
    """Return whether the board on this port has accepted its rig file at the start."""
    return not condition(path) & messages.CONDITION_RIG_FILE_INVALID


def condition(path: str) -> int:
    """Return the CONDITION_ bits of the board on this port."""
    return _asked(GetCondition(), lambda: path, "")[1].bits


def _asked(
    request: Request[_Answer], find: Callable[[], str | None], otherwise: str, advice: str = ""
) -> tuple[str, _Answer]:
    """Repeat a request until it is answered.

    A board that starts has no port yet, and a port that a program has just closed may be busy for a
    moment.
    """
    end = time.monotonic() + _START_S
    why = otherwise
    while True:
        time.sleep(_LOOK_S)
        if path := find():
            try:
                with Client.open(path, _ANSWER_S) as client:
                    return path, client.request(request)
            except (ToolError, OSError) as error:
                why = str(error)
        if time.monotonic() > end:
            raise DeviceError(f"the board does not come up ({why}){advice}")


def greeting(path: str, info: DeviceInfo) -> str:
    """Return a line with the device's name, version and capabilities."""
    return (
        f"{info.name} on {path}, firmware {info.major}.{info.minor}.{info.revision}: "
        f"{info.motors} motors, {info.dmx_channels} DMX channels, "
        f"{info.outputs} outputs, {info.inputs} inputs, {info.upload_frames} frames"
    )
