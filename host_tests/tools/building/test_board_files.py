"""The files for a board are made once for the same sources."""

import pytest

from framestep_tools.building import board_files


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Return a cached function, with its cache and sources in a scratch folder, and the list of its
    calls."""
    calls = []
    source = tmp_path / "module.py"
    source.write_text("A = 1\n")

    def make(board, hide=False):
        calls.append((board, hide))
        return {board: bytes(range(256)), "of": source.read_bytes()}

    monkeypatch.setattr(board_files, "CACHE", tmp_path / "cache")
    monkeypatch.setattr(board_files, "ROOT", tmp_path)
    monkeypatch.setattr(board_files, "FIRMWARE", tmp_path)
    monkeypatch.setattr(board_files, "__file__", str(tmp_path / "tools" / "files.py"))
    monkeypatch.setattr(board_files, "sources", lambda: {"module.py": source})
    (tmp_path / "framestep/motion").mkdir(parents=True)
    (tmp_path / "framestep/motion/formula.py").write_text("")
    return board_files._remembered(make), calls, tmp_path


def test_the_second_time_it_is_there(made):
    remembered, calls, _ = made
    assert remembered("pico") == remembered("pico") == {"pico": bytes(range(256)), "of": b"A = 1\n"}
    assert calls == [("pico", False)]


def test_other_arguments_are_another_result(made):
    remembered, calls, _ = made
    for args in ({}, {"hide": True}):
        for board in ("pico", "pico2"):
            assert board in remembered(board, **args)
    assert len(calls) == 4


@pytest.mark.parametrize(
    "changed",
    [
        "module.py", "framestep/motion/formula.py", "framestep/protocol/declared/general.py",
        "tools/names.py", "tools/commands/flash.py", "boards/x/board.json", "boards/chips.json",
    ],
)  # fmt: skip
def test_made_anew_where_a_source_a_tool_or_a_board_changes(made, changed):
    remembered, calls, folder = made
    remembered("pico")
    path = folder / changed
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("A = 2\n")
    assert remembered("pico")["of"] == (folder / "module.py").read_bytes()
    assert len(calls) == 2


def test_a_caller_may_change_what_it_gets(made):
    remembered, _, _ = made
    remembered("pico").clear()
    assert remembered("pico")


def test_old_results_go(made, monkeypatch):
    remembered, _, folder = made
    monkeypatch.setattr(board_files, "_KEPT_RESULTS", 3)
    for i in range(5):
        remembered(str(i))
    assert len(list((folder / "cache/mpy/results").iterdir())) == 3
    assert [p.name for p in (folder / "cache/mpy").iterdir()] == ["results"], "no scratch is left"


def test_a_board_has_settings_without_their_meaning():
    """The tables on a board are those of a computer, but for the last column."""
    tables = 0
    for path, file in board_files.sources().items():
        here = file.read_text()
        if not path.startswith(board_files._SETTINGS) or "SETTINGS = {\n" not in here:
            continue
        found = {}
        for text in (here, board_files.without_meanings(here)):
            exec(compile(text, path, "exec"), names := {})
            found[text] = {key: v for key, v in names.items() if f"\n{key} = {{\n" in text}
        whole, short = found.values()
        assert whole.keys() == short.keys()
        tables += len(whole)
        for table, rows in whole.items():
            assert all(row[-1] for row in rows.values())
            assert short[table] == {key: (*row[:-1], "") for key, row in rows.items()}
    assert tables >= 10
