"""Every board's data is sound, its page and drawing are made from them, and its example rig file is
valid."""

import copy
import json
import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

from framestep.rig import Rig
from framestep.rig.pins import fitted
from framestep_tools import paths
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
from framestep_tools.prove import measurement, report

BOARDS = board_names()


def test_the_boards_that_there_are():
    """The front page has three of them, and links to the list."""
    assert {"pico", "skr_pico", "esp32_s3_595"} <= set(BOARDS)
    text = (ROOT / "README.md").read_text()
    assert len(re.findall(r"^\| .*\]\(boards/\w+/README\.md\) \|", text, re.MULTILINE)) == 3
    assert "](boards/README.md)" in text
    for name in BOARDS:
        same = [other for other in BOARDS if board_data(other)["name"] == board_data(name)["name"]]
        assert same == [name], f"give each board a name of its own in board.json: {same}"


@pytest.mark.parametrize("name", BOARDS)
def test_data_is_sound(name):
    assert board_pages.complaints(board_data(name)) == []


def change(name, **entries):
    return copy.deepcopy(board_data(name)) | entries


FOUR_MOTORS = {
    "motors": 4, "step": [10, 16, 0, 2], "dir": [9, 15, 1, 3], "enable": [8, 14, 4, 5], "page": {},
}  # fmt: skip


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
        (change("pico", with_drivers={"drivers": {"uart": 0, "tx": 28, "rx": 29, "address": [0]}}),
         "the same UART"),
        (change("pico", with_drivers={"drivers": {"uart": 1, "tx": 20, "rx": 21, "address": [0]}}),
         "pin 20 is used 2"),
        (change("skr_pico", drivers={"uart": 1, "tx": 8, "rx": 9, "address": [0, 0]}),
         "addresses [0, 0]"),
        (change("skr_pico", drivers={"uart": 1, "tx": 8, "rx": 9, "address": [4]}),
         "addresses [4]"),
        (change("fysetc_erb", drivers={"pins": [11], "address": [0, 0]}),
         "drivers: 1 pins for 2 motors"),
        (change("skr_pico", drivers={"pins": [8, 9, 26, 29], "address": [0] * 4}),
         "not enough state machines for 4"),
        (change("pico", rgb=29), "8 motors: not enough state machines for the RGB LED"),
        (change("fysetc_erb", **FOUR_MOTORS),
         "not enough state machines for 2 driver UARTs and the RGB LED"),
        (change("skr_pico", leds=[1]), "leds: no such entry"),
        (change("pico", flash_mhz=150), "flash_mhz: 150 is no whole number from 20 to 133"),
        (change("pico", flash_mhz="133"), "flash_mhz: '133' is no whole number from 20 to 133"),
        (change("skr_pico", page={}), "page.drivers is missing: the column in the table of"),
        (change("skr_pico", page={"price": "$1"}),
         "page.price: no such entry, only costs, drivers, header, labels, printed,"),
    ],
)  # fmt: skip
def test_a_mistake_is_found(data, complaint):
    found = board_pages.complaints(data)
    assert any(complaint in text for text in found), found


def test_all_that_is_made_from_the_boards_is_up_to_date():
    old = board_pages.outdated()
    assert not old, f"run {board_pages.COMMAND}: {', '.join(old)} no longer fit boards/"


@pytest.mark.parametrize("name", BOARDS)
def test_drawing_shows_every_pin_inside_its_frame(name):
    board = board_data(name)
    root = ElementTree.fromstring(board_pages.drawing(board))
    width = float(root.attrib["viewBox"].split()[2])
    texts = root.findall("{http://www.w3.org/2000/svg}text")
    shown = {text.text for text in texts}
    off_the_header = {"led"} if "header" in board.get("page", {}) else set()
    for use in board_pages.uses(fitted(board)):
        off = use.pin in {board.get(key) for key in off_the_header}
        assert off or f"{use.what}: {use.wire}" in shown
    for text in texts:
        # letters of this size are on average 6.6 units wide
        room = {"start": width - float(text.attrib["x"]), "end": float(text.attrib["x"])}
        assert 6.6 * len(text.text) < room.get(text.attrib["text-anchor"], width), text.text


def test_changed_data_shows(monkeypatch):
    monkeypatch.setattr(board_pages, "board_data", lambda name: change(name, estop=29))
    for path, text in board_pages.page("skr_pico").items():
        assert path.read_text() != text


@pytest.mark.parametrize("name", BOARDS)
def test_page_is_complete(name):
    page = (ROOT / "boards" / name / "README.md").read_text()
    assert "not yet tried on hardware" in page.lower()
    assert f"runs at {board_data(name)['clock_mhz']} MHz" in page
    heading = f"# {board_data(name)['name']}"
    assert page.splitlines()[0] == heading, (
        f"boards/{name}/README.md is to begin with the name in board.json: {heading}"
    )
    if name in files_boards():
        assert f"framestep install --board {name} --micropython FILE.bin" in page
        assert f'pip install "{VERSION}"' in page


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


MADE_UP = board_data("skr_pico") | {"name": "Made-up Board"}
README = f"""# Made-up Board

Written by hand.

<!-- pins: made by {board_pages.COMMAND} -->
<!-- end of pins -->

Also by hand.
"""


