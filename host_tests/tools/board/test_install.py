"""`framestep install`: drives on three systems, and a folder in place of a drive, with a simulated
board behind it."""

import threading
import time

import pytest

from framestep_tools import cli
from framestep_tools.board import bootsel_drive, install
from framestep_tools.board.bootsel_drive import Drive, DriveError
from framestep_tools.building.board_files import board_data, board_names
from framestep_tools.simulator.boards import SimulatedBoard
from framestep_tools.simulator.serve import Server
from host_tests.tools.board.test_uf2 import uf2_file

ABOUT = "UF2 Bootloader v3.0\nModel: Raspberry Pi RP2\nBoard-ID: {}\n"


def drive_in(folder, board="RPI-RP2"):
    folder.mkdir(exist_ok=True)
    (folder / "INFO_UF2.TXT").write_text(ABOUT.format(board))
    return folder


# ---- drives


@pytest.mark.parametrize(("board", "chip"), [("RPI-RP2", "rp2040"), ("RP2350", "rp2350")])
def test_a_drive_names_its_chip(tmp_path, board, chip):
    assert bootsel_drive.look(drive_in(tmp_path, board)) == Drive(tmp_path, chip)


def test_what_is_no_drive_of_these_boards(tmp_path):
    assert bootsel_drive.look(tmp_path) is None
    assert bootsel_drive.look(drive_in(tmp_path, "SAMD21")) is None


def test_places_on_each_system(tmp_path):
    mounts = tmp_path / "mounts"
    mounts.write_text(
        "/dev/sda1 / ext4 rw 0 0\n"
        "/dev/sdb1 /media/me/RPI-RP2 vfat rw 0 0\n"
        "/dev/sdc1 /mnt/with\\040blank vfat rw 0 0\n"
    )
    linux = [place.as_posix() for place in bootsel_drive.places("linux", mounts)]
    assert linux == ["/media/me/RPI-RP2", "/mnt/with blank"]
    assert str(next(bootsel_drive.places("win32"))) == "D:\\"
    assert list(bootsel_drive.places("linux", tmp_path / "none")) == []


def test_waiting_says_once_what_to_press(tmp_path):
    said = []
    looks = iter([[], [], [Drive(tmp_path, "rp2040")]])
    assert bootsel_drive.wait(said.append, 60, lambda: next(looks)) == Drive(tmp_path, "rp2040")
    assert said == [bootsel_drive.PRESS]


def test_none_and_several(tmp_path):
    with pytest.raises(DriveError, match="no board's drive has appeared in 0 s"):
        bootsel_drive.wait(lambda line: None, 0, list)
    both = [Drive(tmp_path / "a", "rp2040"), Drive(tmp_path / "b", "rp2040")]
    with pytest.raises(DriveError, match="2 boards show a drive"):
        bootsel_drive.wait(lambda line: None, 60, lambda: both)


@pytest.fixture
def drive(tmp_path):
    return Drive(drive_in(tmp_path / "drive"), "rp2040")


def test_a_drive_that_goes_with_the_last_block_has_taken_everything(drive, monkeypatch):

    def gone(descriptor):
        (drive.path / "INFO_UF2.TXT").unlink()
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(bootsel_drive.os, "fsync", gone)
    bootsel_drive.drop(drive, "x.uf2", bytes(1000))


def test_a_drive_that_takes_nothing_says_so(drive, monkeypatch):
    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(bootsel_drive.os, "fsync", full)
    with pytest.raises(DriveError, match="No space left"):
        bootsel_drive.drop(drive, "x.uf2", bytes(1000))


# ---- the whole command


@pytest.fixture
def board_behind(tmp_path):
    """Return the port of a board behind a folder that takes the place of a drive: after a UF2 file
    has come, the drive disappears and the board starts."""
    folder = drive_in(tmp_path / "RPI-RP2")
    server = Server(SimulatedBoard(), None, "127.0.0.1:0")
    address = next(line.split()[1] for line in server.announcements if line.startswith("tcp "))
    stop = threading.Event()
    got = []

    def restart():
        while not stop.is_set():
            files = list(folder.glob("*.uf2"))
            if files and not got:
                got.append(files[0])
            if got:
                server.step()
            else:
                time.sleep(0.01)

    thread = threading.Thread(target=restart)
    thread.start()
    yield folder, f"socket://{address}", got
    stop.set()
    thread.join()
    server.close()


def test_it_copies_the_image_and_asks_the_board_who_it_is(board_behind, tmp_path, capsys):
    folder, port, got = board_behind
    image = tmp_path / "mine.uf2"
    image.write_bytes(uf2_file())
    words = ["install", "--drive", str(folder), "--image", str(image), "--device", port]
    assert cli.app.status(words) == 0
    said = capsys.readouterr().out
    copying = f"copying 6 kB for the Raspberry Pi Pico onto {folder}\n"
    assert f"{copying}  100 %\nthe board starts\n" in said
    assert f"framestep on {port}, firmware 0.1.0: 8 motors" in said
    assert got[0].name == "framestep-pico.uf2"
    assert got[0].read_bytes() == image.read_bytes()


RP2040_BOARDS = [name for name in board_names() if board_data(name)["chip"] == "rp2040"]


@pytest.mark.parametrize(
    ("args", "complaint"),
    [
        (["--board", "pico2"],
         f"has an RP2040, pico2 an RP2350: --board {' or '.join(RP2040_BOARDS)}"),
        (["--board", "nano"], "no board 'nano'"),
        (["--image", "/not/there.uf2"], "cannot read /not/there.uf2: No such file"),
    ],
)  # fmt: skip
def test_what_does_not_fit_changes_nothing(drive, args, complaint, capsys):
    assert cli.app.status(["install", "--drive", str(drive.path), *args]) != 0
    (line,) = capsys.readouterr().err.splitlines()
    assert complaint in line
    assert [path.name for path in drive.path.iterdir()] == ["INFO_UF2.TXT"]


def test_an_image_for_the_other_chip_is_not_copied(tmp_path):
    drive = Drive(drive_in(tmp_path / "drive", "RP2350"), "rp2350")
    with pytest.raises(DriveError, match="is for an RP2040, the board has an RP2350"):
        install.onto_drive("pico2", uf2_file(), drive, "socket://127.0.0.1:1", print)
    assert not list(drive.path.glob("*.uf2"))


def test_a_folder_that_is_no_drive(tmp_path, capsys):
    assert cli.app.status(["install", "--drive", str(tmp_path)]) == 3
    assert "is not a board's drive: hold the board's BOOTSEL button" in capsys.readouterr().err
