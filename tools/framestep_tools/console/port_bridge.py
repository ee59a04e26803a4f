"""Carries bytes between a page and a device's port, and stops jogs when the page is gone.

A jog lasts as long as the page repeats it. A page that is gone cannot send a stop, so the bridge
does: it reads from the requests which motors are being jogged. The page decides beforehand whether
other motions may go on without it.

Other programs can use the port (framestep_tools.client.shared_port), as with every framestep
command: `framestep stop` stops what the page moves. The page's own stops are passed on to them, so
that none repeats its jog. Another page stops everything by `stop_all`.
"""

import asyncio
import contextlib
import os
import queue
import struct
import threading
from collections.abc import Callable
from typing import Any

from framestep.protocol import messages

from ..client.client import BrokenOff
from ..client.open_port import close_port
from ..client.shared_port import ALL_MOTORS, STOPS, SharedPort
from ..client.tcp_port import is_socket
from ..client.wire import Frame, FrameDecoder, encode
from ..payloads import REQUESTS, Ack, MotorStatus, MotorStopAll, Payload, Status

_LOOK_S = 0.05  # the reader waits this long for a byte before it checks whether to end
_ANSWER_S = 5.0
_MOST_AWAITED = 1000
_FIRST_ID = 0xF000_0000  # IDs of the bridge's own requests; the page counts from 1
_FIRST_OF_OTHERS = 0xE000_0000  # IDs of other programs' requests


class Jogs:
    """The jogs that have been requested, and not been stopped since."""

    def __init__(self) -> None:
        self._decoder = FrameDecoder()
        self._stops: dict[Payload, None] = {}  # that end them, in their order

    def note(self, data: bytes) -> list[Frame]:
        """Note the bytes on their way to the device. Return the frames in them."""
        frames = list(self._decoder.feed(data))
        for frame in frames:
            kind = REQUESTS.get(frame.type)
            if kind is MotorStopAll:
                self._stops.clear()
            if not kind or not (kind.JOGS or kind.STOPS):
                continue
            with contextlib.suppress(ValueError):  # the device refuses it
                request, _ = kind.unpack_known(frame.payload)
                if kind.JOGS:
                    self._stops[request.stop()] = None
                else:
                    self._stops.pop(request, None)
        return frames

    def __bool__(self) -> bool:
        return bool(self._stops)

    def stops(self) -> list[Payload]:
        """Return the requests that end all jogs."""
        found = list(self._stops)
        self._stops.clear()
        return found


