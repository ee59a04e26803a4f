"""From a bare ESP32 to the first move: MicroPython formats its flash, `framestep install` puts the
files there through the REPL, `framestep flash` brings edited ones, and the power may go at any
time."""

from contextlib import suppress

import pytest

from framestep_tools import cli
from framestep_tools.board import file_install
from framestep_tools.board.file_install import LIST, MAIN, Package, main_py
from framestep_tools.building.board_files import board_sources, compiled
from framestep_tools.payloads import Hi, MotorMove
from framestep_tools.simulator.esp32_board import BOARD, PROCESSOR, Esp32Board, installed, modules
from host_tests.end_to_end.session import Session
from host_tests.esp32.conftest import Terminal

REPLY_S = 0.06
ENOUGH = 10**6  # bytes of flash for every update
RIG = b'{"name": "jib"}'
BACKLASH = "framestep/motors/backlash.mpy"
STEP = "        w[_MOTOR] = step + offset\n"


def changed():
    """Return a backlash.py that makes seven steps more upward."""
    source = board_sources(BOARD)[BACKLASH].decode()
    assert source.count(STEP) == 1
    text = source.replace(STEP, STEP.replace("step", "7 + step"))
    return {BACKLASH: compiled(BACKLASH.replace(".mpy", ".py"), text.encode(), PROCESSOR)}


@pytest.fixture
def packaged(monkeypatch):
    """Replace the installed modules by modules for the simulated chip's processor."""

    def use(changes=None, chip="ESP32", processor=PROCESSOR):
        found = Package(BOARD, modules() | (changes or {}), main_py(), chip, processor)
        monkeypatch.setattr(file_install, "package", lambda board: found)

    use()
    return use


@pytest.fixture
def boards():
    """Return boards(files): a board with these files; {} is an erased flash. All end with the
    test."""
    made = []

    def make(files):
        made.append(Esp32Board(files=files))
        return made[-1]

    yield make
    for each in made:
        each.close()


def command(board, capsys, *words, status=0):
    """Run a command with the board's port as its --port. Return its output."""
    with Terminal(board) as terminal:
        result = cli.app.status([*words, "--port", terminal.path])
    said = "".join(capsys.readouterr())
    assert result == status, said
    return said


def power_cycle(board):
    """Return a session with the board after a power cycle."""
    board.power_off()
    board.power_on()
    return Session(board, reply_s=REPLY_S)


def steps(board):
    """Return the pulses that 500 steps make after power-up, judged behind the shift registers."""
    session = power_cycle(board)
    session.speed(1, 2000, 10_000).accept(MotorMove(1, session.position(1) + 500)).wait_idle()
    return session.made(1)


def test_from_an_erased_flash_to_the_first_move(boards, packaged, capsys):
    board = boards({})
    said = command(board, capsys, "install", "--board", BOARD)
    assert "copying 1/" in said
    assert "firmware 0.1.0: 8 motors, 512 DMX channels" in said
    assert board.files().keys() == {"/boot.py", *installed()}
    assert power_cycle(board).ask(Hi()).name == "framestep"
    assert steps(board) == 500
    again = command(board, capsys, "install", "--board", BOARD)
    assert "copying" not in again
    assert f"all of framestep ({len(modules())} modules) is on the board" in again
    packaged(changed())
    said = command(board, capsys, "flash")
    assert "copying 1/1 /framestep/motors/backlash.mpy" in said
    assert steps(board) == 507


def test_a_rig_file_and_a_move_from_the_shell(boards, capsys, monkeypatch, tmp_path):
    """The commands of the first move, each over the one port."""
    (tmp_path / "rig.json").write_text('{"name": "turntable", "motor_count": 2}')
    monkeypatch.setenv("EDITOR", f"cp {tmp_path}/rig.json")
    board = boards(installed())
    with Terminal(board) as terminal:
        port = terminal.path
        for words in (
            ["rig", "edit", "--port", port],
            ["move", port, "2", "200"],
            ["status", port],
        ):
            assert cli.app.status(words) == 0, capsys.readouterr()
    said = capsys.readouterr().out
    assert "turntable, firmware 0.1.0: 2 motors" in said
    assert "motor 2: 200" in said


