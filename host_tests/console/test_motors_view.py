"""Motors in the console: positions, jogs that end on release, stop, zero, limits."""

import re

import pytest
from playwright.sync_api import expect

from framestep_tools import cli
from framestep_tools.payloads import GetExceeded, MotorGetPosition, MotorSetSpeed
from host_tests.console import looking as ui

# Without a time limit a jog ends only when the page or its server says so
ENDLESS_JOGS = {"jog_timeout_ms": 0}


@pytest.fixture(scope="module")
def opened(shared_stage):
    page, _ = shared_stage.opened(ENDLESS_JOGS, motors=2)
    return page


def card_of(page, number):
    return ui.motor(page, f"Motor {number}")


def settings_of(page, number):
    return ui.settings(page, f"Motor {number}")


def test_a_move_and_its_position(page):
    before = ui.steps(page, 1)
    card = card_of(page, 2)
    ui.move_to(card, -700)
    expect(ui.position(page, 2)).to_have_text("-700")
    assert ui.steps(page, 1) == before


def test_a_jog_lasts_as_long_as_its_button_is_held(page):
    before = ui.steps(page)
    with ui.held(page, "Jog motor 1 up"):
        ui.wait_moving(page)
        ui.wait_far(page, 1, before, 300)
    ui.wait_rest(page)
    assert ui.steps(page) > before + 300


@pytest.mark.parametrize(
    "ends",
    [
        pytest.param(lambda page: page.keyboard.press("Escape"), id="escape"),
        pytest.param(lambda page: page.keyboard.up("ArrowLeft"), id="key up"),
        pytest.param(
            lambda page: page.evaluate("window.dispatchEvent(new Event('blur'))"), id="blur"
        ),
        pytest.param(lambda page: page.evaluate(ui.HIDE, True), id="hidden"),
        pytest.param(lambda page: page.locator("#stop").click(), id="stop"),
    ],
)
def test_a_jog_by_key_ends_and_a_key_that_is_still_held_begins_no_other(page, ends):
    other, before = ui.steps(page, 1), ui.steps(page, 2)
    page.keyboard.press("2")
    page.keyboard.down("ArrowLeft")
    ui.wait_far(page, 2, before, 200)
    ends(page)
    ui.wait_rest(page)
    stood = ui.steps(page, 2)
    assert stood < before - 200
    page.keyboard.down("ArrowLeft")  # like a held key that repeats
    page.keyboard.up("ArrowLeft")
    page.evaluate(ui.HIDE, False)
    assert ui.steps(page, 1) == other


def test_zero(page):
    card = settings_of(page, 1)
    card.get_by_label("Call this position").fill("4321")
    card.get_by_role("button", name="Set position").click()
    expect(ui.position(page)).to_have_text("4321")
    expect(card_of(page, 1)).to_contain_text("known: set by the host")


def test_a_refusal_is_reported_and_changes_nothing(page):
    card = settings_of(page, 1)
    before = ui.steps(page)
    card.get_by_label("Upper, steps").fill(str(before))
    card.get_by_label("Upper soft limit").check()
    card.get_by_role("button", name="Set limits").click()
    expect(ui.log(page)).to_contain_text("Motor 1: limits are set.")
    card = card_of(page, 1)
    ui.move_to(card, before + 1)
    expect(ui.log(page)).to_contain_text(
        f"Refused: {before + 1} is past the upper soft limit of motor 1, {before}"
    )
    assert ui.steps(page) == before


def test_what_does_not_fit_is_not_sent(page):
    before = ui.steps(page, 2)
    card = card_of(page, 2)
    ui.move_to(card, 2147483648)
    assert card.get_by_label("Move to step").evaluate("field => !field.validity.valid")
    assert ui.steps(page, 2) == before


def test_nothing_is_asked_of_other_hosts(page):
    hosts = {re.sub(r"^\w+://([^/]*)/.*", r"\1", url) for url in page.asked}
    assert len(hosts) == 1, hosts


def test_settings_come_from_the_device_and_reach_it(stage):
    device = stage.simulated(motors=1)
    with device.client() as client:
        client.request(MotorSetSpeed(1, 1234, 5678))
    page = stage.page(stage.console(device.url).url)
    card = settings_of(page, 1)
    expect(card.get_by_label("Velocity, steps/s")).to_have_value("1234")
    card.get_by_label("Acceleration, steps/s²").fill("9999")
    card.get_by_label("Lower soft limit").check()
    card.get_by_label("Lower, steps").fill("-50")
    card.get_by_role("button", name="Set limits").click()
    card.get_by_role("button", name="Set speed").click()
    expect(ui.log(page)).to_contain_text("Motor 1: speed is set.")
    page.close()
    with device.client() as client:  # without a page the port is free
        found = client.request(GetExceeded(1))
        assert list(client.request(MotorGetPosition()).steps) == [0]
    assert (found.velocity, found.acceleration, found.lower, found.upper) == (1234, 9999, -50, 0)


def test_the_page_that_leaves_stops_its_jog(stage):
    page, _ = stage.opened(ENDLESS_JOGS, motors=1)
    page.keyboard.down("ArrowRight")
    ui.wait_far(page, 1, 0, 200)
    page.reload()
    ui.wait_connected(page)
    ui.wait_rest(page)
    assert ui.steps(page) > 200


def test_framestep_stop_in_another_window_ends_a_jog(stage):
    """It comes through the server that has the port; the held key does not start another jog."""
    device = stage.simulated(ENDLESS_JOGS, motors=1)
    page = stage.connected(stage.console(device.path).url)
    page.keyboard.down("ArrowRight")
    ui.wait_far(page, 1, 0, 200)
    assert cli.app.status(["stop", "--device", device.path]) == 0
    expect(ui.log(page)).to_contain_text("Another program has stopped the motors.")
    ui.wait_rest(page)
    stood = ui.steps(page)
    page.keyboard.down("ArrowRight")  # like a held key that repeats
    page.keyboard.up("ArrowRight")
    page.keyboard.down("ArrowLeft")
    ui.wait_far(page, 1, stood, 50)
    page.keyboard.up("ArrowLeft")
    ui.wait_rest(page)
    assert ui.steps(page) < stood


def test_homing_is_offered_where_the_rig_file_sets_it_up(page, stage):
    expect(page.get_by_role("button", name=re.compile("Home"))).to_have_count(0)
    rig = {"limits": [{"low": 26}], "motors": [{"home": {"limit": 1, "travel": 1_000_000}}]}
    device = stage.simulated(rig, motors=2, wired=True)
    other = stage.connected(stage.console(device.url).url)
    ui.motor(other, "Motor 2").get_by_role("button", name="Home motor 2").click()
    expect(ui.log(other)).to_contain_text("HOME was refused with ERR_RANGE")
    ui.motor(other, "Motor 1").get_by_role("button", name="Home motor 1").click()
    ui.wait_far(other, 1, 0, 100)
    other.keyboard.press("Escape")
    ui.wait_rest(other)
    assert ui.steps(other, 1) < -100
