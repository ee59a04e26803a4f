"""Talk to a motion controller over the DMC v2 protocol.

    with Client.open("/dev/ttyACM1") as client:
        print(client.request(Hi()).name)
        client.request(MotorMove(motor=1, position=5000))
        client.wait_idle()

There is one thread and no unexpected callback: the port is read only while a method of the client
waits. A port is anything with pyserial's `read`, `write`, `timeout` and `close`. All times are
seconds of the port's clock: its method `clock()`, if it has one (an emulated board in lockstep),
else the computer's clock.
"""

import dataclasses
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from framestep.protocol import messages

from ..axes.rig_axes import Axes
from ..errors import BROKEN_OFF, NO_CONTROLLER, REFUSED, USAGE, ToolError
from ..payloads import (
    LAST_SECTION,
    REPORTS,
    Ack,
    DeviceInfo,
    Hi,
    MotorStatus,
    Moving,
    Numbers,
    Payload,
    Request,
    RtUploadMoveAxis,
    RtUploadMoveBegin,
    RtUploadMoveEnd,
    type_name,
)
from .open_port import close_port, open_port
from .shared_port import SharedPort, stopped_by
from .tcp_port import is_socket
from .wire import Frame, FrameDecoder, encode

if TYPE_CHECKING:
    from typing_extensions import Self

DEFAULT_TIMEOUT_S = 2.0
POLL_INTERVAL_S = 0.05  # between two requests for MOTOR_STATUS
READ_SIZE = 4096
_NOISE_BYTES = 1000
_DRAWN = 8  # times that a REPL shows what it got
# spaces: with it no byte of a HI makes a REPL do anything but edit its line
GREETING_ID = 0x20202020
CTRL_C = b"\x03"
_CLOCK_GRAIN_S = 1e-6  # a shorter remainder is only rounding, and a port may round it to 0
_LONGEST_READ_S = 1.0  # endless waits are divided, because ports need a finite timeout
_MOTOR_AND_INDEX = 5

R = TypeVar("R")
P = TypeVar("P", bound=Payload)


class ClientError(ToolError):
    """Base class of errors between client and device. The text gives the reason."""

    status = NO_CONTROLLER


class RequestRefused(ClientError):
    """The device acknowledged a request with a code other than OK."""

    status = REFUSED

    def __init__(self, request: Payload, code: Ack):
        name = type_name(request.TYPE)
        super().__init__(
            f"{name} was refused with {code.name} (0x{code:04X}): {code.description}. "
            f"It was {_filled(request)}"
        )
        self.request = request
        self.code = code


def _filled(request: Payload) -> str:
    """Return a request as text, without empty fields."""
    values = ((field.name, getattr(request, field.name)) for field in dataclasses.fields(request))
    return (
        f"{type(request).__name__}"
        f"({', '.join(f'{name}={value}' for name, value in values if value is not None)})"
    )


class NoAnswer(ClientError, TimeoutError):
    """No answer came within the time limit."""


class BrokenOff(ClientError):
    """The connection is gone: the cable was pulled, the board was reset, or a program in between
    has ended."""

    status = BROKEN_OFF


class BadRequest(ClientError, ValueError):
    """A value does not fit into its request."""

    status = USAGE


class Echoed(ClientError):
    """The port has sent the request back."""


class WrongPort(ClientError):
    """Something else is at this port, such as a REPL."""


class Event(NamedTuple):
    """A message that the device sent unasked: when it was read, and its payload (the bare Frame if
    unknown)."""

    time_s: float
    message: Payload | Frame


