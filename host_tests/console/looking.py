"""What tests of the console look at on the page."""

import re

from playwright.sync_api import expect

from framestep_tools.building.board_files import ROOT
from host_tests.console.conftest import PATIENCE_MS

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

expect.set_options(timeout=PATIENCE_MS)


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


def wait_moving(page):
    expect(page.locator("#moving")).to_have_text(re.compile("^(?!Nothing moves).* moves?[.,]"))


def wait_rest(page):
    expect(page.locator("#moving")).to_contain_text("Nothing moves")


def wait_connected(page):
    expect(page.locator("#who")).to_contain_text("firmware")
    expect(position(page)).to_have_text(re.compile(r"\d"))


def log(page):
    return page.get_by_role("log")


def go_to(page, view):
    page.get_by_role("navigation").get_by_role("button", name=view, exact=True).click()


def newest(page):
    """Return the newest message, without its time."""
    return log(page).locator("p span").first
