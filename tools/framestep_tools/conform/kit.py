"""Checks, and how they are run."""

import functools
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

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


class LeftOut(Exception):
    """The device has not what a check is about."""


def only_if(it_has: object) -> None:
    """Leave out a check unless the device has what it is about."""
    if not it_has:
        raise LeftOut


# the values of a word in a check's name: {shown: value}, or values that are shown as they are
Values = Mapping[str, Any] | Iterable[Any]


class Subject:
    """The checks of one subject: functions below a line that says what a device must or should do.

        @MOTORS.must("JOG at {speed} {way}, then STOP", "MSG_MOTOR_JOG",
                     speed=(1000, 5000), way={"up": 1, "down": -1})
        def jogged(bench, speed, way): ...

    are four checks. A function raises Failed, or returns a text that is reported as a reading. A
    name that cannot have all combinations takes rows: `rows={"up to 5": (5, 1)}` are shown as
    `{row}` and are the arguments.
    """

    def __init__(
        self, name: str, needs: Callable[[Bench], object] = lambda bench: True, full: bool = False
    ):
        self.name = name
        self.needs = needs
        self.full = full
        self.checks: list[Check] = []

    def where(self, needs: Callable[[Bench], object]) -> "Subject":
        """Return the part of the subject for devices that have something more."""
        part = Subject(self.name, lambda bench: self.needs(bench) and needs(bench), self.full)
        part.checks = self.checks
        return part

    def must(self, name: str, source: str, /, **more: Any) -> Callable[[Any], Any]:
        """Register what a device must do; see Check for `needs` and `full`."""
        return self._register(MUST, name, source, **more)

    def should(self, name: str, source: str, /, **more: Any) -> Callable[[Any], Any]:
        """Register what a device should do."""
        return self._register(SHOULD, name, source, **more)

    def reading(self, name: str, source: str, /, **more: Any) -> Callable[[Any], Any]:
        """Register what is only reported."""
        return self._register(READING, name, source, **more)

    def _register(
        self,
        level: str,
        name: str,
        source: str,
        /,
        needs: Callable[[Bench], object] = lambda bench: True,
        full: bool = False,
        rows: Mapping[str, tuple[Any, ...]] | None = None,
        **values: Values,
    ) -> Callable[[Any], Any]:
        def has(bench: Bench) -> bool:
            return bool(self.needs(bench) and needs(bench))

        def register(check: Any) -> Any:
            for row, arguments in (rows or {"": ()}).items():
                for shown, chosen in _combinations(values):
                    run = functools.partial(_run, check, arguments, chosen)
                    text = name.format(row=row, **shown)
                    self.checks.append(
                        Check(self.name, text, source, run, level, has, self.full or full)
                    )
            return check

        return register


def _run(check: Any, arguments: tuple[Any, ...], chosen: dict[str, Any], bench: Bench) -> Any:
    return check(bench, *arguments, **chosen)


def _combinations(values: Mapping[str, Values]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yield {name: shown} and {name: value}, for all combinations."""
    columns = [
        list(column.items()) if isinstance(column, Mapping) else [(each, each) for each in column]
        for column in values.values()
    ]
    for chosen in itertools.product(*columns):
        yield (
            dict(zip(values, [shown for shown, _ in chosen], strict=True)),
            dict(zip(values, [value for _, value in chosen], strict=True)),
        )


def once(play: Callable[..., Any]) -> Callable[..., Any]:
    """Play something only once for all the checks that judge it."""

    @functools.wraps(play)
    def played(bench: Bench, *arguments: Any) -> Any:
        key = play, arguments
        if key not in bench.kept:
            bench.kept[key] = play(bench, *arguments)
        return bench.kept[key]

    return played


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
        only_if(check.needs(bench))
        text = check.run(bench)
        bench.rest()
    except LeftOut:
        return Result(check, LEFT_OUT, "the device does not advertise it, or nothing shows it")
    except Failed as failed:
        bench.recover()
        return Result(check, FAULT if check.level == MUST else DEPARTS, str(failed))
    return Result(check, READING, text) if text else Result(check, PASSED)
