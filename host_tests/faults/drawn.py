"""Faults drawn at random and put into the core, one at a time: which tests find them?

    make drawn-faults                    the list, each with what has found it
    make drawn-faults ARGS="--try 3 17"  put these in and look again; or left: the untried
    make drawn-faults ARGS="--draw 60 --seed 5"   another list

A fault changes an operator, a number or a condition, leaves out a call, or swaps two statements.
Each is tried in a copy of the tree, first with the tests nearest to its file (near.py), then with
others of the core's; the first test that fails has found it.
"""

import argparse
import ast
import itertools
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from framestep_tools.building.board_files import CACHE, ROOT
from host_tests.near import nearest

LIST = Path(__file__).parent / "drawn.txt"
CORE = "firmware/framestep"
PLACES = ("protocol", "motion", "pulse", "motors", "moves", "virtual_axes", "io", "stops.py")
SEED = 20261125
STAGES = (3, 6, 12)  # how many files of tests, the nearest first
TESTS = (
    *("protocol", "pulse", "motion", "motors", "moves", "virtual_axes", "io", "rig", "hal", "repl"),
    *("fuzz", "conform", "end_to_end", "runtime"),
)
NOTHING = "nothing"
STAGE_S = 300  # of processor time: tests that take longer hang, so they have found the fault
LINKED = ("tools/framestep_emulator/board/node_modules",)

COMPARISONS = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
}  # fmt: skip
OPERATORS = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "//", ast.FloorDiv: "*", ast.Div: "*", ast.BitAnd: "|",
    ast.BitOr: "&", ast.LShift: ">>", ast.RShift: "<<", ast.BitXor: "&",
}  # fmt: skip


@dataclass
class Fault:
    """Lines of a file, and others in their place. at: which one, if several places have these
    lines.

    found: the test that finds it, or why none can.
    """

    file: str
    at: int
    before: list[str]
    after: list[str]
    found: str = ""

    def __str__(self) -> str:
        lines = [f"{self.file} {self.at}", *(f"- {line}" for line in self.before)]
        return "\n".join(
            [*lines, *(f"+ {line}" for line in self.after), f"= {self.found}".rstrip()]
        )

    def spoiled(self, text: str) -> str:
        """The file with the fault in it."""
        lines = text.split("\n")
        begins = places(lines, self.before)
        if self.at >= len(begins):
            raise SystemExit(f"{self.file} has changed: draw anew\n{self}")
        begin = begins[self.at]
        lines[begin : begin + len(self.before)] = self.after
        return "\n".join(lines)


def places(lines: list[str], wanted: list[str]) -> list[int]:
    """Return the places of these lines."""
    count = len(wanted)
    return [i for i in range(len(lines) - count + 1) if lines[i : i + count] == wanted]


def kept() -> list[Fault]:
    """Return the faults of the list."""
    found = []
    for block in LIST.read_text().strip().split("\n\n"):
        head, *lines = block.split("\n")
        file, at = head.split()
        sorted_by = {
            sign: [line[2:] for line in lines if line.startswith(sign)] for sign in ("-", "+", "=")
        }
        found.append(
            Fault(file, int(at), sorted_by["-"], sorted_by["+"], "\n".join(sorted_by["="]))
        )
    return found


def keep(faults: list[Fault]) -> None:
    """Write the list."""
    LIST.write_text("\n\n".join(map(str, faults)) + "\n")


# ---- drawing -------------------------------------------------------------------------------------


