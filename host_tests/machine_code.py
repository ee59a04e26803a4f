"""Kernels as machine code of this computer, so that simulated sessions take a third of the time.

`install()`, called before anything of framestep is imported, translates the kernels of each module
of the core to C while the module is loaded, and replaces them. Results and exceptions are those of
the same kernel in Python, and more is checked, by base/native.py's contract:

* Each result of an operation has to fit 32 bits signed, unless `& mask` cuts it at once. In a line
  that ends in `# wraps` it wraps, as on a board.
* What is stored has to fit its item, and no index may lie outside.

What cannot be translated stays as it is. So does everything if this computer has no C compiler or
no headers of Python.
"""

import ast
import functools
import hashlib
import importlib.abc
import importlib.machinery
import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import types
from array import array
from pathlib import Path

from framestep.base import native_cpython
from framestep_tools.building.kernels import is_kernel

_ROOT = Path(__file__).parents[1]
# Not from framestep_tools: that loads modules of the core.
_CACHE = Path(os.environ.get("FRAMESTEP_CACHE") or _ROOT / ".cache") / "machine_code"
# Not answers: the Controller makes a method of a kernel in it.
_PACKAGES = (
    "pulse", "motion", "motors", "moves", "virtual_axes", "io", "hand_wheel",
    "protocol.checksum", "protocol.frames",
)  # fmt: skip
_NAMES = tuple(f"framestep.{each}" for each in _PACKAGES)
_KEPT = 8  # libraries of a module, for its last versions
_RUNTIME = Path(__file__).with_suffix(".h").read_text()
_FLAGS = ("-O2", "-fwrapv", "-shared", "-fPIC", "-w")
_SIZES = {"ptr8": 1, "ptr16": 2, "ptr32": 4}
_SIMPLE = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.BitAnd: "&", ast.BitOr: "|", ast.BitXor: "^",
}  # fmt: skip
_CALLED = {
    ast.LShift: "left_shift", ast.RShift: "right_shift", ast.FloorDiv: "divided",
    ast.Mod: "modulo",
}  # fmt: skip
_COMPARED = {
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
_RING = {ast.Add, ast.Sub, ast.Mult, ast.LShift, ast.BitAnd, ast.BitOr, ast.BitXor}
# Kinds of values: an item's size of a pointer, or one of these
_WORD, _OBJECT, _NOTHING = "word", "object", "nothing"
_C_TYPES = {_WORD: "word", _OBJECT: "PyObject *", _NOTHING: "void"}


class _Stays(Exception):
    """It stays in Python."""


def _c_type(kind) -> str:
    return _C_TYPES.get(kind, "pointer")


@functools.cache
def _sources(path: str) -> dict[str, ast.FunctionDef]:
    """Return {qualified name: function} of a file, also of methods. Sums in a function's lines
    `wraps` may wrap."""
    text = Path(path).read_text()
    wraps = {i for i, line in enumerate(text.split("\n"), 1) if line.rstrip().endswith("# wraps")}
    found = {}
    for node in ast.parse(text).body:
        for function in node.body if isinstance(node, ast.ClassDef) else [node]:
            if isinstance(function, ast.FunctionDef):
                prefix = f"{node.name}." if function is not node else ""
                found[prefix + function.name] = function
                function.wraps = wraps
    return found


_originals: dict[object, types.FunctionType] = {}  # kernel in C -> the function


class _Unit:
    """The C source of a module's kernels, and of the kernels that they call."""

    def __init__(self):
        self.functions: dict[types.FunctionType, _Function | None] = {}
        self.texts: list[str] = []
        self.objects: dict[str, object] = {}  # memory of modules, by its name in C

    def function(self, python: types.FunctionType) -> "_Function":
        """Return the translation. Raises _Stays if there is none."""
        if python not in self.functions:
            self.functions[python] = None
            source = _sources(python.__code__.co_filename).get(python.__qualname__)
            if source is None:
                raise _Stays
            self.functions[python] = translated = _Function(
                self, python, source, f"k{len(self.functions)}"
            )
            try:
                translated.translate()  # it may call itself
            except _Stays:
                self.functions[python] = None
                raise
            self.texts.append(translated.text)
        found = self.functions[python]
        if found is None:
            raise _Stays
        return found


class _Function:
    """A kernel in C."""

    def __init__(self, unit: _Unit, python, source: ast.FunctionDef, name: str):
        self.unit, self.name, self.names = unit, name, python.__globals__
        self.wraps = source.wraps
        inline = not source.decorator_list  # of base/clock.py
        args = source.args
        if args.defaults or args.kwonlyargs or args.vararg or args.kwarg:
            raise _Stays
        self.kinds: dict[str, object] = {}
        self.parameters = [
            _WORD if inline else self._annotated(argument.annotation) for argument in args.args
        ]
        self.returns = self._returned(source, inline)
        self.source = source
        self.text = ""

    def translate(self) -> None:
        """Set `text`. Raises _Stays if there is none."""
        parameters = [argument.arg for argument in self.source.args.args]
        self.kinds = dict(zip(parameters, self.parameters, strict=True))
        self._infer(self.source)
        body = "".join(map(self._statement, self.source.body))
        heads = ", ".join(
            f"{_c_type(kind)} v_{argument}"
            for argument, kind in zip(parameters, self.parameters, strict=True)
        )
        local = "".join(
            f"{_c_type(kind)} v_{variable} = {{0}};\n"
            for variable, kind in self.kinds.items()
            if variable not in parameters
        )
        end = "" if self.returns == _NOTHING else "return 0;\n"
        self.text = (
            f"static {_c_type(self.returns)} {self.name}({heads or 'void'}) "
            f"{{\n{local}{body}{end}}}\n\n"
        )

    def _annotated(self, annotation):
        name = annotation.id if isinstance(annotation, ast.Name) else None
        if name in _SIZES:
            return _SIZES[name]
        return {"int": _WORD, "object": _OBJECT, None: _OBJECT}.get(name) or self._stay()

    def _returned(self, source, inline):
        values = [n for n in ast.walk(source) if isinstance(n, ast.Return) and n.value]
        name = source.returns.id if isinstance(source.returns, ast.Name) else None
        if inline or name in ("int", "bool"):
            self.truth = name == "bool"
            return _WORD
        self.truth = False
        return self._stay() if values or name else _NOTHING

    def _stay(self):
        raise _Stays

    def _infer(self, source):
        """Find the kinds of the variables. A variable has one kind."""
        assigned = [n for n in ast.walk(source) if isinstance(n, ast.Assign)]
        waiting = [
            (to.id, n.value) for n in assigned for to in n.targets if isinstance(to, ast.Name)
        ]
        for node in ast.walk(source):
            if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
                waiting.append((node.target.id, node.value))
        while waiting:
            left = []
            for name, value in waiting:
                kind = self._kind(value)
                if kind is None:
                    left.append((name, value))
                elif self.kinds.setdefault(name, kind) != kind:
                    raise _Stays
            if len(left) == len(waiting):
                raise _Stays
            waiting = left

    def _kind(self, node):
        """Return the kind of an expression, None if it is not known yet."""
        match node:
            case ast.Name(id=name):
                return self.kinds.get(name) or (
                    _WORD if isinstance(self.names.get(name), int) else None
                )
            case ast.Call(func=ast.Name(id=name)) if name in _SIZES:
                return _SIZES[name]
            case ast.Subscript(value=value):
                kind = self._kind(value)
                return kind and (_OBJECT if kind == _OBJECT else _WORD)
            case ast.IfExp(body=one, orelse=other):
                return self._kind(one) or self._kind(other)
            case ast.Attribute() if self._constant(node) is None:
                return _OBJECT
        return _WORD

    def _constant(self, node):
        """Return the number that a module's constant stands for, None for anything else."""
        match node:
            case ast.Attribute(value=ast.Name(id=module), attr=name) if isinstance(
                self.names.get(module), types.ModuleType
            ):
                value = getattr(self.names[module], name, None)
                return value if type(value) is int else None
        return None

    # ---- statements

    def _body(self, statements):
        return "{\n" + "".join(map(self._statement, statements)) + "}\n"

    def _statement(self, node) -> str:
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                return ";\n"
            case ast.Expr(value=ast.Call() as call):
                return self._call(call)[0] + ";\n"
            case ast.Assign(targets=[target], value=value):
                return self._assign(target, value)
            case ast.Assign(targets=targets, value=value):
                first, *others = sorted(targets, key=lambda to: not isinstance(to, ast.Name))
                same = ast.parse(ast.unparse(first), mode="eval").body
                return self._assign(first, value) + "".join(self._assign(o, same) for o in others)
            case ast.AugAssign(target=target, op=op, value=value):
                if any(isinstance(n, ast.Call) for n in ast.walk(target)):
                    raise _Stays
                there = ast.parse(ast.unparse(target), mode="eval").body
                total = ast.copy_location(ast.BinOp(there, op, value), node)
                return self._assign(target, total)
            case ast.If(test=test, body=body, orelse=orelse):
                other = f" else {self._body(orelse)}" if orelse else "\n"
                return f"if ({self._truth(test)}) {self._body(body)}{other}"
            case ast.While(test=test, body=body, orelse=[]):
                return f"while ({self._truth(test)}) {{ turn();\n{self._body(body)}}}\n"
            case ast.Return(value=None) if self.returns == _NOTHING:
                return "return;\n"
            case ast.Return(value=value) if value and self.returns == _WORD:
                return f"return {self._word(value)};\n"
            case ast.Break():
                return "break;\n"
            case ast.Continue():
                return "continue;\n"
        raise _Stays

    def _assign(self, target, value):
        if isinstance(target, ast.Name) and target.id in self.kinds:
            text, kind = self._expression(value)
            if kind != self.kinds[target.id]:
                raise _Stays
            return f"v_{target.id} = {text};\n"
        if isinstance(target, ast.Subscript):
            text, kind = self._expression(target.value)
            if kind in _SIZES.values():
                at = self._word(target.slice)
                return f"{{ word t = {self._word(value)}; store_{kind}({text}, {at}, t); }}\n"
        if isinstance(target, ast.Attribute):
            owner = self._object(target.value)
            text, kind = self._expression(value)
            given = f"PyLong_FromLongLong({text})" if kind == _WORD else f"Py_NewRef({text})"
            return f'set_attribute({owner}, "{target.attr}", {given});\n'
        raise _Stays

    # ---- expressions

    def _word(self, node, masked: bool = False) -> str:
        text, kind = self._expression(node, masked)
        if kind != _WORD:
            raise _Stays
        return text

    def _truth(self, node) -> str:
        match node:
            case ast.BoolOp(op=op, values=values):
                sign = " && " if isinstance(op, ast.And) else " || "
                return f"({sign.join(map(self._truth, values))})"
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"(!{self._truth(operand)})"
        text, kind = self._expression(node)
        return f"truth({text})" if kind == _OBJECT else self._word(node)

    def _ordered(self, form: str, *operands: tuple[str, ast.expr]) -> str:
        """Return an operation on two texts. C leaves open which operand comes first, and a call may
        change memory."""
        texts = [text for text, _ in operands]
        if not any(isinstance(n, ast.Call) for _, node in operands for n in ast.walk(node)):
            return form.format(*texts)
        return f"({{{{ word a = {{}}, b = {{}}; {form}; }}}})".format(*texts, "a", "b")

    def _fit(self, node, text: str) -> str:
        """Return the result of an operation, which has to fit a word."""
        return f"wrapped({text})" if node.lineno in self.wraps else f"fit({text}, {node.lineno})"

    def _is_mask(self, node) -> bool:
        value = node.value if isinstance(node, ast.Constant) else None
        if isinstance(node, ast.Name) and node.id not in self.kinds:
            value = self.names.get(node.id)
        return isinstance(value, int) and 0 <= value <= 0x7FFFFFFF

    def _operation(self, node, masked: bool) -> str:
        op = type(node.op)
        masked = masked and op in _RING
        cut = op is ast.BitAnd and (self._is_mask(node.left) or self._is_mask(node.right))
        left = self._word(node.left, masked or cut)
        right = self._word(node.right, (masked or cut) and op is not ast.LShift)
        form = f"({{}} {_SIMPLE[op]} {{}})" if op in _SIMPLE else f"{_CALLED[op]}({{}}, {{}})"
        text = self._ordered(form, (left, node.left), (right, node.right))
        return text if masked or cut else self._fit(node, text)

    def _expression(self, node, masked: bool = False) -> tuple[str, object]:
        """Return the text and kind of an expression. masked: only its value modulo 2^32 counts, as
        `& mask` follows."""
        match node:
            case ast.Constant(value=bool() | int() as value):
                return f"INT64_C({int(value)})", _WORD
            case ast.Name(id=name) if name in self.kinds:
                return f"v_{name}", self.kinds[name]
            case ast.Name(id=name) if type(self.names.get(name)) is int:
                return f"INT64_C({self.names[name]})", _WORD
            case ast.Name(id=name) if self._is_object(self.names.get(name)):
                return self._bound(self.names["__name__"], name, self.names[name]), _OBJECT
            case ast.Attribute() if (value := self._constant(node)) is not None:
                return f"INT64_C({value})", _WORD
            case ast.Attribute(value=ast.Name(id=owner), attr=name) if isinstance(
                module := self.names.get(owner), types.ModuleType
            ) and self._is_object(found := getattr(module, name)):
                return self._bound(module.__name__, name, found), _OBJECT
            case ast.Attribute(value=owner, attr=name):
                return f'attribute({self._object(owner)}, "{name}")', _OBJECT
            case ast.BinOp(op=op) if type(op) in _SIMPLE or type(op) in _CALLED:
                return self._operation(node, masked), _WORD
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() as value)):
                return f"INT64_C({-value})", _WORD
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self._fit(node, f"(-{self._word(operand)})"), _WORD
            case ast.UnaryOp(op=ast.Invert(), operand=operand):
                return f"(~{self._word(operand)})", _WORD
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"((word)!{self._truth(operand)})", _WORD
            case ast.Compare(left=left, ops=ops, comparators=others):
                if len(ops) > 1:
                    raise _Stays
                form = f"({{}} {_COMPARED[type(ops[0])]} {{}})"
                sides = [(self._word(side), side) for side in (left, *others)]
                return self._ordered(form, *sides), _WORD
            case ast.BoolOp(op=op, values=values):
                text = self._word(values[-1])
                for value in reversed(values[:-1]):
                    chosen = f"{text} : t" if isinstance(op, ast.And) else f"t : {text}"
                    text = f"({{ word t = {self._word(value)}; t ? {chosen}; }})"
                return text, _WORD
            case ast.IfExp(test=test, body=one, orelse=other):
                return f"({self._truth(test)} ? {self._word(one)} : {self._word(other)})", _WORD
            case ast.Subscript(value=value, slice=at):
                text, kind = self._expression(value)
                if kind == _OBJECT:
                    return f"item({text}, {self._word(at)})", _OBJECT
                if kind in _SIZES.values():
                    return f"load_{kind}({text}, {self._word(at)})", _WORD
            case ast.Call():
                return self._call(node)
        raise _Stays

    @staticmethod
    def _is_object(value) -> bool:
        """Return whether a module's name stands for memory or for a function in Python."""
        return isinstance(value, array | bytearray | types.FunctionType)

    def _bound(self, module: str, name: str, value) -> str:
        bound = f"of_{module.replace('.', '_')}_{name}"
        self.unit.objects[bound] = value
        return bound

    def _object(self, node) -> str:
        text, kind = self._expression(node)
        if kind == _OBJECT:
            return text
        if kind in _SIZES.values():
            return f"{text}.object"
        raise _Stays

    def _in_python(self, function: str, arguments) -> tuple[str, object]:
        """Return a call of a function in Python: an object, and the name of its method or NULL."""
        form = given = ""
        for argument in arguments:
            text, kind = self._expression(argument)
            form += "L" if kind == _WORD else "O"
            given += ", " + (f"(long long){text}" if kind == _WORD else self._object(argument))
        return f'called({function}, "({form})"{given})', _WORD

    def _call(self, node) -> tuple[str, object]:
        if node.keywords:
            raise _Stays
        match node.func:
            case ast.Name(id=name) if self.kinds.get(name) == _OBJECT:
                return self._in_python(f"v_{name}, NULL", node.args)
            case ast.Name(id=name):
                called = self.names.get(name)
            case ast.Attribute(value=ast.Name(id=module), attr=name) if isinstance(
                self.names.get(module), types.ModuleType
            ):
                called = getattr(self.names[module], name)
            case ast.Attribute(value=owner, attr=name):
                return self._in_python(f'{self._object(owner)}, "{name}"', node.args)
            case _:
                raise _Stays
        if name in ("int", "bool") and len(node.args) == 1:
            text, kind = self._expression(node.args[0])
            text = f"number({text})" if kind == _OBJECT else self._word(node.args[0])
            return (text if name == "int" else f"((word)!!{text})"), _WORD
        if name == "len" and len(node.args) == 1:
            return f"length({self._object(node.args[0])})", _WORD
        if name in _SIZES:
            return self._pointer(*self._expression(node.args[0]), _SIZES[name]), _SIZES[name]
        called = _originals.get(called, called)
        if not isinstance(called, types.FunctionType):
            raise _Stays
        try:
            function = self.unit.function(called)
        except _Stays:
            bound = self._bound(called.__module__, name, called)
            return self._in_python(f"{bound}, NULL", node.args)
        if len(function.parameters) != len(node.args):
            raise _Stays
        given = ""
        for i, (kind, argument) in enumerate(zip(function.parameters, node.args, strict=True)):
            text, own = self._expression(argument)
            if own == _OBJECT and kind in _SIZES.values():
                text = self._pointer(text, own, kind)
            elif own in _SIZES.values() and kind == _OBJECT:
                text = f"{text}.object"
            elif own == _OBJECT and kind == _WORD:
                text = f"number({text})"
            elif own != kind:
                raise _Stays
            given += f"{_c_type(kind)} a{i} = {text}; "
        names = ", ".join(f"a{i}" for i in range(len(node.args)))
        return f"({{ {given}{function.name}({names}); }})", function.returns

    def _pointer(self, text, kind, size):
        if kind == _WORD:
            return f"to_address({text}, {size})"
        return f"to_object({text if kind == _OBJECT else text + '.object'}, {size})"

    # ---- as a function of Python

    def entry(self) -> str:
        """Return the C function that Python calls. It gets the original for other arguments."""
        checks, values = [f"count != {len(self.parameters)}", "names"], []
        for i, kind in enumerate(self.parameters):
            if kind == _WORD:
                checks.append(f"!is_word(args[{i}])")
                values.append(f"PyLong_AsLongLong(args[{i}])")
            elif kind == _OBJECT:
                values.append(f"args[{i}]")
            else:
                checks.append(f"!is_memory(args[{i}])")
                values.append(f"to_object(args[{i}], {kind})")
        call = f"{self.name}({', '.join(values)})"
        if self.returns == _NOTHING:
            call = f"{call}; Py_INCREF(Py_None); found = Py_None"
        else:
            call = f"found = {'PyBool_FromLong' if self.truth else 'PyLong_FromLongLong'}({call})"
        return (
            f"static PyObject *entry_{self.name}(PyObject *self, PyObject *const *args, "
            "Py_ssize_t count, PyObject *names) {\n"
            f"if ({' || '.join(checks)})\n"
            f"return PyObject_Vectorcall(original_{self.name}, args, count, names);\n"
            "jmp_buf here, *before = caller;\nPyObject *volatile found = NULL;\ncaller = &here;\n"
            f"if (!setjmp(here)) {{ {call}; }}\ncaller = before;\nreturn found;\n}}\n\n"
        )


