"""The console on the emulated board: what only the firmware itself and its REPL can show."""

import json
import re

import pytest
from playwright.sync_api import expect

from framestep_tools.board import rig_file
from framestep_tools.board.restart import takes_rig
from framestep_tools.console.board_requests import BoardWork
from framestep_tools.errors import ToolError
from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.console import looking as ui
from host_tests.console.conftest import Device

# The page's check of a rig file on a board that has no memory for it
SCARCE = """async () => {
    (await import('/protocol.js')).SCRIPTS.check = 'print("\\\\x02"); print(\\'[null, ""]\\')';
}"""
LIVE = re.compile(
    r"Interrupts: [1-9]\d* µs of each 1000(.|\n)*Segments that wait, of 16: motor 1 \d"
)


@pytest.fixture(scope="module")
def device(shared_stage):
    found = Device(EmulatedBoard({"name": "before"}, trace=False), 1.0, repl=True)
    shared_stage.closing(found.close)
    return found


def put(rig, text, said):
    """Put a rig file onto the board, and wait until that is reported."""
    rig.get_by_label("Rig file").fill(text)
    rig.get_by_role("button", name="Put onto the board").click()
    expect(rig.get_by_role("status")).to_contain_text(said)


def load_of(page):
    return page.get_by_role("article", name="Load of the board")


def watch_the_load_of_a_move(page):
    """Watch live figures while motor 1 moves; they do not disturb the move."""
    ui.go_to(page, "Motors")
    target = ui.steps(page) + 30_000  # six seconds
    card = ui.motor(page, "Motor 1")
    ui.move_to(card, target)
    ui.wait_moving(page)
    ui.go_to(page, "Rig file, load, terminal")
    load = load_of(page)
    load.get_by_label("Live").check()
    expect(load.get_by_role("status")).to_contain_text(LIVE)
    late, limit = map(
        int, re.search(r"motion: (\d+) µs, the limit is (\d+)", load.text_content()).groups()
    )
    assert late < limit
    expect(load.get_by_role("status")).to_contain_text("No motor moves.")
    expect(load.get_by_role("img", name="Interrupts").locator("polyline")).to_be_visible()
    ui.go_to(page, "Motors")  # out of sight, the page asks nothing
    assert ui.steps(page) == target
    assert page.locator("#conditions li").count() == 0
    ui.go_to(page, "Rig file, load, terminal")
    expect(load.get_by_label("Live")).not_to_be_checked()


PASTE = """text => {
    const pasted = new DataTransfer();
    pasted.setData('text/plain', text);
    document.querySelector('.xterm-helper-textarea').dispatchEvent(
        new ClipboardEvent('paste', {clipboardData: pasted, bubbles: true, cancelable: true}));
}"""


def use_the_terminal(page):
    """Type, paste, interrupt. Another task of the page takes the port, and the page says so."""
    ui.go_to(page, "Rig file, load, terminal")
    repl = page.get_by_role("article", name="REPL")
    rows = repl.locator(".xterm-rows")
    repl.get_by_role("button", name="Open a terminal").click()
    expect(rows).to_contain_text(">>>")
    page.keyboard.type("6 * 7000")
    page.keyboard.press("Enter")
    expect(rows).to_contain_text("42000")
    page.evaluate(PASTE, "for i in range(2):\n    if i:\n        print('line', i)\n")
    expect(rows).to_contain_text("line 1")
    # A Ctrl-C that MicroPython reads before it has begun to run the line is not one.
    page.keyboard.type("print('be' + 'gun'); exec('while True: pass')")
    page.keyboard.press("Enter")
    expect(rows).to_contain_text("begun")
    repl.get_by_role("button", name="Ctrl-C").click()
    expect(rows).to_contain_text("KeyboardInterrupt")
    page.get_by_role("button", name="Measure").click()
    expect(load_of(page).get_by_role("status")).to_contain_text("us in a tick of 1000 on average")
    expect(repl.get_by_role("status").first).to_have_text(
        "The terminal has ended: the page itself uses the REPL, for the rig file or the load."
    )
    repl.get_by_role("button", name="Open a terminal").click()
    expect(repl.get_by_role("button", name="Close it")).to_be_visible()
    expect(repl.locator("textarea")).to_be_focused()
    page.keyboard.type("'again'.upper()")
    page.keyboard.press("Enter")
    expect(rows).to_contain_text("AGAIN")
    repl.get_by_role("button", name="Close it").click()
    expect(repl.get_by_role("button", name="Open a terminal")).to_be_enabled()


