"""Code that a board runs from where it lies in flash, although it was copied as files.

MicroPython loads a .mpy file into RAM. Its bytecode and machine code would run from anywhere,
though, and flash can be read like memory. So the bodies of functions are taken out of the .mpy
files and put into one file beside them, and what is loaded has placeholders, which
framestep.hal.rp2_code replaces by the places of the bodies in flash.

Bodies that run while their module is imported stay in it: the module's own and its classes', and
the functions that those call. A placeholder that is called after all raises TypeError.

A page of the file is what littlefs keeps in one block of flash. A block but the first begins with
pointers of littlefs, so each page has its first 32 bytes free of code; the first page begins with
the file's head. A body lies in one page, at a multiple of four. It is found by its key, which is
made of its content, so a .mpy file and a code file that do not belong together are found out. The
index, pairs of key and place in order of the keys, has the second half of as many pages as it
needs.
"""

import ast
import struct
import zlib
from collections.abc import Iterator, Set
from dataclasses import dataclass, field
from hashlib import sha256
from itertools import zip_longest

from .mpy_file import Body, Kind, MpyError, MpyFile, parse

NAME = "framestep/code.bin"
PAGE = 4096
# bytes at the start of a page without code; littlefs needs 28 of them in a file of up to 127 pages
HEAD = 32
INDEX = 2048  # where in a page the index is
ENTRIES = 256  # of the index, in a page
# the end of each module with placeholders
FORWARD = b'\n__import__("framestep.hal.rp2_code").hal.rp2_code.forward()\n'
MAGIC = b"framestp"
MARK = 0x1AF2C0DE  # in a placeholder; a small integer on the board
MARK_AT = 16  # where in a placeholder it is, the key behind it
_POINTER = 4
_WORTH = 32  # bytes of code: below, the placeholder takes as much memory

_LOAD_NONE, _RAISE = 0x51, 0x65
_NATIVE_RAISE = 34  # number in the table of functions for machine code
# decorators that do not call the function
_HARMLESS = {"property", "staticmethod", "classmethod", "viper", "setter"}
_Scope = (
    ast.FunctionDef
    | ast.Lambda
    | ast.ClassDef
    | ast.ListComp
    | ast.SetComp
    | ast.DictComp
    | ast.GeneratorExp
)
_SCOPES = (
    ast.FunctionDef,
    ast.Lambda,
    ast.ClassDef,
    ast.ListComp,
    ast.SetComp,
    ast.DictComp,
    ast.GeneratorExp,
)


# ---- which functions run while a module is imported ----------------------------------------------


def _nested(scope: ast.Module | _Scope) -> Iterator[_Scope]:
    """The scopes directly in a scope, in the order in which the compiler comes to them."""
    parts: list[ast.AST]
    match scope:
        case ast.Module(body=body) | ast.FunctionDef(body=body) | ast.ClassDef(body=body):
            parts = [*body]
        case ast.Lambda(body=value):
            parts = [value]
        case ast.DictComp(key=key, value=value, generators=[first, *rest]):
            parts = [*first.ifs, *rest, key, value]
        case (
            ast.ListComp(elt=value, generators=[first, *rest])
            | ast.SetComp(elt=value, generators=[first, *rest])
        ):
            parts = [*first.ifs, *rest, value]
        case ast.GeneratorExp(elt=value, generators=[first, *rest]):
            parts = [*first.ifs, *rest, value]
    for part in parts:
        yield from _scopes(part)


def _scopes(node: ast.AST) -> Iterator[_Scope]:
    """The scopes in a node that are not in another one; the node itself, if it is one."""
    parts: list[ast.AST]
    match node:
        case ast.FunctionDef(args=args) | ast.Lambda(args=args):
            decorators = node.decorator_list if isinstance(node, ast.FunctionDef) else []
            for before in (
                *decorators,
                *args.defaults,
                *(default for default in args.kw_defaults if default),
            ):
                yield from _scopes(before)
            yield node
            return
        case ast.ClassDef():
            yield node
            parts = [*node.bases]
        case ast.ListComp() | ast.SetComp() | ast.DictComp() | ast.GeneratorExp():
            yield node
            parts = [node.generators[0].iter]
        case ast.Assert():
            parts = []
        case ast.If(test=ast.Constant(value=value)):
            parts = [*(node.body if value else node.orelse)]
        case _:
            parts = list(ast.iter_child_nodes(node))
    for part in parts:
        yield from _scopes(part)