@pytest.fixture
def copy_with_a_board(tmp_path, monkeypatch):
    """Return a copy of what is made from the boards, with a folder of a board that is new."""
    for path in board_pages.files():
        copied = tmp_path / path.relative_to(ROOT)
        copied.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, copied)
    for path in (ROOT / "boards").rglob("*.json"):
        shutil.copy(path, tmp_path / path.relative_to(ROOT))
    folder = tmp_path / "boards/made_up"
    folder.mkdir()
    added = {key: MADE_UP[key] for key in MADE_UP if key not in ("hal", "ports", "pins", "clocks")}
    (folder / "board.json").write_text(json.dumps(added))
    (folder / "rig.json").write_text('{"name": "made up"}')
    (folder / "README.md").write_text(README)
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    monkeypatch.setattr(paths, "BOARDS", tmp_path / "boards")
    monkeypatch.setattr(report, "EMULATED", Path(shutil.copy(report.EMULATED, tmp_path)))
    # measuring takes minutes
    figures = {"late_us": 7}
    monkeypatch.setattr(measurement, "renew", lambda name, say: report.renew(name, 4, figures))
    return tmp_path


def nav_pages(nav):
    """Return {title: page} of a site's navigation, without pages that have no title there."""
    found = {}
    for entry in nav:
        for title, inside in entry.items() if isinstance(entry, dict) else ():
            found |= nav_pages(inside) if isinstance(inside, list) else {title: inside}
    return found


def test_a_board_takes_three_files(copy_with_a_board):
    """The command adds it wherever boards are listed, changes nothing else, and measures it."""
    places = {
        "boards/made_up/README.md", "boards/made_up/wiring.svg", "boards/README.md",
        "tools/framestep_tools/site/mkdocs.yml", ".github/ISSUE_TEMPLATE/fault.yml",
    }  # fmt: skip
    assert set(board_pages.outdated()) == {*places, "made_up in emulated.json"}
    assert board_pages.app.status([]) == 0
    assert board_pages.outdated() == []
    texts = {place: (copy_with_a_board / place).read_text() for place in places}
    page = texts["boards/made_up/README.md"]
    assert "| GPIO 11 | motor 1 step | socket X, address 0 |\n" in page
    assert page.replace(board_pages.table(MADE_UP), "") == README
    assert "Made-up Board" in texts["boards/made_up/wiring.svg"]
    rows = [line for line in texts["boards/README.md"].splitlines() if line[:3] == "| ["]
    row = "| [Made-up Board](made_up/README.md) | 4 | $25 | TMC2209 on the board | image |"
    assert rows[2] == row, "by name, those with an image first"
    site = re.sub(r"!\S+", "", texts["tools/framestep_tools/site/mkdocs.yml"])
    assert nav_pages(yaml.safe_load(site)["nav"])["Made-up Board"] == "boards/made_up/README.md"
    form = yaml.safe_load(texts[".github/ISSUE_TEMPLATE/fault.yml"])
    fields = {part.get("id"): part["attributes"] for part in form["body"]}
    assert "Made-up Board" in fields["board"]["options"]
    for place in ("boards/README.md", ".github/ISSUE_TEMPLATE/fault.yml"):
        lines = texts[place].splitlines()
        kept = [line for line in lines if "made_up" not in line and "Made-up" not in line]
        assert kept == (ROOT / place).read_text().splitlines()
    assert report.emulated_boards()["made_up"] == (4, 125, {"late_us": 7})


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("README.md", None, "boards/made_up needs README.md"),
        ("rig.json", None, "boards/made_up needs rig.json"),
        ("README.md", "# Made-up Board\n", "boards/made_up/README.md needs one comment with"),
        ("board.json", '"drivers": "TMC2209', "boards/made_up/board.json: page.drivers is missing"),
    ],
)
def test_a_mistake_in_the_three_files_changes_nothing(copy_with_a_board, capsys, file, text, said):
    path = copy_with_a_board / "boards/made_up" / file
    if text is None:
        path.unlink()
    elif file == "board.json":
        path.write_text(path.read_text().replace(text, text.replace("drivers", "printed")))
    else:
        path.write_text(text)

    def texts():
        return {path: path.read_text() for path in copy_with_a_board.rglob("*") if path.is_file()}

    before = texts()
    assert board_pages.app.status([]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line
    assert texts() == before


@pytest.mark.parametrize(
    "board", [name for name in image_boards() if board_data(name)["chip"] == "rp2350"]
)
def test_no_input_of_an_rp2350_needs_its_pull_down(board):
    """The first chips have one that is too weak (erratum RP2350-E9), and the page says so."""
    data = board_data(board)
    example = json.loads((ROOT / "boards" / board / "rig.json").read_text())
    rigs = [Rig(example, data)]
    rigs += [Rig({"motor_count": count}, data) for count in range(1, data["motors"] + 1)]
    pulls = {item["pull"] for rig in rigs for item in rig.inputs}
    assert pulls == {"up"}
    page = (ROOT / "boards" / board / "README.md").read_text()
    assert "erratum RP2350-E9" in page
    assert "4.7 kΩ to GND" in page