def test_another_rate_from_the_shell(boards, capsys, monkeypatch, tmp_path):
    """The rate belongs to the port's name. `rig edit` finds the board at the new one."""
    board = boards(installed())
    with Terminal(board) as terminal:
        port, fast = terminal.path, f"{terminal.path}@460800"
        for name, rig, words in (
            ("faster", '{"uart_baud": 460800}', ["--port", port]),
            ("again", '{"motor_count": 2}', ["--port", fast]),
        ):
            (tmp_path / name).write_text(rig)
            monkeypatch.setenv("EDITOR", f"cp {tmp_path}/{name}")
            assert cli.app.status(["rig", "edit", *words]) == 0, capsys.readouterr()
            assert cli.app.status(["status", port if rig.startswith('{"m') else fast]) == 0
    said = capsys.readouterr().out
    assert f"framestep on {fast}, firmware" in said
    assert f"framestep on {port}, firmware 0.1.0: 2 motors" in said


@pytest.mark.repeats
def test_power_cuts(boards, packaged, capsys):
    """At each moment of an update the board has all old modules, all new ones, or a REPL and a
    sentence, and another attempt completes it."""
    old = {**installed(), "/rig.json": RIG, "/framestep/gone.mpy": b"of an older version"}
    new = installed() | {f"/{name}": content for name, content in changed().items()}
    packaged(changed())
    outcomes = []
    for cut in (1, 4000, 8000, 12_000, 16_000, 20_000, 24_000, ENOUGH):
        board = boards(old)
        board.run_until(board.now_ns + 10**8)
        board.cut_power_after(cut)
        with (
            Terminal(board) as terminal,
            suppress(file_install.DeviceError),
            file_install.Device(terminal.path) as device,
        ):
            file_install.bring(device, file_install.package(BOARD), lambda line: None)
        board.power_off()
        board.power_on()
        outcomes.append(outcome(board, old, new))
        if outcomes.count("incomplete") == 1 and outcomes[-1] == "incomplete":
            command(board, capsys, "install", "--board", BOARD)
            assert steps(board) == 507
    assert "incomplete" in outcomes
    assert outcomes[0] == "old"
    assert outcomes[-1] == "new"
    order = [("old", "incomplete", "new").index(each) for each in outcomes]
    assert order == sorted(order)


def outcome(board, old, new):
    files = board.files()
    assert files["/rig.json"] == RIG
    if LIST in files:
        found = "old" if "/framestep/gone.mpy" in files else "new"
        expected = old if found == "old" else new
        assert {name: files[name] for name in expected} == expected
        assert steps(board) == (500 if found == "old" else 507)
        return found
    board.run_until(board.now_ns + 10**8)
    said = board.transmit().decode()
    assert "framestep: not started, its files are incomplete; framestep install" in said
    assert said.endswith(">>> ")
    return "incomplete"


@pytest.mark.parametrize(
    ("files", "package", "why"),
    [
        ({MAIN: b"print(1)"}, {}, "/main.py of its own"),
        ({}, {"chip": "ESP32-S3"}, "has an ESP32-S3: name the right board"),
        ({}, {"processor": "xtensawin"}, "name the right board"),
    ],
)
def test_what_is_refused_changes_nothing(boards, packaged, capsys, files, package, why):
    packaged(**package)
    board = boards(files or {"/boot.py": b""})
    before = board.files()
    said = command(board, capsys, "install", "--board", BOARD, status=1)
    assert why in said
    assert board.files() == before


def test_options_for_other_boards(capsys):
    assert cli.app.status(["install", "--board", BOARD, "--drive", "/tmp"]) == 1
    assert f"--drive is not for {BOARD}" in capsys.readouterr().err
    assert cli.app.status(["install", "--board", "pico", "--port", "/dev/ttyUSB0"]) == 1
    assert "--port is not for pico" in capsys.readouterr().err
