"""The README's table of the rig file is the one that the code makes."""

from framestep_tools import rig_table


def test_readme_is_up_to_date():
    text = rig_table.README.read_text()
    assert rig_table.updated(text) == text, "run python -m framestep_tools.rig_table"


def test_a_changed_setting_shows(monkeypatch):
    kind, low, _, default, unit, meaning = rig_table.rig.SETTINGS["report_ms"]
    monkeypatch.setitem(rig_table.rig.SETTINGS, "report_ms", (kind, low, 999, default, unit, meaning))
    text = rig_table.README.read_text()
    assert rig_table.updated(text) != text
