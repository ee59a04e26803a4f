"""`make release`: the parts that do not need a build of MicroPython."""

import io
import zipfile

import pytest

from framestep_tools.building import release
from framestep_tools.building.board_files import board_data, board_names, image_boards
from framestep_tools.building.images import BuildError


def test_a_zip_is_the_same_for_the_same():
    files = {"b/c": b"1" * 1000, "a": b"2"}
    once = release.zipped(files, 1_700_000_000)
    assert once == release.zipped(dict(reversed(files.items())), 1_700_000_000)
    with zipfile.ZipFile(io.BytesIO(once)) as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == files


def test_a_wheel_becomes_the_same_whenever_it_was_built():
    def built(order, year):
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w") as archive:
            for name in order:
                archive.writestr(zipfile.ZipInfo(name, (year, 1, 1, 0, 0, 0)), name * 9)
        return release.same_each_time(out.getvalue(), 1_700_000_000)

    assert built(["x.py", "y/z.py"], 2020) == built(["y/z.py", "x.py"], 2024)


CHANGELOG = """# Changelog

## Unreleased

{}
## 0.2.0 (2026-01-01)

Second.

### Fixed

* A fault.

## 0.1.0

First.
"""


def changes(changelog, version):
    """Return the last part of the notes."""
    return release.notes(changelog, version).partition("## What has changed\n\n")[2]


def test_notes_have_the_changes_of_the_version():
    assert changes(CHANGELOG.format(""), "0.2.0") == "Second.\n\n### Fixed\n\n* A fault.\n"
    assert changes(CHANGELOG.format(""), "0.1.0") == "First.\n"
    assert changes(CHANGELOG.format("* New.\n"), "0.3.0") == "* New.\n"
    assert changes(CHANGELOG.format("* New.\n"), "0.1.0") == "* New.\n\nFirst.\n", (
        "what is unreleased is in the files as well"
    )
    with pytest.raises(BuildError, match=r"CHANGELOG\.md says nothing of 0\.3\.0"):
        release.notes(CHANGELOG.format(""), "0.3.0")


def test_notes_say_which_file_to_take():
    text = release.notes(CHANGELOG.format(""), "0.2.0")
    assert text.startswith("# framestep 0.2.0\n")
    for board in board_names():
        name = board_data(board)["name"]
        ending = "uf2" if board in image_boards() else "zip"
        assert f"\n| {name} | `framestep-{board}-0.2.0.{ending}` |\n" in text
    assert "`pipx install ./framestep-0.2.0-py3-none-any.whl`" in text


def test_links_of_the_notes_lead_to_the_repository(monkeypatch):
    changelog = CHANGELOG.format("* [Moves](docs/use/moves.md), [a page](https://a.example/).\n")
    monkeypatch.setenv("GITHUB_REPOSITORY", "somebody/framestep")
    monkeypatch.delenv("GITHUB_SERVER_URL", raising=False)
    assert changes(changelog, "0.3.0") == (
        "* [Moves](https://github.com/somebody/framestep/blob/v0.3.0/docs/use/moves.md), "
        "[a page](https://a.example/).\n"
    )
