"""Compiler of formulas, from text to the bytes that `compute` executes. Runs on CPython only.

    _BRAKING = formula(registers, "velocity, room -> ticks", '''
        way = velocity * velocity / LIMIT / 2
        assert way <= room  # else it cannot stop there
        ticks = 2 * way / velocity
    ''')
    reals.copy(r, _BRAKING.velocity, RATE)
    reals.fetch(r, _BRAKING.room, ...)
    if compute(r, _BRAKING):
        reals.floor(r, _BRAKING.ticks, ...)

The first text names the formula's parameters and results. Each has a register, which the compiler
chooses: ARGUMENTS and the ones behind it, in the order of the text. So the next formula may take
the same ones: a result is to be used before. check() refuses what breaks that rule. With
`velocity=_BEFORE.velocity` behind the texts a parameter is where another formula has left it.

The build for a board replaces the call by the bytes, and _BRAKING.ticks by a number
(framestep_tools.building.constants). On CPython they are made when the module is imported. Names in
capitals are registers: constants of the given module; JOINT[2] is the second number after JOINT.
Other names in small letters are the formula's own variables, which are kept in free registers, from
SCRATCH to SCRATCH_END. A line is one of

    name = expression
    a, b = sincos(x)
    assert a > b            or >=, <, <=: if it does not hold, the formula ends and compute()
                            returns 0
    ...                     last line of a formula to which another one is appended

An expression has + - * /, numbers, sqrt(x), floor(x), min(a, b), max(a, b) and angle(y, x) in
degrees. Operations are done from left to right, as in Python, each rounded like those of `reals`;
2 * x, x / 4 and the like are exact and cheap. A register that an expression reads is changed only
by the expression's last operation.
"""

import ast
import textwrap
from fractions import Fraction

from framestep.motion import compute as kernel

_OPERATORS = {
    ast.Add: kernel.ADD,
    ast.Sub: kernel.SUBTRACT,
    ast.Mult: kernel.MULTIPLY,
    ast.Div: kernel.DIVIDE,
}
_FUNCTIONS = {  # name: operation, number of operands
    "sqrt": (kernel.ROOT, 1),
    "floor": (kernel.FLOOR, 1),
    "min": (kernel.LESSER, 2),
    "max": (kernel.GREATER, 2),
    "angle": (kernel.ANGLE, 2),
}
_CONDITIONS = {  # operation, and whether its operands are swapped
    ast.Gt: (kernel.ABOVE, False),
    ast.GtE: (kernel.NOT_ABOVE, True),
    ast.Lt: (kernel.ABOVE, True),
    ast.LtE: (kernel.NOT_ABOVE, False),
}
_BIAS = 128
_LARGEST = 0xFFFF


class FormulaError(Exception):
    """A formula that cannot be compiled. line: in its text, from 1; reason: what is wrong there."""

    def __init__(self, line, reason):
        super().__init__(f"line {line} of the formula: {reason}")
        self.line = line
        self.reason = reason


class Formula(bytes):
    """A formula's bytes, with the registers of its parameters and results as attributes.

    places: {name: register}; parameters, results: their names; given: those parameters that are
    where another formula has left them; writes: all registers that it sets; space: of the build,
    which registers these are.
    """

    places: dict
    parameters: tuple
    results: tuple
    given: frozenset
    writes: frozenset
    space: str = ""

    def __getattr__(self, name):
        try:
            return self.places[name]
        except KeyError:
            raise AttributeError(f"{name} is no parameter or result of this formula") from None


def formula(names, *texts, **places):
    """Return a Formula. names: the module, or a dict, that has its registers. texts: parameters and
    results (see above), which may be left out, and the lines. places: registers of parameters.
    Raises FormulaError."""
    names = names if isinstance(names, dict) else vars(names)
    signature = texts[0] if len(texts) > 1 else ""
    return _Formula(names).compile(texts[-1], signature, places)


