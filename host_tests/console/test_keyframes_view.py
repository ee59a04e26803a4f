"""Keyframes in the console: a move made on the page, its files, and frames shot at intervals."""

import json
import math
from itertools import pairwise

import pytest
from playwright.sync_api import expect

from framestep.motors.rates import DEFAULT_VELOCITY
from framestep_tools.axes.axes_file import read_axes
from framestep_tools.console.move_requests import MoveWork
from framestep_tools.errors import ToolError
from framestep_tools.move.move_conversion import to_table
from framestep_tools.move.move_file import read_move
from framestep_tools.move.move_formats import FORMATS, WITH_RATE
from framestep_tools.payloads import MotorResetPosition
from host_tests.console import looking as ui
from host_tests.console.test_moves_view import send, stand

AXES = """[[axis]]
name = "track"
motor = 1
steps_per_unit = 10
unit = "mm"
in_file = "camera1.translateX"

[[axis]]
name = "pan"
motor = 2
steps_per_unit = 100
unit = "deg"
in_file = "camera1.rotateY"
invert = true
"""
READ = """async text => {
    const { Keyframes } = await import('./keyframes.js');
    const found = new Keyframes();
    found.read(text);
    return found.toMove(found.all[0].steps.map((_, i) => `m${i}`)).positions;
}"""
PARTS = """async ([text, motor, frames]) => {
    const { Keyframes } = await import('./keyframes.js');
    const found = new Keyframes();
    found.read(text);
    return frames.map((frame) => found.position(frame, motor));
}"""


@pytest.fixture
def opened(stage, tmp_path):
    """Return the page, and a device of two motors with an axes.toml."""
    path = tmp_path / "axes.toml"
    path.write_text(AXES)
    device = stage.simulated(motors=2, speed=3.0, known=True)
    with device.client() as client:
        client.request(MotorResetPosition(1, 50))
    page = stage.page(stage.console(device.url, axes=path).url)
    expect(page.get_by_label("Position of track in mm")).to_have_text("5.0 mm")
    ui.go_to(page, "Move")
    yield page, device
    assert page.errors == []


def fill(page, label, value):
    field = page.get_by_label(label, exact=True)
    field.fill(str(value))
    field.press("Tab")


def keyframes(page):
    """Return what the browser keeps."""
    return json.loads(page.evaluate("localStorage.getItem('keyframes')"))["keyframes"]


def keep(page, frame):
    ui.card(page, "Keyframe").get_by_label("Frame", exact=True).fill(str(frame))
    ui.card(page, "Keyframe").get_by_role("button", name="Keyframe here").click()
    expect(ui.newest(page)).to_have_text(f"Frame {frame} is a keyframe.")


def two(page):
    """Make two keyframes: track from 0 to 24 mm, pan from 0 to 4.8 degrees."""
    keep(page, 1)
    fill(page, "track, frame 1", 0)
    keep(page, 25)
    fill(page, "track, frame 25", 24)
    fill(page, "pan, frame 25", 4.8)


def test_a_move_from_poses_to_the_rig(opened):
    page, _ = opened
    keep(page, 1)
    assert keyframes(page)[0]["steps"] == [50, 0]
    fill(page, "track, frame 1", 0)
    keep(page, 25)
    fill(page, "track, frame 25", 24)
    fill(page, "pan, frame 25", 4.8)
    assert keyframes(page)[1]["steps"] == [240, -480]
    page.get_by_label("To the next, frame 1").select_option("linear")
    preview = ui.card(page, "Needs")
    preview.get_by_role("button", name="Check as the board would").click()
    expect(preview.get_by_label("Verdict")).to_contain_text("motor 1, track: fits")
    expect(preview.get_by_label("Verdict")).to_contain_text("24 mm/s (240 steps/s)")
    ui.close_drawer(page)
    send(page, 13)
    expect(ui.log(page)).to_contain_text("Frames 1 to 25 for 2 motors are uploaded.")
    expect(page.get_by_label("Position of motor 1 in steps")).to_have_text("120")
    expect(page.get_by_label("Position of motor 2 in steps")).to_have_text("-240")
    ui.go_to(page, "Move")
    page.get_by_label("Go to the pose, frame 25").click()
    expect(page.get_by_label("Position of motor 2 in steps")).to_have_text("-480")
    page.reload()
    ui.wait_connected(page)
    assert len(keyframes(page)) == 2


