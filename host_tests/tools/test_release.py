"""`make release`: what does not take a build of MicroPython. The index is read as mpremote's mip
does."""

import hashlib
import http.server
import io
import json
import threading
import zipfile
from functools import partial

import pytest

from framestep_tools import dist, release
from framestep_tools.builds import BuildError
from framestep_tools.files import board_files, board_names, write_tree


@pytest.fixture(scope="module")
def tree():
    return release.index(dist.packages())


def test_the_index_has_a_package_for_each_board(tree):
    listed = json.loads(tree["index.json"])["packages"]
    assert [entry["name"] for entry in listed] == [f"framestep-{board}" for board in board_names()]
    for entry in listed:
        latest = tree[f"package/6/{entry['name']}/latest.json"]
        assert latest == tree[f"package/6/{entry['name']}/{entry['version']}.json"]
        for _, short in json.loads(latest)["hashes"]:
            assert hashlib.sha256(tree[f"file/{short[:2]}/{short}"]).hexdigest().startswith(short)


def test_mpremote_installs_from_it(tree, tmp_path, monkeypatch):
    """mpremote's own mip, with a board of nothing but files, and the index served as a web page."""
    from mpremote import mip

    write_tree(tmp_path, tree)
    handler = partial(http.server.SimpleHTTPRequestHandler, directory=str(tmp_path))
    monkeypatch.setattr(http.server.SimpleHTTPRequestHandler, "log_message", lambda *_: None)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    board = FileBoard()
    try:
        url = f"http://127.0.0.1:{server.server_address[1]}"
        mip._install_package(board, "framestep-pico", url, "/lib", None, True)
    finally:
        server.shutdown()
    files = {path.replace("/lib/../", "/"): content for path, content in board.files.items()}
    assert files == board_files("armv6m", "pico")


class FileBoard:
    """What mip asks of mpremote's transport."""

    def __init__(self):
        self.files = {}

    def exec(self, script):
        pass

    def eval(self, expression):
        assert expression == "getattr(sys.implementation, '_mpy', 0) & 0xFF"
        return 6

    def fs_exists(self, path):
        return False

    def fs_isdir(self, path):
        return True

    def fs_mkdir(self, path):
        pass

    def fs_hashfile(self, path, algorithm, **_):
        raise FileNotFoundError

    def fs_writefile(self, path, data, **_):
        self.files[path] = bytes(data)


def test_a_zip_is_the_same_for_the_same():
    files = {"b/c": b"1" * 1000, "a": b"2"}
    once = release.zipped(files, 1_700_000_000)
    assert once == release.zipped(dict(reversed(files.items())), 1_700_000_000)
    with zipfile.ZipFile(io.BytesIO(once)) as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == files


def test_a_wheel_becomes_the_same_whenever_it_was_built():
    def built(order, year):
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w") as archive:
            for name in order:
                archive.writestr(zipfile.ZipInfo(name, (year, 1, 1, 0, 0, 0)), name * 9)
        return release.same_each_time(out.getvalue(), 1_700_000_000)

    assert built(["x.py", "y/z.py"], 2020) == built(["y/z.py", "x.py"], 2024)


CHANGELOG = """# Changelog

## Unreleased

{}
## 0.2.0 (2026-01-01)

Second.

### Fixed

* A fault.

## 0.1.0

First.
"""


def test_notes_are_those_of_the_version():
    assert (
        release.notes(CHANGELOG.format(""), "0.2.0")
        == "# framestep 0.2.0\n\nSecond.\n\n### Fixed\n\n* A fault.\n"
    )
    assert release.notes(CHANGELOG.format(""), "0.1.0") == "# framestep 0.1.0\n\nFirst.\n"
    assert release.notes(CHANGELOG.format("* New.\n"), "0.3.0") == "# framestep 0.3.0\n\n* New.\n"
    assert (
        release.notes(CHANGELOG.format("* New.\n"), "0.1.0")
        == "# framestep 0.1.0\n\n## Since the first 0.1.0\n\n* New.\n\n## 0.1.0\n\nFirst.\n"
    ), "what is unreleased is in the files as well"
    with pytest.raises(BuildError, match=r"CHANGELOG\.md says nothing of 0\.3\.0"):
        release.notes(CHANGELOG.format(""), "0.3.0")
