"""Paths of framestep's own files: in a checkout of its sources, or in the package that a user has
installed.

pyproject.toml and hatch_build.py put into the package what a user needs without the sources:
`data/boards` with each board's board.json and rig.json, `data/images/<board>.uf2`, and
`data/files/<board>` with the files of boards that have framestep in their file system.
"""

import os
import re
import subprocess
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
DATA = PACKAGE / "data"
INSTALLED = DATA.is_dir()
ROOT = PACKAGE.parents[1]  # of the checkout
BOARDS = DATA / "boards" if INSTALLED else ROOT / "boards"
IMAGES = DATA / "images"
FILES = DATA / "files"
FIRMWARE = ROOT / "firmware"
CACHE = Path(os.environ.get("FRAMESTEP_CACHE") or ROOT / ".cache").absolute()
_MODULES = ROOT / "tools/framestep_emulator/board/node_modules/@xterm"
_TERMINAL = {
    "xterm/xterm.mjs": "xterm/lib/xterm.mjs",
    "xterm/addon-fit.mjs": "addon-fit/lib/addon-fit.mjs",
    "xterm/xterm.css": "xterm/css/xterm.css",
    "xterm/LICENSE.txt": "xterm/LICENSE",
}


@cache
def version() -> str:
    """Return framestep's version, such as 0.1.0, as the firmware reports it to a host.

    Read from the source, because importing the controller would take long.
    """
    folder = PACKAGE.parent if INSTALLED else FIRMWARE
    text = (folder / "framestep" / "reports.py").read_text()
    found = re.search(r"^VERSION = \((\d+), (\d+), (\d+)\)", text, re.MULTILINE)
    assert found, "framestep/reports.py has no VERSION"
    return ".".join(found.groups())


def terminal() -> dict[str, Path]:
    """Return the files of xterm.js by their paths in the console's page, from the node package;
    none without it. The package for pip brings them."""
    found = {name: _MODULES / path for name, path in _TERMINAL.items()}
    return found if all(path.exists() for path in found.values()) else {}


def repository() -> str | None:
    """Return the repository's address on the web, without a slash at its end.

    A workflow of GitHub knows it, else the clone's `origin`; None if that is not on the web.
    """
    if name := os.environ.get("GITHUB_REPOSITORY"):
        return f"{os.environ.get('GITHUB_SERVER_URL', 'https://github.com')}/{name}"
    if INSTALLED or not (ROOT / ".git").exists():
        return None
    asked = subprocess.run(
        ["git", "remote", "get-url", "origin"], cwd=ROOT, capture_output=True, text=True
    )
    return web_address(asked.stdout.strip())


def web_address(remote: str) -> str | None:
    """Return the web page of a remote such as git@github.com:owner/name.git, or None."""
    found = re.fullmatch(
        r"(?:https?://|ssh://|)(?:[^/@\s]+@)?([\w-]+(?:\.[\w-]+)+)(?::\d+/|[:/])"
        r"([\w.-]+/[\w./-]+?)(?:\.git)?/?",
        remote,
    )
    return f"https://{found[1]}/{found[2]}" if found else None


def linked_outside(page: str) -> str:
    """Return a page of the root for readers elsewhere: its links lead to the repository
    on the web. Without one there are only their texts, and no pictures."""
    url = repository()

    def led(link: re.Match[str]) -> str:
        picture, text, target = link.groups()
        if "://" in target:
            return link[0]
        if url is None:
            return "" if picture else text
        if target.startswith("../../"):
            return f"{picture}[{text}]({url}/{target.removeprefix('../../')})"
        return f"{picture}[{text}]({url}/{'raw' if picture else 'blob'}/v{version()}/{target})"

    return re.sub(r"(!?)\[((?:[^][]|\[[^]]*\])*)\]\(([^)\s]+)\)", led, page)


def site() -> str | None:
    """Return the address of the site that GitHub publishes for the repository, with a slash at its
    end. SITE_URL is another one. None if the repository is not on GitHub."""
    if given := os.environ.get("SITE_URL"):
        return given.rstrip("/") + "/"
    found = re.fullmatch(r"https://github\.com/([^/]+)/([^/]+)", repository() or "")
    if not found:
        return None
    host = f"{found[1].lower()}.github.io"
    return f"https://{host}/" if found[2].lower() == host else f"https://{host}/{found[2]}/"
