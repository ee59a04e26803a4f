"""The site of the documents: every link and anchor leads somewhere, the front page leads to the
emulated board, and no page loads anything from another host."""

import re
from html.parser import HTMLParser
from urllib.parse import urlsplit

import pytest

from framestep_tools.errors import ToolError
from framestep_tools.site import documents

# Elements that make a browser load something, with the attribute that names it
LOADING = {
    "audio": "src", "embed": "src", "iframe": "src", "image": "href", "img": "src", "input": "src",
    "link": "href", "object": "data", "script": "src", "source": "src", "track": "src",
    "use": "href", "video": "src",
}  # fmt: skip
ONLY_NAMED = {"canonical", "next", "prev"}  # relations of a <link> that load nothing


class Loads(HTMLParser):
    """Collects what a page loads."""

    def __init__(self, text):
        super().__init__()
        self.found = re.findall(r"""(?:url\(|@import\s+(?!url))\s*["']?([^"')\s]+)""", text)
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        if tag == "link" and attributes.get("rel") in ONLY_NAMED:
            return
        if address := attributes.get(LOADING.get(tag, "")):
            self.found.append(address)
        self.found += [
            each.split()[0] for each in (attributes.get("srcset") or "").split(",") if each
        ]


def elsewhere(text):
    """Return the addresses on other hosts that a page or a style sheet loads."""
    return [each for each in Loads(text).found if urlsplit(each).netloc]


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """Return the staged documents, with empty pages in place of those that `make try` makes."""
    folder = tmp_path_factory.mktemp("pages")
    documents.stage(folder)
    for name in ("try", "install"):
        (folder / name).mkdir()
        (folder / name / "index.html").write_text(f"<title>{name}</title>")
    return folder


@pytest.fixture(scope="module")
def site(pages, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    documents.build(pages, folder)
    return folder


def test_each_document_is_a_page(pages, site):
    for path in pages.rglob("*.md"):
        page = path.relative_to(pages).with_suffix(".html")
        page = page.with_name("index.html") if page.stem == "README" else page
        text = (site / page).read_text()
        # Python-Markdown makes paragraphs of some lists, tables and code that GitHub recognises
        prose = re.sub(r"<pre>.*?</pre>", "", text, flags=re.DOTALL)
        assert not re.findall(
            r"^(?:<p>)?[*-] .*|^(?:<p>)?\|.*|^.*\| ?---.*", prose, re.MULTILINE
        ), page
        assert not re.findall(r"<code>[^<]*\n[^<]*</code>|```", prose), page


@pytest.mark.parametrize("name", ["try", "install"])
def test_front_page_leads_to_the_pages(site, name):
    assert f'href="{name}/index.html"' in (site / "index.html").read_text()
    assert "../releases" not in (site / "index.html").read_text()
    assert (site / name / "index.html").read_text() == f"<title>{name}</title>"


def test_releases_are_those_of_the_repository(monkeypatch, tmp_path):
    monkeypatch.setenv("GITHUB_REPOSITORY", "somebody/fork")
    monkeypatch.delenv("GITHUB_SERVER_URL", raising=False)
    documents.stage(tmp_path)
    front = (tmp_path / "README.md").read_text()
    assert "[Releases](https://github.com/somebody/fork/releases)" in front
    assert "[**Try it in your browser**](try/index.html)" in front


def test_nothing_comes_from_another_host(site):
    files = [path for path in site.rglob("*") if path.suffix in (".html", ".css", ".svg")]
    assert len(files) > 40
    assert {str(path): found for path in files if (found := elsewhere(path.read_text()))} == {}


def test_what_comes_from_another_host_is_found():
    assert elsewhere('<img src="https://a.example/a.png"><a href="https://b.example">b</a>')
    assert elsewhere("<style>@import url(//a.example/font.css)</style>")
    assert elsewhere('<link rel="stylesheet" href="//a.example/style.css">')
    assert not elsewhere('<link rel="canonical" href="https://a.example"><img src="a.png">')


@pytest.mark.parametrize("link", ["[no page](nothing.md)", "[no anchor](start/install.md#nothing)"])
def test_a_link_to_nowhere_is_an_error(pages, tmp_path, link):
    page = pages / "docs/glossary.md"
    text = page.read_text()
    page.write_text(f"{text}\n{link}\n")
    try:
        with pytest.raises(ToolError, match="contains a link"):
            documents.build(pages, tmp_path)
    finally:
        page.write_text(text)
