"""A computer that the simulated ESP32 is plugged into: it enumerates the device and has its serial
ports (tools/micropython/esp32/usb.c)."""

import struct
from typing import NamedTuple, Protocol

from ..errors import ToolError

_DEBOUNCE_NS = 100_000_000  # from the appearance of a device to its reset
_RECOVERY_NS = 10_000_000
_REQUEST_NS = 5_000_000_000
_STEP_NS = 1_000_000
_RESULT, _REFUSED = 0, 255  # kinds of records
_ADDRESS = 5
_DEVICE, _CONFIGURATION, _STRING, _INTERFACE, _ENDPOINT, _ASSOCIATION = 1, 2, 3, 4, 5, 11
_TO_HOST = 0x80
_BULK = 2
_GET_DESCRIPTOR, _SET_ADDRESS, _SET_CONFIGURATION = 6, 5, 9
_SET_LINE_CODING, _SET_CONTROL_LINE_STATE = 0x20, 0x22
_CLASS_INTERFACE = 0x21
_CDC = 2
_LINE_CODING = struct.pack("<IBBB", 115200, 0, 0, 8)


class UsbError(ToolError):
    """The device does not do what a host asks for."""


class Wire(Protocol):
    """What a host needs of the board."""

    @property
    def now_ns(self) -> int:
        """Virtual time in ns."""

    def step(self, ns: int) -> None:
        """Let time pass until then."""

    def usb(self, letter: str, form: str, *values: int, data: bytes = b"") -> None:
        """Send a command for USB: see usb_command() in tools/micropython/esp32/board.c."""


class Function(NamedTuple):
    """A serial port in the descriptors."""

    name: str
    interface: int
    notify: int  # endpoints' addresses
    out: int
    into: int


class Device(NamedTuple):
    """What a device says of itself."""

    vendor: int
    product: int
    strings: dict[int, str]
    functions: list[Function]


class SerialPort:
    """A serial port of the device, as Linux treats it: it reads while the port is open."""

    def __init__(self, host: "UsbHost", function: Function):
        self.function = function
        self._host = host
        self.arrived = bytearray()
        self._opened = False

    @property
    def there(self) -> bool:
        """Whether the device still has this port."""
        return self in self._host.ports

    def receive(self, data: bytes) -> None:
        """Send bytes to the board."""
        if data and self.there:
            self._host.wire.usb("s", "BI", self.function.out, len(data), data=data)
            self._host.queued[self.function.out] += len(data)

    def transmit(self) -> bytes:
        """Return the board's bytes since the last call."""
        data = bytes(self.arrived)
        self.arrived.clear()
        return data

    def open_port(self, on: bool) -> None:
        """Open or close the port (DTR)."""
        if on == self._opened or not self.there:
            return
        self._opened = on
        if on:
            self.arrived.clear()
            self._class_request(_SET_LINE_CODING, 0, _LINE_CODING)
        else:
            self._host.wire.usb("f", "B", self.function.out)
        self._host.wire.usb("l", "BB", self.function.into & 15, on)
        self._class_request(_SET_CONTROL_LINE_STATE, 3 if on else 0)

    def _class_request(self, number: int, value: int, data: bytes = b"") -> None:
        self._host.request(_CLASS_INTERFACE, number, value, self.function.interface, data)

    @property
    def pending(self) -> int:
        """Number of bytes that the board has not read yet."""
        return self._host.queued[self.function.out]