def other(node: ast.AST) -> Iterator[ast.AST]:
    """Yield replacements of an expression or a statement."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
        sign = COMPARISONS[type(node.ops[0])]
        yield parsed(f"a {sign} b", left=node.left, comparators=node.comparators)
    elif isinstance(node, ast.BinOp) and ast.unparse(node.right) == "0":
        return  # as machine code's indices are written
    elif isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        yield parsed(f"a {OPERATORS[type(node.op)]} b", left=node.left, right=node.right)
    elif isinstance(node, ast.BoolOp):
        op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield ast.BoolOp(op, node.values)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield node.operand
    elif isinstance(node, ast.Constant) and type(node.value) is int:
        yield ast.Constant(node.value + 1)
    elif isinstance(node, ast.Constant) and type(node.value) is bool:
        yield ast.Constant(not node.value)
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        yield ast.Pass()


def parsed(text: str, **fields: object) -> ast.AST:
    node = ast.parse(text, mode="eval").body
    for name, value in fields.items():
        setattr(node, name, value)
    return node


def depend(one: ast.stmt, two: ast.stmt) -> bool:
    """Whether the order of two statements may matter: one uses what the other sets, or both are
    calls."""

    def uses(statement: ast.stmt, other: ast.stmt) -> bool:
        targets = getattr(other, "targets", None) or [getattr(other, "target", None)]
        return any(ast.unparse(to) in ast.unparse(statement) for to in targets if to)

    calls = isinstance(one, ast.Expr) and isinstance(two, ast.Expr)
    return calls or uses(one, two) or uses(two, one)


def with_other(lines: list[str], node: ast.expr, new: ast.AST) -> list[str]:
    """The lines of a node with another in its place; one line of a file is a fault's, so what spans
    several is left out by candidates()."""
    line = lines[node.lineno - 1].encode()
    inside = ast.unparse(new)
    if isinstance(new, (ast.BinOp, ast.BoolOp, ast.Compare)):
        inside = f"({inside})"
    return [(line[: node.col_offset] + inside.encode() + line[node.end_col_offset :]).decode()]


def candidates(file: Path) -> list[Fault]:
    """Each fault that can be made in a file."""
    text = file.read_text()
    lines = text.split("\n")
    name = file.relative_to(ROOT).as_posix()
    found = []

    def add(first: int, last: int, after: list[str]) -> None:
        before = lines[first:last]
        at = places(lines, before).index(first)
        found.append(Fault(name, at, before, after))

    for function in ast.walk(ast.parse(text)):
        if not isinstance(function, ast.FunctionDef):
            continue
        for node in ast.walk(function):
            if getattr(node, "lineno", None) is None or node.lineno != node.end_lineno:
                continue
            for new in other(node):
                add(node.lineno - 1, node.lineno, with_other(lines, node, new))
        for body in (getattr(n, "body", None) for n in ast.walk(function)):
            for one, two in itertools.pairwise(body) if isinstance(body, list) else ():
                simple = (ast.Assign, ast.AugAssign, ast.Expr)
                if not (isinstance(one, simple) and isinstance(two, simple)) or (
                    isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant)
                ):
                    continue
                consecutive = one.lineno == one.end_lineno == two.lineno - 1 == two.end_lineno - 1
                if consecutive and depend(one, two):
                    a, b = lines[one.lineno - 1 : two.lineno]
                    add(one.lineno - 1, two.lineno, [b, a])
    return found


def draw(seed: int, count: int) -> list[Fault]:
    """Faults from all of the places, each of a line of its own."""
    chance = random.Random(seed)
    files = []
    for place in PLACES:
        path = ROOT / CORE / place
        files += [path] if path.is_file() else sorted(path.rglob("*.py"))
    every = [fault for file in files for fault in candidates(file)]
    chance.shuffle(every)
    taken, found = set(), []
    for fault in every:
        where = (fault.file, fault.at, fault.before[0])
        if where in taken or compiles(fault) is None:
            continue
        taken.add(where)
        found.append(fault)
        if len(found) == count:
            break
    return sorted(found, key=lambda fault: fault.file)


def compiles(fault: Fault) -> object:
    try:
        return compile(fault.spoiled((ROOT / fault.file).read_text()), fault.file, "exec")
    except SyntaxError:
        return None


# ---- trying --------------------------------------------------------------------------------------


def copied(folder: Path) -> Path:
    """A copy of the tree to spoil."""
    tree = folder / "tree"
    listed = subprocess.run(
        ["git", "ls-files", "-z", "-c", "-o", "--exclude-standard"],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    for name in listed.stdout.split("\0")[:-1]:
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)
    for name in LINKED:
        if (ROOT / name).exists():
            (tree / name).symlink_to(ROOT / name)
    return tree


def run(tree: Path, tests: list[str], more: list[str]) -> str:
    """The first test that fails, "" where none does."""
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(str(tree / part) for part in ("", "firmware", "tools")),
        "FRAMESTEP_CACHE": str(CACHE),
        "PYTHONHASHSEED": "0",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--tb=no"]
    done = subprocess.run(
        [*command, *more, *tests],
        cwd=tree,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (STAGE_S, STAGE_S)),
    )
    if done.returncode < 0:
        return f"a hang in {tests[0]} or a later one"
    if done.returncode == 0:
        return ""
    lines = [line for line in done.stdout.split("\n") if line.startswith(("FAILED ", "ERROR "))]
    if lines:
        return lines[0].split(" - ")[0].split(" ", 1)[1]
    return "import: " + done.stdout.strip().split("\n")[-1]  # the core cannot even be loaded


def stages(file: str) -> Iterator[list[str]]:
    """Files of tests of the core, the nearest first."""
    tests = [test for test in nearest({file}) if test.split("/")[1] in TESTS]
    begun = 0
    for count in STAGES:
        yield tests[begun : begun + count]
        begun += count


def attempt(tree: Path, fault: Fault, more: list[str]) -> str:
    """Try a fault. Return the test that finds it, or ""."""
    path = tree / fault.file
    text = path.read_text()
    sound: list[str] = []  # tests that fail without the fault as well
    for files in stages(fault.file):
        while files:
            path.write_text(fault.spoiled(text))
            try:
                found = run(tree, files, [*more, *(f"--deselect={test}" for test in sound)])
            finally:
                path.write_text(text)
            if not found:
                break
            if "::" not in found or not run(tree, [found], more):
                return found
            sound.append(found)
    return NOTHING


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, prog="make drawn-faults")
    parser.add_argument("--draw", type=int, metavar="COUNT", help="a new list")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--try", nargs="+", dest="tried", metavar="NUMBER", help="or all, left")
    parser.add_argument("--all", action="store_true", help="with the tests of make test-all")
    args = parser.parse_args()
    if args.draw:
        keep(draw(args.seed, args.draw))
    faults = kept()
    if not args.tried:
        for number, fault in enumerate(faults, 1):
            print(f"{number}: {fault}\n")
        return
    numbers = {
        "all": range(1, len(faults) + 1),
        "left": [i for i, fault in enumerate(faults, 1) if not fault.found],
    }.get(args.tried[0]) or [int(number) for number in args.tried]
    with tempfile.TemporaryDirectory() as folder:
        tree = copied(Path(folder))
        for number in numbers:
            fault = faults[number - 1]
            fault.found = attempt(tree, fault, ["--all"] if args.all else [])
            print(f"{number}: {fault}\n", flush=True)
            keep(faults)
    tried = [fault for fault in faults if fault.found]
    missed = sum(fault.found.startswith(NOTHING) for fault in tried)
    print(f"{len(tried) - missed} of {len(tried)} found")


if __name__ == "__main__":
    main()
