"""The state of the whole at a glance: a banner, messages with their time, what a move needs."""

import re

import pytest
from playwright.sync_api import expect

from framestep_tools.move.move_file import CAMERA_MOVE
from host_tests.console import looking as ui

RIG = {
    "jog_timeout_ms": 0,
    "estop": "no",
    "limits": [{"low": 26}],
    "motors": [{"home": {"limit": 1, "travel": 300}}],
}


@pytest.fixture(scope="module")
def opened(shared_stage):
    """Return a page for all tests, which leave everything at rest, and its device."""
    device = shared_stage.simulated(RIG, motors=2, wired=True)
    page = shared_stage.connected(shared_stage.console(device.url).url)
    return page, device


def banner(page):
    return page.locator("#banner")


def test_the_banner_shows_motion_and_the_e_stop(opened):
    page, device = opened
    expect(banner(page)).to_contain_text("Positions not set")
    expect(banner(page)).to_have_class("warn")
    page.keyboard.down("ArrowRight")
    expect(banner(page)).to_contain_text("Motor 1 moves Jog at 20 %; it ends when you let go.")
    expect(banner(page)).to_have_class("moves")
    device.set_pin("estop", 0)
    expect(banner(page)).to_contain_text("E-STOP is held: nothing moves until it is released.")
    expect(banner(page)).to_have_class("bad")
    page.keyboard.up("ArrowRight")
    device.set_pin("estop", 1)
    expect(banner(page)).to_have_class("warn")


def test_nothing_can_be_pressed_while_the_device_is_silent(opened):
    page, device = opened
    jog = page.get_by_role("button", name="Jog motor 1 up")
    with device.held():
        expect(page.get_by_role("alert")).to_contain_text("The device does not answer.")
        expect(banner(page)).to_have_class("blind")
        expect(jog).to_be_disabled()
        expect(page.locator("#stop")).to_be_enabled()
    expect(banner(page)).to_have_class("warn")
    expect(jog).to_be_enabled()


def test_messages_have_their_time(opened):
    page, _ = opened
    ui.motor(page, "Motor 2").get_by_role("button", name="Home motor 2").click()
    expect(ui.log(page).locator("p").first).to_have_text(
        re.compile(r"^\d\d:\d\d:\d\d HOME was refus")
    )


def test_homing_reports_how_it_has_ended(opened):
    page, _ = opened
    ui.go_to(page, "Positions")
    page.get_by_role("button", name="Home all motors").click()
    page.get_by_role("button", name="Press again: all motors move").click()
    expect(ui.log(page)).to_contain_text(
        "Motor 1 is not homed: its position is lost: homing did not find its switch."
    )
    ui.wait_rest(page)


def test_step_buttons_add_up_while_the_motor_moves(opened):
    page, _ = opened
    ui.motor(page, "Motor 2")
    before = ui.steps(page, 2)
    by = page.get_by_role("button", name="Move motor 2 by +100 steps", exact=True)
    by.evaluate("button => { for (let i = 0; i < 3; i += 1) button.click(); }")  # before any answer
    expect(ui.position(page, 2)).to_have_text(str(before + 300))
    page.get_by_role("button", name="Move motor 2 by −1 steps", exact=True).click()
    expect(ui.position(page, 2)).to_have_text(str(before + 299))
    ui.wait_rest(page)


def test_a_move_is_shown_with_what_it_needs_and_what_is_set(stage):
    page, _ = stage.opened(motors=4)
    ui.go_to(page, "Move")
    page.get_by_label("Open a move").set_input_files(CAMERA_MOVE)
    first = page.get_by_role("row", name=re.compile("^Motor 1"))
    expect(first).to_contain_text("11664 steps/s, set 5000 steps/s: too little")
    expect(page.get_by_role("row", name=re.compile("^Motor 4"))).to_contain_text(
        re.compile(r"4\d\d\d steps/s, set 5000 steps/s[^:]")
    )
    verdict = page.locator("#verdict")
    expect(verdict).to_contain_text("do not fit")
    page.get_by_role("button", name="Raise the speeds to fit").click()
    expect(ui.log(page)).to_contain_text("Speeds are set: motor 1 12831 steps/s")
    expect(first).to_contain_text("11664 steps/s, set 12831 steps/s")
    expect(first).not_to_contain_text("too little")
    expect(verdict).to_have_text("✓ fits")
    rate = page.get_by_label("Frames per second")
    rate.fill("48")
    rate.press("Tab")
    expect(first).to_contain_text("23328 steps/s, set 12831 steps/s: too little")
    expect(verdict).to_contain_text("do not fit")
    assert page.errors == []


def test_a_wrong_address_says_what_to_do(stage):
    device = stage.simulated(motors=1)
    url = stage.console(device.url).url
    page = stage.page(url.partition("token=")[0] + "token=old")
    expect(ui.log(page)).to_contain_text("open the address that it prints")


def test_the_cross_is_beside_the_drawing(stage):
    from host_tests.console.pictures import crane, prepare

    page = stage.page(crane(stage).url)
    prepare(page)
    ui.go_to(page, "XYZ jog")
    places = {
        name: page.get_by_role("button", name=f"Camera {name}", exact=True).bounding_box()
        for name in ("up", "down", "left", "right", "forward", "backward")
    }
    assert places["up"]["y"] < places["left"]["y"] == places["right"]["y"] < places["down"]["y"]
    assert places["left"]["x"] < places["up"]["x"] == places["down"]["x"] < places["right"]["x"]
    drawing = page.get_by_role("img", name="The rig from above").bounding_box()
    assert drawing["x"] + drawing["width"] < places["left"]["x"]
    assert drawing["y"] < places["down"]["y"]
    with ui.held(page, "Camera up"):
        expect(banner(page)).to_have_class("moves")
    ui.wait_rest(page)


def test_a_jog_ends_when_the_device_becomes_silent(opened):
    page, device = opened
    ui.motor(page, "Motor 1")
    before = ui.steps(page, 2)
    page.get_by_role("button", name="Jog motor 2 up").focus()
    page.keyboard.down(" ")
    ui.wait_far(page, 2, before, 50)
    with device.held():
        expect(page.get_by_role("alert")).to_contain_text("The device does not answer.")
    ui.wait_rest(page)
    page.keyboard.up(" ")


def test_a_second_page_takes_the_device_over(opened, stage):
    page, _ = opened
    ui.motor(page, "Motor 1")
    before = ui.steps(page)
    page.keyboard.down("ArrowRight")
    ui.wait_far(page, 1, before, 50)
    second = stage.page(page.url)
    take = second.get_by_role("button", name="Take over")
    take.click()
    second.get_by_role("button", name="Press again").click()
    expect(second.locator("#banner")).not_to_contain_text("You watch")
    ui.wait_connected(second)
    expect(take).to_be_hidden()
    ui.wait_rest(second)
    expect(page.get_by_role("alert")).to_be_hidden()
    expect(page.locator("#banner")).to_contain_text("Another page has the device.")
    expect(ui.log(page)).to_contain_text("Another page has taken the device over")
    expect(page.get_by_role("button", name="Take over")).to_be_visible()
