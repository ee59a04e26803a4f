"""Plays the host's side of a log against a device, and records the device's messages."""

import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from ..client.client import DEFAULT_TIMEOUT_S, READ_SIZE, NoAnswer
from ..client.wire import FrameDecoder, encode
from ..payloads import HardStop, MotorStatus, RtEnd, RtGo, Status
from .log import DEVICE, HOST, OPEN, REPLAY_IDS, Entry, Recorder
from .sniffer import meaning

_ASK_AGAIN_S = 0.05
_LOOK_S = 0.05  # longest interval between two readings of the clock
_GRAIN_S = 1e-6  # a shorter remainder is only rounding, and a port may round it to 0
_MILESTONES = {HardStop.TYPE, RtEnd.TYPE, RtGo.TYPE}


class Replay:
    """Sends the bytes of the log's host at the log's pace; `entries` is the recording.

    Each request waits until the device has sent the messages that preceded it in the log: answers,
    HARD_STOP, RT_GO and RT_END. If the log shows that motion had stopped, the replay repeats
    MOTOR_STATUS, with its own IDs, until the device says so too. It waits at most `patience_s` for
    motion, and an answer's time limit for an answer; then it goes on.

    open_device: opens the device's port; speed: factor on the log's speed.
    """

    def __init__(
        self,
        log: list[Entry],
        open_device: Callable[[], Any],
        speed: float = 1.0,
        patience_s: float = 10.0,
    ):
        self.log = log
        self.entries: list[Entry] = []
        self.port: Any = None
        self._open_device = open_device
        self._speed, self._patience_s = speed, patience_s
        self._clock: Callable[[], float] = time.monotonic
        self._recorder = Recorder(self.entries.append, lambda: self._clock())
        self._decoder = FrameDecoder()
        self._sent: Counter[tuple[int, int]] = Counter()  # requests by (ID, type)
        self._heard: Counter[tuple[int, int]] = Counter()  # the device's messages by (ID, type)
        self._expected: Counter[tuple[int, int]] = Counter()
        self._idle: bool | None = None  # the last MOTOR_STATUS
        self._asked = 0  # number of the replay's own requests

    def play(self) -> list[Entry]:
        """Play the whole log. Return the recording. Raises NoAnswer if the device is silent."""
        try:
            self._play()
        finally:
            self.close()
        return self.entries

    def close(self) -> None:
        """Close the device's port. Motors come to rest."""
        if self.port is not None:
            self.port.close()
            self.port = None
            self._recorder.port(False)

    def _play(self) -> None:
        last_log = last = None
        for entry in self.log:
            if entry.who == DEVICE:
                self._wait_for(entry)
                continue
            frame = entry.frame
            if frame and frame.id in REPLAY_IDS and entry.who == HOST:
                continue  # a request of an earlier replay: this one makes its own
            if last is not None and last_log is not None:
                self._listen_until(last + (entry.time_s - last_log) / self._speed)
            self._do(entry)
            last_log, last = entry.time_s, self._clock()
        if last is not None and last_log is not None:
            self._listen_until(last + (self.log[-1].time_s - last_log) / self._speed)

    def _do(self, entry: Entry) -> None:
        if entry.who == HOST:
            self._open()
            if frame := entry.frame:
                self._sent[frame.id, frame.type] += 1
            self._send(entry.data)
        elif entry.who == OPEN:
            self._open()
        else:
            self.close()

    def _open(self) -> None:
        if self.port is None:
            self.port = self._open_device()
            self._clock = getattr(self.port, "clock", time.monotonic)
            self._decoder.reset()
            self._recorder.port(True)

    def _send(self, data: bytes) -> None:
        self._recorder.passed(HOST, data)
        self.port.write(data)

    # ---- messages of the device

    def _wait_for(self, entry: Entry) -> None:
        """Wait until the device has sent the messages that the log shows."""
        frame = entry.frame
        if frame is None or self.port is None:
            return
        key = frame.id, frame.request_type
        if frame.id == 0 and not frame.is_ack:
            if frame.type in _MILESTONES:
                self._expect(key, self._patience_s)
            return
        if self._sent[key]:
            self._expect(key, DEFAULT_TIMEOUT_S)
            if not self._heard:
                raise NoAnswer(
                    f"no answer to the log's first request within {DEFAULT_TIMEOUT_S:g} s"
                )
        said = meaning(frame, False)
        if isinstance(said, Status) and said.idle:
            self._wait_until_idle()

    def _expect(self, key: tuple[int, int], seconds: float) -> None:
        self._expected[key] += 1
        wanted = self._expected[key]
        if not self._listen(lambda: self._heard[key] >= wanted, seconds):
            self._expected[key] = self._heard[key]  # do not wait for it again

    def _wait_until_idle(self) -> None:
        end = self._clock() + self._patience_s
        while self._idle is False and self._clock() < end:
            self._listen(lambda: False, _ASK_AGAIN_S)
            number = REPLAY_IDS.start + self._asked % len(REPLAY_IDS)
            self._asked += 1
            self._send(encode(MotorStatus.TYPE, b"", number))
            self._expect((number, MotorStatus.TYPE), DEFAULT_TIMEOUT_S)

    def _listen_until(self, time_s: float) -> None:
        self._listen(lambda: False, time_s - self._clock())

    def _listen(self, done: Callable[[], bool], seconds: float) -> bool:
        """Receive messages until `done` is true or the time is over. Return whether it is true."""
        end = self._clock() + seconds
        while not done():
            left = end - self._clock()
            if left < _GRAIN_S:
                return False
            if self.port is None:
                if self._clock is not time.monotonic:
                    return False  # this port's clock stops while nobody reads
                time.sleep(min(left, _LOOK_S))
                continue
            self.port.timeout = min(left, _LOOK_S)
            if data := self.port.read(1):
                self.port.timeout = 0
                self._take(data + self.port.read(READ_SIZE))
        return True

    def _take(self, data: bytes) -> None:
        self._recorder.passed(DEVICE, data)
        for frame in self._decoder.feed(data):
            self._heard[frame.id, frame.request_type] += 1
            said = meaning(frame, False)
            if isinstance(said, Status) and frame.id:
                self._idle = said.idle
