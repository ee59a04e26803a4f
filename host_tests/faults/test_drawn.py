"""What may be wrong with a function, and that the list can be read."""

import pytest

from host_tests.faults import drawn

SOUND = """def f(a, b):
    c = a + 1
    d = c < b
    g(a)
    return c and not d
"""


@pytest.fixture
def faults(tmp_path, monkeypatch):
    monkeypatch.setattr(drawn, "ROOT", tmp_path)
    file = tmp_path / "sound.py"
    file.write_text(SOUND)
    return drawn.candidates(file)


def test_faults_of_each_kind(faults):
    spoiled = [fault.spoiled(SOUND) for fault in faults]
    changed = {tuple(set(text.split("\n")) - set(SOUND.split("\n"))) for text in spoiled}
    assert changed == {
        ("    c = (a - 1)",),
        ("    c = a + 2",),
        ("    d = (c <= b)",),
        ("    pass",),
        ("    return (c or not d)",),
        ("    return c and d",),
        (),  # two lines in the other order
    }
    (swapped,) = [text for text in spoiled if set(text.split("\n")) == set(SOUND.split("\n"))]
    assert swapped.index("d = c") < swapped.index("c = a")


def test_a_list_is_kept(faults, tmp_path, monkeypatch):
    monkeypatch.setattr(drawn, "LIST", tmp_path / "list")
    faults[0].found = "a test"
    drawn.keep(faults)
    assert drawn.kept() == faults


def test_a_line_that_is_gone_is_reported(faults):
    with pytest.raises(SystemExit, match="draw anew"):
        faults[0].spoiled("def f(): pass")
