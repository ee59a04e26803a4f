"""docs/internals/protocol-notes.md: every cited number exists, and the frames in it are valid."""

import itertools
import re
import subprocess

import pytest

from framestep_tools.building.board_files import ROOT
from framestep_tools.client.wire import FrameDecoder
from framestep_tools.payloads import REPORTS, REQUESTS, TYPE_NAMES, VirtConfig, type_name
from host_tests.protocol.notes import NOTES, table

CITED = re.compile(
    r"field\s+notes?\s+((?:\d+(?:\.\d+)?(?:(?:,|\s+to|\s+and|,\s+and)\s+(?=\d))?)+)", re.IGNORECASE
)
_TEXTS = {".py", ".md", ".mjs", ".js", ".c", ".h", ".cmake", ".sh", ".toml", ".json", ".yml", ""}


def tracked():
    names = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
    ).stdout
    return [ROOT / name for name in names.split("\0") if name]


def numbers():
    """Return the numbers of the notes' sections and notes."""
    text = NOTES.read_text()
    found = set(re.findall(r"^## (\d+)\. ", text, re.MULTILINE))
    return found | set(re.findall(r"^\*\*(\d+\.\d+)\*\* ", text, re.MULTILINE))


def cited(text):
    return [number for run in CITED.findall(text) for number in re.findall(r"\d+(?:\.\d+)?", run)]


def test_citations_are_found():
    assert cited("# field note 2.3") == ["2.3"]
    assert cited("(field notes 1.8 and 2); see") == ["1.8", "2"]
    assert cited("field notes 4.1, 4.2 and\n4.3.") == ["4.1", "4.2", "4.3"]
    assert cited("Field notes 5.2 to 5.4") == ["5.2", "5.4"]


def test_every_number_cited_exists():
    known = numbers()
    assert {"1.1", "4.6", "6.13", "9.9", "2", "10"} <= known
    missing, count = [], 0
    for path in tracked():
        if path.suffix in _TEXTS and path.is_file() and path.name != "test_protocol_notes.py":
            for number in cited(path.read_text(errors="replace")):
                count += 1
                if number not in known:
                    missing.append(f"{path.relative_to(ROOT)}: {number}")
    assert not missing
    assert count > 100, "the search has found next to nothing"


def test_notes_count_up():
    """No number is there twice, none is missing."""
    order = [
        tuple(map(int, n.split(".")))
        for n in re.findall(r"^\*\*(\d+\.\d+)\*\* ", NOTES.read_text(), re.MULTILINE)
    ]
    for before, after in itertools.pairwise(order):
        assert after in ((before[0], before[1] + 1), (before[0] + 1, 1), (before[0] + 2, 1)), after


def test_frame_vectors():
    """Field note 10: its frames are valid, except the one that must be refused."""
    lines = re.findall(
        r"^(.+?): +((?:[0-9A-F]{2} ?)+)$", NOTES.read_text().split("## 10.")[1], re.MULTILINE
    )
    assert len(lines) == 6
    source = (ROOT / "host_tests" / "protocol" / "test_frames.py").read_text()
    for name, text in lines:
        assert text.strip() in source, f"{name}: the frame reader is not tested with it"
        frames = FrameDecoder().feed(bytes.fromhex(text))
        assert len(frames) == (0 if "refused" in name else 1), name


def test_every_message_is_in_the_table():
    reported = table()
    missing = sorted(set(TYPE_NAMES.values()) - reported.keys())
    assert not missing, (
        f"add a row to the table in 2 of docs/internals/protocol-notes.md: {missing}"
    )
    gone = sorted(reported.keys() - set(TYPE_NAMES.values()))
    assert not gone, (
        "not in framestep.protocol.declared, so remove them from the table in 2 of "
        f"docs/internals/protocol-notes.md: {gone}"
    )


@pytest.mark.parametrize("cls", REQUESTS.values(), ids=lambda cls: cls.__name__)
def test_requests_are_declared_as_in_the_table(cls):
    row = table()[type_name(cls.TYPE)]
    assert row.number == cls.TYPE
    assert bool(row.asked) is not cls.ONLY_SENT
    if cls is VirtConfig:  # each of its types has its own layout
        assert row.asked[0][0] == cls.LEAST
    elif row.asked:
        assert row.asked[0] == (cls.LEAST, cls.ENTRY)
        assert row.asked[-1] == (cls.SIZE, cls.ENTRY)


@pytest.mark.parametrize("cls", REPORTS.values(), ids=lambda cls: cls.__name__)
def test_answers_are_declared_as_in_the_table(cls):
    """The longest form, and the shortest if the device sends more than one."""
    reported = table()[type_name(cls.TYPE)].reported
    assert reported[-1] == (cls.SIZE, cls.ENTRY)
    assert reported[0][0] == cls.LEAST or len(reported) == 1
