"""Takes pictures of the console, to look at: wide, dark, on a phone; with --states each of its
states in four sizes, light and dark.

python -m host_tests.console.pictures [--states]
"""

import re
import sys

from playwright.sync_api import expect, sync_playwright

from framestep_tools.building.board_files import ROOT
from host_tests.console.conftest import FLAGS, Stage, browser_program
from host_tests.console.looking import close_drawer, go_to, log, wait_connected, wait_rest

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
SPEED = 8.0  # times real time
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
    "Motors",
    "Move",
    "Options",
    "Positions",
    "XYZ jog",
    "Lights",
    "Log",
    "Keys",
    "Names and units",
    "Virtual axes",
    "Rig file, load, terminal",
]
# What the pictures are of: (view, look)
PICTURES = [("Motors", "wide"), ("Motors", "dark"), ("Motors", "phone"), ("Move", "wide")]


def path(view, look):
    """Return the path of a view's picture."""
    return (
        FOLDER / f"{'desk' if view == 'Motors' else re.split('[ ,]', view)[0].lower()}-{look}.png"
    )


def prepare(page):
    """Give the page something to show in every view."""
    wait_connected(page)
    go_to(page, "Move")
    page.get_by_label("Open a move").set_input_files(KEYFRAMES)
    expect(page.get_by_role("article", name="Poses")).to_contain_text("Slope")
    page.wait_for_timeout(500)  # until the device has reported its speeds
    if (too_slow := page.get_by_role("button", name="Raise the speeds to fit")).is_visible():
        too_slow.click()
        expect(log(page)).to_contain_text("Speeds are set")
    go_to(page, "Virtual axes")
    for name, motor, per_unit, _, _ in AXES:
        axis = page.get_by_role("group", name=name, exact=True)
        axis.get_by_label("Motor").select_option(f"{name} (motor {motor})")
        axis.get_by_label("Steps per unit").fill(str(per_unit))
    page.get_by_label("Arm").fill("800")
    page.get_by_role("button", name="Configure").click()
    expect(log(page)).to_contain_text("configured")


def rest_on_frame(page):
    """Move the rig to the middle of its move."""
    go_to(page, "Positions")
    for name in [name for name, *_ in AXES] + [f"motor {n}" for n in range(5, MOTORS + 1)]:
        page.get_by_role("button", name=f"Set position of {name}", exact=True).click()
        expect(log(page)).to_contain_text("this position is 0")
    close_drawer(page)
    page.locator("#send").click()
    expect(page.locator("#moving")).to_contain_text(f"Play head {FRAME}.000")
    wait_rest(page)


def take(page, view, file):
    """Write the picture of the desk with a drawer."""
    go_to(page, view)
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
    device = stage.simulated(RIG, MOTORS, speed)
    device.at_board(lambda board: board.wire_switches())
    served = stage.console(device.url)
    served.server.device.name = DEVICE
    served.server.device.axes = Names()
    return served


def take_states(browser):
    """Take a picture of each state in each size and theme. Return their number."""
    from host_tests.console.states import SIZES, begun, states

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
            url = crane(stage, SPEED).url
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


if __name__ == "__main__":
    main()