def _translated(functions: dict[str, types.FunctionType]) -> tuple[str, dict[str, str], dict]:
    """Return the C source, {qualified name: name in C} of the kernels that could be translated, and
    the objects that bind() gets, by their names."""
    unit, entries, names, objects = _Unit(), [], {}, {}
    for qualified, python in functions.items():
        try:
            function = unit.function(python)
        except _Stays:
            continue
        entries.append(function.entry())
        names[qualified] = function.name
        objects[f"original_{function.name}"] = python
    objects |= unit.objects
    methods = "".join(
        f'{{"{name}", (PyCFunction)(void (*)(void))entry_{name}, METH_FASTCALL | METH_KEYWORDS}},\n'
        for name in names.values()
    )
    bound = "".join(
        f'if (!({each} = PyDict_GetItemString(objects, "{each}"))) return NULL;\n'
        f"Py_INCREF({each});\n"
        for each in ("memory", *objects)
    )
    text = (
        _RUNTIME
        + "".join(f"static PyObject *{each};\n" for each in objects)
        + "".join(unit.texts + entries)
        + "static PyObject *bind(PyObject *self, PyObject *objects) {\n"
        + f"{bound}Py_RETURN_NONE;\n}}\n"
        + f"static PyMethodDef methods[] = {{\n{methods}"
        + '{"bind", bind, METH_O}, {"method", method, METH_O}, {NULL}};\n'
        + "static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "
        + '"machine_code", NULL, -1, methods};\n'
        + "PyMODINIT_FUNC PyInit_machine_code(void) { return PyModule_Create(&module); }\n"
    )
    return text, names, objects


