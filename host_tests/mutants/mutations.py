"""The mutants of a file: what cosmic-ray's operators make of the functions in it.

Left out are replacements that change nothing on CPython (`==` by `is`, decorators taken away) and
powers of large numbers, which only take time.
"""

import ast
import random
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_IDLE = ("RemoveDecorator", "VariableReplacer", "VariableInserter", "_Pow", "_Is", "_IsNot")


@dataclass(frozen=True)
class Mutant:
    """One change. path: below firmware/framestep; line: of the change; function: the line that its
    function begins at, with its decorators; before, after: that line of the source."""

    path: str
    line: int
    function: int
    operator: str
    before: str
    after: str
    source: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.before}  ->  {self.after}"


def functions(source: str) -> list[tuple[int, int]]:
    """First and last line of each function, the innermost last."""
    return sorted(
        (min([node.lineno, *(each.lineno for each in node.decorator_list)]), node.end_lineno or 0)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef)
    )


def places(source: str) -> dict[tuple[tuple[int, int], tuple[int, int]], list[tuple[str, int]]]:
    """{(begin, end): [(operator, its occurrence)]} of all that can be changed in functions."""
    from cosmic_ray import plugins
    from cosmic_ray.ast import ast_nodes, get_ast

    nodes = list(ast_nodes(get_ast(source)))
    inside = functions(source)
    found = defaultdict(list)
    for name in plugins.operator_names():
        if any(part in name for part in _IDLE):
            continue
        operator = plugins.get_operator(name)()
        occurrence = 0
        for node in nodes:
            for begin, end in operator.mutation_positions(node):
                if any(first <= begin[0] <= last for first, last in inside):
                    found[begin, end].append((name, occurrence))
                occurrence += 1
    return dict(found)


def mutant(path: str, source: str, line: int, operator: str, occurrence: int) -> Mutant:
    """The change of one operator at one of its occurrences."""
    from cosmic_ray import plugins
    from cosmic_ray.mutating import mutate_code

    changed = mutate_code(source, plugins.get_operator(operator)(), occurrence)
    function = max(first for first, last in functions(source) if first <= line <= last)
    lines, others = source.splitlines(), changed.splitlines()
    return Mutant(
        path,
        line,
        function,
        operator.removeprefix("core/"),
        lines[line - 1].strip(),
        others[line - 1].strip() if line <= len(others) else "",
        changed,
    )


def sample(folder: Path, paths: list[str], count: int, seed: int) -> Iterator[Mutant]:
    """`count` mutants of these files, of each as many as its share of places, and at least one. A
    place is drawn first, then what is done to it."""
    dice = random.Random(seed)
    sources = {path: (folder / path).read_text() for path in paths}
    all_places = {path: places(source) for path, source in sources.items()}
    total = sum(map(len, all_places.values()))
    for path, found in all_places.items():
        share = min(len(found), max(1, round(count * len(found) / total))) if found else 0
        for place in dice.sample(sorted(found), share):
            operator, occurrence = dice.choice(found[place])
            yield mutant(path, sources[path], place[0][0], operator, occurrence)
