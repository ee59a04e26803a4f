"""`make release`: build everything that a release contains, in build/release.

framestep-VERSION-py3-none-any.whl   the package, for pipx install
framestep-BOARD-VERSION.uf2          the image of each board with an RP2040 or RP2350
framestep-BOARD-VERSION.zip          the files of each board with an ESP32
framestep-pages-VERSION.zip          the pages to try framestep and to install it
SHA256SUMS, NOTES.md                 sums of all of these; what to do and which file to take

Each build makes the same bytes: times inside the files are the commit's, or SOURCE_DATE_EPOCH.
"""

import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import time
import zipfile
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from .. import paths
from ..board import file_install
from ..building.board_files import board_data, files_boards, image_boards
from ..building.images import BuildError, frozen
from ..building.release_names import files_name, image_name, pages_name
from ..errors import Command
from ..paths import ROOT, version
from . import install_page, try_page

RELEASE = ROOT / "build" / "release"
_FIRST = 315532800  # 1980, the earliest time in a zip file

app = Command("release")


def epoch() -> int:
    """Return the time that the release's files carry."""
    if given := os.environ.get("SOURCE_DATE_EPOCH"):
        return int(given)
    asked = subprocess.run(
        ["git", "log", "-1", "--format=%ct"], cwd=ROOT, capture_output=True, text=True
    )
    return int(asked.stdout) if asked.returncode == 0 and asked.stdout.strip() else _FIRST


_NOTES = """\
# framestep {version}

* **Try it** without a board: {try_it}.
* **Install it**: {install_it}. Or plug the board in with BOOTSEL held, and drop its `.uf2` onto the drive that appears.
* **Commands** for Linux, macOS and Windows, with Python 3.10 or newer: `pipx install ./framestep-{version}-py3-none-any.whl`, then `framestep install`.
* **Update** in the same way: your `rig.json` and your other files stay on the board. `framestep status` must answer.
* **What it can**: {changes}. Check the files by `sha256sum -c --ignore-missing SHA256SUMS`.

| you have | take |
|---|---|
{rows}
| a computer, for the commands | `framestep-{version}-py3-none-any.whl` |
| a web server, for the pages | `framestep-pages-{version}.zip` |
"""  # noqa: E501


def notes(changelog: str, wanted: str) -> str:
    """Return the release notes: what to do in five lines, and which file to take."""
    if not re.search(rf"^## {re.escape(wanted)}(?: |$)", changelog, re.MULTILINE):
        raise BuildError(f"CHANGELOG.md says nothing of {wanted}")
    site, repository = paths.site(), paths.repository()
    in_zip = f"unpack `{pages_name(wanted)}`, run `python3 -m http.server` there and open"
    rows = "\n".join(
        f"| {name} | `{file(board, wanted)}`{what} |"
        for boards, file, what in (
            (image_boards(), image_name, ""),
            (files_boards(), files_name, ", unpacked onto a board with MicroPython"),
        )
        for name, board in sorted((board_data(board)["name"], board) for board in boards)
    )
    return _NOTES.format(
        version=wanted,
        rows=rows,
        try_it=f"[in your browser]({site}try/index.html)" if site else f"{in_zip} `try/`",
        install_it=f"[from your browser]({site}install/index.html), with Chrome or Edge"
        if site
        else f"{in_zip} `install/` in Chrome or Edge",
        changes=f"[CHANGELOG.md]({repository}/blob/v{wanted}/CHANGELOG.md)"
        if repository
        else "CHANGELOG.md",
    )


def zipped(files: Mapping[str, bytes], when: int) -> bytes:
    """Return a zip file of these files; equal files give equal bytes."""
    out = io.BytesIO()
    stamp = time.gmtime(max(when, _FIRST))[:6]
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, stamp)
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, files[name])
    return out.getvalue()


def wheel(folder: Path, when: int) -> None:
    """Build the package, with the images that are ready, into a folder."""
    result = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder],
        cwd=ROOT,
        env={**os.environ, "SOURCE_DATE_EPOCH": str(max(when, _FIRST))},
        capture_output=True,
        text=True,
    )
    if result.returncode != 0:
        raise BuildError(f"the package cannot be built:\n{result.stderr.strip()}")


def pages() -> dict[str, bytes]:
    """Return {path: content} of the pages to try framestep and to install it."""
    with TemporaryDirectory() as scratch:
        try_page.make(Path(scratch) / "try")
        images = {board: frozen(board).with_suffix(".uf2") for board in image_boards()}
        install_page.make(Path(scratch) / "install", images)
        return {
            path.relative_to(scratch).as_posix(): path.read_bytes()
            for path in Path(scratch).rglob("*")
            if path.is_file()
        }


def make(folder: Path) -> list[Path]:
    """Make the release in a folder, which is emptied first. Return its files."""
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    when = epoch()
    os.environ["SOURCE_DATE_EPOCH"] = str(when)
    for board in files_boards():
        package = file_install.package(board)
        (folder / files_name(board, version())).write_bytes(zipped(package.files(), when))
    for board in image_boards():
        print(f"the image for the {board_data(board)['name']}", flush=True)
        shutil.copyfile(
            frozen(board, show=True).with_suffix(".uf2"),
            folder / image_name(board, version()),
        )
    print("the package for pip", flush=True)
    wheel(folder, when)
    print("the pages", flush=True)
    (folder / pages_name(version())).write_bytes(zipped(pages(), when))
    (folder / "NOTES.md").write_text(notes((ROOT / "CHANGELOG.md").read_text(), version()))
    files = sorted(path for path in folder.iterdir() if path.is_file())
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    (folder / "SHA256SUMS").write_text("".join(sums))
    return [*files, folder / "SHA256SUMS"]


@app.command()
def main() -> None:
    """Make the release in build/release."""
    assert not paths.INSTALLED
    for path in make(RELEASE):
        print(f"{path.relative_to(ROOT)}, {path.stat().st_size // 1024} kB")


if __name__ == "__main__":
    app()
