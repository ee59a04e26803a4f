"""Copied code: functions run from where they lie in flash."""

import ast
import re

import pytest

from framestep_tools.client import Client
from framestep_tools.code_file import FORWARD, INDEX, MARK, MARK_AT, NAME, CodeFile
from framestep_tools.files import FIRMWARE, board_files, board_modules, compiled, sources
from framestep_tools.merging import groups, where
from framestep_tools.payloads import Hi, MotorGetPosition, MotorMove

CODE = "/lib/" + NAME
FLASH = 0x1000_0000
RAM, RAM_SIZE = 0x2000_0000, 264 * 1024
CODE_OF_A_FUNCTION = 12  # offset of the pointer to its code (py/objfun.h, mp_obj_fun_bc_t)
MOST_NAMES = 1210  # the 1261st takes 7.7 kB (framestep_tools.names), and the REPL adds some 50

# Every function of a module, and of the classes in it, with what is nested in it: a loaded function
# has a table of that (py/emitglue.h, mp_raw_code_t), whose length is not known: what follows it is
# looked at, too.
LOOK = f"""
from machine import mem32
import sys
RAM, END = {RAM}, {RAM + 256 * 1024}
def at(address):
    return mem32[address] if RAM <= address < END and not address & 3 else 0
def left(pointer):
    return not pointer & 15 and at(pointer + {MARK_AT}) == {MARK}
def loaded(table, depth=4):
    if depth:
        for i in range(8):
            inner = at(table + 4 * i)
            if not inner & 15 and at(inner):
                yield at(inner + 4)
                yield from loaded(at(inner + 8), depth - 1)
def functions(things, seen=[]):
    for thing in list(things.values()):
        kind = type(thing).__name__
        if kind == "type" and id(thing) not in seen:
            seen.append(id(thing))
            yield from functions(thing.__dict__)
        elif kind in ("function", "generator", "property", "staticmethod", "closure"):
            yield id(thing)
found = flash = 0
for name in sorted(sys.modules):
    if name.startswith("framestep"):
        for function in functions(sys.modules[name].__dict__):
            code = at(function + {CODE_OF_A_FUNCTION})
            flash += code >> 28 == 1
            for pointer in [code] + list(loaded(at(function + 8))):
                if left(pointer):
                    print(name, hex(function))
                    found += 1
print(found, flash)
"""

# Words of memory that begin a unit of the heap, and are the mark of a placeholder. The mark is
# handed over, as the word would be in the code otherwise.
MARKS = f"""
import micropython
@micropython.viper
def marks(at: int, mark: int) -> int:
    found = 0
    while at < {RAM + 256 * 1024}:
        if ptr32(at)[0] == mark:
            found += 1
        at += 16
    return found
print(marks({RAM}, {MARK}))
"""

IMPORT_ALL = """
import gc
gc.threshold(4096)
for name in NAMES:
    __import__(name)
"""


@pytest.fixture(scope="module")
def files():
    return board_files()


def test_it_runs_from_flash_with_room_for_a_long_move(board):
    """Virtual axes are on, the move's memory is large, and nothing points at a placeholder."""
    emulator = board()
    emulator.wait_usb(10_000, ports=2)
    with Client(emulator.serial(1)) as client:
        info = client.request(Hi())
        assert info.upload_frames >= 5000
        assert info.motors == 8
        assert info.capabilities & 0x7C, "virtual axes"
        client.request(MotorMove(1, 500))
        client.wait_idle()
        assert client.request(MotorGetPosition()).steps[0] == 500
        repl = emulator.repl()
        names = re.search(r"n_qstr=(\d+)", repl.exec("import micropython\nmicropython.qstr_info()"))
        assert names
        assert int(names[1]) < MOST_NAMES
        left, in_flash = map(int, repl.exec(LOOK, timeout=60).splitlines()[-1].split())
        assert left == 0
        assert in_flash > 400
        tick = "id(__import__('framestep.motion.tick', None, None, ('Header',)).Header.tick)"
        code = repl.eval(f"__import__('machine').mem32[{tick} + {CODE_OF_A_FUNCTION}]")
        assert RAM <= code < RAM + RAM_SIZE, "the tick runs from RAM, not through the flash cache"
        assert client.request(Hi()) == info, "it still answers"


def test_no_module_calls_a_placeholder_while_it_is_imported(emulator, files):
    """A placeholder that is called raises."""
    names = [
        path[len("/lib/") : -len(".mpy")].replace("/", ".").removesuffix(".__init__")
        for path in files
        if path.endswith(".mpy")
    ]
    emu = emulator(files=without("/main.py", files))
    printed = emu.repl().exec(
        f"NAMES = {names!r}\n" + IMPORT_ALL + "print(len(NAMES), 'are there')", timeout=60
    )
    assert f"{len(names)} are there" in printed
    # a small object in the place of the first half of one would be taken for a placeholder
    assert int(emu.repl().exec(MARKS)) == 0


