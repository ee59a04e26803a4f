"""What the USB port's callbacks call in answers.py is machine code, or has no branch.

A branch of bytecode may let MicroPython's USB task run, which is an error within a callback
("TinyUSB callback can't recurse").
"""

import ast

from framestep_tools.building.board_files import ROOT

FIRMWARE = ROOT / "firmware/framestep"
BRANCHES = (ast.If, ast.IfExp, ast.For, ast.While, ast.BoolOp, ast.Try)
OTHERS = ("hal/esp32", "hal/host.py", "hal/contract.py", "base/native_cpython.py")
# a method with the name of a function of base/clock.py, which is meant
OTHER_REACHED = ("moves/operation_runner.py", "reached")


def functions():
    """Return {name: [(file, definition)]} of the firmware on a board with such callbacks."""
    found = {}
    for path in sorted(FIRMWARE.rglob("*.py")):
        place = path.relative_to(FIRMWARE).as_posix()
        if not place.startswith(OTHERS):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.FunctionDef) and (place, node.name) != OTHER_REACHED:
                    found.setdefault(node.name, []).append((place, node))
    return found


def calls(node):
    for call in ast.walk(node):
        if isinstance(call, ast.Call):
            yield getattr(call.func, "attr", None) or getattr(call.func, "id", None)


def reached():
    """Return {name: [definitions]} of all that answers.answer() leads to. Of several definitions
    with one name, those in machine code are meant; of begin_stop(), all."""
    every = functions()
    seen, todo = {}, ["answer"]
    while todo:
        name = todo.pop()
        found = every.get(name, [])
        if name != "begin_stop":
            found = [each for each in found if is_machine_code(each[1])] or found
        seen[name] = found
        for _, node in found:
            todo += [called for called in calls(node) if called not in seen]
    return seen


def is_machine_code(node):
    return any("viper" in ast.unparse(decorator) for decorator in node.decorator_list)


def test_what_a_callback_leads_to_has_no_branch_in_bytecode():
    found = reached()
    assert {"begin_stop", "ease", "slow", "sides", "align", "release"} <= set(found)
    for name, places in found.items():
        for place, node in places:
            branches = any(isinstance(part, BRANCHES) for part in ast.walk(node))
            assert is_machine_code(node) or not branches, f"{place}: {name}()"
