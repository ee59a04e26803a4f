"""The table of docs/rig-file.md is the one that the code makes."""

from framestep_tools import rig_table


def test_page_is_up_to_date():
    text = rig_table.PAGE.read_text()
    assert rig_table.updated(text) == text, "run python -m framestep_tools.rig_table"


def test_a_changed_setting_shows(monkeypatch):
    kind, low, _, default, unit, meaning = rig_table.rig.SETTINGS["report_ms"]
    monkeypatch.setitem(rig_table.rig.SETTINGS, "report_ms", (kind, low, 999, default, unit, meaning))
    text = rig_table.PAGE.read_text()
    assert rig_table.updated(text) != text
