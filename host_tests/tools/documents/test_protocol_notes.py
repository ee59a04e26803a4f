"""docs/protocol-notes.md: every number that is cited exists, and the frames that it shows are what
is sent."""

import itertools
import re
import struct
import subprocess

from framestep.protocol import messages
from framestep_tools.building.board_files import ROOT
from framestep_tools.client.wire import FrameDecoder
from framestep_tools.payloads import REPORTS, TYPE_NAMES, codec

NOTES = ROOT / "docs" / "protocol-notes.md"
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
    """Those that the notes have: sections and notes."""
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
    """No number twice, none left out."""
    order = [
        tuple(map(int, n.split(".")))
        for n in re.findall(r"^\*\*(\d+\.\d+)\*\* ", NOTES.read_text(), re.MULTILINE)
    ]
    for before, after in itertools.pairwise(order):
        assert after in ((before[0], before[1] + 1), (before[0] + 1, 1), (before[0] + 2, 1)), after


def test_frame_vectors():
    """Field note 10: the frames there are frames, but for the one that is to be refused."""
    lines = re.findall(
        r"^(.+?): +((?:[0-9A-F]{2} ?)+)$", NOTES.read_text().split("## 10.")[1], re.MULTILINE
    )
    assert len(lines) == 6
    source = (ROOT / "host_tests" / "protocol" / "test_frames.py").read_text()
    for name, text in lines:
        assert text.strip() in source, f"{name}: the frame reader is not tested with it"
        frames = FrameDecoder().feed(bytes.fromhex(text))
        assert len(frames) == (0 if "refused" in name else 1), name


def lengths():
    """{message: (from the host, from the device)} of the table in 2, as text."""
    section = NOTES.read_text().split("## 2.")[1].split("## 3.")[0]
    rows = re.findall(r"^\| ([A-Z_0-9]+)[^|]*\|([^|]*)\|([^|]*)\|$", section, re.MULTILINE)
    return {name: (asked.strip(), told.strip()) for name, asked, told in rows}


def sizes(text):
    """(least, bytes of an entry) of "4 + 8n", "31, 35 with angles" and the like."""
    least, entry = re.match(r"(\d+)(?: \+ (\d*)n)?", text).groups()
    return int(least), 0 if entry is None else int(entry or 1)


def test_every_message_has_its_lengths_in_the_notes():
    told = lengths()
    missing = sorted(set(TYPE_NAMES.values()) - told.keys())
    assert not missing, f"add a row to the table in 2 of docs/protocol-notes.md: {missing}"
    gone = sorted(told.keys() - set(TYPE_NAMES.values()))
    assert not gone, (
        f"no MSG_ in protocol/messages.py, so take out of 2 of docs/protocol-notes.md: {gone}"
    )


def test_lengths_in_the_notes_are_those_of_the_code():
    told = lengths()
    for kind, wanted in messages.REQUESTS.items():
        name = TYPE_NAMES[kind]
        if name not in told:
            continue  # the test above says what to do
        if kind == messages.MSG_VIRT_CONFIG:  # each type has its own
            wanted = (wanted[0], 0)
        assert sizes(told[name][0]) == wanted, (
            f"{name}: the table in 2 of docs/protocol-notes.md says {told[name][0]!r}, "
            f"REQUESTS in protocol/messages.py {wanted}"
        )


def test_lengths_in_the_notes_are_those_of_the_answers():
    """The least that the device sends, each entry that repeats left out."""
    told = lengths()
    for kind, cls in REPORTS.items():
        least = sum(
            struct.calcsize("<" + code)
            for _, code, optional in codec.layout(cls)
            if not optional and not isinstance(code, type) and code[0] != "*"
        )
        longest = least + sum(
            struct.calcsize("<" + code) for _, code, optional in codec.layout(cls) if optional
        )
        name = TYPE_NAMES[kind]
        if name not in told:
            continue
        assert told[name][1], f"{name}: say in 2 of docs/protocol-notes.md what the device sends"
        assert least <= sizes(told[name][1])[0] <= longest, (
            f"{name}: the table in 2 of docs/protocol-notes.md says {told[name][1]!r}, "
            f"the class in framestep_tools/payloads has {least} to {longest} bytes"
        )
