"""The page of `make try`: framestep on an emulated board that runs in the browser's tab."""

import pytest
from playwright.sync_api import expect

from framestep_tools.site import try_page
from host_tests.console.file_server import FileServer
from host_tests.console.looking import wait_connected


@pytest.fixture(scope="module")
def url(tmp_path_factory):
    folder = tmp_path_factory.mktemp("try")
    try_page.make(folder)
    server = FileServer(folder)
    yield server.url
    server.close()


def terminal(page):
    return page.get_by_role("article", name="REPL")


def type_on_repl(page, text):
    terminal(page).locator("textarea").focus()
    page.keyboard.type(text)
    page.keyboard.press("Enter")


def test_console_and_repl_of_the_board_in_the_page(stage, url):
    page = stage.page(url)
    wait_connected(page)
    expect(page.locator("#who")).to_contain_text(try_page.RIG["name"])
    expect(page.get_by_role("article", name="Motor 4")).to_be_visible()
    type_on_repl(page, "6 * 7000")
    expect(terminal(page).locator(".xterm-rows")).to_contain_text("42000")
    assert page.errors == []
    assert all(asked.startswith(url) for asked in page.asked), page.asked