def test_a_move_that_is_too_fast_says_so_as_the_command_does(opened):
    page, _ = opened
    two(page)
    fill(page, "track, frame 25", 2400)
    preview = ui.card(page, "Needs")
    expect(preview.get_by_role("row", name="track")).to_contain_text("too little")
    preview.get_by_role("button", name="Check as the board would").click()
    expect(preview.get_by_label("Verdict")).to_contain_text("motor 1, track: refused:")
    expect(preview.get_by_label("Verdict")).to_contain_text(f"set {DEFAULT_VELOCITY}")
    fill(page, "track, frame 25", 24)
    expect(preview.get_by_label("Verdict")).to_be_empty()


def drag(page, mark, down):
    """Drag a mark down by that many pixels."""
    ui.wait_drawn(page)
    mark.hover()
    place = mark.bounding_box()
    x, y = place["x"] + place["width"] / 2, place["y"] + place["height"] / 2
    page.mouse.down()
    page.mouse.move(x, y + down / 2)
    page.mouse.move(x, y + down)
    page.mouse.up()


def test_curves_are_bent_by_their_handles_and_undo_takes_it_back(opened):
    page, _ = opened
    two(page)
    before = keyframes(page)
    drag(page, page.locator("circle.handle").first, -40)
    slope = keyframes(page)[0]["slopes"][0]
    assert slope > 1
    assert float(page.get_by_label("Slope of track, frame 1").input_value()) == pytest.approx(
        slope / 10, abs=1e-3
    )
    fill(page, "Slope of track, frame 1", 0.5)
    assert keyframes(page)[0]["slopes"] == [5, None]
    drag(page, page.locator("rect.key").last, 60)
    moved = keyframes(page)[1]
    assert moved["frame"] == 25
    assert moved["steps"][0] < 200
    assert moved["steps"][1] == -480
    for _ in range(3):
        page.get_by_role("button", name="Undo").click()
    assert keyframes(page) == before


def test_the_table_moves_and_removes_keyframes(opened):
    page, _ = opened
    two(page)
    keep(page, 40)
    fill(page, "Frame, frame 40", 25)
    expect(ui.newest(page)).to_have_text("Frame 25 has a keyframe already.")
    expect(page.get_by_label("Frame, frame 40", exact=True)).to_have_value("40")
    fill(page, "Frame, frame 40", 12)
    assert [key["frame"] for key in keyframes(page)] == [1, 12, 25]
    page.get_by_label("Remove the keyframe, frame 12").click()
    page.get_by_label("Remove the keyframe, frame 25").click()
    expect(page.locator("main")).to_contain_text("No move yet: a move takes two keyframes or more.")
    expect(page.locator("#ready")).to_be_disabled()


def text(*keys, fps=24):
    return json.dumps({"framestep keyframes": 1, "fps": fps, "keyframes": list(keys)})


def key(frame, *steps, **more):
    return {"frame": frame, "steps": list(steps), **more}


