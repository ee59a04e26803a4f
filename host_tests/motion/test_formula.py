"""The compiler of formulas: its results, computed, against Python's arithmetic; what it refuses."""

import math
from array import array

import pytest
from hypothesis import given
from hypothesis import strategies as st

from framestep.motion import compute as c
from framestep.motion import reals
from framestep.motion.formula import FormulaError, formula
from framestep_tools.building.constants import FoldError, fold
from framestep_tools.move.kinematics import put

NAMES = {"A": 0, "B": 2, "C": 4, "D": 6, "J": 8, "SCRATCH": 16, "SCRATCH_END": 24}
END = bytes((c.END, 0, 0, 0))


def computed(text, *values):
    """Return the result of compute(), and the numbers in A, B, C, D and after J."""
    r = array("i", [0] * 24)
    for i, value in enumerate(values):
        put(r, 2 * i, value)
    code = c.compute(r, formula(NAMES, text))
    return code, [reals.value(r, i) for i in range(0, 16, 2)]


def result(text, *values):
    return computed(text, *values)[1][3]


@pytest.mark.parametrize(
    "text",
    [
        "A + B * C",
        "(A + B) * C",
        "A - B - C",
        "A - (B - C)",
        "A / B / C",
        "A / (B * C)",
        "-A * B + C",
        "-(A * B + C)",
        "A * B + B * C + C * A",
        "(A + B) * (B + C) / ((A - B) * (C - A))",
        "((A + B) * (B + C) + (A + C) * (B - C)) * ((A - C) * (B + 1) + 2)",
        "2 * A + B / 4 - 0.375 * C",
        "100000 * A / 360",
        "A * 2 ** -5 - 7",
        "-3",
    ],
)
def test_precedence_and_parts(text):
    values = {"A": 3.25, "B": -1.5, "C": 7.75}
    assert result(f"D = {text}", *values.values()) == pytest.approx(
        eval(text, {}, values), rel=2**-26
    )


@given(st.floats(-100, 100), st.floats(-100, 100))
def test_functions(a, b):
    assert result("D = min(A, B)", a, b) == pytest.approx(min(a, b))
    assert result("D = max(A + 1, B - 1)", a, b) == pytest.approx(max(a + 1, b - 1), abs=1e-6)
    assert result("D = floor(A / 2 + 0.5)", a) == pytest.approx(math.floor(a / 2 + 0.5))
    assert result("D = sqrt(A * A + B * B)", a, b) == pytest.approx(math.hypot(a, b), abs=1e-6)
    angle = result("D = angle(A, B)", a, b) - math.degrees(math.atan2(a, b))
    assert min(abs(angle), abs(abs(angle) - 360)) < 1e-5 or not (abs(a) > 1e-6 or abs(b) > 1e-6)


def test_names_of_its_own_are_kept_apart_from_parts():
    text = """
        sum = A + B
        difference = A - B
        D = (sum * sum - difference * difference) / (4 * B)
        sum = sum + D  # from now on another
        C = sum
    """
    assert computed(text, 3, 5)[1][:4] == [3, 5, 11, 3]


def test_a_register_that_is_read_is_changed_last():
    assert computed("A = (A + B) * (A - B)", 5, 3)[1][0] == 16
    assert computed("A = B * B - A * B", 5, 3)[1][0] == -6
    assert computed("A = A * A + A", 5)[1][0] == 30
    assert computed("A = A + 1", 5)[1][0] == 6
    assert computed("A = 3 * A", 5)[1][0] == 15
    assert computed("A = 2 / A", 4)[1][0] == 0.5
    assert computed("A = max(A, 1)", 5)[1][0] == 5


def test_sine_and_cosine():
    code, (a, b, *_) = computed("A, B = sincos(A + 30)", 30)
    assert code == 1
    assert (a, b) == (pytest.approx(math.sqrt(3) / 2), pytest.approx(0.5))


def test_registers_by_number():
    assert computed("J[0] = A\nJ[3] = J[0] + A", 2)[1][4:] == [2, 0, 0, 4]


@pytest.mark.parametrize(
    "condition, holds",
    [
        ("A > B", False), ("A >= B", True), ("A < B", False), ("A <= B", True), ("A + 1 > B", True),
        ("A < B * 2", True),
    ],
)  # fmt: skip
def test_what_does_not_hold_ends_it(condition, holds):
    code, numbers = computed(f"C = 1\nassert {condition}\nD = 1", 4, 4)
    assert (code, numbers[2:4]) == (int(holds), [1, int(holds)])


def test_the_fewest_operations():
    """Powers of two are not multiplied; the result's register is used for intermediate results."""
    cosine = "D = sqrt((A - B) * (A + B))"
    assert formula(NAMES, cosine) == END.join(
        [
            bytes(
                (c.SUBTRACT, 6, 0, 2)
                + (c.ADD, 16, 0, 2)
                + (c.MULTIPLY, 6, 6, 16)
                + (c.ROOT, 6, 6, 6)
            ),
            b"",
        ]
    )
    assert formula(NAMES, "D = A / 8") == bytes((c.SCALE, 6, 0, 0, 125, 0, 0, 0)) + END
    assert formula(NAMES, "D = A") == bytes((c.COPY, 6, 0, 6)) + END
    assert formula(NAMES, "D = A\n...") == bytes((c.COPY, 6, 0, 6))
    assert formula(NAMES, "") == END


