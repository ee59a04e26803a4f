"""A game controller in the console: a jog lasts only while its button and stick are held."""

import pytest
from playwright.sync_api import expect

from framestep_tools.client.wire import FrameDecoder
from framestep_tools.payloads import MotorJog
from host_tests.console import looking as ui

CONNECT = """() => {
    window.pad = {connected: true, axes: [0, 0],
        buttons: Array.from({length: 17}, () => ({pressed: false}))};
    navigator.getGamepads = () => [null, window.pad];
    window.dispatchEvent(new Event('gamepadconnected'));
}"""
L1, B, UP, DOWN = 4, 1, 12, 13


def jogs(page):
    """Return the number of jogs that the page has requested."""
    sent = b"".join(each for each in page.sent if isinstance(each, bytes))
    return sum(frame.type == MotorJog.TYPE for frame in FrameDecoder().feed(sent))


class Pad:
    """A fake game controller."""

    def __init__(self, page):
        self._page = page
        page.evaluate(CONNECT)

    def button(self, number, pressed):
        self._set(f"buttons[{number}].pressed", pressed)

    def stick(self, way):
        self._set("axes[0]", way)

    def unplug(self):
        self._page.evaluate("window.pad = null")

    def _set(self, what, value):
        self._page.evaluate(f"value => {{ window.pad.{what} = value; }}", value)
        self.be_seen()

    def be_seen(self):
        """Wait until the page has looked at it."""
        self._page.evaluate(
            "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )


@pytest.fixture(scope="module")
def opened(shared_stage):
    page, _ = shared_stage.opened({"jog_timeout_ms": 0}, motors=2)
    return page


ENDS = {
    "button": lambda page, pad: pad.button(L1, False),
    "stick": lambda page, pad: pad.stick(0.1),
    "turned": lambda page, pad: pad.stick(-1),
    "unplugged": lambda page, pad: pad.unplug(),
    "escape": lambda page, pad: page.keyboard.press("Escape"),
    "B": lambda page, pad: pad.button(B, True),
    "blur": lambda page, pad: page.evaluate("window.dispatchEvent(new Event('blur'))"),
    "stop": lambda page, pad: page.locator("#stop").click(),
}


def test_a_jog_ends(page):
    for name, ends in ENDS.items():
        before = ui.steps(page)
        pad = Pad(page)
        pad.button(L1, True)
        pad.stick(0.9)
        ui.wait_moving(page)
        ui.wait_far(page, 1, before, 50)
        ends(page, pad)
        ui.wait_rest(page)
        ui.go_to(page, "Motors")
        asked = jogs(page)
        pad.be_seen()
        pad.be_seen()
        assert jogs(page) == asked, f"{name}: the stick has not been let go"
        assert ui.steps(page) > before + 50, name


def test_without_the_dead_mans_button_nothing_moves(page):
    pad = Pad(page)
    pad.stick(1)
    pad.stick(0)
    pad.button(L1, True)
    pad.stick(-0.45)  # not far enough to begin
    pad.stick(0)
    assert jogs(page) == 0
    pad.stick(1)
    ui.wait_moving(page)
    assert jogs(page) > 0
    pad.stick(0)


def test_after_a_stop_the_stick_is_let_go_first(page):
    before = ui.steps(page)
    pad = Pad(page)
    pad.button(L1, True)
    pad.stick(1)
    ui.wait_far(page, 1, before, 50)
    page.keyboard.press("Escape")
    ui.wait_rest(page)
    stood = ui.steps(page)
    pad.stick(0.95)
    expect(page.locator("#moving")).to_contain_text("Nothing moves")
    expect(ui.position(page)).to_have_text(str(stood))
    pad.stick(0)
    pad.stick(-1)
    ui.wait_far(page, 1, stood, 50)
    pad.stick(0)
    ui.wait_rest(page)
    assert ui.steps(page) < stood


def test_the_cross_chooses_the_motor(page):
    before = ui.steps(page)
    pad = Pad(page)
    for button in (DOWN, DOWN):  # the second press finds no further motor
        pad.button(button, True)
        pad.button(button, False)
    pad.button(L1, True)
    pad.stick(1)
    ui.wait_far(page, 2, 0, 50)
    pad.stick(0)
    ui.wait_rest(page)
    assert ui.steps(page, 1) == before
    pad.button(UP, True)
    expect(page.get_by_role("button", name="Choose motor 1")).to_have_attribute(
        "aria-pressed", "true"
    )
