"""Compiled modules (.mpy, version 6) taken apart and put together again.

The form is described in MicroPython's py/persistentcode.c: a head, the tables of names and constant
objects, then the body of the module, in which the bodies of its classes and functions are nested.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum


class MpyError(Exception):
    """A compiled module that is not as expected; the text says in what."""


class Kind(IntEnum):
    """How a body has been compiled."""

    BYTECODE = 0
    NATIVE = 1
    VIPER = 2
    ASSEMBLER = 3


@dataclass
class Body:
    """What one `def`, `class`, `lambda`, comprehension or module has been compiled to."""

    kind: Kind
    code: bytes
    extra: bytes  # of machine code: what follows it in the file
    children: list["Body"]

    @property
    def argument_count(self) -> int:
        """Of bytecode: positional arguments, those with defaults included."""
        return self._signature()[0]

    @property
    def frame_words(self) -> int:
        """Of bytecode: words of a call's frame, its locals and stack, and three for each `try`
        nested in another."""
        state = self.code[0] >> 3 & 15
        tries = self.code[0] >> 2 & 1
        for n, byte in enumerate(self.code[1 : self._signature()[1]]):
            state |= (byte & 0x30) << 2 * n
            tries |= (byte & 2) << n
        return state + 1 + 3 * tries

    @property
    def signature(self) -> bytes:
        """Of bytecode: the bytes before its size, which say how it is called and how deep its stack
        is."""
        return self.code[: self._signature()[1]]

    @property
    def name_index(self) -> int:
        """Of bytecode: the entry in the table of names that has its name."""
        at = self._signature()[1]
        while self.code[at] & 0x80:
            at += 1
        return _Reader(self.code, at + 1).number()

    def _signature(self) -> tuple[int, int]:
        """Number of positional arguments, and where the signature ends. Bits are told in
        py/bc.h."""
        arguments = self.code[0] & 3
        at = 0
        while self.code[at] & 0x80:
            at += 1
            arguments |= (self.code[at] & 4) << (at - 1)
        return arguments, at + 1

    def walk(self) -> Iterator["Body"]:
        """This body and all that are nested in it."""
        yield self
        for child in self.children:
            yield from child.walk()

    def packed(self) -> bytes:
        """The body as it stands in the file."""
        parts = [
            _packed(len(self.code) << 3 | bool(self.children) << 2 | self.kind),
            self.code,
            self.extra,
        ]
        if self.children:
            parts += [_packed(len(self.children)), *(child.packed() for child in self.children)]
        return b"".join(parts)


@dataclass
class MpyFile:
    """A compiled module."""

    head: bytes  # all before the body
    names: list[str | None]  # None for those that every MicroPython knows by number
    # which of the constant objects is the table of functions for machine code; -1: none
    function_table: int
    body: Body

    def packed(self) -> bytes:
        """The file."""
        return self.head + self.body.packed()


# without data: the table of functions for machine code, None, False, True, ...
_PLAIN_OBJECTS = range(0, 5)
_FUNCTION_TABLE = 0
_TEXT, _BYTES, _TUPLE = 5, 6, 10


class _Reader:
    def __init__(self, data: bytes, at: int = 0):
        self.data = data
        self.at = at

    def take(self, count: int) -> bytes:
        self.at += count
        if self.at > len(self.data):
            raise MpyError("a .mpy file is cut short")
        return self.data[self.at - count : self.at]

    def number(self) -> int:
        value = 0
        while True:
            (byte,) = self.take(1)
            value = value << 7 | byte & 0x7F
            if not byte & 0x80:
                return value

    def name(self) -> str | None:
        length = self.number()
        return None if length & 1 else self.take((length >> 1) + 1)[:-1].decode()

    def skip_object(self) -> int:
        """Go behind an object; its kind."""
        (kind,) = self.take(1)
        if kind in _PLAIN_OBJECTS:
            return kind
        length = self.number()
        if kind == _TUPLE:
            for _ in range(length):
                self.skip_object()
        else:
            self.take(length + (kind in (_TEXT, _BYTES)))
        return kind

    def body(self) -> Body:
        head = self.number()
        kind = Kind(head & 3)
        code = self.take(head >> 3)
        begin = self.at
        if kind == Kind.VIPER and self.number():
            raise MpyError("machine code that must be relocated is not expected from mpy-cross")
        elif kind == Kind.NATIVE:
            self.number()
        elif kind == Kind.ASSEMBLER:
            for _ in range(3):
                self.number()
        extra = self.data[begin : self.at]
        return Body(
            kind, code, extra, [self.body() for _ in range(self.number())] if head & 4 else []
        )


def parse(data: bytes) -> MpyFile:
    """Take a compiled module apart; MpyError where it is not of the form known here."""
    reader = _Reader(data)
    letter, version, features, _ = reader.take(4)
    if letter != ord("M") or version != 6 or features & 0x40:
        raise MpyError("not a .mpy file of version 6 as this tool knows it")
    names, objects = reader.number(), reader.number()
    table = [reader.name() for _ in range(names)]
    kinds = [reader.skip_object() for _ in range(objects)]
    head = data[: reader.at]
    body = reader.body()
    if reader.at != len(data):
        raise MpyError("a .mpy file with something behind its code")
    return MpyFile(
        head, table, kinds.index(_FUNCTION_TABLE) if _FUNCTION_TABLE in kinds else -1, body
    )


def _packed(value: int) -> bytes:
    found = [value & 0x7F]
    while value := value >> 7:
        found.append(value & 0x7F | 0x80)
    return bytes(reversed(found))
