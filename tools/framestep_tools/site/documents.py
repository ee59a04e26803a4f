"""`make site`: the documents as a web site in build/site, with the pages of `make try` in its
folders try and install. Built without network, and no page loads anything from another host."""

import os
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

from .. import paths
from ..building import images
from ..errors import Command, ToolError
from ..paths import ROOT
from . import install_page, try_page

SITE = ROOT / "build" / "site"
PAGES = ROOT / "build" / "pages"
_CONFIG = Path(__file__).with_name("mkdocs.yml")
# These links lead to the latest release on GitHub, and to the pages themselves on the site.
_PAGES = {
    "Try it in your browser": "try/index.html",
    "Install it from your browser": "install/index.html",
}
_RELEASES = re.compile(r"(\[[^\]]*\])\((?:\.\./)+(releases(?:/latest)?)\)")

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
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md", ":!.github"],
        cwd=ROOT,
        capture_output=True,
        check=True,
        text=True,
    )
    for page in map(Path, listed.stdout.splitlines()):
        text = (ROOT / page).read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([^)#\s]+)", text):
            if "://" not in target and not target.endswith(".md") and "../releases" not in target:
                _copy((ROOT / page.parent / target).resolve().relative_to(ROOT), folder)
        text = _RELEASES.sub(partial(_on_the_site, page), text)
        (folder / page).parent.mkdir(parents=True, exist_ok=True)
        (folder / page).write_text(text, encoding="utf-8")


def _on_the_site(page: Path, link: re.Match[str]) -> str:
    """Return a link to a release as the site has it: a page of the site, the repository's releases,
    or only its text if the repository is not on the web."""
    text, target = link[1], link[2]
    if (own := _PAGES.get(text.strip("[*]"))) is not None:
        return f"{text}({os.path.relpath(own, page.parent)})"
    url = paths.repository()
    return f"{text}({url}/{target})" if url else text[1:-1]


def _copy(path: Path, folder: Path) -> None:
    (folder / path).parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(ROOT / path, folder / path)


def build(pages: Path, site: Path) -> None:
    """Make the site of the staged pages. A link or an anchor that leads nowhere is an error."""
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "-f", _CONFIG, "-d", site],
        env={
            **os.environ,
            "SITE_PAGES": str(pages),
            "SITE_URL": paths.site() or "",
            "NO_MKDOCS_2_WARNING": "1",
        },
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        raise ToolError(f"mkdocs cannot build the site:\n{done.stderr.strip()}")


if __name__ == "__main__":
    app()
