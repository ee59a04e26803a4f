"""Sizes of call frames in the compiled firmware (.mpy, version 6), read by the format of
MicroPython's py/persistentcode.c."""

from collections.abc import Iterator
from dataclasses import dataclass

from framestep_tools.building.board_files import board_modules, compiled

BYTECODE, NATIVE, VIPER, ASSEMBLER = range(4)  # kinds of bodies
_PLAIN_OBJECTS = range(0, 5)  # kinds of constant objects without data: None, False, True, ...
_TEXT, _BYTES, _TUPLE = 5, 6, 10


@dataclass
class Body:
    """Code of one `def`, `class`, `lambda`, comprehension or module."""

    kind: int
    code: bytes
    children: list["Body"]

    @property
    def _signature_end(self) -> int:
        return next(at for at, byte in enumerate(self.code) if not byte & 0x80) + 1

    @property
    def frame_words(self) -> int:
        """Return the words of a call's frame in bytecode (py/bc.h): locals, stack, and three for
        each nested `try`."""
        state = self.code[0] >> 3 & 15
        tries = self.code[0] >> 2 & 1
        for n, byte in enumerate(self.code[1 : self._signature_end]):
            state |= (byte & 0x30) << 2 * n
            tries |= (byte & 2) << n
        return state + 1 + 3 * tries

    @property
    def name_index(self) -> int:
        """Return the index of the bytecode's name in the module's table of names."""
        at = self._signature_end
        while self.code[at] & 0x80:
            at += 1
        return _Reader(self.code, at + 1).number()

    def walk(self) -> Iterator["Body"]:
        """Yield this body and all nested ones."""
        yield self
        for child in self.children:
            yield from child.walk()


class _Reader:
    def __init__(self, data: bytes, at: int = 0):
        self.data = data
        self.at = at

    def take(self, count: int) -> bytes:
        self.at += count
        assert self.at <= len(self.data)
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

    def skip_object(self) -> None:
        (kind,) = self.take(1)
        if kind in _PLAIN_OBJECTS:
            return
        length = self.number()
        if kind == _TUPLE:
            for _ in range(length):
                self.skip_object()
        else:
            self.take(length + (kind in (_TEXT, _BYTES)))

    def body(self) -> Body:
        head = self.number()
        kind, code = head & 3, self.take(head >> 3)
        for _ in range((0, 1, 1, 3)[kind]):
            self.number()
        return Body(kind, code, [self.body() for _ in range(self.number())] if head & 4 else [])


def parse(data: bytes) -> tuple[list[str | None], Body]:
    """Return a module's names (None for a name that every MicroPython has) and its body."""
    reader = _Reader(data)
    letter, version, _, _ = reader.take(4)
    assert (letter, version) == (ord("M"), 6)
    names, objects = reader.number(), reader.number()
    table = [reader.name() for _ in range(names)]
    for _ in range(objects):
        reader.skip_object()
    body = reader.body()
    assert reader.at == len(data)
    return table, body


def test_frames_of_what_runs_while_the_heap_is_not_locked():
    """Frames of more than eleven words come from the heap (VM_MAX_STATE_ON_STACK in py/objfun.c).
    With no memory left, MicroPython collects for each: 30 ms, in which no pass begins."""
    source = b"def f(a, b):\n  try:\n    return [a, b, [a, b, [a, b]]]\n  finally:\n    a.x\n"
    _, body = parse(compiled("frame.py", source, "armv6m"))
    assert body.children[0].frame_words == 2 + 9 + 3
    names, body = parse(board_modules()["framestep/runner.mpy"])
    words = {
        names[each.name_index]: each.frame_words
        for each in body.walk()
        if each.kind == BYTECODE and each.name_index < len(names)
    }
    assert max(words[name] for name in ("_pass", "_poll", "_blink")) <= 11 < words["_turn"]
