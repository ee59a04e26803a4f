"""The recipe of CONTRIBUTING.md for a message, followed in a copy of the sources."""

import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

from framestep_tools.building.board_files import ROOT

# What holds in the copy without any other change
PROGRAM = """
from framestep_tools import payloads as p
from framestep_tools.building.board_files import folded
from framestep_tools.client.wire import encode
from framestep_tools.console import port_bridge, page_files
from framestep_tools.console.port_bridge import Jogs
from framestep_tools.traffic import compare
from host_tests.end_to_end.session import simulated
from host_tests.fuzz import link
from host_tests.protocol import test_fields, test_messages
from host_tests.tools.documents import test_protocol_notes

kind = p.MotorCreep.TYPE
session = simulated()
session.accept(p.MotorCreep(3, 5000))
session.run(0.4)
assert session.ask(p.MotorGetPosition()).steps[2] > 0
assert session.code(p.MotorCreep(99, 5000)) == p.Ack.ERR_RANGE

jogs = Jogs()
jogs.note(encode(kind, p.MotorCreep(3, 5000).pack(), 1))
assert jogs.stops() == [p.MotorStop(3)]
jogs.note(encode(kind, p.MotorCreep(3, 5000).pack(), 1) + encode(p.MotorStop.TYPE, b"\\3", 2))
assert not jogs
assert port_bridge._refused_jogs(encode(kind, p.MotorCreep(3, 5000).pack(), 1))

assert kind in link.MOTIONS and kind in compare._MOVES
assert '"MotorCreep"' in page_files.protocol_js()
test_protocol_notes.test_requests_are_declared_as_in_the_table(p.MotorCreep)
test_messages.test_payload_lengths_of_every_type()
test_messages.test_every_request_has_a_handler()
test_messages.test_every_handler_says_what_it_is_about()
test_fields.test_handlers_call_fields_by_their_names()

board = {name: text.decode() for name, text in folded({}, True).items()}
assert f"{kind}: self._creep," in board["framestep/motors/requests.py"]
assert "self.reader.copy_i32_to(1, self.words, 0)" in board["framestep/motors/requests.py"]
assert f"{kind}: (5, 0)" in board["framestep/protocol/messages.py"]
"""


def blocks():
    """Return the pieces of text that the recipe shows, between its fences."""
    recipe = (ROOT / "CONTRIBUTING.md").read_text().split("## Add a message")[1].split("\n## ")[0]
    found = re.findall(r"^ +```\w*\n(.*?)^ +```$", recipe, re.MULTILINE | re.DOTALL)
    return [textwrap.dedent(text) for text in found]


def insert(path, before, text):
    whole = path.read_text()
    assert whole.count(before) == 1
    path.write_text(whole.replace(before, text + before))


def test_a_message_of_the_recipe_is_answered(tmp_path):
    for folder in ("firmware", "tools/framestep_tools", "boards", "host_tests"):
        shutil.copytree(
            ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__")
        )
    notes = Path("docs/internals/protocol-notes.md")
    (tmp_path / notes).parent.mkdir(parents=True)
    shutil.copy(ROOT / notes, tmp_path / notes)
    row, declaration, handler = blocks()
    line, _, method = handler.partition("\n\n")
    core = tmp_path / "firmware/framestep"
    insert(tmp_path / notes, "| HOME (framestep's own)", row)
    insert(core / "protocol/declared/general.py", "MSG_MOTOR_MOVE = ", f"{declaration}\n\n")
    insert(core / "motors/requests.py", "            m.MSG_MOTOR_JOG: ", f"            {line}\n")
    insert(
        core / "motors/requests.py",
        "    def _jog(self):",
        textwrap.indent(method, "    ") + "\n",
    )
    paths = [tmp_path, tmp_path / "firmware", tmp_path / "tools"]
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths))},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
