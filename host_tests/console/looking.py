"""What tests of the console look at on the page."""

import contextlib
import re

from playwright.sync_api import expect

from framestep_tools.building.board_files import ROOT
from host_tests.served import PATIENCE_S

LOOK_MS = 20
AXE = ROOT / "tools/framestep_emulator/board/node_modules/axe-core/axe.min.js"
# What it finds in a page: names, contrast, the order of headings, roles
FINDINGS = """async () => (await axe.run({resultTypes: ['violations']})).violations.map(
    found => `${found.id}: ${found.nodes.map(node => node.target.join(' ')).join(', ')}`)"""
# In the page, as each look from outside takes some milliseconds of three processes
FAR = """([label, begin, distance]) => Math.abs(
    Number(document.querySelector(`[aria-label="${label}"]`)?.textContent) - begin) > distance"""
# The tab is hidden, or seen again
HIDE = """hidden => {
    Object.defineProperty(document, 'hidden', {value: hidden, configurable: true});
    document.dispatchEvent(new Event('visibilitychange'));
}"""

# What a key or an answer has changed is drawn with the next picture
DRAWN = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"

expect.set_options(timeout=PATIENCE_S * 1000)


def _position_label(motor):
    return f"Position of motor {motor} in steps"


def position(page, motor=1):
    return page.get_by_label(_position_label(motor))


def steps(page, motor=1):
    """Return a motor's position on the page."""
    return int(position(page, motor).text_content())


def wait_far(page, motor, begin, distance):
    """Wait until a motor is farther than that from its start."""
    page.wait_for_function(FAR, arg=[_position_label(motor), begin, distance], polling=LOOK_MS)


def wait_drawn(page):
    page.evaluate(DRAWN)


def wait_moving(page):
    expect(page.locator("#moving")).to_have_text(re.compile("^(?!Nothing moves).* moves?[.,]"))


def wait_rest(page):
    expect(page.locator("#moving")).to_contain_text("Nothing moves")


def wait_connected(page, label=None):
    """label: of the first motor's position, if it has a unit."""
    expect(page.locator("#who")).to_contain_text("firmware")
    first = page.get_by_label(label) if label else position(page)
    expect(first).to_have_text(re.compile(r"\d"))


def log(page):
    return page.locator("#log")


# Where the console has what: a drawer, or a part of Set up
DRAWERS = {
    "Move": "move", "Options": "options", "Lights": "lights", "XYZ jog": "camera", "Log": "log",
    "Keys": "keys", "Positions": "positions",
}  # fmt: skip
SET_UP = ["Names and units", "Virtual axes", "Rig file, load, terminal", "This page"]


def close_drawer(page):
    """Show the desk alone. A drawer that has a column of its own stays."""
    close = page.locator("#d-close")
    while close.is_visible():
        close.click()


def go_to(page, view):
    """Show a view of the page that installs framestep, or a drawer of the console; Motors: none."""
    if page.locator("#tabs").count():
        page.get_by_role("navigation").get_by_role("button", name=view, exact=True).click()
        return
    close_drawer(page)
    if view == "Motors":
        return
    name = DRAWERS.get(view, "setup")
    opener = page.locator(f'[data-drawer="{name}"]:visible')
    if opener.count():
        opener.first.click()
    else:  # a phone's menu
        page.locator('[data-drawer="setup"]').click()
        page.locator(f'.setup [data-to="{name}"]').click()
    if name == "setup":
        page.locator(".setup nav").get_by_role("button", name=view, exact=True).click()


def motor(page, title):
    """Choose a motor; return its part below the lines."""
    close_drawer(page)
    row(page, title).locator(".name").click()
    return page.get_by_role("article", name=title, exact=True)


def row(page, title):
    return page.locator(f'#rows li[aria-label="{title}"]')


def settings(page, title):
    """Open a motor's settings, as the device has reported them."""
    motor(page, title).get_by_role("button", name="Settings…").first.click()
    name = title[0].lower() + title[1:] if title.startswith("Motor ") else title
    found = page.get_by_role("article", name=f"Settings of {name}", exact=True)
    expect(found).to_have_attribute("aria-busy", "false")
    return found


def card(page, name):
    return page.get_by_role("article", name=name, exact=True)


def move_to(card, position, label="Move to step"):
    """Move a motor, or a virtual axis, by the fields of its part of the page."""
    card.get_by_label(label).fill(str(position))
    card.get_by_role("button", name="Move", exact=True).click()


@contextlib.contextmanager
def held(page, button):
    """Hold a button meanwhile."""
    page.get_by_role("button", name=button, exact=True).hover()
    page.mouse.down()
    yield
    page.mouse.up()


def open_move(page, name, content):
    """Give the page a file with a move."""
    data = content if isinstance(content, bytes) else content.encode()
    page.get_by_label("Open a move").set_input_files(
        {"name": name, "mimeType": "application/octet-stream", "buffer": data}
    )


def newest(page):
    """Return the newest message, without its time."""
    return log(page).locator("p span").first
