"""Where framestep's own files lie: in a checkout of its sources, or inside the package that a user
has installed.

setup.py puts into the package what a user needs without the sources: `data/boards` with each
board's board.json and rig.json, and `data/images/<board>.uf2`.
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
FIRMWARE = ROOT / "firmware"
CACHE = Path(os.environ.get("FRAMESTEP_CACHE") or ROOT / ".cache").absolute()


@cache
def version() -> str:
    """framestep's version, which the firmware tells a host: 0.1.0. Importing the controller for it
    would take long."""
    import framestep

    text = Path(framestep.__file__).with_name("reports.py").read_text()
    found = re.search(r"^VERSION = \((\d+), (\d+), (\d+)\)", text, re.MULTILINE)
    assert found, "framestep/reports.py has no VERSION"
    return ".".join(found.groups())
