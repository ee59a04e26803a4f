"""Where fields are in a payload: as framestep_tools.payloads has them."""

import ast
import inspect
import struct

import pytest

from framestep.protocol import fields, messages
from framestep_tools import payloads
from framestep_tools.building.board_files import sources
from framestep_tools.payloads import codec

_NAMES = [name for name in vars(fields) if name.isupper()]


def _fixed_offsets():
    """{name: offset} of the fields of these requests that lie at the same place always."""
    names = {
        value: name.removeprefix("MSG_").removeprefix("RT_")
        for name, value in vars(messages).items()
        if name.startswith("MSG_")
    }
    found = {}
    for cls in vars(payloads).values():
        if not (inspect.isclass(cls) and issubclass(cls, payloads.Request)):
            continue
        if not isinstance(getattr(cls, "TYPE", None), int):
            continue
        if not any(name.startswith(names[cls.TYPE] + "_") for name in _NAMES):
            continue
        at = 0
        for name, code, _ in codec.layout(cls):
            found[f"{names[cls.TYPE]}_{name}".upper()] = at
            if not isinstance(code, str) or code.startswith("*"):
                break
            at += struct.calcsize("<" + code)
    return found


@pytest.mark.parametrize("name", _NAMES)
def test_a_field_is_where_the_payload_has_it(name):
    assert getattr(fields, name) == _fixed_offsets()[name]


def bare_offsets(tree):
    """(line, offset) where an offset other than 0 is a number: reader.u8(4), reader.payload + 4."""
    for node in ast.walk(tree):
        match node:
            case (
                ast.Call(
                    func=ast.Attribute(value=reader), args=[ast.Constant(value=int(offset)), *_]
                )
                | ast.BinOp(
                    left=ast.Attribute(value=reader, attr="payload"),
                    right=ast.Constant(value=int(offset)),
                )
            ) if offset and ast.unparse(reader) in ("reader", "self.reader"):
                yield node.lineno, offset


def test_handlers_call_fields_by_their_names():
    for path, file in sources().items():
        found = list(bare_offsets(ast.parse(file.read_text())))
        assert not found, (
            "put the offset into protocol/fields.py, under the name that the field has in "
            f"framestep_tools.payloads: {path}, (line, offset) {found}"
        )


def test_there_are_fields():
    assert len(_NAMES) > 30
