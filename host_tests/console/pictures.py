"""Draws each view of the console into build/console, wide and as on a phone, light and dark.

python -m host_tests.console.pictures
"""

from playwright.sync_api import expect, sync_playwright

from framestep_tools.files import ROOT
from framestep_tools.move_file import CAMERA_MOVE
from host_tests.console.conftest import FLAGS, Stage, browser_program
from host_tests.console.looking import go_to, log, wait_connected

FOLDER = ROOT / "build" / "console"
RIG = {
    "name": "crane",
    "limits": [{"low": 26}],
    "motors": [{"home": {"limit": 1, "travel": 60_000}}],
    "inputs": [{"pin": 27}, {"pin": 28}],
    "outputs": [{"pin": 22}],
}
LOOKS = {
    "wide": {"viewport": {"width": 1280, "height": 900}},
    "dark": {"viewport": {"width": 1280, "height": 900}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True},
}
VIEWS = ["Motors", "Moves", "Shoot", "Inputs, outputs, lights", "Virtual axes", "Rig file, load"]


def prepare(page):
    """A page that has something to show in every view."""
    wait_connected(page)
    go_to(page, "Moves")
    page.get_by_label("Move", exact=True).set_input_files(CAMERA_MOVE)
    page.get_by_role("button", name="Upload").click()
    expect(log(page)).to_contain_text("are uploaded")
    go_to(page, "Virtual axes")
    page.get_by_label("Arm").fill("800")
    page.get_by_role("button", name="Configure").click()
    expect(log(page)).to_contain_text("configured")


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_program(), args=FLAGS)
        stage = Stage(browser)
        try:
            device = stage.simulated(RIG, motors=6)
            device.at_board(lambda board: board.wire_switches())
            served = stage.console(device.url)
            for look, options in LOOKS.items():
                page = stage.page(served.url, **options)
                prepare(page)
                for view in VIEWS:
                    go_to(page, view)
                    name = view.split(",")[0].split(" ")[0].lower()
                    page.screenshot(path=FOLDER / f"{name}-{look}.png")
                page.close()
        finally:
            stage.close()
            browser.close()
    print(f"{len(LOOKS) * len(VIEWS)} pictures are in {FOLDER.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
