"""`framestep rig check` reports what the board reports; editing goes on until the file is right."""

import json
import re

import pytest

from framestep import rig
from framestep.rig import homes, servos, settings
from framestep_tools import cli
from framestep_tools.board import rig_change, rig_file
from framestep_tools.board.repl_device import State
from framestep_tools.board.rig_file import RigFileError
from framestep_tools.building.board_files import ROOT, board_data
from framestep_tools.errors import ToolError

WRONG = {
    '{"jog_timeout_ms": -1}': (
        "jog_timeout_ms: found -1, allowed is a whole number from 0 to 60000 ms"
    ),
    '{"nane": "x"}': "nane: no such setting; there are clock_mhz, dialect,",
    '{"motors": [{}, {"pulse_us": "1"}]}': (
        "motors[2].pulse_us: found '1', allowed is a number from 0.25 to 50.0 µs"
    ),
    '{"name": "a\\u0000b"}': "a text of 1 to 32 bytes of UTF-8, without control characters",
    '{"estop_cuts_power": true}': 'estop_cuts_power: found true, but `estop` is "none"',
    '{"outputs": [{"pin": 2}]}': "outputs[1].pin: found 2, which is the board's step 1 already",
}
NO_JSON = {
    b'{\n  "name": "x",\n  "ports" 1\n}': (
        "not valid JSON in line 3, column 11 (Expecting ':' delimiter)"
    ),
    b'{"name": "x",\n5}': "not valid JSON in line 2, column 1",
    b'{"ports": NaN}': "not valid JSON (NaN is not JSON)",
    b'{\n"name": "\xe9"}': "expected UTF-8, found byte 0xE9 in line 2",
    b'{\n"name": "\\ud83d\\ude00"}': "\\ud83d in line 2 is half a character, and a board does",
    b'{"\\uD800": 1}': "\\uD800 in line 1 is half a character",
    b"[1]": "expected an object of settings, found list",
}


MEANT = {
    '{"nane": "x"}': "; did you mean name?",
    '{"motors": [{"backlsh": 2}]}': "; did you mean backlash?",
    '{"motors": [{"Invert": true}]}': "; did you mean invert?",
    '{"motors": [{"driver": {"run_ma": 500, "mirosteps": 8}}]}': "; did you mean microsteps?",
    '{"qqq": 1}': "qqq: no such setting; there are clock_mhz, dialect",
    '{"pulse_us": 1}': "pulse_us: no such setting; did you mean motors[n].pulse_us?",
    '{"ports": 1, "ports": 2}': '"ports" occurs twice in one {…}',
    '{"motors": [{}, {"ports": 1, "ports": 1}]}': '"ports" occurs twice in one {…}',
}


@pytest.fixture
def check(tmp_path, capsys):
    """Return check(content, *options): what `rig check` says of a file FILE with this content."""
    file = tmp_path / "rig.json"

    def run(content, *options, status=0):
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
        assert cli.app.status(["rig", "check", str(file), *options]) == status
        said = capsys.readouterr()
        return (said.err if status else said.out).replace(str(file), "FILE")

    return run


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_setting_is_reported_as_on_the_board(text, check, tmp_path):
    said = check(text, status=1).strip()
    _, mistake = rig.load(str(tmp_path / "rig.json"), board_data("pico"))
    reported = re.sub(r"; did you mean \w+\? There", "; there", said)
    assert reported == f"framestep: {mistake}".replace(str(tmp_path / "rig.json"), "FILE")
    assert WRONG[text] in reported


def test_all_mistakes_at_once(check):
    """Not the pin that is missing once the wrong one has been left out."""
    first, *mistakes = check(
        '{"outputs": [{"pin": 99}], "nane": "x", "motors": [{"jerk": -1}, {"driver": {"x": 2}}]}',
        status=1,
    ).splitlines()
    assert first == "framestep: FILE: 5 mistakes:"
    assert sorted(line.split(":")[0].strip() for line in mistakes) == [
        "motors[1].jerk", "motors[2].driver.run_ma", "motors[2].driver.x", "nane", "outputs[1].pin",
    ]  # fmt: skip


@pytest.mark.parametrize("content", NO_JSON)
def test_what_is_no_json_is_reported_with_its_line(content, check):
    assert f"framestep: FILE: {NO_JSON[content]}" in check(content, status=1)


@pytest.mark.parametrize("text", MEANT)
def test_what_was_meant(text, check):
    assert MEANT[text] in check(text, "--board", "skr_pico", status=1)


def test_a_backslash_before_a_u_is_no_escape(check):
    assert "valid" in check(b'{"name": "\\\\ud83d \\u00e9"}')


