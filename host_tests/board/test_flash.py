"""The whole of `framestep flash` and `framestep rig edit`, on an emulated board that runs freely:
one board for all tests, in order."""

import os
import re
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest
import serial

from framestep_emulator import Emulator, edge_times
from framestep_emulator.image import read_image
from framestep_tools import cli
from framestep_tools.board import overlay
from framestep_tools.building import images
from framestep_tools.building.board_files import ROOT, board_modules
from framestep_tools.client.client import Client
from framestep_tools.payloads import Hi, MotorMove, MotorSetSpeed, MotorStatus, MotorStopAll
from host_tests.board.modules import edited
from host_tests.board.test_overlay import BACKLASH, STEP, TICK, seven_more

RIG = b'{"name": "my crane"}'
PATIENCE_S = 300


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Yield a board with the image, and the paths of its two ports.

    It is no faster than a real one: the tests do not need what it does while the tools work.
    """
    with (
        Emulator(images.frozen(), files={"/rig.json": RIG}, lockstep=False, speed=1) as emu,
        emu.pty(0) as repl,
        emu.pty(1) as protocol,
    ):
        emu.wait_usb()
        yield SimpleNamespace(
            emu=emu, repl=repl, protocol=protocol, folder=tmp_path_factory.mktemp("flash")
        )


@pytest.fixture
def flash(bench, capsys, monkeypatch):
    """Run the command as if these modules were edited; return what it prints."""

    def run(changes=None, *options, status=0):
        modules = board_modules() | (changes or {})
        monkeypatch.setattr(overlay, "board_modules", lambda *_: modules)
        args = ["flash", "--port", bench.repl, "--protocol", bench.protocol, *options]
        result = cli.app.status(args)
        said = "".join(capsys.readouterr())
        assert result == status, said
        return said

    return run


def files(bench):
    """Return {path: content} on the board's file system."""
    dump = bench.folder / "files.bin"
    bench.emu.cmd("flash_dump", file=str(dump), fs=True)
    return read_image(dump.read_bytes())


def steps(bench):
    """Return the pulses that 500 steps make."""
    with Client.open(bench.protocol, timeout_s=PATIENCE_S) as client:
        client.request(MotorSetSpeed(1, 2000, 10_000))
        bench.emu.trace_start([STEP])
        client.request(MotorMove(1, 500))
        client.wait_idle()
        client.pump(0.1)
    return len(edge_times(bench.emu.trace_stop(), STEP, 1))


@pytest.mark.repeats
def test_nothing_was_edited(bench):
    """The command in its own process, with the modules of this checkout."""
    command = ["make", "-s", "flash", f"PORT={bench.repl}", f"ARGS=--protocol {bench.protocol}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "no overlay is on the board" in done.stdout
    assert re.search(r"my crane on \S+, firmware [\d.]+: 8 motors", done.stdout)
    assert files(bench) == {"/rig.json": RIG}


def test_edited_modules_are_copied_and_removed(bench, flash):
    """An edit, the same again, an edit that cannot start, a clean board."""
    good = seven_more()
    said = flash(good)
    assert f"copying 1/1 {overlay.FOLDER}/{BACKLASH}" in said
    assert "my crane on" in said
    assert steps(bench) == 507
    said = flash(good)
    assert "copying" not in said
    assert "(1 modules) is on the board" in said
    broken = seven_more("raise RuntimeError('mistake')\n")
    assert "RuntimeError: mistake" in flash(broken, status=1)
    assert steps(bench) == 500
    flash(None, "--clean")
    assert files(bench) == {"/rig.json": RIG}


@pytest.mark.repeats
def test_interrupted_the_board_starts_with_the_modules_of_its_image(bench, flash):
    script = (
        "import sys; from host_tests.board.test_flash import edited_flash; "
        "edited_flash(sys.argv[1:])"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script, "--port", bench.repl, "--protocol", bench.protocol],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert any(said.startswith("copying 1/") for said in process.stdout)
    time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    begun = bench.emu.ns
    bench.emu.reset()  # a power cycle
    bench.emu.wait_usb(after=begun, ports=2, ms=PATIENCE_S * 1000)
    assert overlay.LIST not in files(bench)
    assert steps(bench) == 500
    flash(seven_more())
    assert steps(bench) == 507
    flash(None, "--clean")


def edited_flash(args):
    """Run the command with two edited modules."""
    modules = board_modules() | seven_more() | {TICK: edited(TICK, "EDITED = 1\n")}
    overlay.board_modules = lambda *_: modules
    cli.app.status(["flash", *args])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"framestep/soft_reset.mpy": b"x"}, "an overlay cannot replace this"),
        ({"framestep/motors/axis.mpy": bytes(50_000)}, "much for an overlay"),
    ],
    ids=["fixed", "large"],
)
def test_refused_if_an_overlay_cannot_do_it(flash, changes, message):
    said = flash(changes, status=1)
    assert message in said
    assert "framestep install --board pico" in said