class Client:
    """A connection to one device.

    `events` holds the newest `EVENTS_KEPT` unasked messages in the order of their arrival.
    `on_event`, if set, is called with each of them. `stray` counts replies without a request.
    """

    EVENTS_KEPT = 10_000

    def __init__(self, port: Any, timeout_s: float = DEFAULT_TIMEOUT_S, name: str = "the device"):
        self.port = port
        self.name = name
        self.timeout_s = timeout_s
        self.events: deque[Event] = deque(maxlen=self.EVENTS_KEPT)
        self.on_event: Callable[[Event], None] | None = None
        self.stray = 0
        self.info: DeviceInfo | None = None  # the device's HI, after greet()
        self.axes = Axes()  # names and units for texts
        self.shared_port: SharedPort | None = None  # for other programs
        self.stopped = 0  # bits of the motors that other programs have stopped, bit 1 for motor 1
        self._heard = False  # a message has come
        self._noise = b""  # bytes before the first message
        self.clock: Callable[[], float] = getattr(port, "clock", time.monotonic)
        self._decoder = FrameDecoder()
        self._next_id = 1
        self._waiting: dict[int, Payload] = {}  # message ID -> request
        self._answers: dict[int, Frame] = {}

    @classmethod
    def open(cls, url: str, timeout_s: float = DEFAULT_TIMEOUT_S) -> "Self":
        """Open a device path or socket://host:port. Raises NoPort or PortBusy (open_port.py)."""
        return cls(open_port(url, timeout_s), timeout_s, url)

    def close(self) -> None:
        """Close the port. For the device, its host then disconnects."""
        close_port(self.port)

    def __enter__(self) -> "Self":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def skipped(self) -> int:
        """Number of received bytes outside good frames: 0 on a good line."""
        return self._decoder.skipped

    # ---- requests and answers

    def request(self, request: Request[R], timeout_s: float | None = None) -> R:
        """Send a request and return its reply. Raises RequestRefused, or NoAnswer if the device is
        silent."""
        return self.answer_to(self.send(request), timeout_s)

    def code(self, request: Payload, timeout_s: float | None = None) -> Ack:
        """Send a request and return the response code: OK also for a reply with data. Never raises
        RequestRefused."""
        return self._result(self.send(request), timeout_s)[1]

    def send(self, request: Payload) -> int:
        """Send a request without waiting. Return the ID for `answer_to`."""
        # ID 0 is for unasked messages
        id, self._next_id = self._next_id, self._next_id % 0xFFFF_FFFF + 1
        self._waiting[id] = request
        try:
            payload = request.pack()
        except ValueError as error:
            del self._waiting[id]
            raise BadRequest(str(error)) from None
        data = encode(request.TYPE, payload, id)
        self._guard(self.port.write, data)
        return id

    def forward(self, type: int, payload: bytes) -> int:
        """Send another program's message. Return the ID of the answer, which goes to
        shared_port."""
        id, self._next_id = self._next_id, self._next_id % 0xFFFF_FFFF + 1
        self._guard(self.port.write, encode(type, payload, id))
        return id

    def greet(self) -> DeviceInfo:
        """Ask the device for its HI. Raises WrongPort if a REPL is at the port; its input line
        stays empty."""
        self._next_id = GREETING_ID
        try:
            self.info = self.request(Hi())
            return self.info
        except Echoed:
            raise WrongPort(
                f"{self.name} sends back what it gets: it is not the protocol's port, and perhaps "
                "a plug that joins the two lines, or a modem"
            ) from None
        except NoAnswer as error:
            if self._heard:
                raise
            # a line editor echoes its input, and may draw its line again
            if 0 < self._noise.count(b"DF") <= _DRAWN:
                self._guard(self.port.write, CTRL_C)
                raise WrongPort(
                    f"{self.name} is a REPL, not the protocol's port: "
                    "take the board's other one (framestep ports)"
                ) from None
            if self._noise:
                raise WrongPort(
                    f"{self.name} sends {len(self._noise)} bytes that are not this protocol: "
                    "is another device at this port, or another program's output?"
                ) from None
            raise error

    def answer_to(self, id: int, timeout_s: float | None = None) -> Any:
        """Wait for the reply to a request sent with `send`."""
        request = self._waiting[id]
        reply, code = self._result(id, timeout_s)
        if code != Ack.OK:
            raise RequestRefused(request, code)
        return reply

    def stream(
        self, requests: Iterable[Payload], window: int = 1, timeout_s: float | None = None
    ) -> int:
        """Send requests with up to `window` of them unanswered. Return their number.

        After a refusal nothing more is sent. Raises RequestRefused once the remaining answers have
        come.
        """
        if window < 1:
            raise ValueError(f"a window of at least 1 request is needed, not {window}")
        count, unanswered, refused = 0, deque[int](), None
        for request in requests:
            unanswered.append(self.send(request))
            count += 1
            while len(unanswered) >= window and not refused:
                refused = self._refusal(unanswered.popleft(), timeout_s)
            if refused:
                break
        while unanswered:
            later = self._refusal(unanswered.popleft(), timeout_s)
            refused = refused or later  # the first refusal gives the reason
        if refused:
            raise refused
        return count

    def _refusal(self, id: int, timeout_s: float | None) -> RequestRefused | None:
        try:
            self.answer_to(id, timeout_s)
        except RequestRefused as refused:
            return refused
        return None

    def _result(self, id: int, timeout_s: float | None) -> tuple[Any, Ack]:
        request = self._waiting[id]
        timeout_s = self.timeout_s if timeout_s is None else timeout_s
        try:
            if not self._pump_until(lambda: id in self._answers, timeout_s):
                other = (
                    "" if self._heard else "; a board's other port may be the one (framestep ports)"
                )
                raise NoAnswer(
                    f"no answer to {type_name(request.TYPE)} within {timeout_s:g} s{other}"
                )
            frame = self._answers.pop(id)
        finally:
            del self._waiting[id]
        expected: Any = getattr(request, "REPLY", Ack)
        try:
            if not frame.is_ack:
                reply = REPORTS[frame.type].unpack(frame.payload)
                if expected is not Ack and isinstance(reply, expected):
                    return reply, Ack.OK
                raise ValueError(f"found {reply}")
            code = Ack.unpack(frame.payload)
            # dmc-lite dialect: MOTOR_MOVE is acknowledged (field note 1.4)
            if expected is Moving and code == Ack.OK:
                return Moving(1), code
            if expected is not Ack and code == Ack.OK:
                raise ValueError("found a bare acknowledgement")
            return code, code
        except (KeyError, ValueError) as error:
            sent = (request.TYPE, request.pack())
            if expected is not Ack and (frame.type, frame.payload) == sent:
                raise Echoed(f"{type_name(request.TYPE)} came back as it was sent") from None
            raise ClientError(
                f"{type_name(request.TYPE)} expects {expected.__name__} in return: {error}"
            ) from None

    # ---- events

    def pump(self, seconds: float = 0.0) -> None:
        """Receive messages for some seconds; 0 takes those that have come."""
        self._pump_until(lambda: False, seconds)

    def wait_event(
        self,
        kind: type[P],
        timeout_s: float | None = None,
        where: Callable[[P], bool] | None = None,
    ) -> P:
        """Wait for an event of a class (for which `where` is true) and remove it from `events`.

        Returns the oldest one. Raises NoAnswer if none comes.
        """
        timeout_s = self.timeout_s if timeout_s is None else timeout_s
        found: list[P] = []

        def look() -> bool:
            message = self.take_event(kind, where)
            if message is not None:
                found.append(message)
            return bool(found)

        if not self._pump_until(look, timeout_s):
            raise NoAnswer(f"no {kind.__name__} came within {timeout_s:g} s")
        return found[0]

    def take_event(self, kind: type[P], where: Callable[[P], bool] | None = None) -> P | None:
        """Remove the oldest event of a class from `events` and return it, or None."""
        for i, event in enumerate(self.events):
            message = event.message
            if isinstance(message, kind) and (where is None or where(message)):
                del self.events[i]
                return message
        return None

    # ---- whole tasks

    def wait_idle(
        self,
        timeout_s: float = 60.0,
        poll_s: float = POLL_INTERVAL_S,
        motor: int | None = None,
    ) -> None:
        """Poll MOTOR_STATUS until nothing moves any more, as Dragonframe does (field note 4.7).

        motor: wait for this motor only.
        """
        deadline = self.clock() + timeout_s
        while not (status := self.request(MotorStatus())).idle:
            if motor is not None and motor not in status.moving:
                return
            if self.clock() >= deadline:
                raise NoAnswer(
                    f"still moving after {timeout_s:g} s: motors {status.moving}, DMX {status.dmx}"
                )
            self.pump(poll_s)

    def upload_move(
        self,
        start_frame: int,
        end_frame: int,
        positions: Mapping[int, Numbers],
        window: int = 1,
        section_bytes: int = messages.LARGEST_PAYLOAD,
        lights: Iterable[Request[Ack]] = (),
    ) -> None:
        """Upload a move.

        positions: {motor: positions in steps}, one for each scene frame. If there are fewer, the
        device repeats the last one. section_bytes: maximum payload of a section; window: maximum
        number of unanswered sections; lights: requests with light levels and triggers of these
        frames (light_file.py). Raises RequestRefused at the first refused section.
        """
        requests = upload_requests(start_frame, end_frame, positions, section_bytes, lights)
        self.stream(requests, window)

    # ---- the line

    def _pump_until(self, done: Callable[[], bool], seconds: float) -> bool:
        deadline = self.clock() + seconds
        remaining = seconds
        while True:
            if done():
                return True
            wait_s = min(max(0.0, remaining), _LONGEST_READ_S)
            if self.shared_port:
                self.shared_port.look()
                wait_s = self.shared_port.wait(self.port, wait_s)
            self._take(self._read(wait_s))
            if remaining < _CLOCK_GRAIN_S:
                return done()
            remaining = deadline - self.clock()

    def _read(self, seconds: float) -> bytes:
        """Return the received bytes, after waiting at most `seconds` for the first one."""
        data = b""
        if seconds:
            data = self._guard(self._read_within, seconds, 1)
            if not data:
                return data
        return data + self._guard(self._read_within, 0, READ_SIZE)

    def _read_within(self, seconds: float, size: int) -> bytes:
        if self.port.timeout != seconds:
            self.port.timeout = seconds
        return self.port.read(size)

    def _guard(self, call: Callable[..., Any], *arguments: Any) -> Any:
        """Call a method of the port. Raises BrokenOff if the port is gone."""
        try:
            return call(*arguments)
        except Exception as error:
            # termios.error is no OSError, and not every system has a termios to import
            if not isinstance(error, OSError) and type(error).__module__ != "termios":
                raise
            if is_socket(self.name) and not self._heard:
                # A device behind it would not have noticed, so motion is not mentioned.
                why = (
                    "it was closed before the device had said anything: another program has it, "
                    "or there is no device behind it"
                )
            elif "multiple access" in str(error) and os.path.exists(self.name):
                why = (
                    "another program reads the same port, or the board was reset; "
                    "what moved comes to rest by itself"
                )
            else:
                why = (
                    "the cable was pulled, the board was reset, or the program behind it has "
                    "ended; what moved comes to rest by itself"
                )
            raise BrokenOff(f"the connection to {self.name} broke off: {why}") from error

    def _take(self, data: bytes) -> None:
        if not self._heard:
            self._noise = (self._noise + data)[-_NOISE_BYTES:]
        for frame in self._decoder.feed(data):
            self._heard = True
            request = self._waiting.get(frame.id) if frame.id else None
            if request is not None and frame.request_type == request.TYPE:
                self._answers[frame.id] = frame
            elif frame.id == 0 and not frame.is_ack:
                self.stopped |= stopped_by(frame)  # forwarded by the program that has the port
                event = Event(self.clock(), _report(frame))
                self.events.append(event)
                if self.on_event:
                    self.on_event(event)
                if self.shared_port:
                    self.shared_port.pass_on(frame)
            elif not (self.shared_port and self.shared_port.answer(frame)):
                self.stray += 1


