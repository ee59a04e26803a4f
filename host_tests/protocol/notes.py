"""Numbers and lengths of the messages, from the table in docs/internals/protocol-notes.md, 2.

The table was written from the specification; the tests check the declaration against it."""

import re
from dataclasses import dataclass

from framestep_tools.building.board_files import ROOT

NOTES = ROOT / "docs/internals/protocol-notes.md"
_ROW = re.compile(r"^\| ([A-Z_0-9]+)[^|]*\| (0x[0-9A-F]{4}) \|([^|]*)\|([^|]*)\|$", re.MULTILINE)


@dataclass(frozen=True)
class Row:
    """asked, told: the forms that a host and the device may send: (bytes, bytes per entry)."""

    number: int
    asked: list[tuple[int, int]]
    reported: list[tuple[int, int]]

    def fits(self, length):
        """Whether a request may have that length (field note 1.8): more may follow the longest form
        of a fixed layout, and a length between two forms counts as the shorter one."""
        return any(
            length >= least and (not entry or (length - least) % entry == 0)
            for least, entry in self.asked
        )


def forms(text):
    """Return [(least, bytes of an entry)] of "4 + 8n", "29, 31 with flags" and the like."""
    found = [re.match(r" *(\d+)(?: \+ (\d*)n)?", part) for part in re.split("[,;]", text)]
    return [(int(m[1]), 0 if m[2] is None else int(m[2] or 1)) for m in found if m is not None]


def table():
    """Return {message: Row}."""
    section = NOTES.read_text().split("## 2.")[1].split("## 3.")[0]
    return {
        name: Row(int(number, 16), forms(asked), forms(reported))
        for name, number, asked, reported in _ROW.findall(section)
    }
