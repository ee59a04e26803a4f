"""Base classes of messages: declaring, packing and unpacking the data section, field by field.

    class MotorJog(Request[Ack], number=MSG_MOTOR_JOG, moves=True, jogs=True):
        motor: U8
        speed: U16
        destination: I32

    MotorJog.speed                 # 1: offset of the field in the data section
    MotorJog(1, 10_000, 50).speed  # 10000
    MotorJog.SIZE                  # 7

The class becomes a frozen dataclass. `pack` makes the data section, `unpack` reads one. If
something does not fit, both raise ValueError with what was expected and what was found. An optional
field at the end is None if the message leaves it out.
"""

import operator
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Generic,
    Protocol,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

if TYPE_CHECKING:
    from typing_extensions import Self, dataclass_transform
else:

    def dataclass_transform(**_):
        return lambda cls: cls


class Numbers(Protocol):
    """Integers in a sequence: a list, a range, a numpy array."""

    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[Any]: ...
    def __getitem__(self, at: Any, /) -> Any: ...


U8 = Annotated[int, "B"]
U16 = Annotated[int, "H"]
I16 = Annotated[int, "h"]
U32 = Annotated[int, "I"]
I32 = Annotated[int, "i"]
Text32 = Annotated[str, "32s"]
# As many values as the rest of the data section has
Levels = Annotated[Sequence[int], "*B"]
Steps = Annotated[Numbers, "*i"]


_layouts: dict[type, list[tuple[str, Any, bool]]] = {}


def layout(cls: type) -> list[tuple[str, Any, bool]]:
    """Return (name, code, whether it may be left out) of each field. The code is struct's, after
    '*' if values repeat to the end of the data; or the class of records that repeat. Fields without
    a code are not included: their class packs them itself."""
    if cls in _layouts:
        return _layouts[cls]
    hints = get_type_hints(cls, include_extras=True)
    found = _layouts[cls] = []
    for field in fields(cls):
        hint, optional = hints[field.name], False
        if type(None) in get_args(hint):  # X | None
            hint, optional = next(a for a in get_args(hint) if a is not type(None)), True
        if get_origin(hint) is Annotated:
            found.append((field.name, get_args(hint)[1], optional))
    return found


@dataclass_transform(frozen_default=True)
@dataclass(frozen=True)
class Payload:
    """The data section of one message, or a record in one."""

    TYPE: ClassVar[int]  # the message's number
    SIZE: ClassVar[int]  # bytes of all fields without the repeated one
    LEAST: ClassVar[int]  # bytes of the mandatory fields
    ENTRY: ClassVar[int]  # bytes of one repeated entry; 0 if nothing repeats

    def __init_subclass__(cls, number: int | None = None) -> None:
        super().__init_subclass__()
        dataclass(frozen=True)(cls)
        if number is not None:
            cls.TYPE = number
        cls.SIZE = cls.LEAST = cls.ENTRY = 0
        if len(layout(cls)) < len(fields(cls)):
            cls.ENTRY = 1  # any number of bytes may follow the declared fields
        for name, code, optional in layout(cls):
            setattr(cls, name, cls.SIZE)  # an instance has its own value of that name
            if isinstance(code, type):
                cls.ENTRY = code.SIZE  # type: ignore[attr-defined]
            elif code[0] == "*":
                cls.ENTRY = struct.calcsize("<" + code[1])
            else:
                size = struct.calcsize("<" + code)
                cls.SIZE += size
                cls.LEAST += 0 if optional else size

    def pack(self) -> bytes:
        """Return the bytes of the data section."""
        parts, left_out = [], None
        for name, code, _ in layout(type(self)):
            value = getattr(self, name)
            if value is None:
                left_out = left_out or name
                continue
            if left_out:
                raise ValueError(
                    f"{type(self).__name__}: {name} is given, so {left_out} before it is needed too"
                )
            try:
                parts.append(pack_field(code, value))
            except (struct.error, OverflowError) as error:
                raise ValueError(
                    f"{type(self).__name__}: {name}={value!r} does not fit: {error}"
                ) from None
        return b"".join(parts)

    @classmethod
    def unpack(cls, data: bytes) -> "Self":
        """Read a data section. Raises ValueError if it does not have this layout."""
        said, rest = cls.unpack_known(data)
        if rest:
            raise ValueError(f"{cls.__name__}: {rest} of {len(data)} bytes are left over")
        return said

    @classmethod
    def unpack_known(cls, data: bytes) -> "tuple[Self, int]":
        """Read the known fields of a data section. Also return how many bytes follow them (field
        note 1.8)."""
        values, rest = {}, memoryview(data)
        for name, code, optional in layout(cls):
            if optional and not rest:
                continue
            try:
                values[name], rest = _unpack_field(code, rest)
            except struct.error:
                raise ValueError(
                    f"{cls.__name__}: {len(data)} bytes are too few, {name} is not there"
                ) from None
        return cls(**values), len(rest)


