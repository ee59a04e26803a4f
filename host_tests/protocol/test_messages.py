"""Every message has a number, a name, its lengths and a handler. Where one is forgotten a test says
what to add."""

import ast
import itertools
import re

from framestep.controller import _KEEPS_EARLY_PLAN
from framestep.host_board import HostBoard
from framestep.protocol import messages
from framestep.protocol.messages import known, payload_fits
from framestep_tools.building.board_files import sources

SENT_ONLY = {messages.MSG_MOTOR_HARD_STOP, messages.MSG_RT_END}
NAMES = {
    value: name
    for name, value in vars(messages).items()
    if name.startswith("MSG_") and name != "MSG_FLAG_ACK"
}

# Field notes 1.8 and 2, written down once more: the lengths up to 200 bytes that a request may
# have. A fixed layout may be longer than it is known.
LENGTHS = {
    0x0001: set(range(0, 200)),
    0x0020: set(range(3, 200)),
    0x0021: set(range(4, 200)),
    0x0022: set(range(0, 200)),
    0x0023: set(range(4, 200)),
    0x0030: set(range(0, 200)),
    0x0031: set(range(5, 200)),
    0x0032: set(range(1, 200)),
    0x0033: set(range(0, 200)),
    0x0034: set(range(0, 200)),
    0x0035: set(range(5, 200)),
    0x0036: set(range(7, 200)),
    0x0037: set(range(2, 200)),
    0x0038: set(range(9, 200)),
    0x0039: set(range(12, 200)),
    0x0100: set(range(8, 200)),
    0x0101: set(range(5, 200, 4)),
    0x0102: set(range(6, 200)),
    0x0103: set(range(0, 200)),
    0x0104: set(range(4, 200, 8)),
    0x0110: set(range(4, 200)),
    0x0111: set(range(29, 200)),
    0x0112: set(range(11, 200, 9)),
    0x0113: set(range(0, 200)),
    0x0115: set(range(12, 200, 9)),
    0x0116: set(range(0, 200)),
    0x0120: set(range(8, 200)),
    0x0200: set(range(1, 200)),
    0x0201: set(range(5, 200)),
    0x0202: set(range(1, 200)),
    0x0203: set(range(7, 200)),
    0x0205: set(range(0, 200)),
    0x0206: set(range(3, 200)),
    0x0207: set(range(13, 200)),
    0x4600: set(range(0, 200)),  # framestep's own
    0x4601: set(range(0, 200)),
    0x4602: set(range(0, 200)),
}


# What is asked for while a prepared run waits for GO, and has begun to be planned: after these it
# is planned anew, as they may change it or what it has assumed
PLANNED_ANEW = {
    messages.MSG_MOTOR_MOVE,
    messages.MSG_MOTOR_STOP,
    messages.MSG_MOTOR_STOP_ALL,
    messages.MSG_MOTOR_RESET_POSITION,
    messages.MSG_MOTOR_JOG,
    messages.MSG_MOTOR_CONFIGURE,
    messages.MSG_MOTOR_SET_SPEED,
    messages.MSG_MOTOR_SET_LIMITS,
    messages.MSG_RT_UPLOAD_MOVE_BEGIN,
    messages.MSG_RT_UPLOAD_MOVE_AXIS,
    messages.MSG_RT_UPLOAD_MOVE_DMX,
    messages.MSG_RT_UPLOAD_MOVE_END,
    messages.MSG_RT_UPLOAD_MOVE_TRIGGERS,
    messages.MSG_RT_POSITION_FRAME,
    messages.MSG_RT_RUN_MOVE,
    messages.MSG_RT_SHOOT_FRAME,
    messages.MSG_RT_SHOOT_FRAME2,
    messages.MSG_RT_STOP_LOOP,
    messages.MSG_RT_JOG_ALL,
    messages.MSG_VIRT_CONFIG,
    messages.MSG_VIRT_MOVE,
    messages.MSG_VIRT_STOP,
    messages.MSG_VIRT_JOG,
    messages.MSG_VIRT_JOG_ON_LINE,
    messages.MSG_VIRT_AIM_POINT,
    messages.MSG_HOME,
}