def test_a_right_file(check, tmp_path, capsys):
    text = '{"name": "Krän", "motors": [{"invert": true}, {}], "outputs": [{"pin": 22}]}'
    said = "FILE is valid for Raspberry Pi Pico: 'Krän', 2 motors set\n"
    assert check(text, "--board", "pico") == said
    assert "no board 'toaster': there are " in check(text, "--board", "toaster", status=1)
    assert cli.app.status(["rig", "check", str(tmp_path / "none")]) == 1
    assert "cannot read the rig file" in capsys.readouterr().err


def edit(tmp_path, versions, answers):
    """Return (the result of edit_until_right, the mistakes reported) for an editor that writes
    these versions."""
    file = tmp_path / "rig.json"
    file.write_text("{}")
    versions, answers, reported = iter(versions), iter(answers), []

    def again(mistake):
        reported.append(mistake)
        return next(answers)

    return rig_file.edit_until_right(
        file, board_data("pico"), lambda p: p.write_text(next(versions)), again
    ), reported


def test_editing_until_it_is_right(tmp_path):
    new, reported = edit(tmp_path, ['{"ports": 3}', '{"ports": 2', '{"ports": 1}'], [True, True])
    assert new == b'{"ports": 1}'
    assert [mistake.split(",")[0] for mistake in reported] == [
        "rig.json: ports: found 3",
        "rig.json: not valid JSON in line 1",
    ]


def test_giving_up_and_leaving_it_as_it_was(tmp_path):
    with pytest.raises(RigFileError, match="ports: found 3"):
        edit(tmp_path, ['{"ports": 3}'], [False])
    assert edit(tmp_path, ["{}"], []) == (None, [])
    assert edit(tmp_path, ["no JSON", "{}"], [True])[0] is None


def test_a_setting_that_was_changed_in_a_comment_is_reported(tmp_path):
    path = tmp_path / "rig.json"
    path.write_text(rig_file.commented("{}"))
    asked = []

    def editor(file):
        text = file.read_text()
        if not asked:
            file.write_text(text.replace('//   "estop": "none"', '//   "estop": "nc"'))
        else:
            file.write_text(text.replace("{}", '{"estop": "nc"}', 1))

    def again(mistake):
        asked.append(mistake)
        return True

    def edited(editor, again):
        return rig_file.edit_until_right(path, board_data("pico"), editor, again, b"{}")

    assert json.loads(edited(editor, again)) == {"estop": "nc"}
    assert len(asked) == 1
    assert re.match(r'line \d+ has changed, but it is a comment: "estop": "nc"', asked[0])
    # without another try nothing changes, and changes of other comments do not matter
    path.write_text(rig_file.commented("{}"))
    asked.clear()
    assert edited(editor, lambda _: False) is None
    path.write_text("// mine\n{}")
    assert edited(lambda file: file.write_text("// another\n{}"), again) is None


def test_the_editor(tmp_path, monkeypatch):
    file = tmp_path / "rig.json"
    file.write_text("a")
    monkeypatch.delenv("VISUAL", raising=False)
    monkeypatch.setenv("EDITOR", "sed -i s/a/b/")
    rig_file.run_editor(file)
    assert file.read_text() == "b"
    for editor, text in (
        ("false", "ended with status 1"),
        ("/not/there", "cannot start the editor /not/there"),
    ):
        monkeypatch.setenv("EDITOR", editor)
        with pytest.raises(rig_file.ToolError, match=text):
            rig_file.run_editor(file)


@pytest.mark.parametrize("content", ["{}", '{"name": "a // b \\" // c"}', '{\n  "motors": [{}]\n}'])
def test_a_draft_with_comments(content):
    draft = rig_file.commented(content, everything=True)
    assert rig_file.without_comments(draft).strip() == content
    assert rig_file.without_comments(draft).count("\n") == draft.count("\n")
    for table in (
        settings.SETTINGS, settings.MOTOR_SETTINGS, settings.DRIVER_SETTINGS, homes.HOME_SETTINGS,
        servos.SERVO_SETTINGS, settings.LIMIT_SETTINGS,
    ):  # fmt: skip
        assert all(f'//   "{key}": ' in draft for key in table)


def test_a_draft_shows_first_what_a_new_rig_needs():
    """The settings that docs/start/configure.md names."""
    draft = rig_file.commented("{}")
    shown = re.findall(r'^//   "(\w+)": ', draft, re.MULTILINE)
    page = (ROOT / "docs/start/configure.md").read_text()
    first = page.partition("## What to set first")[2].partition("A whole file")[0]
    assert set(re.findall(r'"(\w+)":', first)) <= set(shown)
    wanted = [key for keys in rig_file.FIRST.values() for key in keys]
    assert sorted(shown) == sorted(wanted), "a key of FIRST is no setting"
    assert len(shown) < 30
    assert "framestep rig edit --all" in draft
    assert draft.count("//\n// of ") == 3, "no heading without settings"


