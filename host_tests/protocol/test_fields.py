"""Where fields are in a payload: handlers use the names of the declaration."""

import ast

import pytest

from framestep.protocol import messages
from framestep_tools.building.board_files import sources


@pytest.mark.parametrize(
    ("cls", "field", "offset"),
    [
        (messages.MotorSetLimits, "limit_set", 11),
        (messages.RtRunMove, "close_angle", 33),
        (messages.RtShootFrame, "motors", 11),
        (messages.SetVirtAimPoint, "x", 1),
        (messages.DeviceInfo, "capabilities", 45),
    ],
)
def test_where_a_field_begins(cls, field, offset):
    """The specification under the messages of these names."""
    assert getattr(cls, field) == offset


def test_a_field_of_a_message_is_its_value():
    assert messages.MotorJog(1, 500, -2).speed == 500
    assert messages.RtRunMove(24_000, 1, 9).flags is None


def bare_offsets(tree):
    """Yield (line, offset) for an offset that is a number: reader.u8(4), reader.payload + 4."""
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
            ) if ast.unparse(reader) in ("reader", "self.reader"):
                yield node.lineno, offset


def test_handlers_call_fields_by_their_names():
    for path, file in sources().items():
        found = list(bare_offsets(ast.parse(file.read_text())))
        assert not found, (
            "take the name that the field has in framestep.protocol.declared: "
            f"{path}, (line, offset) {found}"
        )
