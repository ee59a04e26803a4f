"""The page as a whole: a phone's width, names for screen readers, contrast, light and dark, no
server."""

from concurrent.futures import ThreadPoolExecutor
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import expect

from framestep_tools.commands.common import talking
from framestep_tools.payloads import MotorGetPosition, MotorMove
from host_tests.console import looking as ui
from host_tests.console.conftest import PATIENCE_MS
from host_tests.console.pictures import (
    LOOKS,
    VIEWS,
    crane,
    prepare,
)
from host_tests.selection import sweep

# Elements without a name for a screen reader: fields without a label, buttons and pictures without
# a text
NAMELESS = """() => [...document.querySelectorAll('button, input, select, textarea, [role=img]')]
    .filter((each) => !each.labels?.length && !each.getAttribute('aria-label'))
    .filter((each) => !each.textContent.trim())
    .map((each) => each.outerHTML)"""
UNFOLD = "view => view.querySelectorAll('details').forEach(fold => { fold.open = true; })"


@pytest.fixture(scope="module")
def served(shared_stage):
    return crane(shared_stage)


@pytest.mark.parametrize("looks", sweep(["dark", "phone"], "phone"))
def test_every_view_fits_and_everything_in_it_has_a_name(request, served, stage, looks):
    """axe-core also finds mistakes in contrast, in the order of headings, and in roles. It takes
    half of the time, so that without --all it looks at one of them."""
    axe = looks == "dark" or request.config.getoption("repeats") == 1
    options = {}
    for look in looks.split():
        options |= LOOKS[look]
    page = stage.page(served.url, **options)
    prepare(page)
    page.evaluate(ui.AXE.read_text())
    width, height = (options["viewport"][side] for side in ("width", "height"))
    for view in VIEWS:
        ui.go_to(page, view)
        assert page.evaluate("document.documentElement.scrollWidth") <= width, view
        assert page.evaluate("document.documentElement.scrollHeight") <= height, view
        stop = page.locator("#stop").bounding_box()
        assert stop["y"] >= 0, view
        assert stop["y"] + stop["height"] <= height, view
        assert page.evaluate(NAMELESS) == [], view
        page.locator("#d-body").evaluate(UNFOLD)
        if axe:
            assert page.evaluate(ui.FINDINGS) == [], view
    assert {urlsplit(url).netloc for url in page.asked} == {urlsplit(served.url).netloc}
    back = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (back == "rgb(16, 19, 22)") == ("dark" in looks)
    if looks == "dark":
        ui.go_to(page, "This page")
        page.get_by_label("Theme").select_option("light")
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") != back
    page.evaluate("document.querySelector('#d-body').innerHTML += '<h5>too low</h5><input>'")
    mistakes = [name.partition(":")[0] for name in page.evaluate(ui.FINDINGS)]
    assert mistakes == ["heading-order", "label"]
    assert page.errors == []


def test_by_keyboard_alone(served, stage):
    page = stage.connected(served.url)
    before = ui.steps(page)
    page.get_by_role("button", name="Jog track up").focus()
    page.keyboard.down(" ")
    ui.wait_far(page, 1, before, 50)
    page.keyboard.press("Tab")  # leaves the button while it is held
    ui.wait_rest(page)
    page.keyboard.up(" ")
    ui.motor(page, "track").get_by_label("Move to, mm").focus()
    page.keyboard.press("ArrowUp")  # goes into the field, and is no jog
    expect(page.locator("#moving")).to_contain_text("Nothing moves")


def test_the_stop_key_works_while_one_types(served, stage):
    page = stage.connected(served.url)
    card = ui.motor(page, "track")
    before = ui.steps(page)
    card.get_by_label("Move to, mm").fill("990")
    card.get_by_label("Move to, mm").press("Enter")
    ui.wait_far(page, 1, before, 100)
    card.get_by_label("Move to, mm").press("Escape")
    ui.wait_rest(page)
    assert ui.steps(page) < 990 * 50


def test_nothing_is_claimed_of_a_device_that_has_gone(stage):
    page, device = stage.opened(motors=1)
    ui.wait_rest(page)
    line = ui.row(page, "Motor 1")
    expect(line).to_contain_text("lost")
    expect(page.get_by_role("alert")).to_be_hidden()
    device.close()
    expect(page.get_by_role("alert")).to_contain_text("Whether motors move is NOT KNOWN")
    expect(line).to_contain_text("not known")
    expect(line).not_to_contain_text("at rest")
    expect(ui.position(page)).to_have_text("–")
    expect(page.get_by_role("button", name="Jog motor 1 up")).to_be_disabled()
    expect(page.locator("#who")).to_have_text("Not connected")
    expect(page.locator("#moving")).to_have_text("Nothing is connected.")
    expect(ui.log(page)).to_contain_text("The link has ended: the connection to socket://")
    page.locator("#stop").click()
    expect(ui.log(page)).to_contain_text("NOT STOPPED: cannot open socket://")


def test_nothing_is_claimed_of_a_device_that_does_not_answer(stage):
    page, device = stage.opened(motors=1)
    ui.wait_rest(page)
    line = ui.row(page, "Motor 1")
    with device.held():
        expect(page.get_by_role("alert")).to_contain_text("The device does not answer.")
        expect(line).to_contain_text("not known")
        expect(page.locator("#moving")).to_have_text("What moves is not known.")
        expect(page.locator("#stop")).to_be_enabled()
    expect(line).to_contain_text("lost")
    expect(page.get_by_role("alert")).to_be_hidden()


