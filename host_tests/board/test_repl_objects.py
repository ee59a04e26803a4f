"""Whatever a person at the REPL asks about: help, dir, print and tab completion of every package,
class and instance that can be reached, after each command of framestep.repl.

The commands unload their code and so leave deleted entries in the dictionaries of packages.
"""

import ast

import pytest

from framestep_tools.simulator.boards import EmulatedBoard
from host_tests.selection import sweep

COMMANDS = (
    "status()", "move(1, 200)", "stop()", "io()", "timing()", "rig()", "home(1)", "why()", "help()",
)  # fmt: skip
# Asks about an object, then prints what it contains, each as (expression, identity, type).
# Of the entries of a list three are enough. The memory for moves takes a second to print.
LOOK = """
import sys, __main__
def look(o, expression):
    if not isinstance(o, bytearray) or len(o) < 1000:
        print(o)
    help(o)
    names = dir(o)
    print("\\x02")
    if isinstance(o, dict):
        for key in o:
            tell(o[key], "%s[%r]" % (expression, key))
    elif isinstance(o, (list, tuple)):
        for i in range(min(3, len(o))):
            tell(o[i], "%s[%d]" % (expression, i))
    else:
        for name in names:
            if name[:2] != "__":
                tell(getattr(o, name, None), expression + "." + name)
def tell(inner, expression):
    print(repr((expression, id(inner), type(inner).__name__)))
"""
MODULES = """
for module in list(sys.modules.values()) + [__main__]:
    look(module, "")
    for name in dir(module):
        if isinstance(getattr(module, name), type):
            look(getattr(module, name), "")
"""
# Contain nothing. Methods and the like have no class that a user can see.
PLAIN = {"int", "float", "str", "bytes", "NoneType", "bool", "range", "object"}
CALLS = {"function", "bound_method", "closure", "generator"}


def objects(repl):
    """Give each object that can be reached to help, dir and print. Return expressions for them."""
    modules = ast.literal_eval(repl.exec("print(list(sys.modules))"))
    todo = ["__main__", *(f"sys.modules[{name!r}]" for name in modules)]
    seen, found = set(), []
    while todo:
        found.append(todo.pop())
        said = repl.exec(f"look({found[-1]}, {found[-1]!r})")
        for line in said.partition("\x02\n")[2].splitlines():
            expression, ident, kind = ast.literal_eval(line)
            if ident not in seen and kind not in PLAIN and kind not in CALLS:
                seen.add(ident)
                todo.append(expression)
    return found


def complete(repl, expressions):
    """Press the tab key behind each of these at the prompt."""
    repl.leave()
    for expression in expressions:
        repl.serial.write(f"o = {expression}\r".encode())
        repl.serial.write(b"o.\t\x03'en' 'd'\r")
        repl.expect(b"'end'\r\n>>> ")
    repl.enter()


@pytest.fixture(scope="module")
def repl():
    with EmulatedBoard({"name": "asked"}, trace=False) as board:
        repl = board.emulator.repl()
        repl.exec(LOOK)
        repl.exec("import framestep.repl")
        yield repl


@pytest.mark.parametrize("command", sweep(("pass", "status()", "home(1)", "help()"), "status()"))
def test_every_module_and_class_answers(repl, command):
    """Also after commands, which may have deleted entries. The next test has more of them."""
    repl.exec(command)
    said = repl.exec(MODULES)
    for name in ("framestep", "framestep.repl", "__main__"):
        assert f"object <module '{name}'" in said
    complete(repl, ("__main__", "framestep", "framestep.repl", "framestep.boot"))
    assert repl.eval("6 * 7") == 42


@pytest.mark.repeats
def test_every_object_answers(repl):
    """Instances too, after all commands."""
    for command in COMMANDS:
        repl.exec(command)
    found = objects(repl)
    assert len(found) > 500
    complete(repl, found)
    assert repl.eval("6 * 7") == 42