def _report(frame: Frame) -> Payload | Frame:
    try:
        return REPORTS[frame.type].unpack(frame.payload)
    except (KeyError, ValueError):
        return frame


def upload_requests(
    start_frame: int,
    end_frame: int,
    positions: Mapping[int, Numbers],
    section_bytes: int = messages.LARGEST_PAYLOAD,
    lights: Iterable[Request[Ack]] = (),
) -> Iterable[Request[Ack]]:
    """Yield the requests that upload a move; see Client.upload_move."""
    per_section = (section_bytes - _MOTOR_AND_INDEX) // 4
    if per_section < 1:
        raise ValueError(
            f"a section of {section_bytes} bytes holds no position, "
            f"it needs at least {_MOTOR_AND_INDEX + 4}"
        )
    frames = end_frame - start_frame + 1
    for motor, steps in positions.items():
        if not 1 <= len(steps) <= frames:
            raise ValueError(
                f"motor {motor}: 1 to {frames} positions are expected, "
                f"one a frame, found {len(steps)}"
            )
    yield RtUploadMoveBegin(start_frame, end_frame)
    for motor, steps in positions.items():
        for index in range(0, len(steps), per_section):
            last = LAST_SECTION if index + per_section >= len(steps) else 0
            yield RtUploadMoveAxis(motor, index | last, steps[index : index + per_section])
    yield from lights
    yield RtUploadMoveEnd()
