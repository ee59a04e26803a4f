"""Functions taken out of compiled modules, and the file of them as it lies in a board's flash."""

import ast
import random
import struct
import zlib

import pytest

from framestep_emulator.image import make_image
from framestep_tools import builds
from framestep_tools.code_file import (
    ENTRIES,
    HEAD,
    INDEX,
    MAGIC,
    MARK,
    MARK_AT,
    NAME,
    PAGE,
    CodeFile,
    runs_at_import,
)
from framestep_tools.files import IN_RAM, board_files, board_modules, compiled
from framestep_tools.mpy_file import Body, Kind, MpyError, parse


@pytest.fixture(scope="module")
def modules():
    return board_modules()


def test_taken_apart_and_put_together_again_a_module_is_the_same(modules):
    for name, content in modules.items():
        assert parse(content).packed() == content, name
    with pytest.raises(MpyError):
        parse(modules["framestep/boot.mpy"][:-1])
    with pytest.raises(MpyError):
        parse(modules["framestep/boot.mpy"] + b"?")


def test_names_and_arguments():
    source = (
        b"def f(a, b, c, d, e=1): return [x for x in a]\n"
        b"class C:\n"
        b"  def method(self): return lambda: 1\n"
    )
    module = parse(compiled("names.py", source, "armv6m"))
    function, made = module.body.children
    assert [module.names[body.name_index] for body in (function, made, made.children[0])] == [
        "f",
        "C",
        "method",
    ]
    assert function.argument_count == 5
    assert made.children[0].argument_count == 1
    assert [len(body.children) for body in (function, made)] == [1, 1]


def test_frames_of_what_runs_while_the_heap_is_not_locked(modules):
    """Frames of more than eleven words come from the heap (VM_MAX_STATE_ON_STACK in py/objfun.c).
    With all memory taken MicroPython collects for each: 30 ms, in which no pass begins."""
    source = b"def f(a, b):\n  try:\n    return [a, b, [a, b, [a, b]]]\n  finally:\n    a.x\n"
    assert parse(compiled("frame.py", source, "armv6m")).body.children[0].frame_words == 2 + 9 + 3
    module = parse(modules["framestep/runner.mpy"])
    words = {
        module.names[body.name_index]: body.frame_words
        for body in module.body.walk()
        if body.kind == Kind.BYTECODE and body.name_index < len(module.names)
    }
    assert max(words[name] for name in ("_pass", "_poll", "_blink")) <= 11 < words["_turn"]


def names_at_import(source):
    """Names of the functions and classes that run, and "lambda" and the like for others."""
    tree = ast.parse(source)
    return sorted(getattr(node, "name", type(node).__name__) for node in runs_at_import(tree))


@pytest.mark.parametrize(
    ("source", "names"),
    [
        ("def f(): pass", []),
        ("def f(): pass\nf()", ["f"]),
        ("def f(): g()\ndef g(): pass\ndef h(): f()\nx = f()", ["f", "g"]),
        ("def f(): pass\nif 1:\n    for i in f(): pass", ["f"]),
        ("def f(x): pass\ny = sorted(z, key=f)", ["f"]),
        ("def f(): pass\ny = sorted(z, key=f)", ["f"]),
        ("def f(): pass\nHANDLERS = {1: f}", []),
        (
            "class C:\n"
            "    def __init__(self): self.m()\n"
            "    def m(self): pass\n"
            "    def n(self): pass",
            ["C"],
        ),
        (
            "class C:\n"
            "    def __init__(self): self.m()\n"
            "    def m(self): pass\n"
            "    def n(self): pass\n"
            "x = C()",
            ["C", "__init__", "m"],
        ),
        ("def f(): pass\nclass C:\n    x = f()", ["C", "f"]),
        ("@pio(out=1)\ndef f(): pass", ["f"]),
        ("def d(g): return g\n@d\ndef f(): pass", ["d", "f"]),
        (
            "@micropython.viper\ndef f(): pass\nclass C:\n    @property\n    def g(self): pass",
            ["C"],
        ),
        ("def f(): pass\ndef g(x=f()): pass", ["f"]),
        ("x = [i for i in y]\ndef f(): return [i for i in y]", ["ListComp"]),
        ("def f():\n    def inner(): pass\n    inner()\nf()", ["f", "inner"]),
    ],
)
def test_what_runs_while_a_module_is_imported(source, names):
    assert names_at_import(source) == names


LONG = "".join(f"x = x * {i} + y\n" for i in range(10))
SOURCE = f"""
def called(x, y):
    {LONG.replace(chr(10), chr(10) + "    ")}
    return x
def later(x, y=2):
    {LONG.replace(chr(10), chr(10) + "    ")}
    def nested(z, x=1, y=1):
        {LONG.replace(chr(10), chr(10) + "        ")}
        return z
    return [called(nested(i), 1) for i in range(x, x + y) if i * i * i + y * x - 12345 and called(i, x) != nested(y)]
@micropython.viper
def kernel(x: int, y: int) -> int:
    {LONG.replace(chr(10), chr(10) + "    ")}
    return x
def short():
    return 1
TABLE = called(1, 2)
"""  # noqa: E501


