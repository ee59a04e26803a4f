"""Compares what a script does on CPython and on 32-bit MicroPython."""

from pathlib import Path

from hypothesis import HealthCheck, Phase, settings

from framestep_tools.client.wire import FrameDecoder

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


def said(module):
    """Return what module.replay() says on CPython, line by line; keep its session's script."""
    lines = []
    script = module.session.script
    try:
        module.replay(lines.append)
    finally:
        module.session.script = script
    return lines


def assert_same(runtime, module):
    """Assert that module.replay() says the same on MicroPython."""
    name = module.__name__.rpartition(".")[2]
    output = runtime.run(f"from {name} import replay\nreplay(print)\n", path=[HERE], heap="440k")
    assert output.split("\n")[:-1] == said(module)


def frames(lines):
    """Feed a FrameDecoder with the output. Return it and its frames."""
    decoder = FrameDecoder()
    return decoder, [f for line in lines[:-1] for f in decoder.feed(bytes.fromhex(line.split()[1]))]
