"""Takes pictures of the console, to look at: wide, dark, on a phone; with --states each of its
states in four sizes, light and dark.

python -m host_tests.console.pictures [--states]
"""

import re
import sys

from playwright.sync_api import expect, sync_playwright

from framestep_tools.building.board_files import ROOT
from host_tests.console import looking as ui
from host_tests.console.conftest import FLAGS, Stage, browser_program

FOLDER = ROOT / "build/console"  # pictures of pixels are not kept in the repository
RIG = {
    "name": "crane",
    "limits": [{"low": 26}],
    "motors": [{"home": {"limit": 1, "travel": 60_000}}],
    "inputs": [{"pin": 27}, {"pin": 28}],
    "outputs": [{"pin": 22}],
}
MOTORS = 6
# All messages come at the same time, so that a picture changes only if the page does
NOON = "() => { Date.prototype.toLocaleTimeString = () => '12:00:00'; }"
# The camera move's axis, motor, steps per unit, unit, limits
AXES = [
    ("boom", 2, 800, "deg", (-45, 45)),
    ("swing", 3, 200, "deg", (-90, 90)),
    ("track", 1, 50, "mm", (-100, 1000)),
    ("pan", 4, 400, "deg", (-180, 180)),
]
KEYFRAMES = {
    "name": "keyframes.json",
    "mimeType": "application/json",
    "buffer": b"""{"framestep keyframes": 1, "fps": 24, "keyframes": [
        {"frame": 1, "steps": [0, -8000, 4000, 0, 0, 0], "to_next": "ease"},
        {"frame": 49, "steps": [20000, 6000, 1000, 9000, 0, 0]},
        {"frame": 97, "steps": [32000, 12000, -3000, 15000, 0, 0], "to_next": "hold"},
        {"frame": 120, "steps": [32000, 12000, -3000, 15000, 0, 0]}]}""",
}
FAST = 8.0  # times real time
DEVICE = "/dev/ttyACM1"  # its name on the page: the same each time
FRAME = 1  # of the move, for the pictures
WIDTH, HEIGHT = 1280, 800
LOOKS = {
    "wide": {"viewport": {"width": WIDTH, "height": HEIGHT}},
    "dark": {"viewport": {"width": WIDTH, "height": HEIGHT}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True},
}
# "Motors" is the desk alone
VIEWS = [
    "Motors", "Move", "Options", "Positions", "XYZ jog", "Lights", "Log", "Keys", "Names and units",
    "Virtual axes", "Rig file, load, terminal",
]  # fmt: skip
# What the pictures are of: (view, look)
PICTURES = [("Motors", "wide"), ("Motors", "dark"), ("Motors", "phone"), ("Move", "wide")]


def path(view, look):
    """Return the path of a view's picture."""
    return (
        FOLDER / f"{'desk' if view == 'Motors' else re.split('[ ,]', view)[0].lower()}-{look}.png"
    )


def prepare(page):
    """Give the page something to show in every view."""
    ui.wait_connected(page)
    ui.go_to(page, "Move")
    page.get_by_label("Open a move").set_input_files(KEYFRAMES)
    expect(page.get_by_role("article", name="Poses")).to_contain_text("Slope")
    page.wait_for_timeout(500)  # until the device has reported its speeds
    if (too_slow := page.get_by_role("button", name="Raise the speeds to fit")).is_visible():
        too_slow.click()
        expect(ui.log(page)).to_contain_text("Speeds are set")
    ui.go_to(page, "Virtual axes")
    for name, motor, per_unit, _, _ in AXES:
        axis = page.get_by_role("group", name=name, exact=True)
        axis.get_by_label("Motor").select_option(f"{name} (motor {motor})")
        axis.get_by_label("Steps per unit").fill(str(per_unit))
    page.get_by_label("Arm").fill("800")
    page.get_by_role("button", name="Configure").click()
    expect(ui.log(page)).to_contain_text("configured")


