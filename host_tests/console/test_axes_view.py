"""Names and units in the console: shown, typed, edited and saved as axes.toml has them."""

import json

import pytest
from playwright.sync_api import expect

from framestep_tools.axes.axes_file import axes_of, camera_of
from framestep_tools.axes.rig_axes import Axes
from framestep_tools.errors import ToolError
from framestep_tools.payloads import GetExceeded, MotorGetPosition, MotorSetLimits, MotorSetSpeed
from host_tests.console import looking as ui
from host_tests.tools.move.test_scenes import glb, gltf

RIG = """# the rig
[[axis]]
name = "track"   # along the floor
motor = 1
steps_per_unit = 80
unit = "mm"
limits = [0, 1450]

[[axis]]
name = "pan"
motor = 2
steps_per_unit = 200
unit = "deg"
in_file = "Camera Pan"
zero = -90
invert = true
"""
READ = "async text => (await import('./axes.js')).parseAxes(text)"
WRITE = "async list => (await import('./axes.js')).axesText(list)"


@pytest.fixture
def rig(tmp_path):
    path = tmp_path / "axes.toml"
    path.write_text(RIG)
    return path


@pytest.fixture
def opened(stage, rig):
    """Return the page, and a device of three motors with that axes.toml."""
    device = stage.simulated({"jog_timeout_ms": 0}, motors=3, known=True)
    with device.client() as client:
        client.request(MotorSetSpeed(2, 4000, 20_000))
    page = stage.page(stage.console(device.url, axes=rig).url)
    expect(page.get_by_label("Position of pan in deg")).to_have_text("-90.000°")
    return page, device


def test_positions_and_moves_in_units(opened):
    page, _ = opened
    expect(ui.motor(page, "track")).to_contain_text("1 track")
    expect(ui.position(page, 3)).to_have_text("0")
    pan = ui.motor(page, "pan")
    ui.move_to(pan, -88.5, "Move to, deg")
    expect(page.get_by_label("Position of pan in deg")).to_have_text("-88.500°")
    expect(ui.position(page, 2)).to_have_text("-300")
    for by, at in (("+1°", "-500"), ("+0.1°", "-520"), ("−1°", "-320")):
        pan.get_by_role("button", name=f"Move pan by {by}", exact=True).click()
        expect(ui.position(page, 2)).to_have_text(at)
    ui.wait_rest(page)
    track = ui.motor(page, "track")
    ui.move_to(track, 1450.5, "Move to, mm")
    expect(ui.log(page)).to_contain_text(
        "track: 1450.5 mm is beyond its limits of 0 to 1450 mm (axes.toml)."
    )
    expect(ui.position(page, 1)).to_have_text("0")
    expect(page.locator("#moving")).to_contain_text("Nothing moves")


def test_a_phone_shows_one_motors_names_and_units(stage, opened):
    page, _ = opened
    page.set_viewport_size({"width": 390, "height": 844})
    ui.go_to(page, "Names and units")
    shown = page.locator("fieldset:visible")
    expect(shown).to_have_count(1)
    which = page.get_by_role("region", name="Names and units").get_by_label("Motor", exact=True)
    which.select_option("2 pan")
    expect(shown.get_by_label("Name")).to_have_value("pan")
    shown.get_by_label("Steps per unit").fill("0")
    which.select_option("1 track")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(shown.get_by_label("Name")).to_have_value("pan")  # the one that is wrong


def test_up_is_where_the_position_rises(opened):
    page, _ = opened
    with ui.held(page, "Jog pan up"):
        expect(page.locator("#moving")).to_contain_text("pan moves")
        expect(ui.position(page, 2)).not_to_have_text("0")
    ui.wait_rest(page)
    assert ui.steps(page, 2) < 0
    page.keyboard.press("1")
    page.keyboard.down("ArrowRight")
    expect(page.locator("#moving")).to_contain_text("track moves")
    expect(ui.position(page, 1)).not_to_have_text("0")
    page.keyboard.up("ArrowRight")
    ui.wait_rest(page)
    assert ui.steps(page, 1) > 0


def test_settings_in_units_reach_the_device(opened):
    page, device = opened
    pan = ui.settings(page, "pan")
    expect(pan.get_by_label("Velocity, deg/s")).to_have_value("20")  # 4000 steps/s
    pan.get_by_label("Velocity, deg/s").fill("30")
    pan.get_by_role("button", name="Set speed").click()
    pan.get_by_label("Call this position, deg").fill("-45")
    pan.get_by_role("button", name="Set position").click()
    expect(ui.log(page)).to_contain_text("pan: this position is -45° (-9000) now.")
    pan.get_by_label("Lower soft limit").check()
    pan.get_by_label("Lower, deg").fill("-60")
    pan.get_by_label("Upper soft limit").check()
    pan.get_by_label("Upper, deg").fill("-30")
    pan.get_by_role("button", name="Set limits").click()
    expect(ui.row(page, "pan").locator(".ends")).to_have_text("-60°-30°")
    pan = ui.motor(page, "pan")
    ui.move_to(pan, -20, "Move to, deg")
    expect(ui.log(page)).to_contain_text(
        "Refused: -20° (-14000) is past the lower soft limit of pan, -30° (-12000)"
    )
    page.close()
    with device.client() as client:
        found = client.request(GetExceeded(2))
        assert (found.velocity, found.lower, found.upper) == (6000, -12_000, -6000)
        assert client.request(MotorGetPosition()).steps[1] == -9000


