"""`make test` gives the same verdict each time: no test depends on chance, or on what ran
before."""

import ast
import functools
import os
import subprocess
import sys
from pathlib import Path

import hypothesis

from framestep_tools.building.board_files import ROOT

TESTS = ROOT / "host_tests"
SEEDED = {"Random", "default_rng"}  # with an argument
DRAWN = """
import json, sys
sys.path[:0] = [{tests!r}, {core!r}]
import conftest
from hypothesis import given, strategies as st
for name in sys.argv[1:]:
    __import__(name)
drawn = []
@given(st.lists(st.integers(), min_size=3), st.floats(), st.text())
def draw(a, b, c):
    drawn.append(repr((a, b, c)))
draw()
print(json.dumps(drawn))
"""


@functools.cache
def sources():
    return {path: ast.parse(path.read_text()) for path in sorted(TESTS.rglob("*.py"))}


def dotted(node):
    """Return the dotted name that an expression is, such as np.random; "" if it is none."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=value, attr=name) if owner := dotted(value):
            return f"{owner}.{name}"
    return ""


def calls(tree):
    """Return (module or object, function, node) of each call of an attribute."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            yield dotted(node.func.value), node.func.attr, node


def test_every_source_of_chance_has_a_seed():
    for path, tree in sources().items():
        if path == Path(__file__):
            continue
        for owner, name, node in calls(tree):
            where = f"{path.relative_to(ROOT)}:{node.lineno}: {name}"
            if name in SEEDED:
                assert node.args, f"{where} needs a seed"
            elif owner in ("random", "np.random", "numpy.random") and name[0].islower():
                # np.random.default_rng(3) is often named `random`
                named = any(
                    isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store) and n.id == owner
                    for n in ast.walk(tree)
                ) or any(isinstance(n, ast.arg) and n.arg == owner for n in ast.walk(tree))
                assert named, f"{where} draws from the module's own generator"
            assert name not in ("urandom", "uuid4", "token_bytes", "SystemRandom"), where


def test_no_test_leaves_the_profile():
    """Examples are drawn from a fixed seed, none is remembered, and slow computers do not fail."""
    profile = hypothesis.settings()
    assert profile.derandomize
    assert profile.database is None
    assert profile.deadline is None
    assert hypothesis.HealthCheck.too_slow in profile.suppress_health_check
    for path, tree in sources().items():
        for node in ast.walk(tree):
            if (
                isinstance(node, ast.Call)
                and getattr(node.func, "attr", dotted(node.func)) == "settings"
            ):
                given = {k.arg: ast.unparse(k.value) for k in node.keywords}
                where = f"{path.relative_to(ROOT)}:{node.lineno}"
                assert given.get("derandomize", "True") == "True", where
                assert given.get("database", "None") == "None", where
                assert given.get("deadline", "None") == "None", where
                assert (
                    given.get("suppress_health_check", "list(HealthCheck)") == "list(HealthCheck)"
                ), where


def test_what_is_asked_of_a_target_is_not_asked_of_those_that_it_makes(tmp_path):
    """`make test ARGS=--durations=9` runs tests that build an image; make must not pass the option
    on."""
    makefile = tmp_path / "Makefile"
    makefile.write_text(
        f"include {ROOT / 'Makefile'}\n"
        "outer:\n"
        "\t@echo '$(ARGS) $(SEED)'; "
        f"$(MAKE) --no-print-directory -f {makefile} inner BOARD=skr_pico\n"
        'inner:\n\t@echo "$(ARGS)$$ARGS$(SEED)$$SEED $(BOARD)"\n'
    )
    command = ["make", "-f", makefile, "outer", "ARGS=--durations=9", "SEED=3", "BOARD=pico2"]
    # of an outer `make test`
    outside = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    made = subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=ROOT, env=outside
    )
    assert made.stdout.splitlines() == ["--durations=9 3", " skr_pico"]


def drawn(*modules):
    """Return the examples of a test after these modules have been imported."""
    script = DRAWN.format(tests=str(TESTS), core=str(ROOT / "firmware"))
    return subprocess.run(
        [sys.executable, "-c", script, *modules], capture_output=True, text=True, check=True
    ).stdout


def test_examples_do_not_depend_on_what_is_imported():
    """Hypothesis would draw numbers from the loaded modules, and so depend on tests that ran
    before."""
    imported = ["framestep.rig", "framestep_tools.payloads", "framestep.motion.ramps"]
    assert drawn() == drawn(*imported) != ""
