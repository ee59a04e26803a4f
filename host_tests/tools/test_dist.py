"""`make dist`: the packages hold what the tree has, compiled for their processor, and nothing
else."""

import json

import pytest

from framestep_tools import dist
from framestep_tools.device import Who
from framestep_tools.files import board_data, board_files, board_names, march


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("dist") / "dist"
    made.mkdir()
    (made / "stale.mpy").write_bytes(b"")
    dist.write(made)
    return made


def package(path):
    """{where it goes on the board: content}"""
    return {
        target: (path.parent / url).read_bytes()
        for target, url in json.loads(path.read_text())["urls"]
    }


@pytest.mark.parametrize("board", board_names())
def test_a_package_holds_what_make_flash_would_copy(folder, board):
    processor = march(board_data(board)["chip"])
    found = package(folder / processor / f"{board}.json")
    assert {
        ("/lib/" + target).replace("/lib/../", "/"): content for target, content in found.items()
    } == board_files(processor, board)
    number = next(i for i in range(9) if named(i) == processor)
    compiled = [content for target, content in found.items() if target.endswith(".mpy")]
    # MicroPython's docs, "mpy files": M, version, then sub-version and processor if there is native
    # code
    assert {content[:2] for content in compiled} == {b"M\x06"}
    assert {content[2] >> 2 & 15 for content in compiled} == {0, number}
    assert {content[2] & 3 for content in compiled if content[2] >> 2 & 15} == {3}


def named(number):
    return Who("rp2", (1, 26, 1), number << 10, "", True, "").march


def test_every_file_belongs_to_a_package_and_every_folder_has_one(folder):
    assert {path.name for path in folder.iterdir()} == {
        march(board_data(board)["chip"]) for board in board_names()
    }
    for processor in folder.iterdir():
        used = {
            url
            for path in processor.glob("*.json")
            for _, url in json.loads(path.read_text())["urls"]
        }
        assert {
            p.relative_to(processor).as_posix() for p in processor.rglob("*") if p.is_file()
        } == used | {path.name for path in processor.glob("*.json")}
        assert (processor / "package.json").exists()
    assert package(folder / "armv6m/package.json") == package(folder / "armv6m/pico.json")
