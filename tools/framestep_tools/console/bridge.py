"""Carries bytes between a page and a device's port, and stops what only a held button may move.

A jog lasts as long as the page repeats it. The page that has gone cannot say stop, so the bridge
does: it reads in the requests which motors are being jogged. Whether anything else may go on
without the page, the page has said before.

Other programs share the port (framestep_tools.client.shared_port), as with any program of framestep
that has one: `framestep stop` stops what the page moves.
"""

import asyncio
import contextlib
import os
import struct
import threading
from collections.abc import Callable
from typing import Any

from framestep.protocol import messages

from ..client.client import BrokenOff
from ..client.open_port import close_port, is_socket
from ..client.shared_port import Door
from ..client.wire import Frame, FrameDecoder, encode
from ..payloads import (
    TYPE_NAMES,
    Ack,
    MotorJog,
    MotorStatus,
    MotorStop,
    MotorStopAll,
    Payload,
    RtJogAll,
    Status,
    VirtJog,
    VirtJogOnLine,
    VirtStop,
)

_LOOK_S = 0.05  # how long the reader waits for a byte before it looks whether it is to end
_ANSWER_S = 5.0
_FIRST_ID = 0xF000_0000  # of requests that the bridge makes; the page counts from 1
_FIRST_OF_OTHERS = 0xE000_0000  # of those that come in by the door
_JOGS = {kind for kind, name in TYPE_NAMES.items() if "JOG" in name}
# the virtual motor that VIRT_STOP names for each axis of JOG_ON_LINE (field note 9.6)
_OF_LINE = {0: 2, 1: 3, 2: 1, 3: 4, 4: 5}


class Jogs:
    """Which motors and virtual motors have been asked to jog, and not to stop since."""

    def __init__(self) -> None:
        self._decoder = FrameDecoder()
        self.motors: set[int] = set()
        self.virtual: set[int] = set()
        self.all = False  # along the uploaded move

    def note(self, data: bytes) -> None:
        """Take in what goes to the device."""
        for frame in self._decoder.feed(data):
            self._note(frame)

    def _note(self, frame: Frame) -> None:
        payload = frame.payload
        if frame.type == MotorStopAll.TYPE:
            self._forget()
        elif frame.type == RtJogAll.TYPE:
            self.all = True
        elif not payload:
            return
        elif frame.type == MotorJog.TYPE:
            self.motors.add(payload[0])
        elif frame.type == MotorStop.TYPE:
            self.motors.discard(payload[0])
        elif frame.type == VirtJog.TYPE:
            self.virtual.add(payload[0])
        elif frame.type == VirtJogOnLine.TYPE:
            self.virtual.add(_OF_LINE.get(payload[0], 0))
        elif frame.type == VirtStop.TYPE:
            self.virtual.discard(payload[0])

    def __bool__(self) -> bool:
        return bool(self.motors or self.virtual or self.all)

    def stops(self) -> list[Payload]:
        """The requests that end them all."""
        found: list[Payload] = [MotorStop(motor) for motor in sorted(self.motors)]
        found += [VirtStop(motor) for motor in sorted(self.virtual)]
        if self.all:
            found.append(MotorStopAll())
        self._forget()
        return found

    def _forget(self) -> None:
        self.motors.clear()
        self.virtual.clear()
        self.all = False