def test_the_terminal(stage, device):
    page = stage.connected(stage.console(device.url, BoardWork(device.repl, device.url)).url)
    use_the_terminal(page)
    page.get_by_role("button", name="Open a terminal").click()
    repl = page.get_by_role("article", name="REPL")
    expect(repl.get_by_role("button", name="Close it")).to_be_visible()
    page.evaluate(ui.AXE.read_text())
    assert page.evaluate(ui.FINDINGS) == []
    taken = stage.page(page.url)  # another page takes the device over, and the terminal with it
    taken.get_by_role("button", name="Take over").click()
    expect(page.get_by_role("banner").get_by_role("status")).to_contain_text("You watch")
    expect(repl).to_be_hidden()
    assert page.errors == []


def test_a_jog_the_load_and_a_new_rig_file(stage, device):
    page = stage.connected(stage.console(device.url, BoardWork(device.repl, device.url)).url)

    page.keyboard.down("ArrowLeft")
    ui.wait_moving(page)
    ui.wait_far(page, 1, 0, 100)
    page.keyboard.up("ArrowLeft")
    ui.wait_rest(page)
    assert ui.steps(page) < -100

    watch_the_load_of_a_move(page)
    page.get_by_role("button", name="Measure").click()
    expect(load_of(page).get_by_role("status")).to_contain_text("us in a tick of 1000 on average")

    rig = page.get_by_role("article", name="Rig file of the board")
    rig.get_by_role("button", name="Read").click()
    expect(rig.get_by_role("status")).to_have_text("As it is on the board.")
    text = rig.get_by_label("Rig file")
    assert json.loads(text.input_value()) == {"name": "before"}
    put(rig, '{"name": "after", "motor_count": 99}', "motor_count")
    text.fill('{"name": "after", // a comment\n "motor_count": 3}')
    rig.get_by_role("button", name="Check").click()
    expect(rig.get_by_role("status")).to_contain_text("valid for Raspberry Pi Pico: 'after'")
    rig.get_by_role("button", name="Put onto the board").click()
    expect(rig.get_by_role("status")).to_contain_text("after on socket://")
    expect(page.locator("#who")).to_contain_text("after, firmware")
    ui.go_to(page, "Motors")
    expect(page.locator("#rows li")).to_have_count(3)
    rig_text = ui.log(page).text_content()
    assert "motor_count" in rig_text  # the page showed the mistake with the file, too


@pytest.mark.repeats
def test_a_rig_file_that_only_the_board_refuses(device, monkeypatch):
    """Firmware of another version may do so; the page reports it and puts the old file back."""
    work = BoardWork(device.repl, device.url)
    before = work.read_rig()
    taken = rig_file.check({"ports": 2}, {}, "rig.json")
    monkeypatch.setattr(rig_file, "check", lambda *_: taken)
    with pytest.raises(ToolError, match=r"refuses it \(/rig.json: motor_count: found 99"):
        work.write_rig('{"name": "wrong", "motor_count": 99}')
    assert work.read_rig() == before
    assert takes_rig(device.url)


@pytest.mark.repeats
def test_rig_file_and_load_without_a_server(stage, device, tmp_path):
    """Over two ports of Web Serial; the board itself judges the rig file."""
    saved = stage.saved(tmp_path)
    page = stage.page(saved.url)
    saved.give_ports(page, device.tcp, device.repl_tcp)
    page.get_by_role("button", name="Connect…").click()
    ui.wait_connected(page)
    ui.go_to(page, "Rig file, load, terminal")
    rig = page.get_by_role("article", name="Rig file of the board")
    expect(rig.get_by_role("button", name="Read")).to_be_disabled()
    page.get_by_role("button", name="Connect the REPL's port…").click()
    watch_the_load_of_a_move(page)
    rig.get_by_role("button", name="Read").click()
    expect(rig.get_by_role("status")).to_have_text("As it is on the board.")
    use_the_terminal(page)
    text = rig.get_by_label("Rig file")
    before = json.loads(text.input_value())
    assert before["name"] == "after"
    for wrong, said in (
        ("{", "rig.json: not valid JSON"),
        ("[1]", "rig.json: expected an object"),
        ('{"motor_count": 99}', "rig.json: motor_count: found 99, allowed is 0 to 24"),
        ('{"motor_count": 9}', "rig.json: motor_count: found 9, this board has 8 motors"),
    ):
        put(rig, wrong, said)
    said = "Übung // 2 has restarted with it."
    put(rig, '// a comment\n{"name": "Übung // 2", "motor_count": 2}', said)
    expect(page.locator("#who")).to_contain_text("Übung // 2, firmware")
    ui.go_to(page, "Motors")
    expect(page.locator("#rows li")).to_have_count(2)

    # a board without the memory judges it when it restarts
    page.evaluate(SCARCE)
    ui.go_to(page, "Rig file, load, terminal")
    said = "it has restarted with the previous file"
    put(rig, '{"name": "wrong", "motor_count": 9}', said)
    expect(page.locator("#who")).to_contain_text("Übung // 2, firmware")
    assert page.locator("#conditions li").count() == 0
    assert page.errors == []
