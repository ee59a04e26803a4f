"""Refuses a formula's result that is read after another formula has taken its register.

Parameters and results of formulas share registers (framestep.motion.formula). Within a function,
from top to bottom: a parameter is set by mentioning it, before compute(r, F); a result is read by
mentioning it, after that. In between nothing may write its register: no other formula, and no call
of a function that computes one, directly or by way of others. Functions are told apart by their
names alone, so a call counts for all functions of that name.
"""

import ast
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from framestep.motion.formula import Formula

from .constants import FoldError, formulas_of, nodes

Register = tuple[str, int]  # whose registers, and which


@dataclass
class _Place:
    """What a register has: a formula's parameter, or its result."""

    formula: str
    name: str
    computed: bool = False


State = dict[Register, _Place]


@dataclass
class _Function:
    path: str
    node: ast.FunctionDef
    formulas: Mapping[str, Formula]
    calls: set[str] = field(default_factory=set)
    writes: set[Register] = field(default_factory=set)


def check(
    texts: Mapping[str, str], given: Mapping[str, Mapping[str, int]] = MappingProxyType({})
) -> int:
    """Check modules; texts, given: as for constants.fold(). Return how often a parameter or a
    result is mentioned. Raises FoldError that says where and what."""
    found = formulas_of(texts, given)
    functions = [
        _Function(path, node, found[path])
        for path, text in texts.items()
        for node in nodes(text)
        if isinstance(node, ast.FunctionDef)
    ]
    writes = _writes(functions)
    return sum(_Walk(function, writes).run() for function in functions)


def _writes(functions: list[_Function]) -> dict[str, set[Register]]:
    """Return {name of a function: the registers that a call of it may write}."""
    for function in functions:
        for node in ast.walk(function.node):
            match node:
                case ast.Call(func=ast.Name(id="compute"), args=[_, ast.Name(id=name)]):
                    function.writes |= _written(function.formulas, name)
                case ast.Call(func=ast.Name(id="compute")):
                    for made in function.formulas.values():
                        function.writes |= _all(made)
                case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
                    function.calls.add(name)
    writes: dict[str, set[Register]] = {}
    for function in functions:
        writes.setdefault(function.node.name, set()).update(function.writes)
    grown = True
    while grown:
        grown = False
        for function in functions:
            own = writes[function.node.name]
            more = set().union(*(writes.get(name, set()) for name in function.calls)) - own
            if more:
                own |= more
                grown = True
    return writes


def _written(formulas: Mapping[str, Formula], name: str) -> set[Register]:
    return _all(formulas[name]) if name in formulas else set()


def _all(made: Formula) -> set[Register]:
    return {(made.space, register) for register in made.writes}


class _Walk:
    """One function, in the order of its text; the ways of an `if` each from the same state."""

    def __init__(self, function: _Function, writes: Mapping[str, set[Register]]):
        self.function = function
        self.writes = writes
        self.seen = 0
        self.breaks: list[list[State]] = []  # of each loop, the states at its breaks

    def run(self) -> int:
        self._block(self.function.node.body, {})
        return self.seen

    def _block(self, body: list[ast.stmt], state: State) -> State | None:
        """Walk through statements. Return the state behind them, or None if that is not reached."""
        for statement in body:
            if isinstance(statement, ast.If):
                self._expression(statement.test, state)
                ways = [
                    self._block(part, dict(state)) for part in (statement.body, statement.orelse)
                ]
                going = _common(ways)
            elif isinstance(statement, (ast.For, ast.While)):
                self._expression(
                    statement.iter if isinstance(statement, ast.For) else statement.test, state
                )
                self.breaks.append([])
                ended: State = state
                for _ in range(2):  # the second turn begins with what the first has left
                    ended = self._block(statement.body, dict(ended)) or ended
                ways = [self._block(statement.orelse, dict(ended)), *self.breaks.pop()]
                if isinstance(statement, ast.While) and isinstance(statement.test, ast.Constant):
                    ways = ways[1:]  # while True
                going = _common(ways)
            elif isinstance(statement, ast.Break):
                self.breaks[-1].append(dict(state))
                return None
            elif isinstance(statement, (ast.Return, ast.Raise, ast.Continue)):
                self._expression(statement, state)
                return None
            else:
                self._expression(statement, state)
                continue
            if going is None:
                return None
            state = going
        return state

    def _expression(self, node: ast.AST, state: State) -> None:
        for part in _in_order(node):
            match part:
                case ast.Attribute(value=ast.Name(id=of), attr=name) if of in self._formulas:
                    self._mention(part, of, name, state)
                case ast.Call(func=ast.Name(id="compute"), args=[_, ast.Name(id=of)]) if (
                    of in self._formulas
                ):
                    self._compute(part, of, state)
                case ast.Call(func=ast.Name(id="compute")):  # one of them
                    for made in self._formulas.values():
                        self._drop(_all(made), state)
                case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
                    self._drop(self.writes.get(name, set()), state)

    @property
    def _formulas(self) -> Mapping[str, Formula]:
        return self.function.formulas

    def _mention(self, node: ast.expr, of: str, name: str, state: State) -> None:
        made = self._formulas[of]
        register = made.space, made.places[name]
        place = state.get(register)
        self.seen += 1
        if place and (place.formula, place.name) == (of, name):
            return  # it has been set, or computed
        if name in made.parameters:
            state[register] = _Place(of, name)
            return
        raise self._error(node, f"{of}.{name} is read, but its register does not have it any more")

    def _compute(self, node: ast.Call, of: str, state: State) -> None:
        made = self._formulas[of]
        places = {name: (made.space, register) for name, register in made.places.items()}
        for name in made.parameters:
            place = state.get(places[name])
            left = place and place.computed and name in made.given
            if not left and (not place or (place.formula, place.name) != (of, name)):
                raise self._error(
                    node, f"{of} is computed, but nothing has set {name}, or it is gone"
                )
        self._drop(_all(made), state)
        for name in made.parameters:  # those that the formula has left
            if made.places[name] not in made.writes:
                state[places[name]] = _Place(of, name, True)
        for name in made.results:
            state[places[name]] = _Place(of, name, True)

    @staticmethod
    def _drop(registers: set[Register], state: State) -> None:
        for register in registers:
            state.pop(register, None)

    def _error(self, node: ast.expr, text: str) -> FoldError:
        return FoldError(f"{self.function.path}, line {node.lineno}: {text}")


def _common(ways: Sequence[State | None]) -> State | None:
    """Return what registers have after any of these ways, of which None does not go on."""
    going = [way for way in ways if way is not None]
    if not going:
        return None
    return {r: place for r, place in going[0].items() if all(w.get(r) == place for w in going)}


def _in_order(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of an expression in the order in which they are evaluated: a call after its
    arguments."""
    for child in ast.iter_child_nodes(node):
        yield from _in_order(child)
    yield node