def test_refused_while_something_moves(bench, flash):
    before = files(bench)
    with Client.open(bench.protocol, timeout_s=PATIENCE_S) as client:
        client.request(MotorSetSpeed(1, 100, 10_000))
        client.request(MotorMove(1, 1_000_000))
        said = flash(status=1)
        assert "motors move, or a run is prepared; nothing has been changed" in said
        assert client.request(MotorStatus()).moving == [1], "and the motion goes on"
        client.request(MotorStopAll())
        client.wait_idle()
    assert files(bench) == before


def edit(bench, monkeypatch, capsys, old, new, *file, status=0):
    """Run `framestep rig edit` with an editor that replaces text, and without answers to
    questions."""
    monkeypatch.setenv("EDITOR", f"sed -i 's/{old}/{new}/'")
    monkeypatch.delenv("VISUAL", raising=False)
    monkeypatch.setattr("builtins.input", lambda question: "n")
    ports = ["--port", bench.repl, "--protocol", bench.protocol]
    result = cli.app.status(["rig", "edit", *file, *ports])
    said = "".join(capsys.readouterr())
    assert result == status, f"{said}\n{bench.emu.events()}"
    return said


def test_rig_edit(bench, monkeypatch, capsys):
    """Changed, wrong, unchanged; the protocol moves to the REPL's port and back."""
    assert "nothing has been changed" in edit(bench, monkeypatch, capsys, "crane", "crane")
    assert files(bench)["/rig.json"] == RIG
    said = edit(bench, monkeypatch, capsys, "my crane", 'my crane", "ports": 3, "x": "', status=1)
    assert "x: no such setting" in said
    draft = re.search("as it was; framestep rig edit (.*) goes on with the draft", said)[1]
    assert files(bench)["/rig.json"] == RIG
    old, new = '"my crane", "ports": 3, "x": ""', '"small", "ports": 1'
    said = edit(bench, monkeypatch, capsys, old, new, draft)
    assert re.search(f"small on {bench.repl}, firmware", said)
    assert files(bench)["/rig.json"] == b'{"name": "small", "ports": 1}'


@pytest.mark.repeats
def test_one_port(bench, flash, monkeypatch, capsys):
    """If Ctrl-C ends the controller, the command asks before it whether anything moves."""
    port = serial.Serial(bench.repl, timeout=1)  # a host that does not claim the port for itself
    with Client(port, PATIENCE_S) as client:
        client.request(MotorSetSpeed(1, 100, 10_000))
        client.request(MotorMove(1, 1_000_000))
        assert "motors move (1); nothing has been changed" in flash(status=1)
        assert client.request(MotorStatus()).moving == [1], "and the motion goes on"
        client.request(MotorStopAll())
        client.wait_idle()
    assert "nothing has been changed" in edit(bench, monkeypatch, capsys, "small", "small")
    with Client.open(bench.repl, timeout_s=PATIENCE_S) as client:
        assert client.request(Hi()).name == "small", "the controller is there again"
    said = edit(bench, monkeypatch, capsys, "1", "2")
    assert re.search(f"small on {bench.protocol}, firmware", said)
