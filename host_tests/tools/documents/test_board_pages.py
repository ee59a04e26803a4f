"""Every board's data is sound, its page and drawing are made from them, and its example rig file is
valid."""

import copy
import re
from xml.etree import ElementTree

import pytest

from framestep.rig import Rig
from framestep.rig.pins import fitted
from framestep_tools.board.esp32_flash import VERSION
from framestep_tools.board.rig_file import read
from framestep_tools.building.board_files import (
    ROOT,
    board_data,
    board_modules,
    board_names,
    data_module,
    data_on_board,
    files_boards,
    image_boards,
    march,
)
from framestep_tools.documents import board_pages

BOARDS = board_names()


def test_the_boards_that_there_are():
    """boards/README.md links to each of them, and the front page to three and to that page."""
    assert {"fysetc_erb", "pico", "pico2", "skr_pico", "esp32_s3_595"} <= set(BOARDS)
    text = (ROOT / "README.md").read_text()
    assert len(re.findall(r"^\| .*\]\(boards/\w+/README\.md\) \|", text, re.MULTILINE)) == 3
    assert "](boards/README.md)" in text
    readme = (ROOT / "boards/README.md").read_text()
    for name in BOARDS:
        count = board_data(name)["motors"]
        found = re.search(rf"^\| \[.*\]\({name}/README\.md\) \| {count} \|", readme, re.MULTILINE)
        assert found, (
            "add a line to the table of boards/README.md: "
            f"| [...]({name}/README.md) | {count} | ..."
        )
        same = [other for other in BOARDS if board_data(other)["name"] == board_data(name)["name"]]
        assert same == [name], f"give each board a name of its own in board.json: {same}"


@pytest.mark.parametrize("name", BOARDS)
def test_data_is_sound(name):
    assert board_pages.complaints(board_data(name)) == []


def change(name, **entries):
    return copy.deepcopy(board_data(name)) | entries


FOUR_MOTORS = {
    "motors": 4,
    "step": [10, 16, 0, 2],
    "dir": [9, 15, 1, 3],
    "enable": [8, 14, 4, 5],
    "page": {},
}


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (change("pico", estop=2), "1 motors: pin 2 is used 2 times"),
        (change("pico", meter=30), "there is no pin 30"),
        (change("pico", motors=7), "motors: 7, but step, dir and enable list [8]"),
        (change("skr_pico", clock_mhz=133), "clock_mhz: 133, but the chip runs at [125, 150, 200]"),
        (change("pico2", chip="rp2040"), "motors: 12, but the chip has 8 state machines"),
        (change("pico", chip="z80"), "chip: z80 is none of rp2040, rp2350"),
        (change("pico", dmx={"uart": 1, "tx": 0, "rx": 1}), "pins 0, 1 are not TX and RX of UART1"),
        (
            change(
                "pico", with_drivers={"drivers": {"uart": 0, "tx": 28, "rx": 29, "address": [0]}}
            ),
            "the same UART",
        ),
        (
            change(
                "pico", with_drivers={"drivers": {"uart": 1, "tx": 20, "rx": 21, "address": [0]}}
            ),
            "pin 20 is used 2",
        ),
        (
            change("skr_pico", drivers={"uart": 1, "tx": 8, "rx": 9, "address": [0, 0]}),
            "addresses [0, 0]",
        ),
        (
            change("skr_pico", drivers={"uart": 1, "tx": 8, "rx": 9, "address": [4]}),
            "addresses [4]",
        ),
        (
            change("fysetc_erb", drivers={"pins": [11], "address": [0, 0]}),
            "drivers: 1 pins for 2 motors",
        ),
        (
            change("skr_pico", drivers={"pins": [8, 9, 26, 29], "address": [0] * 4}),
            "not enough state machines for 4",
        ),
        (change("pico", rgb=29), "8 motors: not enough state machines for the RGB LED"),
        (
            change("fysetc_erb", **FOUR_MOTORS),
            "not enough state machines for 2 driver UARTs and the RGB LED",
        ),
        (change("skr_pico", leds=[1]), "leds: no such entry"),
    ],
)
def test_a_mistake_is_found(data, complaint):
    assert any(complaint in text for text in board_pages.complaints(data)), board_pages.complaints(
        data
    )