def rest_on_frame(page):
    """Move the rig to the middle of its move."""
    ui.go_to(page, "Positions")
    for name in [name for name, *_ in AXES] + [f"motor {n}" for n in range(5, MOTORS + 1)]:
        page.get_by_role("button", name=f"Set position of {name}", exact=True).click()
        expect(ui.log(page)).to_contain_text("this position is 0")
    ui.close_drawer(page)
    page.locator("#send").click()
    expect(page.locator("#moving")).to_contain_text(f"Play head {FRAME}.000")
    ui.wait_rest(page)


def take(page, view, file):
    """Write the picture of the desk with a drawer."""
    ui.go_to(page, view)
    page.screenshot(path=file)


class Names:
    """The crane's axes.toml, as the page's server has it."""

    def read(self):
        axes = (
            f'[[axis]]\nname = "{name}"\nmotor = {motor}\nsteps_per_unit = {per_unit}\n'
            f'unit = "{unit}"\nlimits = {list(limits)}\n'
            for name, motor, per_unit, unit, limits in AXES
        )
        return {"path": "axes.toml", "text": "\n".join(axes)}


def crane(stage, speed=1.0):
    """Start a console for the rig of the pictures."""
    device = stage.simulated(RIG, MOTORS, speed, wired=True)
    served = stage.console(device.url)
    served.server.device.name = DEVICE
    served.server.device.axes = Names()
    return served


def take_states(browser):
    """Take a picture of each state in each size and theme. Return their number."""
    folder = FOLDER / "states"
    folder.mkdir(parents=True, exist_ok=True)
    taken = 0
    for width, height in SIZES:
        for theme in ("light", "dark"):
            stage = Stage(browser)
            try:
                page, device = begun(stage, (width, height), theme)
                for state, shown in states(stage, page, device):
                    name = f"{width}x{height}-{theme}-{state.replace(' ', '-')}.png"
                    shown.screenshot(path=folder / name)
                    taken += 1
            finally:
                stage.close()
    return taken


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_program(), args=FLAGS)
        stage = Stage(browser)
        try:
            url = crane(stage, FAST).url
            for look, options in LOOKS.items():
                page = stage.page(url, **options)
                page.evaluate(NOON)
                prepare(page)
                rest_on_frame(page)
                for view in [view for view, drawn in PICTURES if drawn == look]:
                    take(page, view, path(view, look))
                page.close()
        finally:
            stage.close()
        taken = len(PICTURES) + (take_states(browser) if "--states" in sys.argv else 0)
        browser.close()
    print(f"{taken} pictures are in {FOLDER.relative_to(ROOT)}")


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
    ui.wait_rest(page)
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
    ui.wait_rest(page)
    yield "frame by frame", page
    page.locator("#modes [data-mode=lapse]").click()
    page.locator("#go").click()
    in_banner(page, "Time-lapse picture 1 of")
    yield "time-lapse", page
    page.keyboard.press("Escape")
    ui.wait_rest(page)
    page.locator("#modes [data-mode=run]").click()
    device.set_pin("estop", 0)
    in_banner(page, "E-STOP")
    cannot_play(page, "the E-stop is held")
    yield "E-stop", page
    device.set_pin("estop", 1)
    expect(page.locator("#banner")).not_to_contain_text("E-STOP")
    ask(
        page, "MotorSetLimits", motor=1, lower_enable=0, lower=0, upper_enable=0, upper=0,
        limit_set=1,
    )  # fmt: skip
    page.keyboard.down("ArrowLeft")
    ui.wait_moving(page)
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
    expect(ui.log(page)).not_to_contain_text("The link has ended")
    yield "taken over", page
    page.get_by_role("button", name="Take over").click()
    expect(page.locator("#banner")).not_to_contain_text("You watch")
    ui.wait_connected(page)
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
    ui.wait_connected(page)
    return page, device


if __name__ == "__main__":
    main()