def test_the_bar_shows_the_position_between_its_limits(opened, stage):
    page, device = opened
    track = ui.motor(page, "track")
    expect(ui.row(page, "track").locator(".ends")).to_have_text("0 mm1450 mm")
    mark = ui.row(page, "track").locator(".now")
    expect(mark).to_have_attribute("style", "left: 0%;")
    ui.move_to(track, 14.5, "Move to, mm")
    expect(mark).to_have_attribute("style", "left: 1%;")
    expect(ui.row(page, "Motor 3").locator(".bar")).to_be_hidden()
    page.close()
    with device.client() as client:
        client.request(MotorSetLimits(3, 1, -100, 1, 300, 0))
    other = stage.page(page.url)
    expect(ui.row(other, "Motor 3").locator(".ends")).to_have_text("-100 steps300 steps")
    expect(ui.row(other, "Motor 3").locator(".now")).to_have_attribute("style", "left: 25%;")


def test_names_are_edited_and_saved(opened, rig):
    page, _ = opened
    ui.go_to(page, "Names and units")
    third = page.get_by_role("group", name="Motor 3", exact=True)
    third.get_by_label("Name").fill("pan")
    third.get_by_label("Unit", exact=True).select_option("cm")
    third.get_by_label("Steps per unit").fill("12.5")
    save = page.get_by_role("button", name="Save")
    save.click()
    expect(ui.log(page)).to_contain_text("“name”: pan occurs twice")
    assert rig.read_text() == RIG
    third.get_by_label("Name").fill("lift")
    third.get_by_label("Limits").check()
    third.get_by_label("Lowest").fill("-4")
    third.get_by_label("Highest").fill("4.5")
    save.click()
    expect(ui.log(page)).to_contain_text(f"Names and units are saved in {rig}.")
    found = Axes(axes_of(rig.read_text(), rig))
    assert (found.motor("lift"), found.steps(3, "1cm")) == (3, 12)
    assert found.axis(2) == axes_of(RIG, rig)[1], "keys for files of other programs are kept"
    assert found.axis(3).limits == (-4, 4.5)
    ui.go_to(page, "Motors")
    expect(page.get_by_label("Position of lift in cm")).to_have_text("0.00 cm")


def test_a_file_with_a_mistake_is_reported_and_kept(stage, rig):
    rig.write_text("[[axis]]\nname = 5\n")
    device = stage.simulated(motors=1)
    served = stage.console(device.url, axes=rig)
    page = stage.page(served.url)
    expect(ui.log(page)).to_contain_text('"name": expected a text, found 5; the page shows steps.')
    expect(ui.position(page)).to_have_text("0")
    with pytest.raises(ToolError, match="not valid TOML"):
        served.server.device.axes.write("[[axis")
    assert rig.read_text() == "[[axis]]\nname = 5\n"
    assert page.errors == []


def test_without_a_server_the_browser_keeps_them(stage, tmp_path, rig):
    saved = stage.saved(tmp_path / "page")
    page = stage.page(saved.url)
    ui.go_to(page, "Names and units")
    camera = '[camera]  # the page keeps it\ntype = "X-Y-Z"\norigin = [\n  1, 2,\n  3]\n'
    rig.write_text(RIG.replace("[[axis]]", camera + "[[axis]]", 2).replace(camera, "", 1))
    page.get_by_label("Take another axes.toml").set_input_files(rig)
    expect(ui.log(page)).to_contain_text("axes.toml: names and units are in use.")
    first = page.get_by_role("group", name="Motor 1", exact=True)
    first.get_by_label("Position at step 0").fill("-5")
    page.get_by_role("button", name="Save").click()
    expect(ui.log(page)).to_contain_text("Names and units are saved in this browser.")
    with page.expect_download() as download:
        page.get_by_role("button", name="Download").click()
    text = download.value.path().read_text()
    assert [(axis.name, axis.zero) for axis in axes_of(text, "it")] == [("track", -5), ("pan", -90)]
    assert camera in text
    assert camera_of(text, "it") == {"type": "X-Y-Z", "origin": [1, 2, 3]}
    page.reload()
    ui.go_to(page, "Names and units")
    expect(first.get_by_label("Name")).to_have_value("track")
    expect(first.get_by_label("Position at step 0")).to_have_value("-5")
    assert page.errors == []


