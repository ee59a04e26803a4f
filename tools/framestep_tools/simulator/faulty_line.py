"""A board's port on a cable whose faults can be had on demand, to try a host program against."""

from collections import Counter

from ..traffic.log import DEVICE, HOST, Recorder
from .boards import Channel

_FLIP = 0x10


class FaultyLine:
    """A Channel in front of another one. `recorder` is told what passes, as it arrives.

    `plugged`: False after unplug().
    """

    def __init__(self, channel: Channel, recorder: Recorder):
        self.plugged = True
        self._channel, self._recorder = channel, recorder
        self._open = False  # as the host has its end
        self._damage: Counter[str] = Counter()  # bytes to come, by who sends them

    def plug(self, on: bool) -> None:
        """Pull the cable, or put it back: the board finds its port closed, the host is not told."""
        if on == self.plugged:
            return
        self.plugged = on
        if self._open:
            self._tell_board(on)

    def damage(self, who: str) -> None:
        """Flip a bit of what HOST or DEVICE sends next."""
        self._damage[who] += 1

    def receive(self, data: bytes) -> None:
        """Bytes for the board; lost while the cable is out."""
        if self.plugged:
            data = self._damaged(HOST, data)
            self._recorder.passed(HOST, data)
            self._channel.receive(data)

    def transmit(self) -> bytes:
        """What the board has sent since the last call; nothing while the cable is out."""
        data = self._channel.transmit()
        if not self.plugged or not data:
            return b""
        data = self._damaged(DEVICE, data)
        self._recorder.passed(DEVICE, data)
        return data

    def open_port(self, on: bool) -> None:
        """The host opens or closes its end."""
        self._open = on
        if self.plugged:
            self._tell_board(on)

    @property
    def pending(self) -> int:
        """Bytes that the board has not taken yet."""
        return self._channel.pending

    def _tell_board(self, on: bool) -> None:
        self._recorder.port(on)
        self._channel.open_port(on)

    def _damaged(self, who: str, data: bytes) -> bytes:
        if not self._damage[who] or not data:
            return data
        self._damage[who] -= 1
        at = len(data) // 2
        return data[:at] + bytes([data[at] ^ _FLIP]) + data[at + 1 :]
