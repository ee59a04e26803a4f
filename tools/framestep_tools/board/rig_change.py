"""Change the rig file of a running board, and restore the previous one if the board refuses it."""

from collections.abc import Callable
from contextlib import AbstractContextManager

from ..errors import ToolError
from ..payloads import DeviceInfo
from .repl_device import MISTAKE, RIG_FILE, Device
from .restart import hello, takes_rig


class Refused(ToolError):
    """The board refuses the new rig file, and has the previous one again."""


class RigChange:
    """A board that restarts with a new rig file.

    The board must be connected, and `content` checked and without comments. Raises Moving, and
    changes nothing, while motors move.
    """

    def __init__(self, device: Device, content: bytes):
        self._before = device.read(RIG_FILE)
        self._ports_before = device.ports
        device.halt()
        device.replace(RIG_FILE, content)
        device.restart()
        self._device = device

    def see(
        self,
        opened: Callable[[], AbstractContextManager[Device]],
        protocol: str | None,
        ports: int,
    ) -> tuple[str, DeviceInfo]:
        """Wait until the board has restarted. Return the protocol's port and the board's HI.

        opened: makes a context in which the board is connected; protocol: the protocol's port, if
        known; ports: number of ports in the rig file. If the board refuses the file, as other
        firmware may, it restarts again with the previous one. Raises Refused with the reason.
        """
        path, info = hello(self._device.path, protocol, ports)
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
        hello(self._device.path, protocol, self._ports_before)
        raise Refused(f"the board refuses it ({why}) and has restarted with the previous one")