def pack_field(code: str, value: Any) -> bytes:
    if isinstance(code, type):
        return b"".join(record.pack() for record in value)
    if code[0] == "*":
        return _pack_values(code[1], value)
    if code[-1] == "s":
        value = value.encode()
        if len(value) > int(code[:-1]):
            raise OverflowError(f"at most {code[:-1]} bytes of UTF-8")
    return struct.pack("<" + code, value)


def _pack_values(code: str, values: Numbers) -> bytes:
    """Pack values one after the other. Raises OverflowError if one of them is not an integer or
    outside of the type's range."""
    try:
        numbers = [operator.index(value) for value in values]
    except TypeError as error:
        raise OverflowError(f"whole numbers are expected: {error}") from None
    try:
        return struct.pack(f"<{len(numbers)}{code}", *numbers)
    except struct.error:
        bits = 8 * struct.calcsize("<" + code)
        least, most = (
            (0, 2**bits - 1) if code.isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        )
        raise OverflowError(
            f"{least} to {most} are allowed, found {min(numbers)} to {max(numbers)}"
        ) from None


def _unpack_field(code: str, rest: memoryview) -> tuple[Any, memoryview]:
    if isinstance(code, type):
        if len(rest) % code.SIZE:
            raise struct.error
        return tuple(
            code.unpack(bytes(rest[i : i + code.SIZE])) for i in range(0, len(rest), code.SIZE)
        ), rest[:0]
    if code[0] == "*":
        count, left = divmod(len(rest), struct.calcsize("<" + code[1]))
        if left:
            raise struct.error
        return struct.unpack(f"<{count}{code[1]}", rest), rest[:0]
    size = struct.calcsize("<" + code)
    (value,) = struct.unpack("<" + code, rest[:size])
    if code[-1] == "s":
        value = value.rstrip(b"\0").decode(errors="replace")
    return value, rest[size:]


R = TypeVar("R")


class Request(Payload, Generic[R]):
    """A message to the device. R is the class of its answer; Ack if there is only a response code.

    moves: it sets motors in motion, or motors wait for it. jogs: they move until a `stop()`, which
    others send for a program that is gone. stops: it ends motion. keeps_plan: a prepared run keeps
    its plan if this comes before GO. only_sent: the device sends it, and refuses it with
    ERR_UNSUPPORTED; it is a request so that tests can send it.
    """

    REPLY: ClassVar[Any]
    MOVES: ClassVar[bool]
    JOGS: ClassVar[bool]
    STOPS: ClassVar[bool]
    KEEPS_PLAN: ClassVar[bool]
    ONLY_SENT: ClassVar[bool]

    def __init_subclass__(
        cls,
        number: int,
        moves: bool = False,
        jogs: bool = False,
        stops: bool = False,
        keeps_plan: bool = False,
        only_sent: bool = False,
    ) -> None:
        super().__init_subclass__(number)
        if jogs and not moves:
            raise TypeError(f"{cls.__name__} jogs, so declare moves=True as well")
        cls.MOVES, cls.JOGS, cls.STOPS = moves, jogs, stops
        cls.KEEPS_PLAN, cls.ONLY_SENT = keeps_plan, only_sent
        for base in cls.__dict__.get("__orig_bases__", ()):
            if get_origin(base) is Request:
                (cls.REPLY,) = get_args(base)
        if issubclass(cls.REPLY, Payload):
            if cls.REPLY.__dict__.get("TYPE", number) != number:
                raise TypeError(f"{cls.REPLY.__name__} is the answer to another message already")
            cls.REPLY.TYPE = number

    def stop(self) -> "Request[Any]":
        """Return the request that ends this jog: of its motor, or of all if it names none."""
        from .general import MotorStop, MotorStopAll

        motor = getattr(self, "motor", None)
        return MotorStopAll() if motor is None else MotorStop(motor)