def test_the_shapes_of_curves(stage):
    page = stage.page(stage.console(stage.simulated().url).url)
    keys = [
        key(0, 0, to_next="ease"), key(10, 1000, to_next="linear"), key(20, 3000, to_next="cubic"),
        key(40, 5000, to_next="cubic"), key(50, 8000, to_next="hold"), key(60, 0, to_next="cubic"),
        key(70, 500, to_next="cubic"), key(80, -500),
    ]  # fmt: skip
    (found,) = page.evaluate(READ, text(*keys))
    assert len(found) == 81
    assert [found[each["frame"]] for each in keys] == [each["steps"][0] for each in keys]
    # ease: the smooth step, 3x² - 2x³
    assert found[:11] == [round(1000 * (3 * x**2 - 2 * x**3)) for x in (i / 10 for i in range(11))]
    assert found[10:21] == list(range(1000, 3001, 200))
    assert set(found[50:60]) == {8000}
    assert all(one <= other for one, other in pairwise(found[20:51]))
    assert max(found[60:]) == 500  # it turns at the keyframe and does not pass it

    def slope(frame, side):
        near = [frame + side * 1e-6, frame]
        ends = page.evaluate(PARTS, [text(*keys), 0, near])
        return (ends[0] - ends[1]) / (near[0] - near[1])

    for frame, expected in ((20, 200), (40, 1 / ((40 / 100 + 50 / 300) / 90)), (50, 0), (70, 0)):
        assert slope(frame, -1) == pytest.approx(expected, abs=0.01)
    for frame, expected in ((20, 200), (40, 1 / ((40 / 100 + 50 / 300) / 90)), (70, 0)):
        assert slope(frame, 1) == pytest.approx(expected, abs=0.01)
    # a slope that is set holds on both sides
    keys[3]["slopes"] = [50]
    assert slope(40, -1) == pytest.approx(50, abs=0.01)
    assert slope(40, 1) == pytest.approx(50, abs=0.01)


BAD_FILES = [
    ("{", "this is no JSON"),
    ("[]", 'expected "framestep keyframes": 1'),
    (text(fps=0), "“fps”: expected a number from 0.001 to 1000, found 0"),
    (text(key(1, 5, to_next="bounce")),
     'keyframe 1: “to_next”: expected one of cubic, ease, linear, hold, found "bounce"'),
    (text(key(1.5, 5)), "keyframe 1: “frame”: expected a whole number from -1000000"),
    (text(key(1, 2**31)), "keyframe 1: “steps”: expected a whole number of 32 bits"),
    (text(key(1, 5), key(1, 6)), "frame 1 has two keyframes"),
    (text(key(1, 5), key(2, 6, 7)), "frame 2: expected 1 positions as in the first keyframe"),
    (text(key(1, 5, speed=3)),
     "keyframe 1: no key “speed”; there are frame, to_next, steps, slopes"),
    (text(key(1, 5, slopes=["a"])),
     "keyframe 1: “slopes”: expected a number or null for each motor"),
]  # fmt: skip


def test_a_file_without_keyframes_changes_nothing(opened):
    page, _ = opened
    keep(page, 7)
    for content, said in BAD_FILES:
        ui.open_move(page, "bad.json", content)
        expect(ui.newest(page)).to_contain_text(f"bad.json: {said}")
        assert [each["frame"] for each in keyframes(page)] == [7]