def _compiled(name: str, text: str) -> Path:
    """Return the library of a module's kernels. Raises RuntimeError if it does not compile."""
    key = hashlib.sha256("\0".join((text, sys.version, *_FLAGS)).encode()).hexdigest()[:24]
    library = _CACHE / name / f"{key}.so"
    if not library.exists():
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            source, made = Path(folder, "kernels.c"), library.with_suffix(f".{os.getpid()}")
            source.write_text(text)
            include = f"-I{sysconfig.get_path('include')}"
            command = ["gcc", *_FLAGS, include, str(source), "-o", str(made)]
            done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"kernels of {name} do not compile:\n{done.stderr}")
        os.replace(made, library)
        for old in sorted(library.parent.glob("*.so"), key=os.path.getmtime)[:-_KEPT]:
            old.unlink(missing_ok=True)
    return library


def replace(module: types.ModuleType) -> None:
    """Replace the kernels of a module that has just been loaded."""
    path = module.__spec__.origin
    functions, owners = {}, {}
    for qualified, source in _sources(path).items():
        if is_kernel(source):
            owner = module
            if "." in qualified:
                owner = getattr(module, qualified.split(".")[0])
            python = vars(owner)[source.name]
            if isinstance(python, types.FunctionType):
                functions[qualified], owners[qualified] = python, owner
    text, names, objects = _translated(functions)
    if not names:
        return
    library = _compiled(module.__name__, text)
    loader = importlib.machinery.ExtensionFileLoader("machine_code", str(library))
    spec = importlib.util.spec_from_file_location("machine_code", library, loader=loader)
    compiled = importlib.util.module_from_spec(spec)
    loader.exec_module(compiled)
    compiled.bind({"memory": native_cpython._memory, **objects})
    for qualified, name in names.items():
        kernel, owner = getattr(compiled, name), owners[qualified]
        _originals[kernel] = functions[qualified]
        setattr(
            owner,
            qualified.rpartition(".")[2],
            kernel if owner is module else compiled.method(kernel),
        )


class Loader(importlib.machinery.SourceFileLoader):
    """Loads a module of the core and replaces its kernels."""

    def exec_module(self, module):
        super().exec_module(module)
        if module.__name__.startswith(_NAMES):
            replace(module)


class _Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if not name.startswith(_NAMES):
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        if spec is None or type(spec.loader) is not importlib.machinery.SourceFileLoader:
            return None
        spec.loader = Loader(name, spec.origin)
        return spec


def missing() -> str:
    """Return what has to be installed before kernels can be compiled, "" if nothing."""
    if not shutil.which("gcc"):
        return "gcc"
    headers = Path(sysconfig.get_path("include"), "Python.h")
    return "" if headers.exists() else f"Python's headers ({headers}; python3-dev on Debian)"


def install() -> None:
    """Load kernels as machine code from now on, if this computer can make it.

    Raises RuntimeError if it is too late.
    """
    if any(isinstance(finder, _Finder) for finder in sys.meta_path):
        return
    if loaded := [name for name in sys.modules if name.startswith(_NAMES)]:
        raise RuntimeError(f"already loaded in Python: {', '.join(loaded)}")
    if not missing():
        sys.meta_path.insert(0, _Finder())