def runs_at_import(tree: ast.Module) -> set[ast.AST]:
    """The scopes of a module that run, or may run, while it is imported.

    A call is taken for one of every function of the module that has the name; functions of other
    modules have been made to run from flash when they are called.
    """
    return _AtImport(tree).found


class _AtImport:
    def __init__(self, tree: ast.Module):
        self.found: set[ast.AST] = set()
        self._functions: dict[str, list[ast.FunctionDef]] = {}
        self._classes: dict[str, list[ast.ClassDef]] = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                self._functions.setdefault(node.name, []).append(node)
            elif isinstance(node, ast.ClassDef):
                self._classes.setdefault(node.name, []).append(node)
        self._run(tree.body)

    def _run(self, nodes: list[ast.stmt]) -> None:
        for node in nodes:
            self._visit(node)

    def _visit(self, node: ast.AST) -> None:
        match node:
            case ast.FunctionDef():
                names = [
                    name for name in map(_identifier, node.decorator_list) if name not in _HARMLESS
                ]
                for name in names:
                    self._call(name)
                if names:
                    self._enter(node)
                for part in (*node.args.defaults, *node.args.kw_defaults, *node.decorator_list):
                    if part:
                        self._visit(part)
                return
            case ast.Call():
                for called in (
                    node.func,
                    *node.args,
                    *(argument.value for argument in node.keywords),
                ):
                    self._call(_identifier(called))
        if isinstance(node, _SCOPES):
            self.found.add(node)
        for child in ast.iter_child_nodes(node):
            self._visit(child)

    def _call(self, name: str) -> None:
        for function in self._functions.get(name, ()):
            self._enter(function)
        for made in self._classes.get(name, ()):
            for function in self._functions.get("__init__", ()):
                if function in made.body:
                    self._enter(function)

    def _enter(self, function: ast.FunctionDef) -> None:
        if function not in self.found:
            self.found.add(function)
            self._run(function.body)


def _identifier(node: ast.AST) -> str:
    """The last name in what is called or named: "run" for `a.b.run` and `run(...)`."""
    match node:
        case ast.Call(func=function):
            return _identifier(function)
        case ast.Attribute(attr=name) | ast.Name(id=name):
            return name
    return ""


def _pairs(module: MpyFile, tree: ast.Module, name: str) -> Iterator[tuple[Body, _Scope]]:
    """Each body of a compiled module with the piece of source that it was made of. MpyError where
    they do not fit."""

    def nested(body: Body, node: ast.Module | _Scope) -> Iterator[tuple[Body, _Scope]]:
        for child, scope in zip_longest(body.children, _nested(node)):
            if child is None or scope is None or not _fits(module, child, scope):
                line = getattr(scope or node, "lineno", 1)
                raise MpyError(
                    f"{name}, line {line}: what was compiled is not what the source says"
                )
            yield child, scope
            yield from nested(child, scope)

    yield from nested(module.body, tree)


def _fits(module: MpyFile, body: Body, scope: _Scope) -> bool:
    if body.kind == Kind.VIPER:
        return isinstance(scope, ast.FunctionDef) and "viper" in map(
            _identifier, scope.decorator_list
        )
    name = module.names[body.name_index]
    if isinstance(scope, ast.FunctionDef | ast.ClassDef):
        return name in (None, scope.name)
    return name is None or name.startswith("<")


# ---- the files -----------------------------------------------------------------------------------


