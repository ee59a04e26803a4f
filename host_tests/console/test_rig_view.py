"""The rig file on the page: comments, the schema's checks and its help."""

import json

import pytest
from playwright.sync_api import expect

from framestep_tools.board import rig_file
from framestep_tools.building.board_files import ROOT
from host_tests.console.looking import go_to

EXAMPLES = sorted(ROOT.glob("boards/*/rig.json"))
COMMENTED = [
    '{"name": "a // b", // a comment\n "estop": "nc"}\n',
    "\ufeff// first\n{}",
    '{"name": "\\"//\\\\", // "x"\n\n "motors": [{}] }',
    '// nothing\n\n{\n// "dmx": false\n}\n',
]
MISTAKES = [
    ({"nme": "x"}, "nme: no such setting; there are name, dialect"),
    ({"motor_count": 99}, "motor_count: found 99, allowed is 0 to 24"),
    ({"motor_count": "2"}, 'motor_count: found "2", allowed is 0 to 24'),
    ({"motor_count": 1.5}, "motor_count: found 1.5"),
    ({"dmx": 1}, "dmx: found 1, allowed is true, false"),
    ({"dialect": "dmc"}, 'dialect: found "dmc", allowed is "spec", "dmc-lite"'),
    ({"name": "ü" * 17}, "allowed is 1 to 32 bytes of text"),
    ({"name": None}, "name: found null"),
    ({"motors": [{}] * 25}, "motors: found 25, allowed is a list of at most 24"),
    ({"motors": [{}, {"jerk": -1}]}, "motors[2].jerk: found -1"),
    ({"motors": [{"pulse_us": 50.5}]}, "motors[1].pulse_us: found 50.5, allowed is 0.25 to 50"),
    ({"motors": [{"home": {"limit": 1}}]}, "motors[1].home.travel: is missing"),
    ({"motors": [3]}, "motors[1]: found 3, allowed is an object"),
    ({"limits": {}}, "limits: found {}, allowed is a list"),
]
MISTAKE = """async (given) => {
    const {mistake} = await import('/rig_text.js');
    const schema = await (await fetch('/rig.schema.json')).json();
    return mistake(given, schema);
}"""
WARNINGS = """async (given) => (await import('/rig_text.js')).warnings(given)"""
BARE = """async (text) => {
    const {bareRig} = await import('/rig_text.js');
    try { return bareRig(text); } catch (error) { return error.message; }
}"""


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.parent.name)
def test_a_right_rig_file_has_no_mistake(modules, example):
    assert modules.evaluate(MISTAKE, json.loads(example.read_text())) is None


@pytest.mark.parametrize(("settings", "said"), MISTAKES, ids=lambda value: str(value)[:30])
def test_a_mistake_is_reported_with_its_key(modules, settings, said):
    assert said in modules.evaluate(MISTAKE, settings)


@pytest.mark.parametrize(
    "motors",
    [
        [{}, {"type": "tb6600", "pulse_us": 2, "hold_us": 20}],
        [{"type": "cl57t", "enable_ms": 200}, {"type": "a4988", "setup_us": 0.1}],
        [{"type": "tb6600", "enable_high": True}, {"pulse_us": 0.5}],
    ],
)
def test_it_warns_of_what_the_tools_warn_of(modules, motors):
    given = {"motors": motors}
    found = modules.evaluate(WARNINGS, given)
    assert found == rig_file.warnings(given, {"enable": list(range(8))})
    assert len(found) == sum("type" in motor and "enable_high" not in motor for motor in motors)


@pytest.mark.parametrize("text", COMMENTED)
def test_comments_are_left_out_as_the_tools_leave_them_out(modules, text):
    bare = modules.evaluate(BARE, text)
    assert json.loads(bare) == rig_file.parse(rig_file.for_board(text.encode()), "rig.json")


@pytest.mark.parametrize("text", ["", "{", "[1]", "null", '{"name": "x" / 2}'])
def test_what_is_no_rig_file(modules, text):
    assert modules.evaluate(BARE, text).startswith("rig.json: ")


def test_the_schema_helps(stage):
    """It shows every setting with its meaning, what is allowed, and its default."""
    page = stage.connected(stage.console(stage.simulated(motors=1).url).url)
    go_to(page, "Rig file, load, terminal")
    page.locator("summary", has_text="All settings").click()
    rows = page.get_by_role("row")
    row = rows.filter(has=page.get_by_text("motors[].home.back_off", exact=True))
    expect(row).to_contain_text("from the switch back to where it is surely open")
    expect(row).to_contain_text("1 to 1000000")
    expect(row.get_by_role("cell").last).to_have_text("200")
    assert rows.count() > 60
    expect(page.get_by_role("button", name="Put onto the board")).to_be_disabled()
    expect(page.locator("main")).to_contain_text("this device shows no port for it")
