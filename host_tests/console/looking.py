"""What tests of the console look at on the page."""

import re

import pytest
from playwright.sync_api import expect

from framestep_tools.building.board_files import ROOT
from host_tests.console.conftest import PATIENCE_MS

LOOK_MS = 20
AXE = ROOT / "tools/framestep_emulator/board/node_modules/axe-core/axe.min.js"
# What it finds in a page: names, contrast, the order of headings, roles
FINDINGS = """async () => (await axe.run({resultTypes: ['violations']})).violations.map(
    found => `${found.id}: ${found.nodes.map(node => node.target.join(' ')).join(', ')}`)"""
# The tab is hidden, or seen again
HIDE = """hidden => {
    Object.defineProperty(document, 'hidden', {value: hidden, configurable: true});
    document.dispatchEvent(new Event('visibilitychange'));
}"""

expect.set_options(timeout=PATIENCE_MS)


def position(page, motor=1):
    return page.get_by_label(f"Position of motor {motor} in steps")


def steps(page, motor=1):
    """Return a motor's position on the page."""
    return int(position(page, motor).text_content())


def wait_far(page, motor, begin, distance):
    """Wait until a motor is farther than that from its start."""
    for _ in range(PATIENCE_MS // LOOK_MS):
        if abs(steps(page, motor) - begin) > distance:
            return
        page.wait_for_timeout(LOOK_MS)
    pytest.fail(f"motor {motor} is still at {steps(page, motor)}")


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
