"""`make site`: the documents as a web site in build/site, with the pages of `make try` in its
folders try and install. Built without network, and no page loads anything from another host."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from ..building import images
from ..errors import Command, ToolError
from ..paths import ROOT
from . import install_page, try_page

SITE = ROOT / "build" / "site"
PAGES = ROOT / "build" / "pages"
_CONFIG = Path(__file__).with_name("mkdocs.yml")
# The README's sentences about the pages are for a clone; the site has the pages themselves.
_IN_A_CLONE = re.compile(
    r"^In a clone, `make try` .*? A release has both\.$", re.MULTILINE | re.DOTALL
)
_HERE = (
    "[Try it in your browser](try/index.html): an emulated Pico runs the real image there. "
    "[Install it from your browser](install/index.html) when you have a board."
)

app = Command("site", expected=(images.BuildError,))


@app.command()
def main() -> None:
    """Build the site."""
    stage(PAGES)
    try_page.make(PAGES / "try")
    install_page.make(PAGES / "install", images.images_ready())
    build(PAGES, SITE)
    shown = SITE.relative_to(ROOT)
    print(f"{shown}: to see it, python3 -m http.server -d {shown}")


def stage(folder: Path) -> None:
    """Copy every document, and every file of ours that one links to, into an emptied folder."""
    shutil.rmtree(folder, ignore_errors=True)
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=ROOT,
        capture_output=True,
        check=True,
        text=True,
    )
    for page in map(Path, listed.stdout.splitlines()):
        text = (ROOT / page).read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([^)#\s]+)", text):
            if "://" not in target and not target.endswith(".md"):
                _copy((ROOT / page.parent / target).resolve().relative_to(ROOT), folder)
        if page == Path("README.md"):
            text, count = _IN_A_CLONE.subn(_HERE, text)
            assert count == 1
        (folder / page).parent.mkdir(parents=True, exist_ok=True)
        (folder / page).write_text(text, encoding="utf-8")


def _copy(path: Path, folder: Path) -> None:
    (folder / path).parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(ROOT / path, folder / path)


def build(pages: Path, site: Path) -> None:
    """Make the site of the staged pages. A link or an anchor that leads nowhere is an error."""
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", _CONFIG, "-d", site],
        env={**os.environ, "SITE_PAGES": str(pages), "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        raise ToolError(f"mkdocs cannot build the site:\n{done.stderr.strip()}")


if __name__ == "__main__":
    app()