def test_files_go_out_and_come_back(opened, tmp_path):
    page, _ = opened
    two(page)
    rate = page.get_by_label("Frames per second")
    rate.fill("30")
    rate.press("Tab")
    fill(page, "Slope of track, frame 1", 0.5)
    files = ui.card(page, "Files")
    with page.expect_download() as saved:
        files.get_by_role("button", name="Save the keyframes").click()
    kept = keyframes(page)
    exported = {}
    for name in ("steps", *FORMATS):
        files.get_by_label("Export the move as").select_option(name)
        if name in ("ae", "aejson", "bvh", "chan", "gltf", "usd"):  # they have no such axes
            files.get_by_role("button", name="Export").click()
            expect(ui.newest(page)).to_contain_text("found 'camera1.translateX': name one")
            continue
        with page.expect_download() as download:
            files.get_by_role("button", name="Export").click()
        exported[name] = download.value.path().read_bytes().decode()
    steps = tmp_path / "steps.csv"
    steps.write_text(exported.pop("steps"))
    move = read_move(steps)
    assert (move.start_frame, move.end_frame) == (1, 25)
    assert move.positions[1][0] == 0
    assert move.positions[1][-1] == 240
    table = to_table(move, read_axes(tmp_path / "axes.toml", every_motor=True))
    for name, content in exported.items():
        assert content == FORMATS[name].write(table, 30 if name in WITH_RATE else None)
    page.get_by_label("Remove the keyframe, frame 1").click()
    page.get_by_label("Open a move").set_input_files(saved.value.path())
    expect(page.get_by_label("Frame, frame 1", exact=True)).to_have_value("1")
    assert keyframes(page) == kept
    expect(rate).to_have_value("30")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("", "no JSON"),
        ("3", "no JSON object"),
        ('{"start": 1, "positions": []}', "sent no move"),
        ('{"start": 1, "positions": [[1], [1, 2]]}', "sent no move"),
        ('{"start": 1, "positions": [[1.5]]}', "sent no move"),
        ('{"start": 1, "positions": [[true]]}', "sent no move"),
        ('{"start": 1, "positions": [[1]], "fps": "a"}', "expected frames per second"),
        ('{"start": 1, "positions": [[1]]}', "asked for no move"),
        ('{"start": 1, "positions": [[1]], "fps": 1, "set": [{"speed": 1}]}', "asked for no move"),
        (
            '{"start": 1, "positions": [[1]], "fps": 1, "set": [], "motors": 1, "frames": 1}',
            "asked for no move",
        ),
    ],
)
def test_a_request_that_is_none(asked, said):
    with pytest.raises(ToolError, match=said):
        MoveWork(None).check_move(asked)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('"format": "odd"', "the format is one of gltf"),
        ('"format": "arc"', "there is no axes.toml"),
    ],
)
def test_an_export_that_cannot_be(more, said):
    with pytest.raises(ToolError, match=said):
        MoveWork(None).export_move('{"start": 1, "positions": [[1]], ' + more + "}")


def upload(page):
    two(page)
    ui.close_drawer(page)
    send(page, 1)
    expect(ui.newest(page)).to_contain_text("are uploaded")
    page.get_by_role("button", name="Frames", exact=True).click()
    page.get_by_label("Exposure, ms").fill("100")
    page.get_by_role("button", name="Time-lapse").click()


def timelapse(page, **fields):
    shots = page.locator('#fields [data-mode="lapse"]')
    for label, value in fields.items():
        shots.get_by_label(label.replace("_", " "), exact=True).fill(str(value))
    return page.locator("#go")


def test_a_timelapse(opened):
    page, _ = opened
    upload(page)
    timelapse(page, From_frame=5, To_frame=3, Seconds_from_picture_to_picture=1).click()
    expect(ui.newest(page)).to_have_text("All 3 frames are shot.")
    ui.wait_rest(page)
    said = ui.log(page).locator("p span").all_text_contents()[:4]
    assert said[1:] == [f"The shot of frame {frame} is over." for frame in (3, 4, 5)]
    assert math.isclose(stand(page)[0], 10 * keyframe_at(page, 3), abs_tol=1)


def keyframe_at(page, frame):
    """Return where track is at a frame, in mm."""
    return 24 * page.evaluate("x => x * x * (3 - 2 * x)", (frame - 1) / 24)


def test_stop_ends_a_timelapse(opened):
    page, _ = opened
    upload(page)
    shoot = timelapse(page, From_frame=1, To_frame=9, Seconds_from_picture_to_picture=60)
    shoot.click()
    expect(ui.log(page)).to_contain_text("The shot of frame 1 is over.")
    expect(shoot).to_be_disabled()
    page.keyboard.press("Escape")
    expect(ui.newest(page)).to_have_text("Frames 1 to 1 are shot; 8 are not, from frame 2 on.")
    expect(shoot).to_be_enabled()


def test_a_timelapse_that_is_too_quick_says_so(opened):
    page, _ = opened
    upload(page)
    timelapse(page, From_frame=1, To_frame=3, Seconds_from_picture_to_picture=0).click()
    expect(ui.newest(page)).to_contain_text("All 3 frames are shot. 2 of them later than")
