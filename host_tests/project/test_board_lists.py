"""A board is three files: no list of boards is kept by hand, in which the next board would be
missing."""

import re
import subprocess

from framestep_tools.building.board_files import ROOT, board_data, board_names
from framestep_tools.documents import board_pages

MANY, NEAR = 3, 8  # a list names at least 3 boards within 8 lines
# Files that may name several boards, because a new one need not be among them
ALLOWED = {
    "CHANGELOG.md": "what was new in a version",
    "README.md": "the three boards to begin with",
    "host_tests/board/test_board_block.py": "examples with other clocks and numbers of motors",
    "host_tests/board/test_image.py": "boards that share an image",
    "host_tests/board/test_repl_memory.py": "examples with drivers",
    "host_tests/fuzz/chip_player.py": "a board of each chip",
    "host_tests/rig/test_rig.py": "examples with other clocks",
    "host_tests/tools/documents/test_board_pages.py": "examples with a mistake each",
}


def first_list(text, boards):
    """Return the line at which the first list of boards begins, or None.

    boards: {folder: name}; a name counts without its version.
    """
    folders = {re.sub(r" v[\d.]+$", "", name): folder for folder, name in boards.items()}
    folders |= {folder: folder for folder in boards}
    longest_first = sorted(map(re.escape, folders), key=len, reverse=True)
    word = re.compile(rf"(?<![\w-])(?:{'|'.join(longest_first)})(?![\w-])")
    found = [
        (number, folders[match[0]])
        for number, line in enumerate(text.splitlines(), 1)
        for match in word.finditer(line)
    ]
    for begin, _ in found:
        if len({folder for line, folder in found if begin <= line < begin + NEAR}) >= MANY:
            return begin
    return None


def by_hand(name):
    """Return a file's text without what board_pages makes; "" if it is no text."""
    try:
        return board_pages.without_made((ROOT / name).read_text())
    except (UnicodeDecodeError, FileNotFoundError):  # git may list a removed file
        return ""


def test_no_list_of_boards_is_kept_by_hand():
    boards = {name: board_data(name)["name"] for name in board_names()}
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    own = tuple(f"boards/{name}/" for name in boards)
    names = [name for name in listed.stdout.splitlines() if not name.startswith(own)]
    assert len(names) > 500
    found = {name: line for name in names if (line := first_list(by_hand(name), boards))}
    unknown = [f"{name}:{line}" for name, line in found.items() if name not in ALLOWED]
    assert not unknown, (
        f"{', '.join(unknown)}: read boards/ instead of a list of boards, or let "
        f"{board_pages.COMMAND} make it"
    )
    assert found.keys() == ALLOWED.keys(), "take out of ALLOWED what is not needed there"


def test_a_list_is_found():
    boards = {"one": "One", "one_x": "One X", "two": "Two v1.0", "three": "Three"}
    assert first_list("\na: one\nb: Two\n\nthree", boards) == 2
    assert first_list("One X, two, Three", boards) == 1
    assert first_list("One, one, two-way, three_way, Two v1.0", boards) is None
    assert first_list("one\ntwo" + "\n" * NEAR + "three", boards) is None