def test_placeholders():
    """Bodies that run later go, those that run at import or are small stay, nested ones go too."""
    whole = parse(compiled("s.py", SOURCE.encode(), "armv6m"))
    code = CodeFile()
    made = parse(code.take("s.py", SOURCE, compiled("s.py", SOURCE.encode(), "armv6m")))
    assert made.head == whole.head
    assert made.body.code == whole.body.code
    changed = {}
    for old, new in zip(whole.body.walk(), made.body.walk(), strict=True):
        assert (old.kind, old.extra, len(old.children)) == (new.kind, new.extra, len(new.children))
        if old.code != new.code:
            mark, key = struct.unpack_from("<II", new.code, MARK_AT)
            assert mark == MARK
            assert code.bodies[key] == old.code
            assert len(new.code) < len(old.code)
            if old.kind == Kind.BYTECODE:
                assert new.signature == old.signature
                assert new.argument_count == old.argument_count
            name = whole.names[old.name_index] if old.kind == Kind.BYTECODE else "kernel"
            changed[name] = old
    assert {"later", "nested", "kernel"} <= changed.keys()
    assert not {"called", "short"} & changed.keys()
    assert CodeFile().take("t.py", "x = 1", compiled("t.py", b"x = 1", "armv6m")) is None


def test_another_source_is_refused():
    with pytest.raises(MpyError, match=r"s\.py"):
        CodeFile().take("s.py", "def other(): pass", compiled("s.py", SOURCE.encode(), "armv6m"))


def in_flash(content):
    """The pages of a code file in a board's flash, found by littlefs' own pointers."""
    image = make_image({"/lib/" + NAME: content, "/a": b"x" * 9000}, builds.micropython("rp2"))
    tail = content[HEAD - PAGE :]
    (last,) = {
        block
        for block in range(len(image) // PAGE)
        if image[block * PAGE + HEAD : (block + 1) * PAGE] == tail
    }
    head = image.index(MAGIC) // PAGE
    blocks = [last]
    while blocks[0] != head:
        blocks.insert(0, struct.unpack_from("<I", image, blocks[0] * PAGE)[0])
    return [image[block * PAGE : (block + 1) * PAGE] for block in blocks]


def find(pages, count, key):
    """The body's start, as the board finds it."""
    keys = []
    for i in range(count):
        found, place = struct.unpack_from("<II", pages[i // ENTRIES], INDEX + 8 * (i % ENTRIES))
        keys.append(found)
        if found == key:
            at = pages[place // PAGE][place % PAGE :]
    assert keys == sorted(set(keys))
    return at


def test_every_function_lies_whole_in_a_block_of_flash():
    chance = random.Random(1)
    code = CodeFile()
    for i in range(900):
        size = chance.choice((33, 100, 250, 700, PAGE - HEAD if i % 100 == 0 else 2000))
        code.add(chance.randbytes(size))
    content = code.packed()
    pages = in_flash(content)
    magic, number, count, check = struct.unpack_from("<8sIII", pages[0])
    assert (magic, number, count) == (MAGIC, len(pages), 900)
    assert check == zlib.crc32(b"".join(page[HEAD:] for page in pages))
    for key, body in code.bodies.items():
        at = find(pages, count, key)
        assert at.startswith(body)
        assert len(at) % 4 == 0


def test_what_a_board_gets(modules):
    """Placeholders and functions belong together; the tick is whole."""
    files = board_files()
    pages = in_flash(files["/lib/" + NAME])
    count = struct.unpack_from("<I", pages[0], 12)[0]
    taken = 0
    for name in modules:
        if "/lib/" + name not in files:
            continue  # merged into another
        new = parse(files["/lib/" + name])
        for body in new.body.walk():
            if (
                len(body.code) == MARK_AT + 8
                and struct.unpack_from("<I", body.code, MARK_AT)[0] == MARK
            ):
                assert name != "framestep/motion/tick.mpy"
                find(pages, count, struct.unpack_from("<I", body.code, MARK_AT + 4)[0])
                taken += 1
    assert taken >= count > 300
    whole = board_files("armv7emsp", "pico2")
    assert "/lib/" + NAME not in whole, "a Pico 2 has memory enough"


def test_bodies_that_are_the_same_are_there_once_and_no_key_stands_for_two():
    code = CodeFile()
    first = code.add(b"x" * 40)
    assert code.add(b"x" * 40) == first
    assert len(code.bodies) == 1
    code.bodies[first] = b"another that has the key"
    assert code.add(b"x" * 40) == first + 1
    assert Body(Kind.BYTECODE, b"", b"", []).children == []


def test_every_function_of_a_copied_module_fits_a_block_of_flash(modules):
    """A larger one would stay in RAM unnoticed, but for what is meant to."""
    for name, content in modules.items():
        if name in IN_RAM:
            continue
        todo = [parse(content).body]
        while todo:
            body = todo.pop()
            assert len(body.code) <= PAGE - HEAD, name
            todo += body.children