class UsbHost:
    """The host. `device` is what it has found, None if there is none; `ports` are the serial
    ports."""

    def __init__(self, wire: Wire):
        self.wire = wire
        self.device: Device | None = None
        self.ports: list[SerialPort] = []
        self.queued = dict.fromkeys(range(1, 7), 0)
        self._state = self._seen = 0
        self._answer: bytes | None = None
        self._refused = False
        self._busy = False
        self.by_endpoint: dict[int, SerialPort] = {}

    # ---- what the board reports

    def take(self, state: int, queued: tuple[int, ...], records: bytes) -> None:
        """Take an answer of the board."""
        self._state = state
        self.queued = dict(enumerate(queued, 1))
        at = 0
        while at < len(records):
            kind, count = struct.unpack_from("<BH", records, at)
            data = records[at + 3 : at + 3 + count]
            at += 3 + count
            if kind == _RESULT:
                self._answer = data
            elif kind == _REFUSED:
                self._refused = True
            elif kind in self.by_endpoint:
                self.by_endpoint[kind].arrived += data
        if not state:
            self.lose()

    def lose(self) -> None:
        """Forget the device, which has gone."""
        self._state = self._seen = 0
        self._forget()

    def _forget(self) -> None:
        self.device = None
        self.ports = []
        self.by_endpoint = {}

    def attend(self) -> None:
        """Enumerate a device that has appeared. Time passes meanwhile."""
        while not self._busy and self._state != self._seen:
            self._busy = True
            self._seen = self._state
            self._forget()
            try:
                if self._seen:
                    self._enumerate()
            except UsbError:
                if self._state == self._seen:
                    raise
                # it has disappeared meanwhile
            finally:
                self._busy = False

    # ---- requests

    def request(
        self, kind: int, number: int, value: int, index: int, data: bytes = b"", length: int = 0
    ) -> bytes:
        """Make a control request. Return the answer; raise UsbError if the device refuses it."""
        self._answer, self._refused = None, False
        setup = struct.pack("<BBHHH", kind, number, value, index, len(data) or length)
        self.wire.usb("c", "8sH", setup, len(data), data=data)  # type: ignore[arg-type]
        end = self.wire.now_ns + _REQUEST_NS
        seen = self._state
        while self._answer is None:
            self.wire.step(self.wire.now_ns + _STEP_NS)
            if self._refused or self._state != seen or self.wire.now_ns > end:
                raise UsbError(f"the device does not answer the request {setup.hex()}")
        return self._answer

    def descriptor(self, kind: int, index: int, length: int, language: int = 0) -> bytes:
        """Return a descriptor, at most `length` bytes of it."""
        return self.request(_TO_HOST, _GET_DESCRIPTOR, kind << 8 | index, language, length=length)

    def string(self, index: int) -> str:
        """Return a string of the device."""
        found = self.descriptor(_STRING, index, 255, 0x409)
        if found[:2] != bytes((len(found), _STRING)):
            raise UsbError(f"string {index} is {found.hex()}")
        return found[2:].decode("utf-16-le")

    def reset_bus(self) -> None:
        """Reset the bus, as the host of a device that has appeared, or one that starts again."""
        self.wire.usb("r", "")
        self.wire.step(self.wire.now_ns + _RECOVERY_NS)

    def plug(self, on: bool) -> None:
        """Pull the cable, or plug it in."""
        self.wire.usb("p", "B", on)
        self._forget()

    def reset_and_enumerate(self) -> None:
        """Do what a host does that starts again: the device is as just plugged in."""
        self._forget()
        self._enumerate()

    def _enumerate(self) -> None:
        wire = self.wire
        wire.step(wire.now_ns + _DEBOUNCE_NS)
        self.reset_bus()
        first = self.descriptor(_DEVICE, 0, 64)
        self.reset_bus()
        self.request(0, _SET_ADDRESS, _ADDRESS, 0)
        whole = self.descriptor(_DEVICE, 0, 18)
        if whole != first[:18] or whole[:2] != bytes((18, _DEVICE)):
            raise UsbError(f"the device descriptor is {whole.hex()}")
        head = self.descriptor(_CONFIGURATION, 0, 9)
        (length,) = struct.unpack_from("<H", head, 2)
        configuration = self.descriptor(_CONFIGURATION, 0, length)
        vendor, product = struct.unpack_from("<HH", whole, 8)
        strings = {index: self.string(index) for index in whole[14:17] if index}
        functions = [
            function._replace(name=self.string(int(function.name)))
            for function in serial_functions(configuration)
        ]
        self.request(0, _SET_CONFIGURATION, configuration[5], 0)
        self.device = Device(vendor, product, strings, functions)
        self.ports = [SerialPort(self, function) for function in functions]
        self.by_endpoint = {port.function.into & 15: port for port in self.ports}


def serial_functions(configuration: bytes) -> list[Function]:
    """Return the CDC serial ports in a configuration descriptor; the name is its string's number.
    Raises UsbError if the descriptor contradicts itself."""
    (length,) = struct.unpack_from("<H", configuration, 2)
    if length != len(configuration):
        raise UsbError(f"the configuration is {len(configuration)} bytes long and says {length}")
    found: list[Function] = []
    interfaces: list[int] = []
    endpoints: list[int] = []
    at = 0
    while at < length:
        size, kind = configuration[at : at + 2]
        if size < 2 or at + size > length:
            raise UsbError(f"the descriptor at {at} has a length of {size}")
        body = configuration[at : at + size]
        at += size
        if kind == _ASSOCIATION:
            if body[2] != len(interfaces) or body[3:5] != bytes((2, _CDC)):
                raise UsbError(f"the association {body.hex()} is not the next serial port's")
        elif kind == _INTERFACE:
            interfaces.append(body[2])
            if body[2] != len(interfaces) - 1:
                raise UsbError(f"interface {body[2]} comes as number {len(interfaces) - 1}")
            if body[5] == _CDC:
                found.append(Function(str(body[8]), body[2], 0, 0, 0))
        elif kind == _ENDPOINT:
            address, attributes = body[2], body[3]
            if address in endpoints:
                raise UsbError(f"endpoint {address:#x} is there twice")
            endpoints.append(address)
            if attributes != _BULK:
                found[-1] = found[-1]._replace(notify=address)
            elif address & _TO_HOST:
                found[-1] = found[-1]._replace(into=address)
            else:
                found[-1] = found[-1]._replace(out=address)
    if configuration[4] != len(interfaces):
        raise UsbError(f"there are {len(interfaces)} interfaces, not {configuration[4]}")
    for function in found:
        if 0 in function[2:]:
            raise UsbError(f"the serial port {function} lacks an endpoint")
    return found
