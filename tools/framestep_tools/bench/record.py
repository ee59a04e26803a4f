"""The figures that `make bench` has recorded last, and what has become worse since.

`make bench ARGS=--renew` records the present ones. The commit says why any of them is worse. A
figure that is not in the record is not compared: it joins with the next --renew.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

from .figures import Figure, number

RECORD = Path(__file__).with_name("record.json")
TOLERANCE = 0.03


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
    """Return a line for each of the figures that is worse by more than TOLERANCE than the recorded
    one, or is recorded and was not measured."""
    kinds = {figure.key: figure for figure in figures}
    lines = [f"{key}: recorded, but not measured" for key in kept if key not in values]
    for key, value in values.items():
        if key not in kept:
            continue
        figure = kinds[key if key in kinds else key.removesuffix("_200")]
        limit = kept[key]
        if figure.at_least is not None:
            is_worse = value < limit * (1 - TOLERANCE)
        else:
            is_worse = value > limit * (1 + TOLERANCE)
        if is_worse:
            lines.append(f"{key}: {number(value)} {figure.unit}, recorded {number(limit)}")
    return lines
