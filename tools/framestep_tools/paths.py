"""Paths of framestep's own files: in a checkout of its sources, or in the package that a user has
installed.

setup.py adds to the package what a user needs without the sources: `data/boards` with each board's
board.json and rig.json, `data/images/<board>.uf2`, and `data/files/<board>` with the files of
boards that have framestep in their file system.
"""

import os
import re
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


@cache
def version() -> str:
    """Return framestep's version, such as 0.1.0, as the firmware reports it to a host.

    Read from the source, because importing the controller would take long.
    """
    import framestep

    text = Path(framestep.__file__).with_name("reports.py").read_text()
    found = re.search(r"^VERSION = \((\d+), (\d+), (\d+)\)", text, re.MULTILINE)
    assert found, "framestep/reports.py has no VERSION"
    return ".".join(found.groups())


def repository() -> str | None:
    """Return the repository's address on the web, without a slash at its end.

    Only a workflow of GitHub knows it; elsewhere None.
    """
    name = os.environ.get("GITHUB_REPOSITORY")
    return name and f"{os.environ.get('GITHUB_SERVER_URL', 'https://github.com')}/{name}"
