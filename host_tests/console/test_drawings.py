"""The drawings of the page in docs/start/by-the-page.md show what the page shows."""

from xml.etree import ElementTree

from host_tests.console import drawings


def words(text):
    return " ".join(" ".join(ElementTree.fromstring(text).itertext()).split())


def test_they_show_the_page(stage, tmp_path):
    guide = (drawings.FOLDER / "by-the-page.md").read_text()
    found = dict(drawings.drawings(stage, tmp_path))
    assert len(found) == 5
    for name, text in found.items():
        kept = drawings.FOLDER / f"{name}.svg"
        assert words(text) == words(kept.read_text()), "python -m host_tests.console.drawings"
        assert f"]({kept.name})" in guide
