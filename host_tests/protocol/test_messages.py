"""Every message has its own number, the lengths of the notes, and a handler. If one is missing, the
test says what to add."""

import ast
import itertools
import re

from framestep.hal.host_board import HostBoard
from framestep.protocol import messages
from framestep.protocol.messages import SIZES, payload_fits
from framestep_tools.building.board_files import sources
from host_tests.protocol.notes import table

NAMES = {
    value: name
    for name, value in vars(messages).items()
    if name.startswith("MSG_") and name != "MSG_FLAG_ACK"
}


def named(kinds):
    """Return message types in readable form."""
    return ", ".join(
        f"{NAMES.get(kind, 'a request without a name')} ({kind:#06x})" for kind in sorted(kinds)
    )


def test_every_request_has_a_handler():
    rig = {"limits": [{"low": 22}], "motors": [{"home": {"limit": 1, "travel": 1000}}]}
    unhandled = set(SIZES) - set(HostBoard(rig).controller.handlers)
    assert not unhandled, (
        "add a handler to the table of the part it is about (controller.py, or requests.py of "
        f"motors, moves, io or virtuals): {named(unhandled)}"
    )


def test_payload_lengths_of_every_type():
    reported = {row.number: row for row in table().values() if row.asked}
    for kind in [*range(0x0400), *range(0x4500, 0x4800), 0x8001, 0xFFFF]:
        assert (kind in SIZES) == (kind in reported), named([kind])
        for length in range(200):
            fits = kind in reported and reported[kind].fits(length)
            assert payload_fits(kind, length) == fits, f"{length} bytes: {named([kind])}"


def test_no_two_names_of_a_kind_share_a_number():
    for prefix in "MSG_", "ERR_", "CAP_", "MOTOR_", "RUN_", "VIRT_MOTOR_", "HARD_STOP_", "LINE_":
        values = [value for name, value in vars(messages).items() if name.startswith(prefix)]
        assert len(values) == len(set(values)) > 1


def handlers():
    """Yield (module, message, docstring) for each handler of the tables in the sources."""
    for path in (
        "controller", "motors/requests", "moves/requests", "io/requests", "virtual_axes/requests",
        "homing",
    ):  # fmt: skip
        tree = ast.parse(sources()[f"framestep/{path}.py"].read_text())
        trees = [tree]
        if path == "controller":
            trees.append(ast.parse(sources()["framestep/stops.py"].read_text()))  # STOP_ALL
        found = {
            node.name: ast.get_docstring(node) or ""
            for node in itertools.chain.from_iterable(map(ast.walk, trees))
            if isinstance(node, ast.FunctionDef)
        }
        for node in ast.walk(tree):
            match node:
                case ast.Dict(keys=keys, values=values):
                    pairs = list(zip(keys, values, strict=True))
                case ast.Assign(targets=[ast.Subscript(slice=key)], value=value):
                    pairs = [(key, value)]
                case _:
                    continue
            for key, value in pairs:
                match key, value:
                    case ast.Attribute(attr=message), ast.Attribute(attr=name) if (
                        message in NAMES.values()
                    ):
                        yield path, message, found[name]


def test_every_handler_says_what_it_is_about():
    """Its docstring begins with the message and says where it is specified."""
    reported = list(handlers())
    assert len(reported) > 30
    for path, message, text in reported:
        where = f"{path}.py, the handler of {message}: "
        assert text.startswith(message), f"{where}begin its docstring with {message}"
        assert re.search(r"note|spec|framestep's own", text), (
            f"{where}cite the field note or the specification"
        )
