"""The table of docs/use/rig-file.md and the schema are those that the code makes."""

import json

from framestep_tools import cli
from framestep_tools.building.board_files import ROOT
from framestep_tools.documents import rig_schema, rig_table


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