@pytest.mark.parametrize("name", BOARDS)
def test_page_and_drawing_are_up_to_date(name):
    old = [
        str(path.relative_to(ROOT))
        for path, text in board_pages.page(name).items()
        if path.read_text() != text
    ]
    assert not old, f"run python -m framestep_tools.documents.board_pages: {', '.join(old)}"


@pytest.mark.parametrize("name", BOARDS)
def test_drawing_shows_every_pin_inside_its_frame(name):
    board = board_data(name)
    root = ElementTree.fromstring(board_pages.drawing(board))
    width = float(root.attrib["viewBox"].split()[2])
    texts = root.findall("{http://www.w3.org/2000/svg}text")
    shown = {text.text for text in texts}
    off_the_header = {"led"} if "header" in board.get("page", {}) else set()
    for use in board_pages.uses(fitted(board)):
        assert f"{use.what}: {use.wire}" in shown or use.pin in {
            board.get(key) for key in off_the_header
        }
    for text in texts:
        # letters of this size are on average 6.6 units wide
        room = {"start": width - float(text.attrib["x"]), "end": float(text.attrib["x"])}
        assert 6.6 * len(text.text) < room.get(text.attrib["text-anchor"], width), text.text


def test_changed_data_shows(monkeypatch):
    monkeypatch.setattr(board_pages, "board_data", lambda name: change(name, estop=29))
    for path, text in board_pages.page("skr_pico").items():
        assert path.read_text() != text


@pytest.mark.parametrize("name", files_boards())
def test_an_esp32s_page_says_how_to_install_it(name):
    page = (ROOT / "boards" / name / "README.md").read_text()
    assert f"framestep install --board {name} --micropython FILE.bin" in page
    assert f'pip install "{VERSION}"' in page
    assert "not yet tried on hardware" in page.lower()
    assert f"runs at {board_data(name)['clock_mhz']} MHz" in page
    assert page.splitlines()[0] == f"# {board_data(name)['name']}"


@pytest.mark.parametrize("name", image_boards())
def test_folder_is_complete(name):
    folder = ROOT / "boards" / name
    page = (folder / "README.md").read_text()
    assert "not yet tried on hardware" in page.lower()
    assert f"runs at {board_data(name)['clock_mhz']} MHz" in page
    heading = f"# {board_data(name)['name']}"
    assert page.splitlines()[0].startswith(heading), (
        f"boards/{name}/README.md is to begin with the name in board.json: {heading}"
    )


@pytest.mark.parametrize("name", BOARDS)
def test_example_rig_file_is_valid(name):
    settings = read(ROOT / "boards" / name / "rig.json")
    rig = Rig(settings, board_data(name))
    assert rig.name.decode() == settings["name"]
    assert rig.estop == "nc"


def test_firmware_compiles_for_the_rp2350():
    """No more can be tested, since it is not emulated. For the RP2040 every test on the board
    compiles the firmware."""
    modules = board_modules(march("rp2350"), "pico2")
    assert modules["framestep/hal/rp2/pulses.mpy"][0] == ord("M")


@pytest.mark.parametrize("name", BOARDS)
def test_what_is_for_the_page_stays_off_the_board(name):
    found = {}
    exec(data_module(data_on_board(board_data(name))), found)
    data = board_data(name)
    for key in ("page", "flash_mhz"):
        data.pop(key, None)
    assert data | found["BOARD"] == data
    assert {key: data[key] for key in data.keys() - found["BOARD"].keys()}.items() <= {
        "ports": 2
    }.items()


def test_motors_free_pins():
    """A Pico 2 with fewer motors has what a Pico has."""
    pico2, pico = board_data("pico2"), board_data("pico")
    assert not {"dmx", "shutter", "meter", "gio"} & set(fitted(pico2))
    ten = fitted(pico2, 10)
    assert (ten["shutter"], ten["meter"], ten["dmx"]["tx"]) == (20, 21, 0)
    assert "gio" not in ten
    for drivers in (False, True):
        eight, wanted = fitted(pico2, 8, drivers), fitted(pico, 8, drivers)
        same = wanted.keys() - {"name", "chip", "clock_mhz", "clocks", "flash_mhz", "page"}
        assert {key: eight[key] for key in same} == {key: wanted[key] for key in same}
    # the UART's pins step motor 11
    assert "drivers" not in fitted(pico2, 11, True)
    assert "drivers" in fitted(pico2, 10, True)
