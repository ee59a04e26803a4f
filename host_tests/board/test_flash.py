"""`make flash` and `framestep rig edit`, whole, on an emulated board that runs freely: one board
for all, in order."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
import serial

from framestep_emulator import Emulator
from framestep_emulator.image import read_image
from framestep_tools import cli, dist
from framestep_tools.client import Client
from framestep_tools.files import ROOT, board_files
from framestep_tools.payloads import Hi, MotorMove, MotorSetSpeed, MotorStatus, MotorStopAll

RIG = b'{"name": "my crane"}'
HELLO = re.compile(r"my crane on \S+, firmware [\d.]+: 8 motors, .* \d{3,} frames")
FILE_SYSTEM = 640 * 1024  # where it begins in the flash
PATIENCE_S = 300


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A board with MicroPython and a rig file, and the paths of its two ports.

    It is no faster than a real one: what it does while the tools work is of no use here.
    """
    with (
        Emulator(files={"/rig.json": RIG}, lockstep=False, speed=1) as emu,
        emu.pty(0) as repl,
        emu.pty(1) as protocol,
    ):
        emu.wait_usb()
        yield SimpleNamespace(
            emu=emu, repl=repl, protocol=protocol, folder=tmp_path_factory.mktemp("flash")
        )


def command(bench):
    return [
        "make",
        "-s",
        "flash",
        "BOARD=pico",
        f"PORT={bench.repl}",
        f"ARGS=--protocol {bench.protocol}",
    ]


@pytest.fixture(scope="module")
def wanted():
    """What a board gets."""
    return board_files()


@pytest.fixture
def flash(bench, capsys):
    """The command in this process: what it prints, standard error too."""

    def run(status=0):
        args = ["--board", "pico", "--port", bench.repl, "--protocol", bench.protocol]
        result = cli.app.status(["flash", *args])
        said = "".join(capsys.readouterr())
        assert result == status, said
        return said

    return run


def files(bench):
    """What lies on the board's file system."""
    dump = bench.folder / "flash.bin"
    bench.emu.cmd("flash_dump", file=str(dump))
    return read_image(dump.read_bytes()[FILE_SYSTEM:])


def copied(text):
    return [int(n) for n in re.findall(r"copying \d+/(\d+) ", text)]


def kill_at(bench, line):
    """Begin, and kill it all a moment after this line."""
    process = subprocess.Popen(
        command(bench), cwd=ROOT, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert any(said.startswith(line) for said in process.stdout)
    time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()


def test_interrupted_half_way_the_next_run_repairs_it(bench, wanted):
    # the second time without a power cycle: the REPL is where it was left
    for line in ("copying 5/", "copying 12/"):
        kill_at(bench, line)
    begun = bench.emu.ns
    bench.emu.reset()  # a power cycle: it comes up as plain MicroPython
    bench.emu.wait_usb(after=begun, ports=1, ms=PATIENCE_S * 1000)
    assert "/main.py" not in files(bench)

    done = subprocess.run(
        command(bench), cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert done.returncode == 0, done.stdout + done.stderr
    said = done.stdout
    numbers = copied(said)
    assert numbers, "what had been copied is not copied again"
    assert numbers[0] <= len(wanted) - 15, "what had been copied is not copied again"
    assert HELLO.search(said.splitlines()[-1]), said
    found = files(bench)
    assert found.pop("/rig.json") == RIG
    found.pop("/lib/framestep/files.json")
    assert found == wanted


def test_the_second_time_there_is_nothing_to_copy(flash, wanted):
    said = flash()
    assert f"all {len(wanted)} files are there already" in said
    assert not copied(said)
    assert HELLO.search(said.splitlines()[-1]), said


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
    """`framestep rig edit` with an editor that replaces text, and nothing to answer questions
    with."""
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
    assert "rig.json: x: no such setting" in said
    draft = re.search("as it was; framestep rig edit (.*) goes on with the draft", said)[1]
    assert files(bench)["/rig.json"] == RIG
    old, new = '"my crane", "ports": 3, "x": ""', '"small", "ports": 1'
    said = edit(bench, monkeypatch, capsys, old, new, draft)
    assert re.search(f"small on {bench.repl}, firmware", said)
    assert files(bench)["/rig.json"] == b'{"name": "small", "ports": 1}'


def test_one_port(bench, flash, monkeypatch, capsys):
    """Where Ctrl-C ends the controller, it is asked before whether anything moves."""
    port = serial.Serial(bench.repl, timeout=1)  # of a host that does not ask for the port alone
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


def one_of_each_kind(package):
    """Entries of a package's list: the smallest file of each folder of the board, what lies beside
    /lib, and what differs from board to board."""
    urls = json.loads(package.read_text())["urls"]
    smallest = {}
    for target, source in sorted(urls, key=lambda url: (package.parent / url[1]).stat().st_size):
        smallest.setdefault(Path(target).parent, [target, source])
    chosen = [url for url in urls if url[0].startswith("../") or url[1].startswith("boards/")]
    return chosen + [url for url in smallest.values() if url not in chosen]


def test_installed_by_mip(tmp_path, wanted):
    """mpremote mip install of a package.json of `make dist`, cut to one file of each kind, onto a
    board that has all others; then a reset: framestep answers. That the whole list is what `flash`
    copies is in tools/test_dist.py."""
    dist.write(tmp_path / "dist")
    package = tmp_path / "dist" / "armv6m" / "package.json"
    urls = one_of_each_kind(package)
    package.write_text(json.dumps({"urls": urls, "version": "1"}))
    coming = {f"/lib/{target}".replace("/lib/../", "/") for target, _ in urls}
    assert {"/boot.py", "/main.py", "/lib/framestep/board.mpy"} < coming
    others = {path: content for path, content in wanted.items() if path not in coming}
    assert len(others) + len(urls) == len(wanted)
    with (
        Emulator(files=others, lockstep=False, speed=1) as emu,
        emu.pty(0) as repl,
        emu.pty(1) as protocol,
    ):
        emu.wait_usb()
        mpremote = [sys.executable, "-m", "mpremote", "connect", repl]
        done = subprocess.run(
            [*mpremote, "mip", "install", str(package)], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert files(SimpleNamespace(emu=emu, folder=tmp_path)) == wanted
        begun = emu.ns
        subprocess.run([*mpremote, "reset"], check=True, capture_output=True)
        emu.wait_usb(after=begun, ports=2, ms=PATIENCE_S * 1000)
        with Client.open(protocol, timeout_s=PATIENCE_S) as client:
            assert client.request(Hi()).motors == 8
