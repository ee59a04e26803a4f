"""The states of the console, one after the other: for tests and pictures."""

from playwright.sync_api import expect

from host_tests.console.looking import log, wait_connected, wait_moving, wait_rest
from host_tests.console.pictures import KEYFRAMES

SIZES = [(1280, 800), (1920, 1080), (390, 844), (844, 390)]
SPEED = 4.0  # times real time
# Keyframes of eight motors that play slowly
SLOW = (KEYFRAMES["buffer"].decode().replace("0, 0]", "0, 0, 0, 0]").replace("000", "00")).replace(
    '"fps": 24', '"fps": 4'
)
MODULES = """async ([request, values]) => {
    const { device } = await import('/session.js');
    return device.ask(request, values);
}"""
SWITCH = 26  # high: hit


def ask(page, request, **values):
    """Send a request as the page does."""
    assert page.evaluate(MODULES, [request, values]) is not None


def in_banner(page, text):
    expect(page.locator("#banner")).to_contain_text(text)


def states(stage, page, device):
    """Yield the name of each state once the page is in it, and the page."""
    in_banner(page, "Positions not set")
    cannot_play(page, "positions are lost")
    yield "positions not set", page
    for number in range(1, 9):
        position = 40_000 if number == 8 else 0
        ask(page, "MotorResetPosition", motor=number, position=position)
    in_banner(page, "At rest")
    yield "at rest", page
    page.keyboard.down("ArrowRight")
    in_banner(page, "moves Jog at")
    yield "jogging", page
    page.keyboard.up("ArrowRight")
    in_banner(page, "At rest")
    page.locator("#ready").click()
    in_banner(page, "on the way to where it begins")
    yield "getting ready", page
    in_banner(page, "READY")
    yield "ready", page
    page.locator("#go").click()
    in_banner(page, "Take 1 runs")
    yield "running", page
    page.keyboard.press("Escape")
    in_banner(page, "Stopped")
    in_banner(page, "by: STOP on this page")
    wait_rest(page)
    yield "stopped", page
    speed = {"motor": 1, "acceleration": 20_000}
    ask(page, "MotorSetSpeed", velocity=10, **speed)
    page.locator("#ready").click()
    in_banner(page, "Refused")
    yield "refused", page
    ask(page, "MotorSetSpeed", velocity=5000, **speed)
    page.locator("#modes [data-mode=frames]").click()
    page.locator("#ready").click()  # next frame
    in_banner(page, "SHOOT takes frame 2")
    wait_rest(page)
    yield "frame by frame", page
    page.locator("#modes [data-mode=lapse]").click()
    page.locator("#go").click()
    in_banner(page, "Time-lapse picture 1 of")
    yield "time-lapse", page
    page.keyboard.press("Escape")
    wait_rest(page)
    page.locator("#modes [data-mode=run]").click()
    device.set_pin("estop", 0)
    in_banner(page, "E-STOP")
    cannot_play(page, "the E-stop is held")
    yield "E-stop", page
    device.set_pin("estop", 1)
    expect(page.locator("#banner")).not_to_contain_text("E-STOP")
    ask(
        page,
        "MotorSetLimits",
        motor=1,
        lower_enable=0,
        lower=0,
        upper_enable=0,
        upper=0,
        limit_set=1,
    )
    page.keyboard.down("ArrowLeft")
    wait_moving(page)
    device.set_pin(SWITCH, 1)
    in_banner(page, "is at its lower switch: only + moves it.")
    page.keyboard.up("ArrowLeft")
    yield "limit switch", page
    device.set_pin(SWITCH, 0)
    broken(device, True)
    in_banner(page, "Fault")
    in_banner(page, "mend what is wrong")
    cannot_play(page, "there is a fault")
    yield "fault", page
    broken(device, False)
    expect(page.locator("#banner")).not_to_contain_text("Fault")
    with device.held():
        in_banner(page, "NO ANSWER")
        yield "no answer", page
    expect(page.locator("#banner")).not_to_contain_text("NO ANSWER")
    taker = stage.page(page.url)
    taker.get_by_role("button", name="Take over").click()
    expect(taker.locator("#banner")).not_to_contain_text("You watch")
    in_banner(page, "Nothing moves.")
    expect(log(page)).not_to_contain_text("The link has ended")
    yield "taken over", page
    page.get_by_role("button", name="Take over").click()
    expect(page.locator("#banner")).not_to_contain_text("You watch")
    wait_connected(page)
    taker.close()
    device.close()
    in_banner(page, "LINK LOST")
    yield "link lost", page
    page.reload()
    in_banner(page, "Cannot open")
    yield "not connected", page


def cannot_play(page, why):
    expect(page.locator("#go")).to_contain_text(why)
    for button in ("#ready", "#go", "#send"):
        expect(page.locator(button)).to_be_disabled()


def broken(device, on):
    def say(board):
        board.host_board.controller.broken = on

    device.at_board(say)


def begun(stage, size, theme):
    """Return a page of this size and theme on a board of eight motors without positions, and its
    device."""
    width, height = size
    rig = {"estop": "no", "name": "desk", "limits": [{"low": SWITCH}]}
    device = stage.simulated(rig, 8, SPEED)
    device.set_pin(SWITCH, 0)
    page = stage.page(
        stage.console(device.url).url,
        viewport={"width": width, "height": height},
        color_scheme=theme,
        has_touch=width < 1000,
    )
    page.evaluate("text => localStorage.setItem('keyframes', text)", SLOW)
    page.reload()
    wait_connected(page)
    return page, device