class Bridge:
    """A port that is open. `on_bytes` is called in the event loop with what the device sends,
    `on_end` once with the reason where the port has gone, `on_stopped` with the reason when
    somebody else has stopped motors: the page's jogs are refused from then on, until `released` is
    called."""

    def __init__(self, port: Any, name: str):
        self.name = name
        self.on_bytes: Callable[[bytes], None] = lambda data: None
        self.on_end: Callable[[str], None] = lambda why: None
        self.on_stopped: Callable[[str], None] = lambda why: None
        self._port = port
        self._loop = asyncio.get_running_loop()
        self._jogs = Jogs()
        self._order = asyncio.Lock()
        self._writing = threading.Lock()
        self._next_id = _FIRST_ID
        self._others_id = _FIRST_OF_OTHERS
        self._stopped = False
        self._closing = False
        self._closed = False
        self._decoder = FrameDecoder()
        self._door: Door | None = None
        if not is_socket(name):  # of a socket another program may have been given the only place
            self._let_others_through()
        self._port.timeout = _LOOK_S
        self._reader = threading.Thread(target=self._read, name="console-reader", daemon=True)
        self._reader.start()

    def _let_others_through(self) -> None:
        with contextlib.suppress(OSError):  # then no other program comes through
            self._door = Door(self, self.name, f"framestep console (process {os.getpid()})")

    async def send(self, data: bytes) -> None:
        """Hand a frame of the page to the device; OSError where the port has gone. Nothing happens
        with one that comes after `close`: the page may not know yet."""
        if self._stopped and (refused := _refused_jogs(data)):
            self.on_bytes(refused)  # it was on its way before the page knew of the stop
            return
        self._jogs.note(data)
        await self._write(data)

    # ---- other programs, in the reader's thread

    def forward(self, kind: int, payload: bytes) -> int:
        """Send another program's request; the ID of the answer, which the door is given."""
        self._others_id += 1
        with self._writing:
            self._port.write(encode(kind, payload, self._others_id))
        return self._others_id

    @property
    def stopped(self) -> bool:
        """Whether another program has stopped motors, and the page has not let go yet."""
        return self._stopped

    @stopped.setter
    def stopped(self, on: bool) -> None:
        self._stopped = on
        self._loop.call_soon_threadsafe(self.on_stopped, "Another program has stopped the motors.")

    def released(self) -> None:
        """The page has let go of all that it held."""
        self._stopped = False

    # ---- what is asked for the page

    @property
    def jogging(self) -> bool:
        """Whether the page has begun what only a held button moves, and not ended it."""
        return bool(self._jogs)

    async def let_go(self, why: str) -> None:
        """End what the page jogs, although it has not let go: the page is told why."""
        self._stopped = True
        await self.stop_jogs()
        self.on_stopped(why)

    async def stop_jogs(self) -> None:
        """End what only a held button moves; a run goes on."""
        await self._ask(self._jogs.stops())

    async def moves(self) -> bool:
        """Ask the device whether any motor moves. What else it sends meanwhile is dropped, so no
        page may be there. OSError where it does not answer."""
        decoder = FrameDecoder()
        number = self._next_id
        answer: asyncio.Future[Status] = self._loop.create_future()

        def take(data: bytes) -> None:
            for frame in decoder.feed(data):
                if frame.id == number and not answer.done():
                    answer.set_result(Status.unpack(frame.payload))

        self.on_bytes = take
        await self._ask([MotorStatus()])
        # not wait_for, which loses a cancellation that comes together with the answer
        done, _ = await asyncio.wait([answer], timeout=_ANSWER_S)
        if not done:
            raise OSError(f"{self.name} does not say what moves")
        return answer.result().motor_bits != 0

    async def close(self) -> None:
        """Stop everything and close the port. A port that has gone is no error."""
        if self._closing:
            return
        with contextlib.suppress(OSError):
            await self._ask([MotorStopAll()])
        self._closing = True
        await asyncio.to_thread(self._reader.join)
        if self._door:
            self._door.close()
        await asyncio.to_thread(self._close_now)

    async def _ask(self, requests: list[Payload]) -> None:
        for request in requests:
            await self._write(encode(request.TYPE, request.pack(), self._next_id))
            self._next_id += 1

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
        """Runs in a thread of its own: ports can only be waited for."""
        try:
            while not self._closing:
                data = self._port.read(1)
                if data:
                    data += self._port.read(self._port.in_waiting)
                    if self._door is None:
                        self._let_others_through()
                    self._loop.call_soon_threadsafe(self.on_bytes, data)
                if self._door:
                    self._door.look()
                    self._pass_on(self._door, data)
        except Exception as error:
            # termios.error is of no other class; not every system has a termios to ask
            if not isinstance(error, OSError) and type(error).__module__ != "termios":
                raise
            if not self._closing:
                why = str(BrokenOff(f"the connection to {self.name} broke off"))
                self._loop.call_soon_threadsafe(self.on_end, why)

    def _pass_on(self, door: Door, data: bytes) -> None:
        """Give other programs what is for them; the page takes no notice of their IDs."""
        for frame in self._decoder.feed(data):
            if frame.id == 0:
                door.tell(frame)
            else:
                door.answer(frame)


def _refused_jogs(data: bytes) -> bytes:
    """The refusal of a frame that asks for a jog; nothing for any other one."""
    return b"".join(
        encode(frame.type | messages.MSG_FLAG_ACK, struct.pack("<H", Ack.ERR_GENERAL), frame.id)
        for frame in FrameDecoder().feed(data)
        if frame.type in _JOGS
    )
