"""The figures that `make bench` has recorded last, and what has become worse since.

`make bench ARGS=--renew` records the present ones. The commit says why any of them is worse. A
figure that is not in the record is not compared: it joins with the next --renew.
"""

import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from .figures import Figure, number

RECORD = Path(__file__).with_name("record.json")
TOLERANCE = 0.03
IDEAL = "_ideal"  # end of the key of a figure at 125 MHz without cache misses
# These also depend on where a build puts code in flash, because that decides which code shares a
# place in the cache. In seven builds whose changes did not concern them they varied by this much.
# One of the builds differed only by 3 kB of other code in front. QUICK of them are recorded without
# cache misses, too.
_BY_PLACE = {
    "tick_us_8": 0.06,
    "frame_error_us": 0.5,
    "smoothing_load_percent": 0.25,
    "reply_ms_median": 0.05,
    "reply_ms_max": 0.35,
    "virtual_reply_ms_max": 0.15,
    "tick_late_us_worst": 0.5,
}


def recorded(file: Path = RECORD) -> dict[str, float]:
    """Return the recorded figures under the keys of bench.json."""
    return dict(json.loads(file.read_text()))


def record(values: Mapping[str, float], file: Path = RECORD) -> None:
    """Record these figures."""
    rounded = {key: float(f"{value:.4g}") for key, value in values.items()}
    file.write_text(json.dumps(rounded, indent=2) + "\n")


def worse(
    figures: Iterable[Figure], values: Mapping[str, float], kept: Mapping[str, float]
) -> list[str]:
    """Return a line for each of the figures that is worse than the recorded one by more than its
    tolerance, or is recorded and was not measured."""
    kinds = {figure.key: figure for figure in figures}
    lines = [f"{key}: recorded, but not measured" for key in kept if key not in values]
    for key, value in values.items():
        if key in kept and _change(_kind(kinds, key), value, kept[key]) < -tolerance(key):
            unit = _kind(kinds, key).unit
            lines.append(f"{key}: {number(value)} {unit}, recorded {number(kept[key])}")
    return lines


def comparison(
    figures: Iterable[Figure],
    values: Mapping[str, float],
    kept: Mapping[str, float],
    sizes: Mapping[str, tuple[int, int]],
) -> str:
    """Return a page in Markdown for a pull request: what has changed, the images, all figures.

    sizes: {board: (bytes of its image, bytes of flash left)}.
    """
    kinds = {figure.key: figure for figure in figures}
    rows, changed = [], []
    for key, value in values.items():
        kind = _kind(kinds, key)
        goal = kind.at(200).goal if key.endswith("_200") else kind.goal
        was, change = "–", ""
        if key in kept:
            was, by = number(kept[key]), _change(kind, value, kept[key])
            if abs(by) > tolerance(key):
                change = "**worse**" if by < 0 else "better"
        row = f"| {key} | {number(value)} | {was} | {goal} | {kind.unit} | {change} |"
        rows.append(row)
        changed += [row] if change else []
    head = ["| figure | now | recorded | goal | unit | |", "|---|---|---|---|---|---|"]
    images = [f"| {name} | {size:,} | {left:,} |" for name, (size, left) in sizes.items()]
    return "\n".join(
        [
            "## Figures of the emulated boards",
            "",
            *([*head, *changed] if changed else ["No figure has changed beyond its tolerance."]),
            "",
            "| image | bytes | bytes of flash left |",
            "|---|---|---|",
            *(line.replace(",", " ") for line in images),
            "",
            "<details><summary>All figures</summary>",
            "",
            *head,
            *rows,
            "",
            "</details>",
            "",
        ]
    )


def tolerance(key: str) -> float:
    """Return by what part of the recorded figure one may be worse."""
    return _BY_PLACE.get(re.sub("_(200|pico2|pico2_595)$", "", key), TOLERANCE)


def _kind(kinds: Mapping[str, Figure], key: str) -> Figure:
    return kinds[key if key in kinds else key.removesuffix("_200").removesuffix(IDEAL)]


def _change(figure: Figure, value: float, kept: float) -> float:
    """Return by what part of the recorded figure one is better; below 0: worse."""
    if value == kept:
        return 0.0
    by = (value - kept) / kept if kept else float("inf")
    return by if figure.at_least is not None else -by
