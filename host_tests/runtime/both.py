"""Compares what a script does on CPython and on 32-bit MicroPython."""

from pathlib import Path

from hypothesis import HealthCheck, Phase, settings

HERE = Path(__file__).parent


def many(examples):
    """Return settings for tests that play many scripts with each start of MicroPython.

    Failures are not shrunk: the tests on CPython do that.
    """
    return settings(
        max_examples=examples,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )


def assert_answers(runtime, replay, scripts, expected):
    """Assert that each line of the scripts gets the answer of expected(script).

    replay: what runs on MicroPython. scripts: lists of (line, step).
    """
    script = [step for script in runtime.share(scripts) for step in script]
    answers = runtime.run(
        replay, heap="8m", stdin="".join(line + "\n" for line, _ in script).encode()
    ).split("\n")
    assert len(answers) == len(script) + 1
    for (line, step), answer, wanted in zip(script, answers, expected(script), strict=False):
        assert answer == wanted, (line[:60], step[:4])
