"""Checks, and how they are run."""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from .bench import Bench
from .link import Failed
from .pace import HELD_UP_S

MUST, SHOULD, READING = "must", "should", "reading"
PASSED, FAULT, DEPARTS, LEFT_OUT = "passed", "fault", "departs", "left out"
NOT_JUDGED = "not judged"
_TRIES = 3  # tries on the computer's clock, as other programs may hold this one up
# results of these subjects do not depend on time
_TIMELESS = ("framing", "lengths", "numbers", "uploads")


class Check(NamedTuple):
    """One thing that a device must or should do, and its source.

    run: raises Failed, or returns a text that is reported as a reading; needs: returns whether the
    device has this feature; full: only for a bench without a load.
    """

    subject: str
    name: str
    source: str
    run: Callable[[Bench], str | None]
    level: str = MUST
    needs: Callable[[Bench], bool] = lambda bench: True
    full: bool = False


class Result(NamedTuple):
    """Result of a check: PASSED, FAULT (of a must), DEPARTS (from a should), READING, LEFT_OUT, or
    NOT_JUDGED (this computer was held up)."""

    check: Check
    verdict: str
    text: str = ""


def run(
    bench: Bench,
    checks: Iterable[Check],
    show: Callable[[Result], None] = lambda result: None,
) -> list[Result]:
    """Run checks. After each one the device is at rest and has no limits."""
    results = []
    for result in results_of(bench, checks):
        results.append(result)
        show(result)
    return results


def results_of(bench: Bench, checks: Iterable[Check]) -> Iterator[Result]:
    """Yield the results one by one, so a caller can end after the first failure."""
    return (_one(bench, check) for check in checks)


def _one(bench: Bench, check: Check) -> Result:
    if check.full and not bench.full:
        return Result(check, LEFT_OUT, "for --full only")
    if not bench.hold_ups:
        return _tried(bench, check)
    found, longest = [], []
    for _ in range(_TRIES):
        bench.hold_ups.take()
        found.append(_tried(bench, check))
        longest.append(bench.hold_ups.take())
        if found[-1].verdict not in (FAULT, DEPARTS):
            break
        bench.forget()
    if len(found) == 1:
        return found[0]
    if found[-1].verdict not in (FAULT, DEPARTS):
        return Result(check, READING, f"only try {len(found)} passed; before: {found[0].text}")
    if check.subject not in _TIMELESS and min(longest) > HELD_UP_S:
        late = min(longest) * 1000
        return Result(
            check, NOT_JUDGED, f"this computer was held up for {late:.0f} ms; {found[-1].text}"
        )
    return found[-1]


def _tried(bench: Bench, check: Check) -> Result:
    try:
        if not check.needs(bench):
            return Result(check, LEFT_OUT, "the device does not advertise it, or nothing shows it")
        text = check.run(bench)
        bench.rest()
    except Failed as failed:
        bench.recover()
        return Result(check, FAULT if check.level == MUST else DEPARTS, str(failed))
    return Result(check, READING, text) if text else Result(check, PASSED)
