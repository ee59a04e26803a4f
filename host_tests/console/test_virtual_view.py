"""Virtual axes in the console: the drawing's numbers against the reference, the rig, jogs."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from framestep_tools.judge.virtual_reference import POSE, Axis, Rig, looks
from framestep_tools.payloads import VirtConfig
from host_tests.console import looking as ui
from host_tests.console.test_moves_view import upload

AXES = tuple(
    Axis(i + 1, n, p) for i, (n, p) in enumerate([(250, 3), (300.5, -10)] + [(80, 0.5)] * 4)
)
RIGS = [
    Rig(1, AXES, length=857.7, extension=78.0, nodal=(20.0, 35.5, -12.0)),
    Rig(1, AXES, length=857.7, table=tuple(round(300 * n - n * n / 3) for n in range(-60, 61))),
    Rig(1, AXES, length=857.7, table=tuple(-250 * n + 17 for n in range(-60, 61)), safe=2.5),
    Rig(2, (Axis(3, -500.0), Axis(2, 100.0))),
    Rig(3, AXES, length=600.0, extension=-20.0, nodal=(0.0, 50.0, 10.0)),
    Rig(4, AXES, nodal=(1.0, -2.0, 3.0), safe=250.0),
]
NAMES = ["boom", "boom-table", "falling-table", "swing-pan", "y-swing", "x-y-z"]
STEPS = [(0,) * 6, (1234, -5000, 70, 6543, -9000, 12), (-14_000, 300, -500, 10, 20, 3000)]
TABLE = [40 * n for n in range(-60, 61)]
JOINTS = [(0,) * 6, (10, 20, 30, 40, 50, 60), (-59, 170, -1000.5, -200, 89, -7)]


def of_page(rig):
    """Return a rig in the page's form."""
    axes = [
        {"motor": a.motor, "perUnit": a.steps_per_unit, "position": a.position} for a in rig.axes
    ]
    return {
        "type": rig.kind, "axes": axes, "length": rig.length, "extension": rig.extension,
        "nodal": rig.nodal, "table": rig.table, "safe": rig.safe,
    }  # fmt: skip


@pytest.mark.parametrize("rig", RIGS, ids=NAMES)
def test_the_configuration_is_packed_as_the_tools_pack_it(modules, rig):
    found = modules.evaluate(
        "async (rig) => (await import('/virtual_config.js')).packConfig(rig)", of_page(rig)
    )
    assert bytes(found) == rig.payload()
    assert VirtConfig.unpack(bytes(found)).type == rig.kind


@pytest.mark.parametrize("rig", RIGS, ids=NAMES)
def test_the_camera_is_drawn_where_the_reference_has_it(modules, rig):
    for joints in JOINTS:
        joints = joints[: len(rig.axes)]
        found = modules.evaluate(
            "async ([rig, joints]) => (await import('/kinematics.js')).pose(rig, joints)",
            [of_page(rig), joints],
        )
        track, east_west, north_south, pan, tilt, _ = rig.forward(joints)
        np.testing.assert_allclose(found["camera"], (east_west, north_south, track), atol=1e-9)
        np.testing.assert_allclose(found["looks"], looks(pan, tilt), atol=1e-12)
        np.testing.assert_allclose((found["pan"], found["tilt"]), (pan, tilt), atol=1e-9)


@pytest.mark.parametrize("rig", RIGS, ids=NAMES)
def test_steps_are_drawn_as_the_joints_that_they_are(modules, rig):
    for steps in STEPS:
        found = modules.evaluate(
            "async ([rig, at]) => (await import('/kinematics.js')).joints(rig, (n) => at[n - 1])",
            [of_page(rig), steps],
        )
        of_motors = [steps[axis.motor - 1] for axis in rig.axes]
        np.testing.assert_allclose(found, rig.joints(of_motors), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 2 3", "expected 121 numbers, a step for each degree from −60 to 60, found 3"),
        (" ".join(map(str, [*TABLE[:-1], "x"])), "expected whole numbers, found “x”"),
        (", ".join(map(str, [*TABLE[:70], *TABLE[69:120]])), "it does not from 9 to 10 degrees"),
        ("0 " * 121, "it does not from -60 to -59 degrees"),
    ],
)
def test_a_boom_table_that_is_none(modules, text, said):
    found = modules.evaluate(
        "async (text) => { const {parseTable} = await import('/virtual_config.js');"
        "try { return String(parseTable(text)); } catch (error) { return error.message; } }",
        text,
    )
    assert said in found


