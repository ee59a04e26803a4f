"""Make the tables of settings in docs/use/rig-file.md from the code that reads the rig file.

python -m framestep_tools.documents.rig_table          put it there
"""

import json

from framestep.rig import homes, pendants, servos, settings

from ..building.board_files import ROOT

PAGE = ROOT / "docs/use/rig-file.md"
BEGIN = "<!-- rig table: made by python -m framestep_tools.documents.rig_table -->\n"
END = "<!-- end of rig table -->"
_HEAD = ("| key | allowed | default | meaning |", "|---|---|---|---|")
# The settings that belong to a task; with a dot at its end, a name stands for all settings in it
TASKS = {
    "Board and host": (
        "name", "dialect", "ports", "uart_baud", "report_ms", "jog_timeout_ms", "watchdog",
        "virtuals", "clock_mhz",
    ),
    "Motors": (
        "motor_count", "motors", "motors[].type", "motors[].invert", "motors[].pulse_us",
        "motors[].setup_us", "motors[].hold_us", "motors[].enable_high", "motors[].enable_ms",
        "motors[].off_after_s",
        "motors[].backlash", "motors[].jerk",
        "hard_stop_factor", "remember_positions",
    ),
    "E-stop and limit switches": ("estop", "estop_cuts_power", "limits", "limits[]."),
    "Drivers": ("motors[].driver", "motors[].driver."),
    "Homing": ("motors[].home", "home_input", "motors[].home."),
    "Servos": ("motors[].servo", "motors[].servo."),
    "Pendant": ("pendant", "pendant."),
    "Moves": ("strict_moves", "smoothing", "go_input", "shoot_input"),
    "Camera, outputs and inputs": (
        "shutter_on", "shutter_delay_ms", "shutter_hold_ms", "meter_on", "outputs", "outputs[].",
        "inputs", "inputs[].",
    ),
    "Lights": ("dmx", "dmx_break_us", "dmx_mark_us", "dmx_ramp_ms"),
}  # fmt: skip


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
        if default is None:
            shown = "–" if kind in (dict, list) else "required"
        else:
            shown = f"`{shown}`"
        rows.append(
            f"| `{prefix}{key}` | {_allowed(kind, low, high, unit)} | {shown} | {meaning} |"
        )
    return rows


def _all_rows() -> dict[str, str]:
    """Return a table's line for each key."""
    rows = _rows(settings.SETTINGS)
    rows += _rows(settings.MOTOR_SETTINGS, "motors[].")
    rows += _rows(settings.DRIVER_SETTINGS, "motors[].driver.")
    rows += _rows(homes.HOME_SETTINGS, "motors[].home.")
    rows += _rows(servos.SERVO_SETTINGS, "motors[].servo.")
    rows += _rows(pendants.PENDANT_SETTINGS, "pendant.")
    rows += _rows(settings.OUTPUT_SETTINGS, "outputs[].")
    rows += _rows(settings.INPUT_SETTINGS, "inputs[].")
    rows += _rows(settings.LIMIT_SETTINGS, "limits[].")
    return {row.split("`")[1]: row for row in rows}


def table() -> str:
    """Return the tables as Markdown, one for each task."""
    rows, parts = _all_rows(), []
    for task, keys in TASKS.items():
        mine = [
            rows.pop(key)
            for wanted in keys
            for key in list(rows)
            if key == wanted or (wanted.endswith(".") and key.startswith(wanted))
        ]
        parts.append("\n".join([f"### {task}", "", *_HEAD, *mine]))
    assert not rows, f"give these settings a task in TASKS: {sorted(rows)}"
    return "\n\n".join(parts) + "\n"


def updated(text: str) -> str:
    """Return the page's text with the present tables in it."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + table() + END + rest.split(END, 1)[1]


if __name__ == "__main__":
    PAGE.write_text(updated(PAGE.read_text()))