SOURCE = """
def bytecode(x):
    return [i * 3 + x for i in range(x)] + [x * 1000 + 1, x * 1000 + 2]
@micropython.viper
def machine_code(x: int) -> int:
    return x * 3 + (x >> 2) * (x + 1000) - (x << 3) * (x + 2000)
def generator(x):
    for i in range(x):
        yield i * 3 + x * 1000 - 12345 + i * i * i
"""
CALL_AT_IMPORT = """
for name in ("bytecode", "machine_code", "generator"):
    try:
        list(globals()[name](5)) if name == "generator" else globals()[name](5)
        print(name, "runs")
    except TypeError:
        print(name, "raises")
"""


def test_a_placeholder_that_is_called_raises(emulator, files):
    """Called so that framestep_tools.code_file does not see it; when the module is there they
    run."""
    source = SOURCE.replace("@", "import micropython\n@", 1) + CALL_AT_IMPORT
    code = CodeFile()
    module = code.take("t.py", source, compiled("t.py", source.encode() + FORWARD, "armv6m"))
    needed = {
        f"/lib/framestep/{name}.mpy"
        for name in ("__init__", "native", "hal/__init__", "hal/rp2_code")
    }
    own = {name: content for name, content in files.items() if name in needed}
    emu = emulator(files={**own, CODE: code.packed(), "/t.mpy": module})
    repl = emu.repl()
    lines = repl.exec("import t").split("\n")
    assert [line.strip() for line in lines if line] == [
        "bytecode raises",
        "machine_code raises",
        "generator raises",
    ]
    assert repl.eval("t.bytecode(2)") == [2, 5, 2001, 2002]
    assert repl.eval("t.machine_code(5)") == 15 + 1005 - 40 * 2005
    assert repl.eval("list(t.generator(1))") == [1000 - 12345]


def without(name, files):
    return {path: content for path, content in files.items() if path != name}


def flipped(content, at):
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda files: without(CODE, files), "there is no /lib/framestep/code.bin"),
        (lambda files: {**files, CODE: flipped(files[CODE], 20_000)}, "code.bin is damaged"),
        (lambda files: {**files, CODE: flipped(files[CODE], 8)}, "code.bin is damaged"),
        (lambda files: {**files, CODE: flipped(files[CODE], INDEX + 1)}, "code.bin is damaged"),
        (lambda files: {**files, CODE: files[CODE][:50_000]}, "code.bin is damaged"),
        (lambda files: {**files, CODE: b""}, "code.bin is damaged"),
        (
            lambda files: {**files, CODE: CodeFile({1: b"old"}).packed()},
            "code.bin is of another version",
        ),
    ],
    ids=[
        "missing",
        "a bit of code",
        "a bit of the head",
        "a bit of the index",
        "cut",
        "empty",
        "old",
    ],
)
def test_a_code_file_that_is_not_right(emulator, files, spoil, said):
    """Told on the REPL, which works, with what to do."""
    emu = emulator(files=spoil(files))
    emu.advance(1500)
    serial = emu.serial(0)
    serial.timeout = 2
    serial.write(b"\r\n")
    text = serial.read_until(b">>> \r\n>>> ").decode()
    assert said in text, text
    assert "run make flash again" in text, text
    assert emu.repl().eval("1 + 1") == 2
    assert not emu.halted


def test_another_file_system(emulator, files):
    """Where the file system is FAT, the code file cannot be found block by block."""
    loader = "framestep/hal/rp2_code.mpy"
    script = f"""
import rp2, vfs, framestep.native
from framestep.hal import rp2_ram
content = open("/lib/{loader}", "rb").read()
vfs.umount("/")
vfs.VfsFat.mkfs(rp2.Flash())
try:
    rp2_ram.load({{"{loader}": content}})
except RuntimeError as error:
    print(error)
"""
    own = {**files, "/lib/framestep/hal/rp2_ram.mpy": board_modules()["framestep/hal/rp2_ram.mpy"]}
    emu = emulator(files=without("/main.py", own))
    assert "needs a littlefs file system" in emu.repl().exec(script, timeout=30)


def test_a_traceback_names_file_and_line(board):
    """Of a function in flash."""
    tree = ast.parse((FIRMWARE / "framestep/moves/operations.py").read_text())
    (method,) = (
        node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name == "poll"
    )
    line = method.body[1].lineno  # after the docstring
    emulator = board()
    emulator.wait_usb(10_000, ports=2)
    repl = emulator.repl()
    printed = repl.exec(
        "import sys\n"
        "from framestep.moves.requests import OperationRunner\n"
        "try:\n"
        "    OperationRunner.poll(None)\n"
        "except AttributeError as error:\n"
        "    sys.print_exception(error)"
    )
    found = re.search(r'File "framestep.moves.requests", line (\d+), in poll', printed)
    assert found
    merged = groups({path: file.read_text() for path, file in sources().items()})
    assert where("framestep/moves/requests.py", int(found[1]), merged) == (
        "framestep/moves/operations.py",
        line,
    )
    assert (
        FLASH
        <= repl.eval(
            f"__import__('machine').mem32[id(OperationRunner.poll) + {CODE_OF_A_FUNCTION}]"
        )
        < RAM
    )
