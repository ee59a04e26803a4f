"""Draws each view of the console for the documents: wide, dark, on a phone, as text of a few kB.

python -m host_tests.console.pictures
"""

import re
from pathlib import Path

from playwright.sync_api import expect, sync_playwright

from framestep_tools.building.board_files import ROOT
from framestep_tools.move.move_file import CAMERA_MOVE
from host_tests.console.conftest import FLAGS, Stage, browser_program
from host_tests.console.looking import go_to, log, wait_connected, wait_rest

FOLDER = ROOT / "docs/use/console"
DRAWING = Path(__file__).with_name("drawing.js")
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
FRAME = 120  # of the camera move, for the pictures
WIDTH, TALLEST = 1280, 2600
LOOKS = {
    "wide": {"viewport": {"width": WIDTH, "height": 900}},
    "dark": {"viewport": {"width": WIDTH, "height": 900}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True},
}
VIEWS = [
    "Motors",
    "Moves",
    "Keyframes",
    "Shoot",
    "Inputs, outputs, lights",
    "Virtual axes",
    "Names, units",
    "Rig file, load",
]
# Views that are also drawn dark, because they contain drawings
DARK = ["Moves", "Keyframes", "Virtual axes"]
# What the pictures are of: (view, look)
PICTURES = [(view, look) for look in LOOKS for view in VIEWS if look != "dark" or view in DARK]


def path(view, look):
    """Return the path of a view's picture."""
    return FOLDER / f"{re.split('[ ,]', view)[0].lower()}-{look}.svg"


def prepare(page):
    """Give the page something to show in every view."""
    wait_connected(page)
    go_to(page, "Moves")
    page.get_by_label("Move", exact=True).set_input_files(CAMERA_MOVE)
    page.get_by_role("button", name="Upload").click()
    expect(log(page)).to_contain_text("are uploaded")
    go_to(page, "Keyframes")
    page.get_by_label("Open keyframes").set_input_files(KEYFRAMES)
    expect(page.get_by_role("article", name="Poses")).to_contain_text("Frame")
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
    go_to(page, "Moves")
    page.get_by_label("Go to frame").fill(str(FRAME))
    page.get_by_role("button", name="Go there").click()
    expect(page.locator("#moving")).to_contain_text(f"Play head {FRAME}.000")
    wait_rest(page)


def draw(page, view, look):
    """Return the picture of a view, as SVG: as tall as the view, except on a phone."""
    go_to(page, view)
    before = page.viewport_size
    if look != "phone":
        tall = page.evaluate("document.documentElement.scrollHeight")
        page.set_viewport_size({"width": WIDTH, "height": min(tall, TALLEST)})
    picture = page.evaluate(DRAWING.read_text())
    page.set_viewport_size(before)
    return picture


def parts(picture):
    """Return the parts of a view when its picture was drawn."""
    return re.search("<desc>(.*)</desc>", picture)[1].split("; ")


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


def main():
    FOLDER.mkdir(exist_ok=True)
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
                    path(view, look).write_text(draw(page, view, look))
                page.close()
        finally:
            stage.close()
            browser.close()
    print(f"{len(PICTURES)} pictures are in {FOLDER.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
