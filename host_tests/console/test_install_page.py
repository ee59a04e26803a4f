"""The page that installs framestep: images onto drives that the browser itself keeps (OPFS), so
they have the interface of real ones; then the emulated board over ports of Web Serial."""

import json
import re

import pytest
from playwright.sync_api import expect

from framestep_tools.board.file_install import Package, main_py
from framestep_tools.building.board_files import board_names, image_boards
from framestep_tools.simulator.boards import EmulatedBoard
from framestep_tools.simulator.esp32_board import BOARD as ESP32
from framestep_tools.simulator.esp32_board import PROCESSOR, Esp32Board, installed, modules
from framestep_tools.site import install_page
from host_tests.console.conftest import Device
from host_tests.console.looking import AXE, FINDINGS, LOOK_MS, card, go_to, wait_rest
from host_tests.console.pictures import LOOKS
from host_tests.selection import sweep

PACKAGES = ["atob-lite", "esptool-js", "pako"]  # what the page is made of
IMAGE = bytes(range(256)) * 800  # several pieces
WITH_IMAGE = ("pico", "pico2")
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
    install_page.make(folder / "page", dict.fromkeys(WITH_IMAGE, image), {})
    return shared_stage.files(folder / "page")


def image_card(page):
    return page.get_by_role("article", name="Its image")


def choose(page, name="pico"):
    page.locator(f'input[value="{name}"]').check()


def save(page, name, about, trouble="() => {}"):
    """Save the image onto a drive, which does `trouble`. Return the page's last sentence."""
    page.evaluate(DRIVE, [name, about])
    page.evaluate(trouble)
    image_card(page).get_by_role("button", name="Save it onto the drive…").click()
    said = image_card(page).get_by_role("status")
    expect(said).to_have_text(re.compile(r"\.$"))
    return said.text_content()


