"""The command line: it answers wrong use with one sentence, and reads traffic."""

import re
from pathlib import Path

import pytest
import typer

from framestep_tools import cli, demo
from framestep_tools.building.board_files import ROOT
from framestep_tools.client.wire import encode
from framestep_tools.commands import emu
from framestep_tools.commands.common import arranged
from framestep_tools.commands.moves import section
from framestep_tools.errors import STATUSES
from framestep_tools.move.move_file import CAMERA_MOVE, MoveFileError, or_example, read_move
from framestep_tools.payloads import Hi, MotorMove, RtUploadMoveAxis
from framestep_tools.traffic.sniffer import capture_bytes

APPS = {"framestep": cli.app, "demo": demo.app, "emu": emu.app}


@pytest.mark.parametrize(
    ("typed", "status", "text"),
    [
        ("framestep status 127.0.0.1:7000", 2, "no device: write socket://127.0.0.1:7000"),
        ("framestep jog /dev/x 1 5 --speed x", 2,
         "--speed: expected a part of the motor's velocity from 0.01% to 100%, such as 5%"),
        ("framestep shoot 1 --exposure x", 2, "--exposure: expected a number"),
        ("framestep virtual x", 2, "axis: 'x' is not one of 'track'"),
        ("framestep lab prove", 3, "no board with framestep is on USB"),
        ("framestep lab conform", 3, "no board with framestep is on USB"),
        ("framestep vcd x.csv", 2, "vcd is one of the lab: framestep lab vcd; framestep --help"),
        ("framestep fly", 2, "No such command 'fly'"),
        ("framestep status", 3, "without a board, framestep console --demo shows a simulated rig"),
        ("framestep status /dev/not-there", 3,
         "cannot open /dev/not-there: No such file or directory; "),
        ("framestep status --device /dev/null", 3, "cannot open /dev/null"),
        ("framestep status socket://127.0.0.1:1", 3,
         "cannot open socket://127.0.0.1:1: Connection refused"),
        ("framestep status socket://nowhere", 3, "expected socket://HOST:PORT"),
        ("framestep status serial://x", 3, "cannot open serial://x"),
        ("framestep status x", 2, "more than expected: x; framestep status"),
        ("framestep move /dev/x one 5", 2, "there is no axis 'one': no axes.toml is here"),
        ("framestep move /dev/x 0 5", 2, "expected a motor from 1 to 32, found 0"),
        ("framestep move /dev/x 1 2147483648", 2,
         "positions have to fit 32 bits signed, found '2147483648'"),
        ("framestep move /dev/x 1 5 --velocity 3", 2, "--velocity and --acceleration go together"),
        ("framestep jog /dev/x 1 5 --speed 10001", 2, "such as 5%, found '10001'"),
        ("framestep stop /dev/x 1 --hard", 2, "--hard stops all motors"),
        ("framestep virtual /dev/x pan", 2, "an axis needs a position as well"),
        ("framestep virtual /dev/x up 5", 2, "'up' is not one of"),
        ("framestep upload /dev/x /not/there.csv", 1, "cannot read the move /not/there.csv"),
        ("framestep play /dev/x move.csv --fps 0", 2,
         "--fps: expected frames per second from 0.001 to 1000"),
        ("framestep play /dev/x a.csv --velocity 5", 2, "go together"),
        ("framestep play /dev/x a.csv --loop --ping-pong", 2, "do not go together"),
        ("framestep play /dev/x a.csv --shutter-angle 90", 2, "needs --camera stills"),
        ("framestep play /dev/x camera_move.csv --to 241", 1,
         "the move has frames 1 to 240, not 241"),
        ("framestep play /dev/x camera_move.csv --dmx /not/there.csv", 1,
         "cannot read the lights /not/there.csv"),
        ("framestep lab sniff", 2, "either a capture file or a --device"),
        ("framestep lab sniff /not/there.hex", 1, "cannot read the capture /not/there.hex"),
        ("framestep console --port 99999", 2, "--port: expected at most 65535"),
        ("framestep sim --trace /not/there.csv", 1, "cannot write the trace /not/there.csv"),
        ("demo --host --out /proc/there", 1, "cannot write /proc/there"),
        ("framestep sim --speed fast", 1, "expected max or a positive number"),
        ("framestep sim --board nano", 1, "no board 'nano': there are esp32_595, esp32_s3_595"),
        ("framestep sim --motors 0", 2, "--motors: expected at least 1"),
        ("framestep sim --rig /not/there.json", 1, "cannot read the rig file /not/there.json"),
        ("emu --single-port --repl", 2, "with a single port"),
        ("emu --nonsense", 2, "No such option: --nonsense"),
        ("demo --board toaster", 1, "no board 'toaster'"),
        ("demo --board esp32_595", 1, "is not emulated, as its chip is esp32: add --host"),
        ("demo --host --move /not/there.csv", 1, "cannot read the move /not/there.csv"),
    ],
)  # fmt: skip
def test_one_sentence_says_what_is_wrong(typed, status, text, capsys):
    program, *args = typed.split()
    assert APPS[program].status(args) == status
    out, err = capsys.readouterr()
    assert out == ""
    assert text in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("app", APPS.values(), ids=APPS)
