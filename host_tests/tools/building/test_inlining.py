import pytest

from framestep_tools.building.board_files import folded
from framestep_tools.building.constants import FoldError
from framestep_tools.building.inlining import inline

CLOCK = '''_WRAP = const(7)


def elapsed(now, then):
    """How long."""
    return (now - then) & _WRAP


def reached(now, then):
    return (now - then) & _WRAP < 4
'''


def inlined(text: str, clock: str = CLOCK) -> str:
    return inline({"a/clock.py": clock, "a/user.py": text}, "a/clock.py")["a/user.py"]


def test_a_call_becomes_what_the_function_gives():
    text = inlined("from a.clock import elapsed\nx = elapsed(self.now, 5) >= 3\n")
    assert text == "pass\nx = (self.now - 5 & 7) >= 3\n"


def test_an_argument_stays_one():
    """Arguments with weaker operators than the function's own, and arguments with a call."""
    values = {"a": 1, "b": 6, "c": 9}
    for arguments in (
        "a, b | c",
        "a if b else c, b",
        "reached(a, b), elapsed(c, elapsed(a, b) + 1)",
        "a, (lambda: 2)()",
    ):
        text = f"from a.clock import elapsed, reached\nx = -elapsed({arguments})\n"
        wanted: dict = dict(values)
        exec("def const(x): return x\n" + CLOCK + text.split("\n")[1], wanted)
        found: dict = dict(values)
        exec(inlined(text), found)
        assert found["x"] == wanted["x"], arguments


def test_lines_stay_where_they_are():
    text = inlined(
        "from a.clock import (\n    elapsed as since,\n)\nx = since(\n    one,\n    two\n)\ny = 1\n"
    )
    assert text.splitlines()[3] == "x = (one - two & 7)"
    assert text.splitlines()[7] == "y = 1"


@pytest.mark.parametrize(
    "use",
    [
        "f = elapsed", "x = elapsed(1)", "x = elapsed(1, then=2)", "x = elapsed(elapsed, 1)",
    ],
)  # fmt: skip
def test_another_use_is_refused(use):
    with pytest.raises(FoldError, match="line 2: elapsed has to be called, with all arguments"):
        inlined(f"from a.clock import elapsed\n{use}\n")


@pytest.mark.parametrize("result", ["now", "now + then + other"])
def test_a_function_that_is_not_fit_is_refused(result):
    with pytest.raises(FoldError, match="elapsed has to use its parameters, nothing else"):
        inlined("", f"def elapsed(now, then):\n    return {result}\n")


@pytest.mark.parametrize("result", ["then - now if now else 0", "now * now - then", "now and then"])
def test_what_may_be_computed_twice_or_not_at_all_calls_nothing(result):
    clock = f"def elapsed(now, then):\n    return {result}\n"
    text = inlined("from a.clock import elapsed\nx = elapsed(1, w[2])\n", clock)
    found: dict = {"w": [5, 6, 7]}
    exec(text, found)
    wanted: dict = {"now": 1, "then": 7}
    exec(f"x = {result}", wanted)
    assert found["x"] == wanted["x"]
    with pytest.raises(FoldError, match="none of which calls anything if it is used more"):
        inlined("from a.clock import elapsed\nx = elapsed(f(), 1)\n", clock)


PUT = '''_MASK = const(3)


def put(ring, word):
    """A word goes into the ring, then counts."""
    at = ring[4]
    ring[at & _MASK] = word
    ring[4] = at + 1
'''


@pytest.mark.parametrize("call", ["put(r, at + r[4])", "put(\n    r,\n    at - 1\n)", "put(r, 7)"])
def test_assignments_take_the_place_of_a_call(call):
    """Also where the caller has a variable of the same name, and where the argument reads what they
    change."""
    user = f"from a.clock import put\nfor at in 1, 2, 3, 4, 5:\n    {call}\n    x = at\n"
    found: dict = {"r": [0, 0, 0, 0, 0]}
    exec(inlined(user, PUT), found)
    wanted: dict = {"r": [0, 0, 0, 0, 0]}
    exec("def const(x): return x\n" + PUT + user.partition("\n")[2], wanted)
    assert (found["r"], found["x"]) == (wanted["r"], wanted["x"])
    assert "put(" not in inlined(user, PUT)
    assert inlined(user, PUT).count("\n") == user.count("\n")


@pytest.mark.parametrize("use", ["x = put(r, 1)", "put(r[0], 1)", "put(f(), 1)", "put(r, f())"])
def test_assignments_take_the_place_of_nothing_else(use):
    """As a value, with a ring that may be another after a store, with an argument that calls."""
    with pytest.raises(FoldError, match="line 2: put has to be called, with all arguments"):
        inlined(f"from a.clock import put\n{use}\n", PUT)


@pytest.mark.parametrize(
    "body",
    [
        "if now: then[0] = 1", "now = then", "f(now)\n    then[0] = 1", "return",
        "then[0] = 1; return 1",
    ],
)  # fmt: skip
def test_what_is_no_assignment_is_refused(body):
    with pytest.raises(FoldError, match="one expression, or assignments to its own variables"):
        inlined("", f"def put(now, then):\n    {body}\n")


def test_boards_have_no_functions_that_are_put_in_place():
    gone = (b"framestep.base.clock", b"framestep.motors.backlash_rules", b"framestep.pulse.engine")
    for engine in ("pio", "stream"):
        for name, text in folded({}, True, engine).items():
            itself = name.removesuffix(".py").replace("/", ".").encode() in gone
            assert itself or not any(module in text for module in gone), name