def pose_of(page, axis):
    pose = page.get_by_role("status", name=axis, exact=True)
    expect(pose).to_have_text(re.compile(r"\d"))  # a dash until the device has reported it
    return float(pose.text_content())


def wait_pose(page, axis, least):
    for _ in range(1000):
        if pose_of(page, axis) > least:
            return
        page.wait_for_timeout(ui.LOOK_MS)
    pytest.fail(f"{axis} is still at {pose_of(page, axis)}")


def test_a_boom_by_its_table(stage):
    page, _ = stage.opened(motors=6, speed=4.0, known=True)
    ui.go_to(page, "Virtual axes")
    page.get_by_label("Arm").fill("1000")
    page.locator("summary", has_text="Boom table").click()
    table = page.get_by_label("The boom motor's step for each degree")
    table.fill("1, 2, 3")
    page.get_by_role("button", name="Configure").click()
    expect(ui.log(page)).to_contain_text("the boom table: expected 121 numbers")
    table.fill("\n".join(map(str, TABLE)))
    page.get_by_role("button", name="Configure").click()
    expect(ui.log(page)).to_contain_text("Boom, swing, track: configured.")
    first = ui.motor(page, "Motor 1")
    ui.move_to(first, TABLE[90])
    ui.go_to(page, "XYZ jog")
    wait_pose(page, "vNS", 499.9)  # 30 degrees
    assert pose_of(page, "vNS") == pytest.approx(500, abs=0.1)
    page.reload()
    ui.wait_connected(page)
    ui.go_to(page, "Virtual axes")
    expect(page.get_by_label("The boom motor's step")).to_have_value(" ".join(map(str, TABLE)))


def test_each_type_is_configured_as_it_is_offered_on_a_board_with_few_motors(stage):
    page, _ = stage.opened(motors=4, known=True)
    ui.go_to(page, "Virtual axes")
    kinds = page.get_by_label("Type").locator("option").all_text_contents()
    assert len(kinds) == 4
    for kind in kinds:
        page.get_by_label("Type").select_option(kind)
        page.get_by_role("button", name="Configure").click()
        expect(ui.newest(page)).to_have_text(f"{kind}: configured.")


def test_a_rig_is_configured_moved_jogged_and_drawn(stage):
    page, _ = stage.opened({"jog_timeout_ms": 0}, motors=6, known=True)
    upload(page)
    ui.go_to(page, "Virtual axes")
    page.get_by_label("Type").select_option("X, Y, Z")
    for group in page.get_by_role("group").filter(has=page.get_by_label("Steps per unit")).all():
        if group.get_attribute("class") == "row":
            group.get_by_label("Steps per unit").fill("100")
    page.get_by_role("button", name="Configure").click()
    expect(ui.log(page)).to_contain_text("X, Y, Z: configured.")
    ui.go_to(page, "XYZ jog")
    for axis in POSE:
        expect(page.get_by_role("status", name=axis, exact=True)).to_have_text("0.000")

    card = page.get_by_role("article", name="vTrack")
    ui.move_to(card, 3.5, "Move to")
    expect(page.get_by_role("status", name="vTrack")).to_have_text("3.500")
    ui.wait_rest(page)

    with ui.held(page, "Jog vNS up"):
        wait_pose(page, "vNS", 1.0)
    ui.wait_rest(page)

    before = pose_of(page, "vEW")
    with ui.held(page, "Camera right"):
        ui.wait_moving(page)
        wait_pose(page, "vEW", before + 1.0)
        page.keyboard.press("Escape")
        ui.wait_rest(page)
    assert pose_of(page, "vEW") > before + 1.0

    expect(page.locator("#above")).to_contain_text("forward")
    ui.go_to(page, "Virtual axes")
    page.get_by_role("button", name="No virtual axes").click()
    ui.go_to(page, "XYZ jog")
    expect(page.get_by_role("status", name="vTrack")).to_have_text("–")
    assert page.errors == []
    assert re.search("configured", ui.log(page).text_content())