@pytest.mark.parametrize("option", ["--help", "-h"])
def test_help(app, option, capsys):
    assert app.status([option]) == 0
    assert "Usage" in capsys.readouterr().out


def commands_of(app):
    return typer.main.get_command(app).commands


def test_each_command_is_listed_once_under_its_subject_and_not_cut_short(capsys):
    assert cli.app.status(["--help"]) == 0
    shown = capsys.readouterr().out
    listed = re.findall(r"^  (\w+) +[A-Z]", shown.partition("  -h, --help")[2], re.MULTILINE)
    assert sorted(listed) == sorted(commands_of(cli.app))
    assert "..." not in shown.partition("Options:")[2], "begin its docstring with a short sentence"


def test_no_description_of_a_command_is_cut_short(capsys):
    assert cli.app.status(["rig", "--help"]) == 0
    listed = capsys.readouterr().out.partition("Commands:")[2].partition("\n\n")[0]
    assert len(listed.splitlines()) > 3
    assert "..." not in listed, "begin its docstring with a short sentence"


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("framestep mo", "move"),
        ("framestep move --ve", "--velocity"),
        ("framestep rig ex", "example"),
        ("framestep lab sn", "sniff"),
    ],
)
def test_a_shell_completes_commands_and_options(typed, completed, monkeypatch, capfd):
    monkeypatch.setenv("_FRAMESTEP_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
    with pytest.raises(SystemExit) as end:
        cli.app.status([])
    assert end.value.code == 0
    assert capfd.readouterr().out.split() == [completed]


def test_every_exit_status_is_documented():
    page = (ROOT / "docs/use/troubleshooting.md").read_text(encoding="utf-8")
    listed = "".join(f"| {number} | {text} |\n" for number, text in STATUSES.items())
    assert page.endswith(listed), "the table at the end is errors.STATUSES"


def test_nothing_asked_for_shows_the_help(capsys):
    assert cli.app.status([]) == 0
    shown = capsys.readouterr().out
    assert "status" in shown
    assert "framestep console --demo" in shown.splitlines()[-2]
    assert "framestep install" in shown.splitlines()[-1]
    assert cli.app.status(["--version"]) == 0
    assert capsys.readouterr().out.startswith("framestep ")


@pytest.mark.parametrize(
    ("typed", "needed", "read"),
    [
        (["1", "-500"], 2, ["--", "1", "-500"]),
        (["-.5", "--speed", "-3", "-d", "COM5"], 1, ["--speed", "-3", "-d", "COM5", "--", "-.5"]),
        (["/dev/ttyACM1", "1", "-1e9"], 2, ["--device", "/dev/ttyACM1", "--", "1", "-1e9"]),
        (["COM12", "move.csv", "--json"], 1, ["--json", "--device", "COM12", "--", "move.csv"]),
        (["/dev/stdin"], 1, ["--", "/dev/stdin"]),
        (["socket://h:1"], 0, ["--device", "socket://h:1", "--"]),
        (["1", "5", "COM12"], 2, ["--device", "COM12", "--", "1", "5"]),
        (["1", "--", "-x"], 2, ["--", "1", "-x"]),
    ],
)
def test_arguments_as_they_are_typed(typed, needed, read):
    assert arranged(typed, {"--speed", "-d", "--device"}, needed) == read


# ---- sniffing

TRAFFIC = (
    encode(Hi.TYPE, b"", 1)
    + b"noise"
    + encode(MotorMove.TYPE, MotorMove(2, -500).pack(), 0x12345678)
    + encode(0x8031, b"\x14\0", 0x12345678)
    + encode(0x7777, bytes(3), 9)
    + encode(RtUploadMoveAxis.TYPE, RtUploadMoveAxis(1, 0, range(100)).pack(), 10)
)


def test_a_capture_is_read(tmp_path, capsys):
    binary, digits, empty = tmp_path / "c.bin", tmp_path / "c.hex", tmp_path / "empty"
    binary.write_bytes(TRAFFIC)
    digits.write_text(TRAFFIC.hex(" ") + "\n")
    printed = []
    for path in (binary, digits):
        assert cli.app.status(["lab", "sniff", str(path)]) == 0
        printed.append(capsys.readouterr().out.splitlines())
    assert printed[0] == printed[1]
    lines = [" ".join(line.split()) for line in printed[0]]
    assert lines == [
        "1 HI",
        "305419896 MOTOR_MOVE motor=2 position=-500",
        "305419896 MOTOR_MOVE ACK ERR_RANGE (0x0014) (there is no such motor, frame or value, "
        "or it needs more velocity or acceleration than is set)",
        "9 0x7777 3 bytes: 00 00 00",
        "10 RT_UPLOAD_MOVE_AXIS motor=1 start_index=0 "
        "positions=[0, 1, 2, 3, 4, 5, 6, 7, … 99; 100 values] (from frame 0 of the move)",
        "5 frames; 5 bytes outside frames, 0 frames with a wrong checksum, "
        "0 bytes of an unfinished frame at the end",
    ]
    empty.touch()
    assert cli.app.status(["lab", "sniff", str(empty)]) == 0
    assert capsys.readouterr().out.startswith("0 frames; 0 bytes outside frames, ")


def test_hexadecimal_in_any_dress():
    assert capture_bytes(b"44 46\n0x01,0x02 ab:CD") == b"DF\x01\x02\xab\xcd"
    assert capture_bytes(b"DF\x01") == b"DF\x01"


# ---- moves as files


def test_the_camera_move():
    move = read_move(CAMERA_MOVE)
    assert (move.start_frame, move.end_frame, move.frames) == (1, 240, 240)
    assert list(move.names.values()) == ["track", "boom", "swing", "pan"]
    assert move.section(3, 1)[1] == move.positions[1][2::-1]


def test_backward_is_backward():
    move = read_move(CAMERA_MOVE)
    assert section(move, 9, 3, reverse=True) == (9, 3)
    assert section(move, 3, 9, reverse=True) == (9, 3)
    assert section(move, 9, 3, reverse=False) == (9, 3)
    assert section(move, None, None, reverse=True) == (240, 1)


def test_an_example_is_found_by_its_name_unless_there_is_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert or_example(Path("camera_move.csv")) == CAMERA_MOVE
    assert or_example(Path("elsewhere/camera_move.csv")) == Path("elsewhere/camera_move.csv")
    assert or_example(Path("mine.csv")) == Path("mine.csv")
    (tmp_path / "camera_move.csv").write_text("frame,a\n1,2\n")
    assert or_example(Path("camera_move.csv")) == Path("camera_move.csv")


def test_the_camera_move_is_what_its_generator_makes(tmp_path, monkeypatch):
    import importlib.util

    path = CAMERA_MOVE.with_name("generate.py")
    spec = importlib.util.spec_from_file_location("generate", path)
    generate = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(generate)
    monkeypatch.setattr(generate, "__file__", str(tmp_path / "generate.py"))
    generate.main()
    assert (tmp_path / "camera_move.csv").read_bytes() == CAMERA_MOVE.read_bytes()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "expected the header"),
        ("time,a\n1,2\n", "expected the header"),
        ("frame,a\n", "a line for each frame"),
        ("frame,a\n1,2,3\n", "line 2: expected 2 whole numbers, found '1,2,3'"),
        ("frame,a\n1,2\n\n2,2\n", "line 3: expected 2 whole numbers, found ''"),
        ("frame,a\n1,2\n3,2\n", "line 3: expected frame 2, found 3"),
        ("frame,a\n1,2147483648\n", "line 2: positions have to fit 32 bits"),
        ("frame,a\n1," + "7" * 5000 + "\n", "line 2: .*found '7777*…'$"),
        ("frame,a\n1," + "7" * 200_000 + "\n", "line 2: field larger than field limit"),
        ("x" * 9000, "line 1: expected the header .*xxxx…'$"),
    ],
)
def test_files_that_are_no_move(tmp_path, text, complaint):
    path = tmp_path / "move.csv"
    path.write_text(text)
    with pytest.raises(MoveFileError, match=complaint):
        read_move(path)


def _floats(command, path):
    if hasattr(command, "commands"):
        for name, each in command.commands.items():
            yield from _floats(each, [*path, name])
    for param in getattr(command, "params", ()):
        given = getattr(param, "type_descriptor", None)
        if given and given.annotation is float and not given.parameter_info.parser:
            yield " ".join([*path, param.name]), param


def test_a_number_has_both_ends():
    """So that 1e400 and nan get a sentence."""
    found = dict(_floats(typer.main.get_command(cli.app), []))
    assert "virtual position" in found
    for name, param in found.items():
        assert None not in (param.min, param.max), name


@pytest.mark.parametrize("text", ["nan", "inf", "1e400", "-1e30"])
def test_numbers_that_are_none(text, capsys):
    for args in (["virtual", "pan", text], ["check", "camera_move.csv", "--preroll", text]):
        with pytest.raises(SystemExit) as end:
            cli.app(args)
        assert end.value.code == 2
        error = capsys.readouterr().err
        assert "expected at " in error
        assert len(error.splitlines()) == 1
