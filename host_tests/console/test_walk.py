"""The first minute: from the front page of the site to a rig that moves, with nothing but the
page."""

import time
from collections.abc import Iterator
from pathlib import Path

from framestep_tools.site import documents, try_page
from host_tests.console.conftest import Stage
from host_tests.console.looking import steps, wait_connected, wait_far, wait_rest

_MOVED = 50  # steps that anybody sees


def make_site(folder: Path) -> Path:
    """Make the documents and the page to try framestep as `make site` does. Return their folder."""
    documents.stage(folder / "pages")
    try_page.make(folder / "pages/try")
    (folder / "pages/install").mkdir()
    (folder / "pages/install/index.html").write_text("<title>install</title>")
    documents.build(folder / "pages", folder / "site")
    return folder / "site"


def walk(stage: Stage, url: str) -> Iterator[tuple[str, float]]:
    """Yield what has happened, and the seconds since the front page was opened."""
    begun = time.monotonic()
    page = stage.page(url)
    yield "the front page is open", time.monotonic() - begun
    page.get_by_role("link", name="Try it in your browser").first.click()
    wait_connected(page)
    yield "the emulated board answers", time.monotonic() - begun
    before = steps(page)
    page.get_by_role("button", name="Jog track up").focus()
    page.keyboard.down("Enter")
    wait_far(page, 1, before, _MOVED)
    yield "the rig moves", time.monotonic() - begun
    page.keyboard.up("Enter")
    wait_rest(page)
    yield "it is at rest again", time.monotonic() - begun
    assert page.errors == []


def test_from_the_front_page_to_a_rig_that_moves(stage, tmp_path):
    events = list(walk(stage, stage.files(make_site(tmp_path))))
    assert [what for what, _ in events][-2:] == ["the rig moves", "it is at rest again"]
    assert all(seconds < 60 for _, seconds in events), events
