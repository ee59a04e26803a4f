"""Make the tables of settings in docs/use/rig-file.md from the code that reads the rig file.

python -m framestep_tools.documents.rig_table          put it there
"""

import json

from framestep.rig import homes, servos, settings

from ..building.board_files import ROOT

PAGE = ROOT / "docs/use/rig-file.md"
BEGIN = "<!-- rig table: made by python -m framestep_tools.documents.rig_table -->\n"
END = "<!-- end of rig table -->"


def _allowed(kind: type, low: object, high: object, unit: str) -> str:
    if isinstance(low, tuple):
        return ", ".join(f"`{json.dumps(choice)}`" for choice in low)
    if kind is bool:
        return "`true`, `false`"
    if kind is list:
        return "a list" if high is None else f"a list of at most {high}"
    if kind is dict:
        return "an object"
    numbers = f"{low} … {high}" if low is not None else kind.__name__
    return f"{numbers} {unit}".strip()


def _rows(settings: dict, prefix: str = "") -> list[str]:
    rows = []
    for key, (kind, low, high, default, unit, meaning) in settings.items():
        shown = (
            str(default).lower() if isinstance(default, bool) else repr(default).replace("'", '"')
        )
        shown = "–" if default is None else f"`{shown}`"
        rows.append(
            f"| `{prefix}{key}` | {_allowed(kind, low, high, unit)} | {shown} | {meaning} |"
        )
    return rows


def table() -> str:
    """The table as Markdown."""
    head = ["| key | allowed | default | meaning |", "|---|---|---|---|"]
    rows = _rows(settings.SETTINGS)
    rows += _rows(settings.MOTOR_SETTINGS, "motors[].")
    rows += _rows(settings.DRIVER_SETTINGS, "motors[].driver.")
    rows += _rows(homes.HOME_SETTINGS, "motors[].home.")
    rows += _rows(servos.SERVO_SETTINGS, "motors[].servo.")
    rows += _rows(settings.OUTPUT_SETTINGS, "outputs[].")
    rows += _rows(settings.INPUT_SETTINGS, "inputs[].")
    rows += _rows(settings.LIMIT_SETTINGS, "limits[].")
    return "\n".join(head + rows) + "\n"


def updated(text: str) -> str:
    """The page's text with the present table in it."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END, 1)[1]


if __name__ == "__main__":
    PAGE.write_text(updated(PAGE.read_text()))