def _literal(node):
    """Return the value of a number or of an expression of numbers, or None."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        return Fraction(node.value)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _literal(node.operand)
        return None if value is None else -value
    if isinstance(node, ast.BinOp):
        left, right = _literal(node.left), _literal(node.right)
        if left is not None and right is not None:
            if isinstance(node.op, ast.Div) and right:
                return left / right
            if isinstance(node.op, ast.Mult):
                return left * right
            if isinstance(node.op, ast.Pow) and right.denominator == 1 and left:
                return left**right
    return None


def _power(value):
    """Return n if the value is 2^n, else None."""
    if value is None or value <= 0 or (value.numerator & (value.numerator - 1)):
        return None
    if value.denominator & (value.denominator - 1):
        return None
    return value.numerator.bit_length() - value.denominator.bit_length()


class _Formula:
    def __init__(self, names):
        self.names = names
        self.code = []
        self.own = {}  # the formula's own names: (register, line)
        self.used = set()  # own names that have been read
        self.set = set()  # own names that have been set
        self.free = []
        self.writes = set()
        if "SCRATCH" in names:
            self.free = list(range(names["SCRATCH"], names["SCRATCH_END"], 2))

    def compile(self, text, signature="", places=()):
        parameters, results = self._signature(signature, dict(places))
        ended = False
        for statement in self._statements(text):
            if ended:
                raise FormulaError(statement.lineno, "nothing may follow ...")
            if isinstance(statement, ast.Expr) and _is_dots(statement.value):
                ended = True
            else:
                self._statement(statement)
        for name, (_, line) in self.own.items():
            if name not in self.used and name not in results:
                raise FormulaError(line, f"{name} is no register, and nothing uses it")
        for name in results:
            if name not in self.set:
                raise FormulaError(1, f"nothing gives the result {name}")
        if not ended:
            self._emit(kernel.END, 0, 0, 0)
        made = Formula(self.code)
        made.places = {name: self.own[name][0] for name in (*parameters, *results)}
        made.parameters, made.results, made.given = parameters, results, frozenset(places)
        made.writes = frozenset(self.writes)
        return made

    def _signature(self, text, places):
        """Give each parameter and result its register. Return their names, two tuples."""
        begins, _, ends = text.partition("->")
        parameters, results = (
            tuple(name.strip() for name in part.split(",") if name.strip())
            for part in (begins, ends)
        )
        free = list(range(self.names.get("ARGUMENTS", 0), self.names.get("ARGUMENTS_END", 0), 2))
        free = [register for register in free if register not in places.values()]
        for name in dict.fromkeys(parameters + results):
            if not name.isidentifier() or not name.islower() or hasattr(Formula, name):
                raise FormulaError(1, f"{name} cannot name a parameter or a result")
            if parameters.count(name) > 1 or results.count(name) > 1:
                raise FormulaError(1, f"{name} is named twice")
            if name not in places and not free:
                raise FormulaError(1, "ARGUMENTS has room for fewer parameters and results")
            self.own[name] = places.pop(name) if name in places else free.pop(0), 1
        if places:
            raise FormulaError(1, f"no parameter of this formula: {', '.join(places)}")
        self.given = set(parameters)
        return parameters, results

    @staticmethod
    def _statements(text):
        try:
            return ast.parse(textwrap.dedent(text)).body
        except SyntaxError as error:
            raise FormulaError(error.lineno or 1, error.msg) from None

    def _statement(self, node):
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            target, value = node.targets[0], node.value
            if isinstance(target, ast.Tuple):
                return self._sincos(node, target, value)
            if isinstance(target, (ast.Name, ast.Subscript)):
                return self._assign(target, value)
        if isinstance(node, ast.Assert) and node.msg is None and isinstance(node.test, ast.Compare):
            return self._condition(node.test)
        raise FormulaError(node.lineno, f"not a line of a formula: {ast.unparse(node)}")

    def _assign(self, target, value):
        free = list(self.free)
        mentioned = self._known(target) in self._registers(value)
        to = self._target(target)
        self._is_set(target)
        # A register that the expression reads is changed only by the last operation.
        self._into(value, to, self._take(value) if mentioned and not self._is_simple(value) else to)
        self.free = [r for r in free if r != to]

    def _is_simple(self, node):
        """Return whether all operands are registers, so that no other register is needed."""
        if isinstance(node, ast.BinOp):
            parts = [node.left, node.right]
        elif isinstance(node, ast.UnaryOp):
            parts = [node.operand]
        elif isinstance(node, ast.Call):
            parts = node.args
        else:
            return True
        if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Mult, ast.Div)):
            if _power(_literal(node.right)) is not None:
                parts = [node.left]
            elif isinstance(node.op, ast.Mult) and _power(_literal(node.left)) is not None:
                parts = [node.right]
        return all(isinstance(part, (ast.Name, ast.Subscript)) for part in parts)

    def _sincos(self, node, target, value):
        names = [n for n in target.elts if isinstance(n, (ast.Name, ast.Subscript))]
        call = (
            isinstance(value, ast.Call)
            and isinstance(value.func, ast.Name)
            and value.func.id == "sincos"
        )
        if len(names) != 2 or len(target.elts) != 2 or not call or len(value.args) != 1:
            raise FormulaError(node.lineno, "two names are given by sincos(x) alone")
        free = list(self.free)
        operand = self._value(value.args[0])
        self.free = free
        sine, cosine = (self._target(name) for name in names)
        for name in names:
            self._is_set(name)
        if sine == cosine:
            raise FormulaError(node.lineno, "sine and cosine need a register each")
        self._emit(kernel.SINES, sine, operand, cosine)

    def _condition(self, test):
        if len(test.ops) != 1 or type(test.ops[0]) not in _CONDITIONS:
            raise FormulaError(
                test.lineno, f"no condition that a formula can have: {ast.unparse(test)}"
            )
        what, turned = _CONDITIONS[type(test.ops[0])]
        free = list(self.free)
        a, b = self._value(test.left), self._value(test.comparators[0])
        self._emit(what, 0, *((b, a) if turned else (a, b)))
        self.free = free

    # ------------------------------------------------------------ registers

    def _known(self, node):
        """Return the register of a name or name[i], or None if it has none yet."""
        index = 0
        base = node
        if isinstance(node, ast.Subscript):
            base = node.value
            if not (isinstance(base, ast.Name) and isinstance(node.slice, ast.Constant)):
                raise FormulaError(
                    node.lineno, f"a register's number has to be a literal: {ast.unparse(node)}"
                )
            index = 2 * node.slice.value  # type: ignore[assignment, operator]
        register = self.names.get(base.id) if base.id.isupper() else None
        if register is not None:
            if not isinstance(register, int) or not 0 <= register + index <= 254:
                raise FormulaError(node.lineno, f"{ast.unparse(node)} is no register of 0 to 254")
            return register + index
        if isinstance(node, ast.Name) and base.id in self.own:
            return self.own[base.id][0]
        return None

    def _target(self, node):
        register = self._known(node)
        if register is None:
            if not isinstance(node, ast.Name) or not node.id.islower():
                raise FormulaError(node.lineno, f"no register: {ast.unparse(node)}")
            register = self._take(node)
            self.own[node.id] = register, node.lineno
        return register

    def _is_set(self, node):
        if isinstance(node, ast.Name):
            self.set.add(node.id)

    def _take(self, node):
        if not self.free:
            raise FormulaError(
                node.lineno, "too few free registers; cut the expression up, or reuse a name"
            )
        return self.free.pop(0)

    def _read(self, node):
        register = self._known(node)
        if register is None:
            raise FormulaError(
                node.lineno, f"{ast.unparse(node)} is no register, and has no value yet"
            )
        if isinstance(node, ast.Name) and node.id in self.own:
            if node.id not in self.given and node.id not in self.set:
                raise FormulaError(node.lineno, f"the result {node.id} has no value yet")
            self.used.add(node.id)
        return register

    def _registers(self, node):
        """Return all registers that an expression reads."""
        if isinstance(node, (ast.Name, ast.Subscript)):
            return {self._read(node)}
        if isinstance(node, ast.Call):
            return set().union(*map(self._registers, node.args))
        return set().union(
            *(self._registers(n) for n in ast.iter_child_nodes(node) if isinstance(n, ast.expr))
        )

    # ------------------------------------------------------------ expressions

    def _emit(self, what, to, a, b):
        self.code += (what, to, a, b)
        if what not in (kernel.END, kernel.ABOVE, kernel.NOT_ABOVE):
            self.writes.add(to)
        if what == kernel.SINES:
            self.writes.add(b)

    def _value(self, node):
        """Return a register with the value of an expression: a name's own, else a free one."""
        if isinstance(node, (ast.Name, ast.Subscript)):
            return self._read(node)
        to = self._take(node)
        self._into(node, to, to)
        return to

    def _into(self, node, to, work):
        """r[to] = the expression. r[work] may hold its first operand that has to be computed."""
        value = _literal(node)
        if value is not None:
            return self._number(node, to, value)
        if isinstance(node, (ast.Name, ast.Subscript)):
            return self._emit(kernel.COPY, to, self._read(node), to)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return self._operate(kernel.NEGATE, to, [node.operand], work)
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            return self._binary(node, to, work)
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in _FUNCTIONS
        ):
            what, count = _FUNCTIONS[node.func.id]
            if len(node.args) != count or node.keywords:
                raise FormulaError(
                    node.lineno, f"{node.func.id}() takes {count} operands: {ast.unparse(node)}"
                )
            return self._operate(what, to, node.args, work)
        raise FormulaError(node.lineno, f"not an expression of a formula: {ast.unparse(node)}")

    def _binary(self, node, to, work):
        power = None
        operand = node.left
        if isinstance(node.op, ast.Mult):
            power = _power(_literal(node.right))
            if power is None:
                power = _power(_literal(node.left))
                if power is not None:
                    operand = node.right
        elif isinstance(node.op, ast.Div):
            value = _literal(node.right)
            if value is not None and value == 0:
                raise FormulaError(node.lineno, "divided by 0")
            power = _power(value)
            power = None if power is None else -power
        if power is None:
            return self._operate(_OPERATORS[type(node.op)], to, [node.left, node.right], work)
        self._operate(kernel.SCALE, to, [operand], work)
        self.code += (self._exponent(node, power), 0, 0, 0)

    def _operate(self, what, to, operands, work):
        free = list(self.free)
        found = []
        for operand in operands:
            if isinstance(operand, (ast.Name, ast.Subscript)):
                found.append(self._read(operand))
            elif work is not None:
                self._into(operand, work, work)
                found.append(work)
                work = None
            else:
                found.append(self._value(operand))
        self.free = free
        self._emit(what, to, found[0], found[1] if len(found) > 1 else found[0])

    def _exponent(self, node, power):
        if not -_BIAS <= power < _BIAS:
            raise FormulaError(node.lineno, f"2 to the power of {power} is too far from 1")
        return power + _BIAS

    def _number(self, node, to, value):
        if value < 0:
            self._number(node, to, -value)
            return self._emit(kernel.NEGATE, to, to, to)
        exponent = 0
        if value.denominator & (value.denominator - 1):
            raise FormulaError(
                node.lineno, f"{ast.unparse(node)} has no exact binary form; divide registers"
            )
        exponent = 1 - value.denominator.bit_length()
        mantissa = value.numerator
        while mantissa and mantissa % 2 == 0:
            mantissa //= 2
            exponent += 1
        if mantissa > _LARGEST:
            raise FormulaError(
                node.lineno, f"{ast.unparse(node)} has more than 16 digits in binary"
            )
        self._emit(kernel.NUMBER, to, to, to)
        self.code += (mantissa & 0xFF, mantissa >> 8, self._exponent(node, exponent), 0)


def _is_dots(node):
    return isinstance(node, ast.Constant) and node.value is ...
