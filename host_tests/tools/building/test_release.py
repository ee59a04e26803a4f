"""`make release`: the parts that do not need a build of MicroPython."""

import io
import re
import zipfile

import pytest

from framestep_tools import paths
from framestep_tools.building.board_files import ROOT, board_data, board_names, image_boards
from framestep_tools.building.images import BuildError
from framestep_tools.site import release


def test_a_zip_is_the_same_for_the_same():
    files = {"b/c": b"1" * 1000, "a": b"2"}
    once = release.zipped(files, 1_700_000_000)
    assert once == release.zipped(dict(reversed(files.items())), 1_700_000_000)
    with zipfile.ZipFile(io.BytesIO(once)) as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == files


CHANGELOG = "# Changelog\n\n## 0.2.0 (2026-01-01)\n\nSecond.\n\n## 0.1.0\n\nFirst.\n"


@pytest.fixture
def nowhere(monkeypatch):
    """A clone that is not on the web."""
    for name in ("GITHUB_REPOSITORY", "GITHUB_SERVER_URL", "SITE_URL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(paths, "repository", lambda: None)


@pytest.mark.parametrize("version", ["0.3.0", "0.2", "2.0"])
def test_a_version_that_the_changelog_does_not_have_is_no_release(version):
    with pytest.raises(BuildError, match=f"CHANGELOG.md says nothing of {version}"):
        release.notes(CHANGELOG, version)


def test_this_version_has_its_changes():
    assert release.notes((ROOT / "CHANGELOG.md").read_text(), paths.version())


@pytest.mark.parametrize("version", ["0.1.0", "0.2.0"])
def test_notes_say_in_five_lines_what_to_do_and_which_file_to_take(version, nowhere):
    text = release.notes(CHANGELOG, version)
    assert text.startswith(f"# framestep {version}\n\n* ")
    assert len(re.findall(r"^\* ", text, re.MULTILINE)) == 5
    for board in board_names():
        name = board_data(board)["name"]
        ending = "uf2" if board in image_boards() else "zip"
        assert f"\n| {name} | `framestep-{board}-{version}.{ending}`" in text
    assert f"`pipx install ./framestep-{version}-py3-none-any.whl`" in text
    assert f"unpack `framestep-pages-{version}.zip`" in text
    rows = re.findall(r"^\| ([^|]+) \| `\S+uf2` \|$", text, re.MULTILINE)
    assert rows == sorted(board_data(board)["name"] for board in image_boards())
    assert "](" not in text, "a relative link leads nowhere from a release's page"


def test_links_of_the_notes_lead_to_the_site_and_the_repository(monkeypatch):
    monkeypatch.setenv("GITHUB_REPOSITORY", "Some/framestep")
    for name in ("GITHUB_SERVER_URL", "SITE_URL"):
        monkeypatch.delenv(name, raising=False)
    assert re.findall(r"\]\((.*?)\)", release.notes(CHANGELOG, "0.2.0")) == [
        "https://some.github.io/framestep/try/index.html",
        "https://some.github.io/framestep/install/index.html",
        "https://github.com/Some/framestep/blob/v0.2.0/CHANGELOG.md",
    ]


def test_documents_name_the_files_of_this_version():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    found = [
        each
        for page in pages
        for each in re.findall(r"framestep-(?:[a-z][a-z_0-9]*-)?(\d+\.\d+\.\d+)", page.read_text())
    ]
    assert len(found) >= 2
    assert set(found) == {paths.version()}