@dataclass
class CodeFile:
    """Bodies of functions that have been taken out of compiled modules."""

    bodies: dict[int, bytes] = field(default_factory=dict)  # by key

    def take(
        self, name: str, source: str, compiled: bytes, stays: Set[str] = frozenset()
    ) -> bytes | None:
        """The module with placeholders for the bodies that have been taken out of it, None if there
        were none.

        source: what it was compiled of, but for FORWARD at its end. stays: names of functions that
        stay in it.
        """
        module = parse(compiled)
        tree = ast.parse(source)
        at_import = runs_at_import(tree)
        taken = False
        for body, scope in _pairs(module, tree, name):
            if scope in at_import or getattr(scope, "name", "") in stays:
                continue
            if len(body.code) <= _WORTH or len(body.code) > PAGE - HEAD:
                continue
            if body.kind not in (Kind.BYTECODE, Kind.VIPER):
                continue
            start = (
                _raising(body)
                if body.kind == Kind.BYTECODE
                else _raising_machine_code(module.function_table)
            )
            if len(start) <= MARK_AT:
                body.code = start.ljust(MARK_AT, b"\0") + struct.pack(
                    "<II", MARK, self.add(body.code)
                )
                taken = True
        return module.packed() if taken else None

    def add(self, code: bytes) -> int:
        """Put a body in; its key."""
        # a small integer on the board
        key = int.from_bytes(sha256(code).digest()[:4], "little") >> 2
        while self.bodies.setdefault(key, code) != code:
            key += 1
        return key

    def packed(self) -> bytes:
        """The file."""
        index_pages = -(-len(self.bodies) // ENTRIES)
        pages: list[bytearray] = []
        free: list[list[tuple[int, int]]] = []  # for each page, from where to where

        def add_page() -> None:
            number = len(pages)
            pages.append(bytearray(b"\xff" * PAGE))
            entries = min(max(len(self.bodies) - number * ENTRIES, 0), ENTRIES)
            free.append([(HEAD, INDEX), (INDEX + 8 * entries, PAGE)] if entries else [(HEAD, PAGE)])

        def place(code: bytes) -> int:
            size = -(-len(code) // 4) * 4
            for number in range(len(pages) + 1):
                if number == len(pages):
                    add_page()
                for i, (begin, end) in enumerate(free[number]):
                    if size <= end - begin:
                        free[number][i] = (begin + size, end)
                        pages[number][begin : begin + len(code)] = code
                        return number * PAGE + begin
            raise AssertionError("a page takes any body")

        for _ in range(max(index_pages, 1)):
            add_page()
        places = {key: place(code) for key, code in self.bodies.items()}
        for i, key in enumerate(sorted(places)):
            struct.pack_into(
                "<II", pages[i // ENTRIES], INDEX + 8 * (i % ENTRIES), key, places[key]
            )
        check = zlib.crc32(b"".join(page[HEAD:] for page in pages))
        pages[0][:HEAD] = struct.pack("<8sIII", MAGIC, len(pages), len(self.bodies), check).ljust(
            HEAD, b"\xff"
        )
        return b"".join(page[_pointers(number) :] for number, page in enumerate(pages))


def _pointers(page: int) -> int:
    """Bytes at the start of a block of a file that littlefs has for itself."""
    return _POINTER * (page & -page).bit_length()


def _raising(body: Body) -> bytes:
    """A function that is called like this one and raises."""
    name = _number(body.name_index)
    return body.signature + bytes([len(name) << 1]) + name + bytes([_LOAD_NONE, _RAISE])


def _number(value: int) -> bytes:
    return bytes([value]) if value < 0x80 else bytes([value >> 7 | 0x80, value & 0x7F])


def _raising_machine_code(table: int) -> bytes:
    """A function that calls MicroPython's own to raise; r0 is the function's object, `table` where
    its constants have the table of functions."""
    return struct.pack(
        "<7H",
        0x6841,  # ldr r1, [r0, #4]    its context
        0x68C9,  # ldr r1, [r1, #12]   the constants
        0x6809 | table << 6,  # ldr r1, [r1, #4 * table]
        0x3100 | _NATIVE_RAISE * 4,  # adds r1, ...
        0x6809,  # ldr r1, [r1]
        0x2003,  # movs r0, #3         the number 1, which is no exception
        0x4708,  # bx r1
    )
