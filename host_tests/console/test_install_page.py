"""The page that installs framestep: images onto drives that the browser itself keeps (OPFS), so
they have the interface of real ones."""

import re

import pytest
from playwright.sync_api import expect

from framestep_tools.building.board_files import board_names, image_boards
from framestep_tools.site import install_page
from host_tests.console.file_server import FileServer
from host_tests.console.pictures import LOOKS
from host_tests.console.test_accessible import AXE, FINDINGS

IMAGE = bytes(range(256)) * 800  # several pieces
NAME = install_page.image_name("pico", install_page.version())
# Takes the place of the browser's window to choose a folder
DRIVE = """async ([name, about]) => {
    const root = await navigator.storage.getDirectory();
    const drive = await root.getDirectoryHandle(name, {create: true});
    if (about !== null) {
        const file = await drive.getFileHandle('INFO_UF2.TXT', {create: true});
        const stream = await file.createWritable();
        await stream.write(about);
        await stream.close();
    }
    window.drive = drive;
    window.showDirectoryPicker = async () => drive;
}"""
ABOUT = "UF2 Bootloader v3.0\r\nModel: Raspberry Pi RP2\r\nBoard-ID: {}\r\n"
FILES = """async () => {
    const found = {};
    for await (const [name, file] of drive.entries()) {
        found[name] = [...new Uint8Array(await (await file.getFile()).arrayBuffer())];
    }
    return found;
}"""
# As a board does it: it has all blocks before the file is closed, restarts, and its drive is gone
RESTARTS = """() => {
    const {close} = FileSystemWritableFileStream.prototype;
    FileSystemWritableFileStream.prototype.close = async function () {
        FileSystemWritableFileStream.prototype.close = close;
        await close.call(this);
        await drive.removeEntry('INFO_UF2.TXT');
        throw new DOMException('the drive has gone', 'NotFoundError');
    };
}"""
FAILS = """() => {
    FileSystemWritableFileStream.prototype.write = async () => {
        throw new DOMException('the disk is full', 'QuotaExceededError');
    };
}"""


@pytest.fixture(scope="module")
def url(tmp_path_factory, shared_stage):
    folder = tmp_path_factory.mktemp("install")
    image = folder / "image"
    image.write_bytes(IMAGE)
    install_page.make(folder / "page", {"pico": image})
    server = FileServer(folder / "page")
    shared_stage.closing(server.close)
    return server.url


def image_card(page):
    return page.get_by_role("article", name="Its image")


def save(page, name, about, trouble="() => {}"):
    """Save the image onto a drive, which does `trouble`. Return the page's last sentence."""
    page.evaluate(DRIVE, [name, about])
    page.evaluate(trouble)
    image_card(page).get_by_role("button", name="Save it onto the drive…").click()
    said = image_card(page).get_by_role("status")
    expect(said).to_have_text(re.compile(r"\.$"))
    return said.text_content()


def test_an_image_goes_onto_its_drive(stage, url):
    page = stage.page(url)
    said = save(page, "RPI-RP2", ABOUT.format("RPI-RP2"))
    assert said == "The image is on the board, which starts with it."
    assert bytes(page.evaluate(FILES)[NAME]) == IMAGE
    assert save(page, "second", ABOUT.format("RPI-RP2"), RESTARTS) == said
    assert bytes(page.evaluate(FILES)[NAME]) == IMAGE
    assert page.request.get(f"{url}{NAME}").body() == IMAGE
    assert all(asked.startswith(url) for asked in page.asked), page.asked
    assert page.errors == []


def test_a_drive_that_is_not_the_boards_is_refused(stage, url):
    page = stage.page(url)
    for name, about, reason in (
        ("RP2350", ABOUT.format("RP2350"), "has an RP2350, Raspberry Pi Pico an RP2040"),
        ("pictures", None, "pictures is not a board's drive, as it has no INFO_UF2.TXT"),
        ("FEATHER", ABOUT.format("SAMD21"), "a board that framestep does not know (SAMD21)"),
    ):
        assert reason in save(page, name, about)
        assert NAME not in page.evaluate(FILES)
    page.route(f"**/{NAME}", lambda route: route.fulfill(body=IMAGE[:-1]))
    assert "is damaged" in save(page, "RPI-RP2", ABOUT.format("RPI-RP2"))
    assert NAME not in page.evaluate(FILES)
    page.unroute_all()
    said = save(page, "RPI-RP2", ABOUT.format("RPI-RP2"), FAILS)
    assert "cannot be written onto RPI-RP2 (the disk is full)" in said
    assert page.errors == []


@pytest.mark.parametrize("look", ["wide", "dark", "phone"])
def test_every_board_without_access_to_drives(stage, url, look):
    """A browser of a phone, or Firefox: a download and pictures."""
    page = stage.page("about:blank", **LOOKS[look])
    page.add_init_script("delete window.showDirectoryPicker")
    page.goto(url)
    page.evaluate(AXE.read_text())
    link = image_card(page).get_by_role("link")
    assert link.get_attribute("href") == link.get_attribute("download") == NAME
    expect(image_card(page).get_by_role("img")).to_have_count(2)
    fits = 0
    for name in board_names():
        choice = page.locator(f'input[value="{name}"]')
        if choice.is_disabled():
            continue
        choice.check()
        fits += 1
        if name in image_boards():
            if name != "pico":
                expect(image_card(page)).to_contain_text("without the image for this board")
        else:
            expect(image_card(page)).to_contain_text(f"framestep install --board {name}")
        assert page.evaluate(FINDINGS) == []
    assert fits == len(image_boards()) + 2
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.errors == []