def test_two_pages(stage):
    """STOP works from both, and what each says is true."""
    device = stage.simulated(motors=1)
    console = stage.console(device.url)
    first = stage.connected(console.url)
    first.get_by_label("Move to step").fill("1000000")
    first.get_by_label("Move to step").press("Enter")
    ui.wait_moving(first)
    second = stage.page(console.url)
    banner = second.locator("#banner")
    expect(banner).to_contain_text("Another page has the device. Motor 1 moves.")
    begin = ui.steps(second)
    ui.wait_far(second, 1, begin, 100)  # it sees the positions
    expect(second.get_by_role("button", name="Jog motor 1 up")).to_be_disabled()
    expect(second.get_by_role("alert")).to_be_hidden()
    second.locator("#stop").click()
    expect(ui.newest(second)).to_have_text("Stopped: all motors ramp down.")
    expect(ui.log(first)).to_contain_text("Another page has stopped the motors.")
    for page in (first, second):
        ui.wait_rest(page)
    expect(ui.position(second)).to_have_text(str(ui.steps(first)))
    second.get_by_role("button", name="Take over").click()
    expect(second.locator("#banner")).not_to_contain_text("watch")
    ui.wait_connected(second)
    expect(first.locator("#banner")).to_contain_text("Another page has the device.")
    expect(first.get_by_role("alert")).to_be_hidden()
    expect(ui.log(first)).to_contain_text("Another page has taken the device over.")
    expect(ui.log(first)).not_to_contain_text("The link has ended")
    second.get_by_label("Move to step").fill("0")
    second.get_by_label("Move to step").press("Enter")
    ui.wait_moving(second)
    ui.wait_moving(first)
    first.keyboard.press("Escape")
    expect(ui.log(second)).to_contain_text("Another page has stopped the motors.")
    ui.wait_rest(second)


def test_stop_reaches_what_another_program_moves(stage):
    """The page cannot have the port, says who has it, and stops it all the same."""
    device = stage.simulated(motors=1)
    with talking(device.path) as other, ThreadPoolExecutor(1) as pool:
        other.request(MotorMove(1, 1_000_000))
        ends = pool.submit(other.wait_idle, PATIENCE_MS / 1000)  # it serves its port meanwhile
        page = stage.page(stage.console(device.path).url)
        expect(page.locator("#banner")).to_contain_text(f"has {device.path} open")
        page.locator("#stop").click()
        expect(ui.log(page)).to_contain_text("Stopped: all motors ramp down.")
        ends.result()
        assert other.stopped
    ui.wait_connected(page)  # once the program has ended
    assert ui.steps(page) < 1_000_000
    assert page.errors == []


def test_taking_over_what_moves_takes_two_presses_and_handing_over(stage):
    device = stage.simulated(motors=1)
    console = stage.console(device.url)
    first = stage.connected(console.url)
    second = stage.connected(console.url, **LOOKS["phone"], user_agent="a browser, Mobile")
    before = ui.steps(first)
    first.keyboard.down("ArrowRight")
    ui.wait_far(first, 1, before, 50)
    ui.wait_moving(second)
    second.get_by_role("button", name="Take over").tap()
    expect(second.locator("#banner")).to_contain_text("Taking over stops what moves.")
    ui.wait_moving(first)
    first.keyboard.up("ArrowRight")
    ui.wait_rest(first)
    ui.go_to(first, "This page")
    first.get_by_role("button", name="Hand over").click()
    expect(ui.log(first)).to_contain_text("A phone has taken the device over.")
    expect(first.locator("#banner")).to_contain_text("A phone has the device. Nothing moves.")
    expect(second.locator("#banner")).not_to_contain_text("watch")
    second.close()  # the page that watches gets the device
    expect(first.locator("#banner")).not_to_contain_text("watch")
    ui.wait_connected(first)
    expect(first.get_by_role("alert")).to_be_hidden()
    assert [*first.errors, *second.errors] == []


def test_without_a_server_over_web_serial(stage, tmp_path):
    device = stage.simulated({"jog_timeout_ms": 0}, motors=1)
    saved = stage.saved(tmp_path)
    page = stage.page(saved.url)
    saved.give_ports(page, device.tcp)
    page.get_by_role("button", name="Connect…").click()
    ui.wait_connected(page)
    assert page.evaluate("window.ports[0].signals") == {"dataTerminalReady": True}
    expect(page.get_by_label("Runs and moves go on")).to_be_hidden()
    page.keyboard.down("ArrowRight")
    ui.wait_far(page, 1, 0, 200)
    page.keyboard.up("ArrowRight")
    ui.wait_rest(page)
    stood = ui.steps(page)
    expect(ui.position(page)).to_have_text(str(stood))
    page.keyboard.down("ArrowLeft")
    ui.wait_far(page, 1, stood, 200)
    assert {urlsplit(url).netloc for url in page.asked} == {urlsplit(saved.url).netloc}
    assert page.errors == []
    page.close()  # the port closes with it
    with device.client() as client:
        client.wait_idle()
        assert client.request(MotorGetPosition()).steps[0] < stood - 200
