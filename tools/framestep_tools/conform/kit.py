"""Checks, and running them one after another."""

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from .bench import Bench
from .link import Failed

MUST, SHOULD, READING = "must", "should", "reading"
PASSED, FAULT, DEPARTS, LEFT_OUT = "passed", "fault", "departs", "left out"


class Check(NamedTuple):
    """One thing that a device must or should do, and the words it rests on.

    `run` raises Failed, or gives back a text that is reported as a reading. `needs` says whether
    the device has what is checked; `full` ones are for the bench only.
    """

    subject: str
    name: str
    source: str
    run: Callable[[Bench], str | None]
    level: str = MUST
    needs: Callable[[Bench], bool] = lambda bench: True
    full: bool = False


class Result(NamedTuple):
    """What came of a check: one of PASSED, FAULT (a must), DEPARTS (a should), READING,
    LEFT_OUT."""

    check: Check
    verdict: str
    text: str = ""


def every_check() -> list[Check]:
    """All of them, by subject, in the order in which they run."""
    from .checks import SUBJECTS

    return [check for subject in SUBJECTS for check in subject.CHECKS]


def run(
    bench: Bench,
    checks: Iterable[Check],
    tell: Callable[[Result], None] = lambda result: None,
) -> list[Result]:
    """Run checks; after each the device stands still again with no limits set."""
    results = []
    for result in results_of(bench, checks):
        results.append(result)
        tell(result)
    return results


def results_of(bench: Bench, checks: Iterable[Check]) -> Iterator[Result]:
    """The same one by one, for whoever has seen enough after the first that fails."""
    return (_one(bench, check) for check in checks)


def _one(bench: Bench, check: Check) -> Result:
    if check.full and not bench.full:
        return Result(check, LEFT_OUT, "for --full only")
    try:
        if not check.needs(bench):
            return Result(check, LEFT_OUT, "the device does not advertise it, or nothing shows it")
        text = check.run(bench)
        bench.rest()
    except Failed as failed:
        bench.recover()
        return Result(check, FAULT if check.level == MUST else DEPARTS, str(failed))
    return Result(check, READING, text) if text else Result(check, PASSED)