def test_no_board_is_chosen_beforehand(stage, url):
    """Three boards have the drive RPI-RP2, so the page asks what is printed on the board."""
    page = stage.page(url)
    expect(page.get_by_role("radio")).to_have_count(len(board_names()))
    expect(page.locator("input[name=board]:checked")).to_have_count(0)
    expect(image_card(page)).to_be_hidden()
    go_to(page, "3. Rig file")
    press(page, "Take the board's example")
    said = card(page, "Onto the board").get_by_role("status")
    expect(said).to_contain_text("choose yours in the first step")
    go_to(page, "1. Board")
    label = page.locator("label", has=page.locator('input[value="skr_pico"]'))
    expect(label).to_contain_text("Printed on it: BIGTREETECH SKR PICO.")
    choose(page)
    expect(image_card(page)).to_contain_text("framestep onto the Raspberry Pi Pico")
    page.set_viewport_size({"width": 720, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.errors == []


def test_an_image_goes_onto_its_drive(stage, url):
    page = stage.page(url)
    choose(page)
    said = save(page, "RPI-RP2", ABOUT.format("RPI-RP2"))
    assert said == "The image is on the board, which starts with it."
    assert bytes(page.evaluate(FILES)[NAME]) == IMAGE
    assert save(page, "second", ABOUT.format("RPI-RP2"), RESTARTS) == said
    assert bytes(page.evaluate(FILES)[NAME]) == IMAGE
    assert page.request.get(f"{url}{NAME}").body() == IMAGE
    assert all(asked.startswith(url) for asked in page.asked), page.asked
    assert page.errors == []


def test_a_pico_2_has_a_drive_of_another_name(stage, url):
    page = stage.page(url)
    choose(page, "pico2")
    expect(image_card(page)).to_contain_text("Here it is RP2350.")
    said = save(page, "RP2350", ABOUT.format("RP2350"))
    assert said == "The image is on the board, which starts with it."
    name = install_page.image_name("pico2", install_page.version())
    assert bytes(page.evaluate(FILES)[name]) == IMAGE
    assert page.errors == []


def test_a_drive_that_is_not_the_boards_is_refused(stage, url):
    page = stage.page(url)
    choose(page)
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


@pytest.mark.parametrize("look", sweep(["wide", "dark", "phone"], "phone"))
def test_every_board_without_access_to_drives(stage, url, look):
    """A browser of a phone, or Firefox: a download and pictures."""
    page = stage.page("about:blank", **LOOKS[look])
    page.add_init_script("delete window.showDirectoryPicker")
    page.goto(url)
    page.evaluate(AXE.read_text())
    assert page.evaluate(FINDINGS) == []
    choose(page)
    link = image_card(page).get_by_role("link")
    assert link.get_attribute("href") == link.get_attribute("download") == NAME
    expect(image_card(page).get_by_role("img")).to_have_count(2)
    for name in board_names():
        choose(page, name)
        if name in image_boards():
            if name not in WITH_IMAGE:
                expect(image_card(page)).to_contain_text("without the image for this board")
        else:
            expect(image_card(page)).to_contain_text(f"framestep install --board {name}")
        assert page.evaluate(FINDINGS) == []
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.errors == []


@pytest.fixture
def board(stage):
    rig = {"name": "before", "estop": "nc"}
    found = Device(EmulatedBoard(rig, trace=False), 1.0, repl=True)
    stage.closing(found.close)
    found.at_board(lambda board: board.wire_switches())
    return found


@pytest.fixture(scope="module")
def esp_site(tmp_path_factory, shared_stage):
    """The page with files for the simulated ESP32's processor."""
    packages = {
        ESP32: Package(ESP32, modules(), main_py(), "ESP32", PROCESSOR),
        "esp32_s3_595": Package("esp32_s3_595", {}, main_py(), "ESP32-S3", PROCESSOR),
    }
    folder = tmp_path_factory.mktemp("esp")
    return shared_stage.saved(folder, lambda folder: install_page.make(folder, {}, packages))


@pytest.fixture(scope="module")
def esp_url(esp_site):
    return esp_site.url


def press(page, name):
    page.get_by_role("button", name=name, exact=True).click()


def unfold(page):
    page.evaluate("document.querySelectorAll('details').forEach(fold => { fold.open = true; })")


def sound(page):
    """Nothing that axe-core finds, and no sideways scrolling, wide and on a phone."""
    assert page.evaluate(FINDINGS) == []
    before = page.viewport_size
    for viewport in (before, LOOKS["phone"]["viewport"]):
        page.set_viewport_size(viewport)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    page.set_viewport_size(before)


def set_up(page):
    """Change the rig file in its form: a wrong value, then right ones, and their differences."""
    go_to(page, "3. Rig file")
    said = card(page, "Onto the board").get_by_role("status")
    name = page.get_by_label("name", exact=True)
    expect(name).to_have_value("before")
    expect(page.get_by_label("estop", exact=True)).to_have_value('"nc"')
    unfold(page)
    name.fill("after")
    count = page.get_by_label("motor_count", exact=True)
    count.fill("99")
    wrong = "motor_count: found 99, allowed is 0 to 24"
    expect(page.locator(".setting", has=count).get_by_role("status")).to_have_text(wrong)
    press(page, "Check, and show the differences")
    expect(said).to_have_text(f"rig.json: {wrong}")
    count.fill("9")
    press(page, "Check, and show the differences")
    expect(said).to_have_text("rig.json: motor_count: found 9, this board has 8 motors")
    count.fill("2")
    sound(page)
    page.get_by_label("motors[2].backlash").fill("24")
    press(page, "Add to outputs")
    page.get_by_label("outputs[1].pin").fill("22")
    expect_differences(
        page,
        [
            'name: "before" → "after"',
            "motor_count: not set → 2",
            "motors[2].backlash: not set → 24",
            "outputs[1].pin: not set → 22",
        ],
    )
    page.get_by_label("motors[2].type").select_option('"tb6600"')
    page.get_by_label("motors[2].pulse_us").fill("2.5")
    press(page, "Check, and show the differences")
    expect(page.get_by_role("list", name="Differences").get_by_role("listitem").last).to_have_text(
        "Warning: motors[2].pulse_us: 2.5 µs is less than the 30 µs that a driver of type tb6600 "
        "needs"
    )
    page.get_by_label("motors[2].type").select_option("")
    page.get_by_label("motors[2].pulse_us").fill("")
    press(page, "Check, and show the differences")
    press(page, "Put it onto the board")
    expect(said).to_have_text("after has restarted with it.")
    expect(page.locator("#who")).to_contain_text("after, firmware")
    press(page, "Check, and show the differences")
    expect(said).to_have_text("The board has exactly these settings.")


def expect_differences(page, lines):
    press(page, "Check, and show the differences")
    shown = page.get_by_role("list", name="Differences").get_by_role("listitem")
    expect(shown).to_have_text(lines)


def try_switches(page, board):
    go_to(page, "4. Motors")
    estop = card(page, "Switches").get_by_role("row", name="E-stop")
    expect(estop).to_contain_text("released")
    for level, state in ((1, "held"), (0, "released")):
        board.at_board(lambda board, level=level: board.emulator.set_pin(19, level))
        expect(estop).to_contain_text(state)
    expect(estop).to_contain_text("seen both ways")


def try_motor(page):
    """A hold moves a motor a little, and ends when it is let go; a wrong direction is swapped."""
    tried = card(page, "One motor at a time")
    up = tried.get_by_role("button", name="Jog up")
    expect(up).to_be_disabled()
    tried.get_by_label("The load is off").check()
    up.focus()
    page.keyboard.down("Enter")
    expect(tried.locator("output")).to_have_text(re.compile(r"^[1-9]"))
    page.evaluate("window.dispatchEvent(new Event('blur'))")  # the hold ends though the key is down
    wait_rest(page)
    page.keyboard.up("Enter")
    assert int(tried.locator("output").text_content()) <= 800
    press(page, "No, swap its direction")
    expect(page.get_by_label("motors[1].invert")).to_have_value("true")
    expect_differences(page, ["motors[1].invert: not set → true"])


def test_from_the_ports_to_the_first_move(stage, board, tmp_path):
    saved = stage.saved(tmp_path, lambda folder: install_page.make(folder, {}, {}))
    page = stage.page(saved.url)
    saved.give_ports(page, board.tcp, board.repl_tcp)
    page.evaluate(AXE.read_text())
    go_to(page, "2. Connect")
    press(page, "Choose Dragonframe's port…")
    connect = card(page, "Connect")
    expect(connect).to_contain_text("before answers: firmware")
    expect(connect).to_contain_text("as on this page, 8 motors")
    asked = []  # by the step that is shown, then to show the board's file
    page.route("**/rig.schema.json", lambda route: asked.append(route))
    press(page, "Choose the REPL's port…")
    go_to(page, "3. Rig file")
    while len(asked) < 2:
        page.wait_for_timeout(LOOK_MS)
    for route in reversed(asked):
        with page.expect_response("**/rig.schema.json"):
            route.continue_()
    page.unroute("**/rig.schema.json")
    go_to(page, "2. Connect")
    expect(connect).to_contain_text("The REPL's port is chosen.")
    sound(page)
    set_up(page)
    try_switches(page, board)
    try_motor(page)
    go_to(page, "4. Motors")
    sound(page)
    go_to(page, "5. First move")
    first = card(page, "First move")
    first.get_by_label("Motor", exact=True).select_option("Motor 2")
    page.get_by_label("Distance, steps").fill("400")
    press(page, "Move there and back")
    expect(first.get_by_role("status")).to_have_text(
        "Motor 2 went 400 steps and is back at 0. That was the first move."
    )
    sound(page)
    assert page.errors == []


# A port of Web Serial with the loader of an ESP32-S3's ROM behind it, then the one that
# esptool-js loads: it keeps what is written to its flash
ROM = """() => {
    const END = 0xc0, ESC = 0xdb;
    const [ERASE, MEM_END, SYNC, READ, DEFLATE_BEGIN, DEFLATE, SECURITY] = [0xd0, 6, 8, 10, 16, 17, 20];
    const chip = {erased: 0, flash: null, address: null, packed: []};
    let to = null, packet = null, escaped = false;
    const slip = (bytes) => [END, ...bytes.flatMap((b) => b === END ? [ESC, 0xdc] : b === ESC ? [ESC, 0xdd] : [b]), END];
    const reply = (op, data = [], value = 0x12345678) => to.enqueue(new Uint8Array(slip([
        1, op, (data.length + 2) & 255, 0, value & 255, value >>> 8 & 255, value >>> 16 & 255, value >>> 24, ...data, 0, 0])));
    const take = async (p) => {
        const op = p[1], word = (at) => (p[at] | p[at + 1] << 8 | p[at + 2] << 16 | p[at + 3] << 24) >>> 0;
        if (op === SYNC) for (let i = 0; i < 8; i += 1) reply(op);
        else if (op === READ) reply(op, [], 0);
        else if (op === SECURITY) reply(op, [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, window.chipId, 0, 0, 0, 0, 0, 0, 0]);
        else {
            if (op === ERASE) chip.erased += 1;
            if (op === DEFLATE_BEGIN) chip.address = word(20);
            if (op === DEFLATE) chip.packed.push(...p.slice(24));
            reply(op);
            if (op === MEM_END) to.enqueue(new Uint8Array(slip([...'OHAI'].map((c) => c.charCodeAt(0)))));
        }
    };
    const port = {
        readable: null,
        writable: null,
        getInfo: () => ({usbVendorId: 0x10c4, usbProductId: 0xea60}),
        async open() {
            this.readable = new ReadableStream({start: (made) => { to = made; }});
            this.writable = new WritableStream({write: (bytes) => {
                for (const byte of bytes) {
                    if (byte === END) { if (packet?.length) take(packet); packet = packet?.length ? null : []; }
                    else if (!packet) continue;
                    else if (escaped) { packet.push(byte === 0xdc ? END : ESC); escaped = false; }
                    else if (byte === ESC) escaped = true;
                    else packet.push(byte);
                }
            }});
        },
        async setSignals() {},
        async close() { this.readable = this.writable = null; },
    };
    Object.defineProperty(navigator, 'serial', {configurable: true, value: {requestPort: async () => port}});
    window.flashed = async () => {
        const unpacked = new Response(new Blob([new Uint8Array(chip.packed)]).stream().pipeThrough(new DecompressionStream('deflate')));
        return [chip.erased, chip.address, chip.packed.length ? [...new Uint8Array(await unpacked.arrayBuffer())] : []];
    };
}"""  # noqa: E501
S3, ESP32_ID = 9, 0


def micropython(chip):
    """Return the beginning of a program for a chip, as large as a table of partitions needs."""
    content = bytearray(range(256)) * 0x90
    content[:16] = b"\xe9" + bytes(11) + bytes([chip]) + bytes(3)
    content[0x8000:0x8002] = b"\xaa\x50"
    return bytes(content)


def write_micropython(page, content):
    """Let the page write a file onto the chip; return what it says."""
    page.get_by_label("MicroPython's .bin file").set_input_files(
        {"name": "m.bin", "mimeType": "application/octet-stream", "buffer": content}
    )
    press(page, "Erase the board and write it…")
    said = image_card(page).get_by_role("status").first
    expect(said).to_have_text(re.compile(r"\.$"))
    return said.text_content()


def test_micropython_onto_an_esp32(stage, esp_url):
    page = stage.page(esp_url)
    page.evaluate(ROM)
    page.locator('input[value="esp32_s3_595"]').check()
    assert "not a whole MicroPython" in write_micropython(page, IMAGE)
    assert "not for an ESP32-S3" in write_micropython(page, micropython(ESP32_ID))
    page.evaluate("window.chipId = 5")
    assert "chip on this port is an ESP32-C3" in write_micropython(page, micropython(S3))
    assert page.evaluate("flashed()") == [0, None, []]
    page.evaluate(f"window.chipId = {S3}")
    said = write_micropython(page, micropython(S3))
    assert said == "MicroPython is on the board, which starts with it. Next: framestep's files."
    erased, address, content = page.evaluate("flashed()")
    assert (erased, address, bytes(content)) == (1, 0, micropython(S3))
    licences = page.request.get(f"{esp_url}licences.txt").text()
    assert re.findall(r"^(\S+) [\d.]+ \(", licences, re.MULTILINE) == PACKAGES
    page.evaluate(AXE.read_text())
    sound(page)
    assert all(asked.startswith(esp_url) for asked in page.asked), page.asked
    assert page.errors == []


def test_files_onto_an_esp32(stage, esp_site):
    """On the simulated ESP32: from MicroPython with a part of the files, which takes less time
    than all of them, to an answer; then nothing more to do."""
    there = [name for name in modules() if not name.startswith("framestep/motors/")]
    files = {f"/{name}": modules()[name] for name in there}
    device = Device(Esp32Board(files=files), 1.0)
    stage.closing(device.close)
    page = stage.page(esp_site.url)
    esp_site.give_ports(page, *[device.tcp] * 4)
    page.locator(f'input[value="{ESP32}"]').check()
    press(page, "Put framestep's files onto it…")
    said = image_card(page).get_by_role("status").last
    count = len(modules()) - len(there) + 2
    expect(said).to_have_text(
        f"framestep is on the board ({count} files written), which restarts with it."
    )
    press(page, "Put framestep's files onto it…")  # framestep runs now
    expect(said).to_have_text("All of framestep was on the board already; it restarts.")
    go_to(page, "2. Connect")
    press(page, "Choose Dragonframe's port…")
    expect(card(page, "Connect")).to_contain_text("framestep answers: firmware")
    assert page.errors == []


@pytest.mark.repeats  # the form as on an RP2040; rates and restarts as in esp32/test_install.py
def test_the_rig_file_of_an_esp32(stage, esp_site):
    """Read and put back through its one port, at the rate that each file sets. It restarts each
    time."""
    rig = {"/rig.json": b'{"name": "before", "uart_baud": 230400}'}
    device = Device(Esp32Board(files=installed() | rig, baud=230400), 1.0)
    stage.closing(device.close)
    page = stage.page(esp_site.url)
    esp_site.give_ports(page, device.tcp)
    page.locator(f'input[value="{ESP32}"]').check()
    page.get_by_label("Rate of its port").select_option("230400")
    go_to(page, "2. Connect")
    press(page, "Choose Dragonframe's port…")
    expect(card(page, "Connect")).to_contain_text("before answers: firmware")
    go_to(page, "3. Rig file")
    press(page, "Read from the board")
    name = page.get_by_label("name", exact=True)
    expect(name).to_have_value("before")
    said = card(page, "Onto the board").get_by_role("status")
    expect(said).to_have_text("This is the board's rig file.")
    assert page.evaluate("ports[0].baudRate") == 230400
    unfold(page)
    name.fill("after")
    page.get_by_label("uart_baud", exact=True).select_option("460800")
    press(page, "Check, and show the differences")
    expect(said).to_have_text("What changes:")
    press(page, "Put it onto the board")
    page.wait_for_function("ports[0].baudRate === 460800")
    device.at_board(lambda board: setattr(board, "baud", 460800))
    expect(said).to_have_text("after has restarted with it.")
    count = page.get_by_label("motor_count", exact=True)
    count.fill("9")
    press(page, "Check, and show the differences")
    press(page, "Put it onto the board")
    expect(said).to_have_text("rig.json: motor_count: found 9, this board has 8 motors")
    expect(page.locator("#who")).to_contain_text("after, firmware")
    found = []
    device.at_board(lambda board: found.append(json.loads(board.files()["/rig.json"])))
    assert found == [{"name": "after", "uart_baud": 460800}]
    assert page.errors == []
