"""`make release`: everything that a release has, in build/release, the same bytes each time.

framestep-VERSION-py3-none-any.whl   the package, for pipx install
framestep-BOARD-VERSION.uf2          the image of each board
SHA256SUMS, NOTES.md                 sums of all of these, and what CHANGELOG.md says of this
                                     version

Times inside the files are that of the commit, or SOURCE_DATE_EPOCH.
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

from .. import paths
from ..errors import Command
from ..paths import ROOT, version
from .board_files import board_data, board_names
from .images import BuildError, frozen

RELEASE = ROOT / "build" / "release"
_FIRST = 315532800  # 1980, the first that a zip file can tell

app = Command("release")


def epoch() -> int:
    """The time that files of the release have."""
    if given := os.environ.get("SOURCE_DATE_EPOCH"):
        return int(given)
    told = subprocess.run(
        ["git", "log", "-1", "--format=%ct"], cwd=ROOT, capture_output=True, text=True
    )
    return int(told.stdout) if told.returncode == 0 and told.stdout.strip() else _FIRST


def notes(changelog: str, wanted: str) -> str:
    """What CHANGELOG.md says of a version, and before it of what is unreleased: that is in the
    files, too."""
    parts = dict(re.findall(r"^## (\S+).*\n((?:(?!## ).*\n?)*)", changelog, re.MULTILINE))
    new, said = parts.get("Unreleased", "").strip(), parts.get(wanted, "").strip()
    if not new and not said:
        raise BuildError(f"CHANGELOG.md says nothing of {wanted}")
    if new and said:
        new = f"## Since the first {wanted}\n\n{new}\n\n## {wanted}\n"
    return (
        f"# framestep {wanted}\n\n"
        + "\n\n".join(part.strip() for part in (new, said) if part)
        + "\n"
    )


def zipped(files: Mapping[str, bytes], when: int) -> bytes:
    """A zip file of these, the same for the same."""
    out = io.BytesIO()
    stamp = time.gmtime(max(when, _FIRST))[:6]
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, stamp)
            entry.external_attr = 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, files[name])
    return out.getvalue()


def same_each_time(wheel: bytes, when: int) -> bytes:
    """A wheel in an order, with times and permissions that do not depend on where it was built."""
    with zipfile.ZipFile(io.BytesIO(wheel)) as archive:
        return zipped(
            {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")},
            when,
        )


def wheel(folder: Path, when: int) -> Path:
    """Build the package into a folder, with the images that are ready."""
    scratch = folder / "scratch"
    result = subprocess.run(
        [sys.executable, "setup.py", "-q", "build", "-b", scratch, "bdist_wheel", "-d", scratch],
        cwd=ROOT,
        env={**os.environ, "SOURCE_DATE_EPOCH": str(max(when, _FIRST))},
        capture_output=True,
        text=True,
    )
    if result.returncode != 0:
        raise BuildError(f"the package cannot be built:\n{result.stderr.strip()}")
    (made,) = scratch.glob("*.whl")
    path = folder / made.name
    path.write_bytes(same_each_time(made.read_bytes(), when))
    shutil.rmtree(scratch)
    return path


def make(folder: Path) -> list[Path]:
    """Make the release in a folder; what was there before goes."""
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    when = epoch()
    os.environ["SOURCE_DATE_EPOCH"] = str(when)
    for board in board_names():
        print(f"the image for the {board_data(board)['name']}", flush=True)
        shutil.copyfile(
            frozen(board, show=True).with_suffix(".uf2"),
            folder / f"framestep-{board}-{version()}.uf2",
        )
    print("the package for pip", flush=True)
    wheel(folder, when)
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
