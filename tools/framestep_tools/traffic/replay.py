"""Plays the host's side of a log against a device, and records what the device says to it."""

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
_LOOK_S = 0.05  # at most between two looks at the clock
_GRAIN_S = 1e-6  # less is left by rounding only, and a port may round it to nothing
_MILESTONES = {HardStop.TYPE, RtEnd.TYPE, RtGo.TYPE}


class Replay:
    """Sends what the log's host sent, byte by byte, in its own time; `entries` is the recording.

    Nothing is sent before the device has said what had come by then in the log: each answer, each
    HARD_STOP, RT_GO and RT_END. Where the log's host had learnt that nothing moves, the replay asks
    on, with IDs of its own, until that is so. It waits `patience_s` at most for what takes motion,
    and an answer's time limit for an answer; then it goes on.

    open_device: opens the device's port. speed: how many times as fast as in the log.
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
        self._sent: Counter[tuple[int, int]] = Counter()  # (ID, type) of requests
        self._heard: Counter[tuple[int, int]] = Counter()  # of what the device has said
        self._expected: Counter[tuple[int, int]] = Counter()
        self._idle: bool | None = None  # what MOTOR_STATUS told last
        self._asked = 0  # questions of its own

    def play(self) -> list[Entry]:
        """All of it; the recording. NoAnswer from a device that says nothing at all."""
        try:
            self._play()
        finally:
            self.close()
        return self.entries

    def close(self) -> None:
        """Close the device's port; what still moves comes to rest."""
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
                continue  # of an earlier replay: it asks for itself
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

    # ---- what the device says

    def _wait_for(self, entry: Entry) -> None:
        """Until the device has said the like of what it said in the log."""
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
            self._expected[key] = self._heard[key]  # it is not waited for again

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
        """Take what the device says for so long, or until that is so; whether it is."""
        end = self._clock() + seconds
        while not done():
            left = end - self._clock()
            if left < _GRAIN_S:
                return False
            if self.port is None:
                if self._clock is not time.monotonic:
                    return False  # that clock stands still while nobody reads
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