def test_the_page_reads_and_writes_the_file_as_the_commands_do(stage, tmp_path):
    saved = stage.saved(tmp_path / "page")
    page = stage.page(saved.url)
    good = [
        RIG,
        '[[ axis ]]\nname="a b"\nmotor=1\nsteps_per_unit=1_000.5e-1#\nlimits=[-1,2.5,]\n',
        "[[axis]]\r\nname = 'it'\r\nmotor = +7\r\nsteps_per_unit = 0.5\r\ninvert = false\r\n",
        '[[axis]]\nname = "t\\u00e9\\"x"\nmotor = 2\nsteps_per_unit = 3\nfile_unit = "units"\n',
    ]
    for text in good:
        expected = axes_of(text, "it")
        found = page.evaluate(READ, text)
        assert axes_of(page.evaluate(WRITE, found), "it") == expected, text
    for text in (
        "", "name = 3\n", "[[axis]]\nname\n", RIG + "motor = 3\n", RIG + "[other]\n",
        RIG + "speed = 3\n", RIG.replace("80", "0"), RIG.replace('"mm"', '"yard"'),
        RIG.replace("[0, 1450]", "[5, 5]"), RIG.replace("[0, 1450]", "[0, 1450"),
        RIG.replace("motor = 2", "motor = 1"), RIG.replace("true", "1"), RIG + "hold = 3 4\n",
        RIG.replace("steps_per_unit = 200\n", ""), RIG.replace('"pan"', '"pan'),
    ):  # fmt: skip
        with pytest.raises(ToolError):
            axes_of(text, "it")
        said = page.evaluate(f"text => ({READ})(text).catch(error => error.constructor.name)", text)
        assert said == "AxesError", text


def test_the_bridge_accepts_no_text_without_a_file(stage):
    device = stage.simulated(motors=1)
    page = stage.page(stage.console(device.url).url)
    expect(ui.position(page)).to_have_text("0")
    assert ui.steps(page) == 0
    ui.go_to(page, "Names and units")
    page.get_by_role("group", name="Motor 1", exact=True).get_by_label("Name").fill("track")
    page.get_by_role("button", name="Save").click()
    expect(ui.log(page)).to_contain_text("saved in this browser")
    assert not any("write_axes" in json.dumps(str(sent)) for sent in page.sent)


def test_another_programs_move(opened):
    """The page asks framestep console, which converts it by axes.toml."""
    page, _ = opened
    ui.go_to(page, "Move")
    text = "# 25 fps\nAxes = Camera Pan, Track\n-90,5 10\n-91,0 20\n"
    ui.open_move(page, "shot.kup", text)
    expect(page.locator("main")).to_contain_text(
        "shot.kup: frames 1 to 2 at 25 frames/s for 2 motors"
    )
    expect(page.get_by_label("Frames per second").first).to_have_value("25")
    ui.close_drawer(page)
    page.keyboard.press("End")
    page.locator("#send").click()
    expect(ui.log(page)).to_contain_text("Frames 1 to 2 for 2 motors are uploaded.")
    expect(ui.position(page, 1)).to_have_text("1600")
    expect(ui.position(page, 2)).to_have_text("200")
    ui.wait_rest(page)


def test_poses_and_files_that_are_no_text(opened, rig):
    """Scenes in binary, JSON that is no keyframes, and letters in Latin-1 go to the server."""
    page, _ = opened
    rig.write_text(
        RIG.replace("limits = [0, 1450]", "") + '[camera]\ntype = "X-Y-Z"\nx = "track"\n'
    )
    ui.go_to(page, "Move")
    tracks = [(0, "translation", "LINEAR", [[0, 0, 0], [0.01, 0, 0], [0.03, 0, 0]])]
    scene, _ = gltf(tracks)
    binary = glb(*gltf(tracks, uri=""))
    page.get_by_label("Frames per second").first.fill("25")
    page.get_by_label("Frames per second").first.press("Tab")
    files = [
        ("shot.gltf", json.dumps(scene).encode(), "frames 1 to 3"),
        (
            "shot.kup",
            "# S\u00fcd\nAxes = Camera Pan, Track\n-90 10\n".encode("latin-1"),
            "frames 1",
        ),
        ("shot.glb", binary, "frames 1 to 3"),
    ]
    for name, content, said in files:
        ui.open_move(page, name, content)
        expect(page.locator("main")).to_contain_text(f"{name}: {said}")
    page.get_by_label("Export the move as").select_option("chan")
    page.get_by_label("The camera's pose, not the axes").check()
    with page.expect_download() as download:
        page.get_by_role("button", name="Export", exact=True).click()
    rows = [line.split() for line in download.value.path().read_text().splitlines()]
    assert [float(row[1]) for row in rows] == [0, 10, 30]
    assert page.errors == []