def named(kinds):
    """Message types as one reads them."""
    return ", ".join(
        f"{NAMES.get(kind, 'a request without a name')} ({kind:#06x})" for kind in sorted(kinds)
    )


def test_every_message_has_its_lengths_here():
    new = set(NAMES) - SENT_ONLY - set(LENGTHS)
    assert not new, f"add to LENGTHS in this file, from docs/protocol-notes.md, 2: {named(new)}"
    gone = set(LENGTHS) - set(NAMES)
    assert not gone, (
        "no MSG_ in protocol/messages.py any more, so take from LENGTHS in this file: "
        f"{named(gone)}"
    )


def test_every_message_but_those_only_sent_is_a_request():
    forgotten = set(NAMES) - SENT_ONLY - set(messages.REQUESTS)
    assert not forgotten, (
        "add to REQUESTS in protocol/messages.py, or to SENT_ONLY here if the host never sends it: "
        f"{named(forgotten)}"
    )


def test_every_request_has_a_name():
    nameless = set(messages.REQUESTS) - set(NAMES)
    assert not nameless, f"add a MSG_ constant to protocol/messages.py: {named(nameless)}"


def test_every_request_has_a_handler():
    rig = {"limits": [{"low": 22}], "motors": [{"home": {"limit": 1, "travel": 1000}}]}
    unhandled = set(messages.REQUESTS) - set(HostBoard(rig).controller.handlers)
    assert not unhandled, (
        "add a handler to the table of the part it is about (controller.py, or requests.py of "
        f"motors, moves, io or virtuals): {named(unhandled)}"
    )


def test_every_request_says_whether_it_keeps_an_early_plan():
    kept = set(_KEEPS_EARLY_PLAN)
    undecided = set(messages.REQUESTS) - kept - PLANNED_ANEW
    assert not undecided, (
        "if a prepared run may keep what it has planned although this comes before GO, add it to "
        "_KEEPS_EARLY_PLAN in controller.py, else to PLANNED_ANEW in this file: "
        f"{named(undecided)}"
    )
    both = kept & PLANNED_ANEW
    assert not both, f"in _KEEPS_EARLY_PLAN and PLANNED_ANEW, take it out of one: {named(both)}"


def test_payload_lengths_of_every_type():
    for kind in [*range(0x0400), *range(0x4500, 0x4800), 0x8001, 0xFFFF]:
        if kind in NAMES and kind not in {*LENGTHS, *SENT_ONLY}:
            continue  # test_every_message_has_its_lengths_here says what to do
        assert known(kind) == (kind in LENGTHS), named([kind])
        assert {n for n in range(200) if payload_fits(kind, n)} == LENGTHS.get(kind, set()), named(
            [kind]
        )


def test_no_two_names_of_a_kind_share_a_number():
    for prefix in "MSG_", "ERR_", "CAP_", "MOTOR_", "RUN_", "VIRT_MOTOR_", "HARD_STOP_", "LINE_":
        values = [value for name, value in vars(messages).items() if name.startswith(prefix)]
        assert len(values) == len(set(values)) > 1


def handlers():
    """(module, message, docstring of its handler) for each handler of the tables in the sources."""
    for path in (
        "controller",
        "motors/requests",
        "moves/requests",
        "io/requests",
        "virtuals/requests",
    ):
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
    """Its docstring begins with the message and tells the payload, by offsets, and where it is
    specified."""
    told = list(handlers())
    assert len(told) > 30
    for path, message, text in told:
        where = f"{path}.py, the handler of {message}: "
        assert text.startswith(message), f"{where}begin its docstring with {message}"
        assert re.search(r"[Nn]o payload|\bpayload\b| \d", text), (
            f"{where}say in its docstring what lies where in the payload"
        )
        assert re.search(r"note|spec|framestep's own", text), (
            f"{where}cite the field note or the specification"
        )
