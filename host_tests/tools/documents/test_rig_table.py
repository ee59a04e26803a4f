"""docs/use/rig-file.md: its tables and the schema come from the code, and every rig file in the
documents loads."""

import json
import re

import pytest

from framestep.rig import Rig
from framestep.rig.drivers import TYPE_SETTINGS
from framestep.rig.settings import RigError
from framestep_tools import cli
from framestep_tools.building.board_files import ROOT, board_data, board_names
from framestep_tools.documents import driver_types, rig_schema, rig_table


def test_page_is_up_to_date():
    text = rig_table.PAGE.read_text()
    assert rig_table.updated(text) == text, "run python -m framestep_tools.documents.rig_table"


def test_a_changed_setting_shows(monkeypatch):
    kind, low, _, default, unit, meaning = rig_table.settings.SETTINGS["report_ms"]
    monkeypatch.setitem(
        rig_table.settings.SETTINGS, "report_ms", (kind, low, 999, default, unit, meaning)
    )
    text = rig_table.PAGE.read_text()
    assert rig_table.updated(text) != text


def test_driver_types_are_up_to_date():
    text = driver_types.PAGE.read_text()
    assert driver_types.updated(text) == text, (
        "run python -m framestep_tools.documents.driver_types"
    )
    assert all(f"| `{name}` |" in text for name in TYPE_SETTINGS)


def test_schema_is_up_to_date(capsys):
    file = ROOT / "docs/use/rig.schema.json"
    assert file.read_text(encoding="utf-8") == rig_schema.text(), (
        "run python -m framestep_tools.documents.rig_schema"
    )
    assert cli.app.status(["rig", "schema"]) == 0
    assert json.loads(capsys.readouterr().out) == rig_schema.schema()


def test_the_schema_knows_every_setting():
    found = rig_schema.schema()["properties"]
    assert set(found) == set(rig_table.settings.SETTINGS)
    motor = found["motors"]["items"]
    assert set(motor["properties"]) == set(rig_table.settings.MOTOR_SETTINGS)
    assert not motor["additionalProperties"]
    assert motor["properties"]["driver"]["required"] == ["run_ma"]
    assert motor["properties"]["pulse_us"]["minimum"] == 0.25
    assert found["outputs"]["items"]["required"] == ["pin"]
    assert found["dialect"]["enum"] == ["spec", "dmc-lite"]


def rig_files(page):
    """Return (board or None, text) of each rig file of a page. "Board: `pico`." names it."""
    lines = page.read_text().splitlines()
    board, found = None, []
    for i, line in enumerate(lines):
        if line.startswith("#"):
            board = None
        if named := re.match(r"Board: `(\w+)`", line):
            board = named[1]
        if line.startswith("    {") and not lines[i - 1].startswith("    "):
            end = next((j for j in range(i, len(lines)) if not lines[j].startswith("    ")), None)
            found.append((board, "\n".join(lines[i:end])))
    return found


SHOWN = [
    pytest.param(board, text, id=f"{page.stem}-{i}")
    for page in sorted((ROOT / "docs").rglob("*.md"))
    for i, (board, text) in enumerate(rig_files(page))
]


@pytest.mark.parametrize(("board", "text"), SHOWN)
def test_rig_files_in_the_documents_load(board, text):
    """On the board that the page names, or on any."""
    mistakes = []
    for name in [board] if board else board_names():
        try:
            Rig(json.loads(text), board_data(name))
        except RigError as error:
            mistakes.append(f"{name}: {error}")
        else:
            return
    pytest.fail("\n".join(mistakes))


def test_there_are_five_recipes():
    found = [board for board, _ in rig_files(rig_table.PAGE) if board]
    assert len(found) == 5
    assert set(found) <= set(board_names())
