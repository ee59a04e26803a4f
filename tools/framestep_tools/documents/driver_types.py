"""Make the table of driver types in docs/use/drivers.md from the one that the board uses.

python -m framestep_tools.documents.driver_types          put it there
"""

from framestep.rig.drivers import TYPE_SETTINGS

from ..building.board_files import ROOT

PAGE = ROOT / "docs/use/drivers.md"
BEGIN = "<!-- driver types: made by python -m framestep_tools.documents.driver_types -->\n"
END = "<!-- end of driver types -->"


def table() -> str:
    """Return the table as Markdown."""
    lines = [
        "| `type` | `pulse_us` | `setup_us` | `hold_us` | `enable_ms` | steps/s at most | source |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, (pulse, setup, hold, enable, _, source) in TYPE_SETTINGS.items():
        fastest = min(500_000, int(500_000 / max(pulse, 1.0)) // 1000 * 1000)
        lines.append(
            f"| `{name}` | {pulse:g} | {setup:g} | {hold:g} | {enable} | {fastest} | {source} |"
        )
    return "\n".join(lines) + "\n"


def updated(text: str) -> str:
    """Return the page's text with the present table in it."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END, 1)[1]


if __name__ == "__main__":
    PAGE.write_text(updated(PAGE.read_text()))