def test_a_key_below_what_the_type_of_driver_needs(check):
    text = (
        '{"motors": [{"type": "tb6600", "pulse_us": 10, "enable_ms": 100}, {"type": "cl57t", '
        '"enable_ms": 200, "enable_high": true}, {"pulse_us": 0.5}]}'
    )
    said = [
        "motors[1].pulse_us: 10 µs is less than the 30 µs that a driver of type tb6600 needs",
        "motors[2].enable_high: the drivers share an enable pin on this board, so that of "
        "motors[1] counts",
        "motors[2].enable_ms: 200 ms is less than the 500 ms that a driver of type cl57t needs",
    ]
    assert check(text).splitlines()[1:] == [f"warning: {line}" for line in said]
    assert json.loads(check(text, "--json"))["warnings"] == said
    pins_of_their_own = json.loads(check(text, "--board", "skr_pico", "--json"))["warnings"]
    assert pins_of_their_own == [said[0], said[2]]


def test_a_draft_is_checked_as_what_the_board_would_get(check):
    mark, draft = "\ufeff", rig_file.commented('{"name": "http://draft"}')
    assert check(mark + draft) == (
        "FILE is valid for Raspberry Pi Pico: 'http://draft', 0 motors set; "
        "it begins with a byte order mark and has // comments, which a board does not read: "
        "framestep rig edit FILE sends it without\n"
    )
    said = check(mark + '{"name": "b"}')
    assert "it begins with a byte order mark, which a board does not" in said
    assert "does not read" not in check('{"name": "b"}')
    assert "FILE: ports: found 3" in check(rig_file.commented('{\n"ports": 3}'), status=1)
    found = check(rig_file.commented('{\n"ports" 3}'), status=1)
    assert "FILE: not valid JSON in line 4, column 9" in found


def test_what_goes_onto_a_board_has_no_comments(tmp_path):
    assert rig_file.for_board(b'{"name": "a"}\n') == b'{"name": "a"}\n', "as it is"
    assert rig_file.for_board(b'\xef\xbb\xbf{ // b\n"name": "// c"}') == b'{\n"name": "// c"}'


@pytest.mark.parametrize("content", [b'{"ports": 1} // one', b'\xef\xbb\xbf{"ports": 1}'])
def test_a_boards_file_with_comments_is_reported_as_such(content):
    with pytest.raises(RigFileError, match="a board reads neither // comments nor a byte order"):
        rig_file.parse(content, "/rig.json")


def test_a_draft_goes_on_from_what_the_board_has(tmp_path):
    file = tmp_path / "rig.json"

    def saved(draft, board):
        file.write_bytes(draft)
        return rig_file.edit_until_right(file, board_data("pico"), lambda p: None, print, board)

    assert saved(b'{"ports": 1} // mine', b'{"ports": 2}') == b'{"ports": 1}'
    assert saved(b'{"ports": 1} // mine', b'{"ports": 1}\n') is None
    assert saved(b"{} // mine", b"{} // mine") == b"{}", "the board cannot read what it has"
    assert saved('{"name": "a\u2028b"} // '.encode(), b"{}") == '{"name": "a\u2028b"}'.encode()


def test_a_file_that_only_the_board_refuses_leaves_the_draft(tmp_path, monkeypatch):
    """Firmware of another version may do so; console/test_board.py tests that the board has its
    earlier file back."""

    class Board:
        path = "/dev/repl"
        state = State(True, 0, True)
        ports = 2

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def board(self):
            return board_data("pico")

        def read(self, name):
            return b'{"name": "before"}'

    class Change:
        def __init__(self, device, content):
            assert content == b'{"name": "after"}'

        def see(self, opened, protocol, ports):
            assert (protocol, ports) == ("/dev/protocol", 2)
            raise rig_change.Refused("the board refuses it (why)")

    def run_editor(draft):
        draft.write_text(draft.read_text().replace("before", "after"))

    monkeypatch.setattr(rig_change, "RigChange", Change)
    monkeypatch.setattr(rig_file, "run_editor", run_editor)
    monkeypatch.setattr(rig_file.tempfile, "mkdtemp", lambda prefix: str(tmp_path))
    with pytest.raises(ToolError) as caught:
        rig_file.edit(Board(), "/dev/protocol")
    draft = tmp_path / "rig.json"
    assert str(caught.value) == (
        f"the board refuses it (why); framestep rig edit {draft} goes on with the draft"
    )
    assert "after" in draft.read_text()
