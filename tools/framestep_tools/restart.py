"""After a restart: the board's protocol port, and who answers there."""

import time

from .client import Client
from .device import DeviceError
from .errors import ToolError
from .payloads import DeviceInfo, Hi
from .ports import protocol_of

_START_S = 60.0
_LOOK_S = 0.2
_ANSWER_S = 2.0


def hello(repl: str, protocol: str | None, ports: int) -> tuple[str, DeviceInfo]:
    """Ask the board that restarts who it is; the port on which it answers, and the answer.

    repl: where its REPL was; protocol: the port of the protocol, if it has one of its own and that is known; ports: how
    many the rig file asks for.
    """
    end = time.monotonic() + _START_S
    why = "it has no port named framestep DMC"
    while True:
        time.sleep(_LOOK_S)
        path = repl if ports == 1 else protocol or protocol_of(repl)
        if path:
            try:
                with Client.open(path, _ANSWER_S) as client:
                    return path, client.request(Hi())
            except (ToolError, OSError) as error:
                why = str(error)
        if time.monotonic() > end:
            raise DeviceError(
                f"the board does not come up ({why}); what it says as it starts shows "
                f"mpremote connect {repl} exec 'import main'"
            )


def greeting(path: str, info: DeviceInfo) -> str:
    """Who the device is and what it can do, in a line."""
    return (
        f"{info.name} on {path}, firmware {info.major}.{info.minor}.{info.revision}: {info.motors} motors, "
        f"{info.dmx_channels} DMX channels, {info.outputs} outputs, {info.inputs} inputs, {info.upload_frames} frames"
    )
