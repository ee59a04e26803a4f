"""A board's port with a cable that fails on demand, to test host programs."""

from collections import Counter

from ..traffic.log import DEVICE, HOST, Recorder
from .boards import Channel

_FLIP = 0x10


class FaultyLine:
    """A Channel in front of another one. recorder: gets all bytes as they arrive.

    `plugged`: False while the cable is out.
    """

    def __init__(self, channel: Channel, recorder: Recorder):
        self.plugged = True
        self._channel, self._recorder = channel, recorder
        self._open = False  # state of the host's end
        self._damage: Counter[str] = Counter()  # number of next bytes to damage, by sender

    def plug(self, on: bool) -> None:
        """Pull the cable, or plug it in. The board's port closes, but the host does not notice."""
        if on == self.plugged:
            return
        self.plugged = on
        if self._open:
            self._notify_board(on)

    def damage(self, who: str) -> None:
        """Flip a bit of the next bytes from HOST or DEVICE."""
        self._damage[who] += 1

    def receive(self, data: bytes) -> None:
        """Send bytes to the board; they are lost while the cable is out."""
        if self.plugged:
            data = self._damaged(HOST, data)
            self._recorder.passed(HOST, data)
            self._channel.receive(data)

    def transmit(self) -> bytes:
        """Return the board's bytes since the last call; none while the cable is out."""
        data = self._channel.transmit()
        if not self.plugged or not data:
            return b""
        data = self._damaged(DEVICE, data)
        self._recorder.passed(DEVICE, data)
        return data

    def open_port(self, on: bool) -> None:
        """Open or close the host's end."""
        self._open = on
        if self.plugged:
            self._notify_board(on)

    @property
    def pending(self) -> int:
        """Number of bytes that the board has not read yet."""
        return self._channel.pending

    def _notify_board(self, on: bool) -> None:
        self._recorder.port(on)
        self._channel.open_port(on)

    def _damaged(self, who: str, data: bytes) -> bytes:
        if not self._damage[who] or not data:
            return data
        self._damage[who] -= 1
        at = len(data) // 2
        return data[:at] + bytes([data[at] ^ _FLIP]) + data[at + 1 :]