class Bridge:
    """An open port.

    All of these are called in the event loop: `on_bytes` with the device's bytes; `on_end` once,
    with the reason, if the port is gone; `on_stopped` with the reason when another program or page
    has stopped motors. From then on the page's jogs are refused until `released` is called.
    `on_report` gets each message that the device sends unasked.
    """

    def __init__(self, port: Any, name: str):
        self.name = name
        self.on_bytes: Callable[[bytes], None] = lambda data: None
        self.on_end: Callable[[str], None] = lambda why: None
        self.on_stopped: Callable[[str], None] = lambda why: None
        self.on_report: Callable[[Frame], None] = lambda frame: None
        self._port = port
        self._loop = asyncio.get_running_loop()
        self._jogs = Jogs()
        self._order = asyncio.Lock()
        self._writing = threading.Lock()
        self._next_id = _FIRST_ID
        self._others_id = _FIRST_OF_OTHERS
        self._stopped = 0
        self._closing = False
        self._closed = False
        self._decoder = FrameDecoder()
        self._answers = FrameDecoder()
        self._awaited: dict[int, Callable[[Frame], None]] = {}  # what takes an answer, by its ID
        self._own_stops: queue.SimpleQueue[Frame] = queue.SimpleQueue()  # for other programs
        self._shared_port: SharedPort | None = None
        if not is_socket(name):  # a socket has room for one client, and another program may be it
            self._let_others_through()
        self._reader = threading.Thread(target=self._read, name="console-reader", daemon=True)
        self._reader.start()

    def _let_others_through(self) -> None:
        with contextlib.suppress(OSError):  # then the port is not offered to other programs
            self._shared_port = SharedPort(
                self, self.name, f"framestep console (process {os.getpid()})"
            )

    async def send(self, data: bytes) -> None:
        """Send a frame of the page to the device. Raises OSError if the port is gone.

        A frame after `close` is dropped: the page may not know yet.
        """
        if self._stopped and (refused := _refused_jogs(data)):
            self.on_bytes(refused)  # the page sent it before it knew of the stop
            return
        frames = self._jogs.note(data)
        await self._write(data)
        self._tell_others(frames)

    # ---- other programs, in the reader's thread

    def forward(self, kind: int, payload: bytes) -> int:
        """Send another program's request. Return the ID of its answer, for SharedPort.answer."""
        self._others_id += 1
        with self._writing:
            self._port.write(encode(kind, payload, self._others_id))
        return self._others_id

    @property
    def stopped(self) -> int:
        """The motors that other programs have stopped while the page still holds its jogs."""
        return self._stopped

    @stopped.setter
    def stopped(self, bits: int) -> None:
        self._stopped = bits
        self._loop.call_soon_threadsafe(self.on_stopped, "Another program has stopped the motors.")

    def released(self) -> None:
        """Note that the page has released all of its jogs."""
        self._stopped = 0

    # ---- requests for the page

    @property
    def jogging(self) -> bool:
        """Whether the page has begun a jog and not ended it."""
        return bool(self._jogs)

    async def let_go(self, why: str) -> None:
        """End the page's jogs although it still holds them, and send it the reason."""
        self._stopped = ALL_MOTORS
        await self.stop_jogs()
        self.on_stopped(why)

    async def stop_all(self, why: str) -> None:
        """Stop everything for another page, and send this one the reason. Raises OSError if the
        device does not acknowledge it."""
        self._stopped = ALL_MOTORS
        self._jogs.stops()
        number = self._new_id()
        answer: asyncio.Future[Frame] = self._loop.create_future()
        self._awaited[number] = answer.set_result
        try:
            await self._ask(MotorStopAll(), number)
            self.on_stopped(why)
            self._tell_others([Frame(number, MotorStopAll.TYPE, MotorStopAll().pack())])
            await asyncio.wait([answer], timeout=_ANSWER_S)
        finally:
            self._awaited.pop(number, None)
        if not answer.done():
            raise OSError(f"{self.name} does not answer")
        if answer.result().payload[:2] != struct.pack("<H", Ack.OK):
            raise OSError(f"{self.name} has refused it")

    async def ask_for(self, frame: Frame, on_answer: Callable[[Frame], None]) -> None:
        """Send the question of a page that watches. Raises OSError if the port is gone."""
        number = self._new_id()
        if len(self._awaited) > _MOST_AWAITED:  # a device that does not answer
            del self._awaited[next(iter(self._awaited))]
        self._awaited[number] = on_answer
        await self._write(encode(frame.type, frame.payload, number))

    def _tell_others(self, frames: list[Frame]) -> None:
        for frame in frames:
            if frame.type in STOPS:
                self._own_stops.put(frame)

    async def stop_jogs(self) -> None:
        """End all jogs; a run goes on."""
        for stop in self._jogs.stops():
            await self._ask(stop, self._new_id())

    async def moves(self) -> bool:
        """Ask the device whether any motor moves. Raises OSError if it does not answer.

        Other messages meanwhile are dropped, so no page may be connected.
        """
        decoder = FrameDecoder()
        number = self._new_id()
        answer: asyncio.Future[Status] = self._loop.create_future()

        def take(data: bytes) -> None:
            for frame in decoder.feed(data):
                if frame.id == number and not answer.done():
                    answer.set_result(Status.unpack(frame.payload))

        self.on_bytes = take
        await self._ask(MotorStatus(), number)
        # not wait_for: it loses a cancellation that comes together with the answer
        done, _ = await asyncio.wait([answer], timeout=_ANSWER_S)
        if not done:
            raise OSError(f"{self.name} does not say what moves")
        return answer.result().motor_bits != 0

    async def close(self) -> None:
        """Stop everything and close the port. A port that is gone is no error."""
        if self._closing:
            return
        with contextlib.suppress(OSError):
            await self._ask(MotorStopAll(), self._new_id())
        self._closing = True
        await asyncio.to_thread(self._reader.join)
        if self._shared_port:
            self._shared_port.close()
        await asyncio.to_thread(self._close_now)

    def _new_id(self) -> int:
        """Return the ID of a request; no other one has it, also while both wait to be sent."""
        self._next_id += 1
        return self._next_id

    async def _ask(self, request: Payload, number: int) -> None:
        await self._write(encode(request.TYPE, request.pack(), number))

    async def _write(self, data: bytes) -> None:
        async with self._order:
            await asyncio.to_thread(self._write_now, data)

    def _write_now(self, data: bytes) -> None:
        with self._writing:
            if not self._closed:
                self._port.write(data)

    def _close_now(self) -> None:
        with self._writing:
            self._closed = True
            close_port(self._port)

    def _read(self) -> None:
        """Read the port in a separate thread, because reading blocks."""
        try:
            while not self._closing:
                wait_s = _LOOK_S
                if self._shared_port:
                    wait_s = self._shared_port.wait(self._port, _LOOK_S)
                if self._port.timeout != wait_s:
                    self._port.timeout = wait_s
                data = self._port.read(1)
                if data:
                    data += self._port.read(self._port.in_waiting)
                    if self._shared_port is None:
                        self._let_others_through()
                    self._loop.call_soon_threadsafe(self._hear, data)
                if self._shared_port:
                    self._shared_port.look()
                    self._pass_on(self._shared_port, data)
        except Exception as error:
            # termios.error is no OSError, and not every system has a termios to import
            if not isinstance(error, OSError) and type(error).__module__ != "termios":
                raise
            if not self._closing:
                why = str(BrokenOff(f"the connection to {self.name} broke off"))
                self._loop.call_soon_threadsafe(self.on_end, why)

    def _hear(self, data: bytes) -> None:
        self.on_bytes(data)
        for frame in self._answers.feed(data):
            if frame.id == 0:
                self.on_report(frame)
            elif on_answer := self._awaited.pop(frame.id, None):
                on_answer(frame)

    def _pass_on(self, shared_port: SharedPort, data: bytes) -> None:
        """Forward messages to other programs. The page ignores their IDs."""
        while not self._own_stops.empty():
            shared_port.pass_on(self._own_stops.get())
        for frame in self._decoder.feed(data):
            if frame.id == 0:
                shared_port.pass_on(frame)
            else:
                shared_port.answer(frame)


def _refused_jogs(data: bytes) -> bytes:
    """Return the refusal of a frame that requests a jog, or nothing for other frames."""
    return b"".join(
        encode(frame.type | messages.MSG_FLAG_ACK, struct.pack("<H", Ack.ERR_GENERAL), frame.id)
        for frame in FrameDecoder().feed(data)
        if (kind := REQUESTS.get(frame.type)) and kind.JOGS
    )
