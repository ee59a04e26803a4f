"""Which MicroPython tools/micropython/build.sh takes, and how it patches it; Debian's archive and
the release are made by the test."""

import os
import re
import shutil
import subprocess
import tarfile
from hashlib import sha256

import pytest

from framestep_tools.building.board_files import ROOT

SCRIPT = ROOT / "tools/micropython/build.sh"
PATCHES = sorted((SCRIPT.parent / "patches").glob("*/*.patch"))
NUMBERS = {"MAJOR": 1, "MINOR": 26, "MICRO": 1, "PRERELEASE": 0}
BEGINS_TO_WORK = '"$ROOT/tools/setup.sh" python'


@pytest.fixture
def run(tmp_path):
    """Return run(commands, *versions): the result of commands with build.sh's functions, if Debian
    has these versions."""
    functions, found, _ = SCRIPT.read_text().partition(f"\n{BEGINS_TO_WORK}\n")
    assert found

    def run(commands, *versions):
        listed = "".join(f"Version: {version}\\n" for version in versions)
        text = functions.replace(
            '"$(dirname "${BASH_SOURCE[0]}")/../steps.sh"', f'"{ROOT}/tools/steps.sh"'
        )
        text += (
            "\napt_setup() { :; }\n"
            "need_packages() { :; }\n"
            f"apt-cache() {{ printf '{listed}'; }}\n"
            f"{commands}\n"
        )
        environment = os.environ | {"FRAMESTEP_CACHE": str(tmp_path / "cache")}
        return subprocess.run(["bash", "-c", text], env=environment, capture_output=True, text=True)

    return run


def release(folder):
    """Make a file like MicroPython's release; return it and its hash."""
    header = folder / "mpconfig.h"
    header.write_text(
        "".join(f"#define MICROPY_VERSION_{name} {number}\n" for name, number in NUMBERS.items())
    )
    file = folder / "release.tar.xz"
    with tarfile.open(file, "w:xz") as archive:
        archive.add(header, "micropython-1.26.1/py/mpconfig.h")
    return file, sha256(file.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("versions", "taken"),
    [
        (["1.28.0+ds-2", "1.26.1+ds-1"], "1.26.1+ds-1"),  # the pinned one
        (["1.25.0+ds-1", "1.28.0+ds-2"], "1.28.0+ds-2"),  # a tested one
    ],
)
def test_of_what_debian_has(run, versions, taken):
    result = run("debian_version", *versions)
    assert (result.returncode, result.stdout) == (0, f"{taken}\n"), result.stderr


def test_the_release_where_debian_has_none_that_is_tested(run, tmp_path):
    file, digest = release(tmp_path)
    take = f'RELEASE_URL=file://{file} RELEASE_SHA256={digest}; sources; version_of "$MP"'
    result = run(take, "1.25.0+ds-1", "1.27.0+ds-1")
    assert result.returncode == 0, result.stderr
    assert result.stdout == "v1.26.1\n"
    assert "what it has is not tested (1.25.0+ds-1 1.27.0+ds-1 )" in result.stderr


def test_another_file_is_not_taken(run, tmp_path):
    file, _ = release(tmp_path)
    result = run(f"RELEASE_URL=file://{file}; sources")
    assert result.returncode == 1
    assert "is not the release of MicroPython 1.26.1: its SHA-256 is" in result.stderr
    assert not (tmp_path / "cache/src/micropython").exists()


def test_nothing_is_to_be_had(run, tmp_path):
    result = run(f"RELEASE_URL=file://{tmp_path}/none; sources")
    assert result.returncode == 1
    assert "give a checkout of v1.26.1 (make image MICROPYTHON=path)" in result.stderr


@pytest.fixture(params=PATCHES, ids=lambda patch: patch.stem)
def patched(request, run, tmp_path):
    """Return (before, after, change) of a patch: the lines that it finds in its file and those that
    it leaves; change(text) makes a file of text, lets build.sh patch it, and returns the result and
    the file's text."""
    head, name, body = re.split(r"^--- a/(.+)\n.+\n", request.param.read_text(), flags=re.MULTILINE)
    assert head.strip(), "it does not say why"
    lines = [line for line in body.splitlines() if not line.startswith("@@")]
    folder, file = tmp_path / "patches" / "one", tmp_path / "sources" / name
    folder.mkdir(parents=True)
    file.parent.mkdir(parents=True)
    shutil.copy(request.param, folder)

    def change(text):
        file.write_text(text)
        result = run(f"PATCHES={folder.parent}; change {tmp_path}/sources one; echo goes on")
        return result, file.read_text()

    return *("".join(f"{s[1:]}\n" for s in lines if s[0] in f" {sign}") for sign in "-+"), change


def test_a_patch_is_made_and_then_left_alone(patched):
    before, after, change = patched
    for text in (before, after):
        result, now = change(text)
        assert (result.stdout, result.stderr, now) == ("goes on\n", "", after)


def test_sources_that_a_patch_does_not_fit_end_the_build(patched):
    """Sources with a change in any line of the patch, also in one that it keeps."""
    before, _, change = patched
    for line in filter(str.strip, before.splitlines()):
        altered = before.replace(line, f"{line} // or so", 1)
        result, now = change(altered)
        assert (result.returncode, result.stdout, now) == (1, "", altered)
        assert re.fullmatch(
            r"The MicroPython in \S+ is not one that \S+\.patch can change: "
            r"take 1\.26\.1, or rewrite that patch\.\n",
            result.stderr,
        )