@pytest.mark.parametrize(
    "text, line, reason",
    [
        ("D = A +", 1, "invalid syntax"),
        ("\nD = A\nD = E", 3, "E is no register, and has no value yet"),
        ("D = x", 1, "x is no register, and has no value yet"),
        ("x = x + A", 1, "x is no register, and has no value yet"),
        ("\n\nsum = A", 3, "sum is no register, and nothing uses it"),
        ("E = A", 1, "no register: E"),
        ("D = J[A]", 1, "a register's number has to be a literal"),
        ("D = J[200]", 1, "is no register of 0 to 254"),
        ("D = sin(A)", 1, "not an expression of a formula: sin(A)"),
        ("D = min(A)", 1, "min() takes 2"),
        ("D = A ** 2", 1, "not an expression of a formula"),
        ("D = A % B", 1, "not an expression of a formula"),
        ("D = A / 0", 1, "divided by 0"),
        ("D = 1 / 3", 1, "has no exact binary form"),
        ("D = 0.1", 1, "more than 16 digits in binary"),
        ("D = 100003", 1, "more than 16 digits in binary"),
        ("D = 2 ** 200 * A", 1, "2 to the power of 200"),
        ("A, B = angle(C, D)", 1, "sincos"),
        ("A, A = sincos(C)", 1, "sine and cosine need a register each"),
        ("assert A == B", 1, "no condition that a formula can have"),
        ("assert A < B < C", 1, "no condition that a formula can have"),
        ("A += B", 1, "not a line of a formula"),
        ("print(A)", 1, "not a line of a formula"),
        ("...\nA = B", 2, "nothing may follow ..."),
        ("a = A\nb = A\nc = A\nd = A\ne = A\nD = a + b + c + d + e", 5, "too few free registers"),
    ],
)
def test_errors_say_where(text, line, reason):
    with pytest.raises(FormulaError) as error:
        formula(NAMES, text)
    assert error.value.line == line
    assert reason in error.value.reason


REGISTERS = "from framestep.base.native import const\nA = const(0)\nB = const(2)\n_C = const(4)\n"
USER = """from framestep.motion.formula import formula
from framestep.motion.compute import compute
from framestep import registers
from framestep.registers import A

SUM = formula(
    registers,
    '''
    A = A + B
    ''',
)


def run(r):
    return compute(r, SUM), r[A]
"""


def folded(text):
    return fold({"framestep/registers.py": REGISTERS, "framestep/user.py": text})[
        "framestep/user.py"
    ]


def test_the_build_puts_the_bytes_there():
    names: dict[str, object] = {}
    text = folded(USER)
    assert "formula" not in text
    assert "registers" not in text
    assert text.count("\n") == USER.count("\n"), "lines stay where they are"
    exec(text, names)
    assert names["SUM"] == formula({"A": 0, "B": 2}, "A = A + B")


def test_a_name_of_the_module_s_own_takes_no_memory():
    text = folded(USER.replace("SUM", "_SUM"))
    assert "_SUM" not in text
    assert text.count("\n") == USER.count("\n")
    names: dict[str, object] = {}
    exec(text, names)
    r = array("i", [0] * 4)
    reals.put(r, 0, 5, 0)
    reals.put(r, 2, 6, 0)
    assert names["run"](r)[0] == 1  # type: ignore[operator]
    assert reals.value(r, 0) == 11


def test_registers_of_the_same_module():
    text = (
        "from framestep.motion.formula import formula\n"
        + REGISTERS
        + "F = formula(globals(), '_C = A * B')\n"
    )
    names: dict[str, object] = {}
    exec(folded(text).replace("from framestep.base.native import const", "const = int"), names)
    assert names["F"] == formula({"A": 0, "B": 2, "_C": 4}, "_C = A * B")


def test_errors_of_the_build_give_file_and_line():
    with pytest.raises(
        FoldError, match=r"framestep/user.py, line 9: C is no register, and has no value yet"
    ):
        folded(USER.replace("A + B", "A + C"))
    with pytest.raises(
        FoldError, match=r"line 6: formula\(\) takes a module, or globals\(\), the names of"
    ):
        folded(USER.replace("    registers,\n", "    names(),\n"))


# ---------------------------------------------------------------- parameters and results

ROOM = {"ARGUMENTS": 10, "ARGUMENTS_END": 16, "SCRATCH": 20, "SCRATCH_END": 30, "LIMIT": 0}


def test_parameters_and_results_have_registers_in_their_order():
    made = formula(ROOM, "way, ticks -> rate", "rate = way / ticks + LIMIT")
    assert (made.way, made.ticks, made.rate) == (10, 12, 14)
    assert made.writes == {14}
    with pytest.raises(AttributeError, match="speed is no parameter or result"):
        _ = made.speed
    after = formula(ROOM, "rate, way -> more", "more = rate + way", rate=made.rate)
    assert (after.rate, after.way, after.more) == (14, 10, 12)


@pytest.mark.parametrize(
    "names, text, reason",
    [
        ("a -> b", "b = 1", "a is no register, and nothing uses it"),
        ("a -> b", "LIMIT = a", "nothing gives the result b"),
        ("-> b", "LIMIT = b", "the result b has no value yet"),
        ("a, a", "LIMIT = a", "a is named twice"),
        ("a, b, c, d", "LIMIT = a + b + c + d", "ARGUMENTS has room for fewer"),
        ("count", "LIMIT = count", "count cannot name a parameter"),
        ("A", "LIMIT = A", "A cannot name a parameter"),
    ],
)
def test_wrong_parameters_and_results(names, text, reason):
    with pytest.raises(FormulaError, match=reason):
        formula(ROOM, names, text)


def test_a_place_for_no_parameter_is_refused():
    with pytest.raises(FormulaError, match="no parameter of this formula: b"):
        formula(ROOM, "a", "LIMIT = a", b=12)
