"""The site of the documents in a browser: its pages load only from their own host, and the search
finds something."""

import pytest
from playwright.sync_api import expect

from framestep_tools.site import documents
from host_tests.console.conftest import PATIENCE_MS


@pytest.fixture
def url(tmp_path, stage):
    documents.stage(tmp_path / "pages")
    for name in ("try", "install"):
        (tmp_path / "pages" / name).mkdir()
        (tmp_path / "pages" / name / "index.html").write_text(f"<title>{name}</title>")
    documents.build(tmp_path / "pages", tmp_path / "site")
    return stage.files(tmp_path / "site")


def test_pages_load_from_their_own_host_and_the_search_finds(stage, url):
    page = stage.page(f"{url}docs/use/console.html")
    page.locator(".md-search__input").click()
    # A word filled in before the search is ready is sometimes never looked for.
    expect(page.locator(".md-search-result__meta")).to_have_text(
        "Type to start searching", timeout=PATIENCE_MS
    )
    page.locator(".md-search__input").press_sequentially("backlash")
    expect(page.locator(".md-search-result__item").first).to_contain_text(
        "backlash", ignore_case=True, timeout=PATIENCE_MS
    )
    assert len(page.asked) > 5
    assert [each for each in page.asked if not each.startswith((url, "data:", "blob:"))] == []


@pytest.mark.parametrize(
    ("start", "link", "title"),
    [
        ("", "Try it in your browser", "try"),
        ("", "Install it from your browser", "install"),
        ("docs/start/by-the-page.html", "Install it from your browser", "install"),
    ],
)
def test_links_lead_to_both_pages(stage, url, start, link, title):
    page = stage.page(f"{url}{start}")
    page.get_by_role("link", name=link).first.click()
    expect(page).to_have_title(title)
