"""A new rig file for a board that runs: put there, and taken back where the board refuses it."""

from collections.abc import Callable
from contextlib import AbstractContextManager

from ..errors import ToolError
from ..payloads import DeviceInfo
from .repl_device import MISTAKE, RIG_FILE, Device
from .restart import hello, takes_rig


class Refused(ToolError):
    """The board does not go by the new rig file, and has that of before again."""


class RigChange:
    """A board that restarts with a new rig file. Made with the board connected, `content` being
    without comments and checked. Moving, and nothing changed, while motors move."""

    def __init__(self, device: Device, content: bytes):
        self._before = device.read(RIG_FILE)
        self._ports_before = 1 if device.state.runs and not device.state.background else 2
        device.halt()
        device.replace(RIG_FILE, content)
        device.restart()
        self._repl = device.path

    def see(
        self,
        opened: Callable[[], AbstractContextManager[Device]],
        protocol: str | None,
        ports: int,
    ) -> tuple[str, DeviceInfo]:
        """Wait until it has restarted; the protocol's port and who answers there.

        opened: makes a context in which the board is connected; protocol: the port of the protocol
        where it is known; ports: how many the rig file asks for. A board that refuses the file, as
        other firmware may, restarts once more with that of before; Refused tells why.
        """
        path, info = hello(self._repl, protocol, ports)
        if takes_rig(path):
            return path, info
        with opened() as device:
            why = device.run(MISTAKE).rpartition("\x02")[2].strip()
            device.halt()
            if self._before is None:
                device.remove(RIG_FILE)
            else:
                device.replace(RIG_FILE, self._before)
            device.restart()
        hello(self._repl, protocol, self._ports_before)
        raise Refused(f"the board rejects it ({why}) and has restarted with the previous one")
