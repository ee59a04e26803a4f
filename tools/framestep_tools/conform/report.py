"""Results of the kit as text, for programs, or as a page."""

import html
from collections import Counter
from collections.abc import Iterable
from typing import Any

from .kit import DEPARTS, FAULT, LEFT_OUT, NOT_JUDGED, PASSED, READING, Result

_ORDER = (FAULT, DEPARTS, NOT_JUDGED, READING, LEFT_OUT, PASSED)


def counts(results: Iterable[Result]) -> str:
    """Return a line with the number of each verdict."""
    found = Counter(result.verdict for result in results)
    shown = [v for v in reversed(_ORDER) if v != NOT_JUDGED or found[v]]
    return ", ".join(f"{found[verdict]} {verdict}" for verdict in shown)


def line(result: Result) -> str:
    """Return a result as a line."""
    check = result.check
    text = f": {result.text}" if result.text else ""
    return f"{result.verdict:8} {check.subject}: {check.name}{text} [{check.level}; {check.source}]"


def as_json(device: str, results: Iterable[Result]) -> dict[str, Any]:
    """Return the results for programs, and as a baseline for a later run."""
    return {
        "device": device,
        "checks": [
            {
                "subject": r.check.subject,
                "name": r.check.name,
                "level": r.check.level,
                "source": r.check.source,
                "verdict": r.verdict,
                "text": r.text,
            }
            for r in results
        ],
    }


def as_html(device: str, results: list[Result]) -> str:
    """Return a page that needs no other files."""
    rows = "\n".join(
        "<tr>"
        + "".join(
            f"<td>{html.escape(text)}</td>"
            for text in (
                r.verdict,
                r.check.subject,
                r.check.name,
                r.text,
                r.check.level,
                r.check.source,
            )
        )
        + "</tr>"
        for r in sorted(results, key=lambda r: _ORDER.index(r.verdict))
    )
    return (
        '<!doctype html><meta charset="utf-8">'
        f"<title>Conformance of {html.escape(device)}</title>"
        "<style>body{font:14px sans-serif}td{border-bottom:1px solid #ccc;padding:2px 8px}</style>"
        f"<h1>{html.escape(device)}</h1><p>{counts(results)}</p><table>"
        "<tr><th>verdict<th>subject<th>check<th>what was found<th>level<th>source</tr>"
        f"{rows}</table>\n"
    )


def changes(before: dict[str, Any], results: Iterable[Result]) -> list[str]:
    """Return the differences from an earlier report."""
    old = {(c["subject"], c["name"]): c["verdict"] for c in before["checks"]}
    return [
        f"{r.check.subject}: {r.check.name}: was {old[key]}, is {r.verdict}"
        for r in results
        if (key := (r.check.subject, r.check.name)) in old and old[key] != r.verdict
    ]
