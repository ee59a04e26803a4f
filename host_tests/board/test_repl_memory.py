"""What the REPL can do with the memory that framestep leaves: every command with every example rig
file, writing files, judging rig files."""

import json

import pytest

from framestep_emulator import Emulator
from framestep_tools.board.repl_device import MISTAKE, Device
from framestep_tools.building import images
from framestep_tools.building.board_files import ROOT, emulated_boards
from framestep_tools.client.client import Client
from framestep_tools.console.repl_scripts import CHECK
from framestep_tools.payloads import Hi
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.board.modules import edited, ident_of, on_board

HOME = {"limit": 1, "travel": 3000, "back_off": 400}
START_MS = 3000  # from power-on until framestep runs, with a margin
# Besides the examples: features that take memory
FEATURES = {
    "homing": ("pico", {"limits": [{"low": 22}], "motors": [{"home": HOME}]}),
    "homing and drivers": (
        "skr_pico",
        {"limits": [{"low": 4}], "motors": [{"driver": {"run_ma": 800}, "home": HOME}]},
    ),
    "a servo": ("pico", {"motors": [{}, {"servo": {}}]}),
    "positions that are kept": ("pico", {"remember_positions": True}),
}
# The least that each command prints. home(1) and move() are refused with some rigs.
COMMANDS = {
    "status()": "motor 1",
    "timing()": "interrupts: ",
    "rig()": "at its default",
    "io()": "",
    "home(1)": "",
    "move(1, 200)": "",
    "stop()": "",
    "why()": "",
    "help()": "positions, until a key is pressed",
    "trace()": "tracing begins now",
    "trace(20)": "",
    "trace(0)": "",
}
# All memory is taken except for single pieces of 640 bytes; an open file takes 636
FRAGMENTED = """
held = []
try:
    while True: held.append(bytearray(640))
except MemoryError: pass
for i in range(0, len(held), 2): held[i] = None
"""
FULL = """
held = []
try:
    while True: held.append(bytearray(64))
except MemoryError: pass
status()
held.clear()
"""


MOST = ("homing and drivers", "positions that are kept")  # they load the most modules


def example(board):
    """Return a board's example rig file."""
    return json.loads((ROOT / "boards" / board / "rig.json").read_text())


def rigs():
    for board in emulated_boards():
        yield pytest.param(
            board, example(board), id=f"example of {board}", marks=pytest.mark.repeats
        )
    for name, (board, rig) in FEATURES.items():
        marks = () if name in MOST else pytest.mark.repeats
        yield pytest.param(board, rig, id=name, marks=marks)


def every_command_works(repl):
    repl.exec("import framestep.repl")
    for command, expected in COMMANDS.items():
        said = repl.exec(command)
        assert expected in said, command
        assert "Error" not in said, command


@pytest.mark.parametrize(("name", "rig"), list(rigs()))
def test_every_command_works(name, rig):
    with EmulatedBoard(rig, trace=False, board=name) as board:
        board.wire_switches()
        every_command_works(board.emulator.repl())


def overlays():
    """Yield a module of the usual size and one of the largest, each with the rigs that leave the
    least memory."""
    large = "framestep/motion/reals.mpy"
    with_drivers = ((board, example(board)) for board in ("skr_pico", "fysetc_erb"))
    for board, rig in (FEATURES["homing"], *with_drivers):
        for module in ("framestep/controller.mpy", large):
            marks = () if (board, module) == ("pico", large) else pytest.mark.repeats
            yield pytest.param(board, rig, module, id=f"{module} on {board}", marks=marks)


@pytest.mark.parametrize(("name", "rig", "module"), list(overlays()))
def test_every_command_works_beside_an_overlay(name, rig, module):
    files = on_board(ident_of(name), {module: edited(module)})
    with EmulatedBoard(rig, trace=False, board=name, files=files) as board:
        board.wire_switches()
        repl = board.emulator.repl()
        every_command_works(repl)
        assert "an overlay is in use" in repl.exec("status()")


def test_a_ctrl_c_while_the_board_starts_changes_nothing():
    """mpremote sends one as soon as the port appears."""
    rig = json.dumps({"name": "starting"}).encode()
    with Emulator(firmware=images.frozen(), files={"/rig.json": rig}, boot=False) as emulator:
        emulator.wait_usb(10_000, ports=1)
        repl = emulator.serial(0)
        while emulator.ns < START_MS * 1_000_000:
            repl.write(b"\r\x03\x03")
            emulator.advance(7)
        with Client(emulator.serial(1)) as client:
            assert client.request(Hi()).name == "starting"


def test_too_little_memory_is_a_sentence():
    """A program on the REPL has taken all memory."""
    with EmulatedBoard({"name": "full"}, trace=False) as board:
        repl = board.emulator.repl()
        repl.exec("import framestep.repl")
        said = repl.exec(FULL)
        assert "status() needs more memory than is free" in said
        assert "Traceback" not in said
        assert "motor 1" in repl.exec("status()")


@pytest.fixture(scope="module")
def refused():
    """Yield the REPL of a board that refuses its rig file."""
    rig = json.dumps({"motor_count": 99}).encode()
    with (
        Emulator(
            firmware=images.frozen(), files={"/rig.json": rig}, lockstep=False, speed=1
        ) as emulator,
        emulator.pty(0) as path,
    ):
        emulator.wait_usb(10_000, ports=2)
        with Device(path) as device:
            yield device


def test_the_mistake_in_the_rig_file_is_reported_without_loading_anything(refused):
    free = "import gc, sys\ngc.collect()\nprint(gc.mem_free(), len(sys.modules))"
    refused.run(free)
    bytes_free, modules = map(int, refused.run(free).split())
    assert "motor_count: found 99" in refused.run(MISTAKE)
    after, modules_after = map(int, refused.run(free).split())
    assert modules_after == modules
    assert bytes_free - after < 300


def test_a_rig_file_is_judged_and_its_code_let_go(refused):
    def judged(text):
        return json.loads(refused.run(f"text = {text!r}\n{CHECK}").rpartition("\x02")[2])

    modules = "import sys\nprint(sorted(sys.modules))"
    before = refused.run(modules)
    assert judged('{"name": "a", "motor_count": 3}') == [
        True,
        "valid for Raspberry Pi Pico: 'a', 0 motors set",
    ]
    right, why = judged('{"motor_count": 99}')
    assert right is False
    assert "motor_count: found 99" in why
    assert judged("{") == [False, "not valid JSON"]
    assert refused.run(modules) == before


def test_a_file_is_written_into_memory_that_is_in_pieces(refused):
    refused.run(FRAGMENTED)
    data = bytes(range(256)) * 5 + b"\x02the end"
    refused.replace("/written", data)
    assert refused.read("/written") == data
    refused.run("held.clear()")
