"""`framestep rig`: check a rig file as the board does, and edit a board's rig file.

framestep.rig, the same code as on the board, judges the settings.
"""

import copy
import difflib
import json
import os
import re
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from framestep import rig
from framestep.rig import drivers, homes, pendants, servos, settings

from ..client.port_finder import at_rate
from ..errors import ToolError

if TYPE_CHECKING:
    from .repl_device import Device


class RigFileError(ToolError):
    """A rig file has a mistake, or cannot be read. The text has the key, what was found and what is
    allowed."""


# an escape of JSON for half of a character beyond U+FFFF; \\u is no escape
_SURROGATE = re.compile(rb"(?<!\\)(?:\\\\)*(\\u[dD][89abAB][0-9a-fA-F]{2})")


class _Doubled(Exception):
    """An object has a key twice."""


def parse(content: bytes, name: str) -> dict[str, Any]:
    """Parse a rig file's content as strictly as a board does. Raises RigFileError, with the line,
    if it is not a JSON object."""

    def constant(word: str) -> None:
        raise ValueError(f"{word} is not JSON")

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            keys = [key for key, _ in pairs]
            double = next(key for key in keys if keys.count(key) > 1)
            raise _Doubled(double)
        return found

    try:
        settings = json.loads(content.decode(), parse_constant=constant, object_pairs_hook=once)
    except _Doubled as error:
        raise RigFileError(
            f'{name}: "{error}" occurs twice in one {{…}}: the board would use the last one'
        ) from None
    except json.JSONDecodeError as error:
        if _bare(content) != content:
            raise RigFileError(
                f"{name}: a board reads neither // comments nor a byte order mark; "
                "framestep rig edit sends a file without them"
            ) from None
        where = f"line {error.lineno}, column {error.colno}"
        raise RigFileError(f"{name}: not valid JSON in {where} ({error.msg})") from None
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise RigFileError(
            f"{name}: expected UTF-8, found byte 0x{content[error.start]:02X} in line {line}"
        ) from None
    except (ValueError, RecursionError) as error:
        raise RigFileError(f"{name}: not valid JSON ({error})") from None
    if escape := _SURROGATE.search(content):
        line = content.count(b"\n", 0, escape.start()) + 1
        raise RigFileError(
            f"{name}: {escape[1].decode()} in line {line} is half a character, and a board does "
            "not join two of them: write the character itself"
        )
    if not isinstance(settings, dict):
        raise RigFileError(
            f"{name}: expected an object of settings, found {type(settings).__name__}"
        )
    return settings


def read(path: str | Path) -> dict[str, Any]:
    """Read the settings of a file without its comments and without checking them. Raises
    RigFileError if it cannot be read."""
    return parse(_bare(content_of(path)), str(path))


def content_of(path: str | Path) -> bytes:
    """Return a file's content. Raises RigFileError if it cannot be read."""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise RigFileError(f"cannot read the rig file {path}: {error.strerror}") from None


def for_board(content: bytes) -> bytes:
    """Return a rig file's content for a board: without // comments and byte order mark."""
    bare = _bare(content)
    return content if bare == content else _tidy(bare)


def check(settings: dict[str, Any], board: Mapping[str, Any], name: str) -> rig.Rig:
    """Return the rig of a board with these settings. Raises RigFileError, with the board's own
    texts, for mistakes."""
    try:
        return rig.Rig(settings, board)
    except rig.RigError as error:
        mistakes = [str(error), *_further(str(error), settings, board)]
        texts = [with_suggestion(mistake) for mistake in mistakes]
        count = [f"{len(texts)} mistakes:"] * (len(texts) > 1)
        raise RigFileError(f"{name}: " + "\n  ".join(count + texts)) from None


def warnings(given: Mapping[str, Any], board: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each key of a valid rig file that is less than what the motor's type of
    driver needs, or that does not count on this board."""
    found = []
    motors = given.get("motors", [])
    shared = not isinstance(board.get("enable"), list)
    for number, motor in enumerate(motors, 1):
        high = motor.get("enable_high")
        if shared and high not in (None, motors[0].get("enable_high", False)):
            found.append(
                f"motors[{number}].enable_high: the drivers share an enable pin on this board, so "
                "that of motors[1] counts"
            )
        for key, least in drivers.needs(motor.get("type", "other")).items():
            if key in motor and key != "enable_high" and motor[key] < least:
                unit = settings.MOTOR_SETTINGS[key][4]
                found.append(
                    f"motors[{number}].{key}: {motor[key]} {unit} is less than the "
                    f"{least:g} {unit} that a driver of type {motor['type']} needs"
                )
    return found


def _further(mistake: str, settings: dict[str, Any], board: Mapping[str, Any]) -> Iterator[str]:
    """Yield the mistakes that the board would name next if each key that is wrong were left out."""
    left = copy.deepcopy(settings)
    dropped = set()
    while True:
        key = mistake.partition(":")[0]
        dropped.add(key)
        if not _drop(left, key):  # it is missing: leave out what needs it, a list as a whole
            key = re.sub(r"\[\d+\]$", "", key.rpartition(".")[0])
            if not _drop(left, key):
                return
        try:
            rig.Rig(left, board)
            return
        except rig.RigError as error:
            mistake = str(error)
        if mistake.partition(":")[0] not in dropped:
            yield mistake


def _drop(settings: Any, key: str) -> bool:
    """Remove a key such as motors[2].driver from settings. Return whether it was there."""
    *path, last = (
        int(number) - 1 if number else name
        for name, number in re.findall(r"([^.\[\]]+)|\[(\d+)\]", key)
    )
    try:
        for part in path:
            settings = settings[part]
        del settings[last]
    except (KeyError, IndexError, TypeError):
        return False
    return True


_NESTED: dict[str, dict[str, Any]] = {
    "motors[n]": settings.MOTOR_SETTINGS,
    "motors[n].driver": settings.DRIVER_SETTINGS,
    "limits[n]": settings.LIMIT_SETTINGS,
    "pendant": pendants.PENDANT_SETTINGS,
    "inputs[n]": settings.INPUT_SETTINGS,
    "outputs[n]": settings.OUTPUT_SETTINGS,
}


def with_suggestion(mistake: str) -> str:
    """Return a mistake with the valid key closest to an unknown one, before all keys."""
    found = re.match(r"([^:]*): no such setting; there are (.*)", mistake)
    if not found:
        return mistake
    key = found[1].rpartition(".")[2].lower()
    close = difflib.get_close_matches(key, found[2].split(", "), 1, 0.5)
    if key == found[1]:  # at the top: it may belong elsewhere
        within = [f"{name}.{key}" for name, table in _NESTED.items() if key in table]
        close = within or close
    meant = f"; did you mean {close[0]}?" if close else ";"
    return f"{found[1]}: no such setting{meant} There are {found[2]}".replace("; There", "; there")


# ---- editing


def run_editor(path: Path) -> None:
    """Let the user edit a file with $VISUAL, $EDITOR or the system's editor. Raises ToolError if
    that fails."""
    windows = os.name == "nt"
    usual = "notepad" if windows else "vi"
    command = shlex.split(
        os.environ.get("VISUAL") or os.environ.get("EDITOR") or usual, posix=not windows
    )
    try:
        status = subprocess.run([*command, str(path)]).returncode
    except OSError as error:
        raise ToolError(
            f"cannot start the editor {command[0]} ({error.strerror}): set EDITOR"
        ) from None
    if status != 0:
        raise ToolError(f"the editor {command[0]} ended with status {status}")


def ask_again(mistake: str) -> bool:
    """Print a mistake, and ask whether to edit again."""
    print(mistake, flush=True)
    try:
        return input("Edit it again? [Y/n] ").strip().lower() in ("", "y", "yes")
    except EOFError:
        return False


_HEAD = """\
// Settings of the rig. Text after // is a comment, for this editor only: it does not go to the board.
// Settings and their defaults are below. Copy those that you change into the braces, with commas between them.
"""  # noqa: E501
# What a new rig needs first, as in docs/start/configure.md
FIRST = {
    "": ("name", "motor_count", "motors", "estop", "estop_cuts_power", "limits"),
    "motors": ("type", "pulse_us", "enable_ms", "off_after_s", "invert", "backlash", "driver"),
    "driver": ("run_ma",),
    "limits": ("low", "high"),
}


def commented(content: str, everything: bool = False) -> str:
    """Add settings, as comments, to a rig file's text: those of FIRST, or all."""
    lines = ["", "// All settings (docs/use/rig-file.md):", "//"]
    if not everything:
        lines[1] = "// The settings to begin with. framestep rig edit --all shows every other one:"
    tables: tuple[tuple[str, dict[str, Any]], ...] = (
        ("", settings.SETTINGS),
        ('of "motors": [{…}, {…}], an object for each motor', settings.MOTOR_SETTINGS),
        ('of "driver": {…} of a motor', settings.DRIVER_SETTINGS),
        ('of "home": {…} of a motor', homes.HOME_SETTINGS),
        ('of "servo": {…} of a motor', servos.SERVO_SETTINGS),
        ('of "pendant": {…}', pendants.PENDANT_SETTINGS),
        ('of "outputs": [{…}]', settings.OUTPUT_SETTINGS),
        ('of "inputs": [{…}]', settings.INPUT_SETTINGS),
        ('of "limits": [{…}]', settings.LIMIT_SETTINGS),
    )
    for title, table in tables:
        (of,) = re.findall(r'^of "(\w+)"|^$', title)
        rows = {k: row for k, row in table.items() if everything or k in FIRST.get(of, ())}
        if title and rows:
            lines += ["//", f"// {title}:"]
        for key, (kind, low, high, default, unit, meaning) in rows.items():
            shown = "…" if default is None else json.dumps(default, ensure_ascii=False)
            allowed = settings.allowed(kind, low, high, unit)
            lines.append(f"//   {f'{json.dumps(key)}: {shown}':<32} {meaning} ({allowed})")
    return _HEAD + content.rstrip("\n") + "\n" + "\n".join(lines) + "\n"


def _with_comments(content: bytes, everything: bool) -> bytes:
    """Return a draft with comments. A draft that has comments stays as it is."""
    try:
        bare = _bare(content) == content
        return commented(content.decode(), everything).encode() if bare else content
    except UnicodeDecodeError:  # the editor will show it
        return content


def without_comments(text: str) -> str:
    """Empty each // comment outside strings. Lines keep their numbers."""
    return re.sub(r'("(?:[^"\\\n]|\\.)*")|//[^\n]*', lambda found: found[1] or "", text)


def _bare(content: bytes) -> bytes:
    """Return a rig file's content without comments. Lines keep their numbers."""
    try:
        return without_comments(content.decode("utf-8-sig")).encode()
    except UnicodeDecodeError:
        return content


def _tidy(content: bytes) -> bytes:
    """Remove empty lines and trailing blanks."""
    return b"\n".join(line.rstrip() for line in content.splitlines() if line.strip())


def _changed_comment(before: bytes, after: bytes) -> str | None:
    """Say which setting was changed inside a comment, where it has no effect, or None."""
    known = set(before.splitlines())
    for number, line in enumerate(after.splitlines(), 1):
        found = re.match(rb'\s*//\s*("\w+"\s*:.*)', line)
        if found and line not in known:
            text = found[1].decode(errors="replace").strip()
            return (
                f"line {number} has changed, but it is a comment: {text}\n"
                "Copy it into the braces, without //, to change the setting."
            )
    return None


def edit_until_right(
    path: Path,
    board: Mapping[str, Any],
    editor: Callable[[Path], None],
    again: Callable[[str], bool],
    before: bytes | None = None,
) -> bytes | None:
    """Let `editor` change a file until it is valid. Return its new content, or None if unchanged.

    before: the board's content, if it differs from the file. A mistake, or a change only inside a
    comment, goes to `again`, which returns whether to edit again. Raises RigFileError if not.
    """
    draft = path.read_bytes()
    before = _tidy(draft if before is None else before)
    while True:
        editor(path)
        edited = path.read_bytes()
        new = _bare(edited)
        if _tidy(new) == before:
            inside = _changed_comment(draft, edited)
            draft = edited
            if inside and again(inside):
                continue
            return None
        try:
            check(parse(new, path.name), board, path.name)
            return _tidy(new)
        except RigFileError as error:
            if not again(str(error)):
                raise


def edit(
    device: "Device", protocol: str | None, file: Path | None = None, everything: bool = False
) -> None:
    """Fetch the rig file of a board (not connected yet), let the user edit it, put it back,
    restart.

    file: where the user begins instead, such as an earlier draft; it is not changed. everything:
    show all settings as comments, not only those that a new rig needs first. If the new
    file cannot be put on the board, the board's file is unchanged and the draft stays.
    """
    from .repl_device import RIG_FILE
    from .restart import greeting, hello
    from .rig_change import Refused, RigChange

    begin = None if file is None else content_of(file)

    with device:
        board = device.board()
        content = device.read(RIG_FILE)
        alone = device.state.runs and not device.state.background
        ports = device.ports
        if alone:  # reaching the REPL has ended the controller
            device.restart()
    if alone:
        hello(device.path, protocol, ports)
    folder = Path(tempfile.mkdtemp(prefix="framestep-"))
    draft = folder / "rig.json"
    there = b"{}" if content is None else content
    draft.write_bytes(_with_comments(there if begin is None else begin, everything))
    try:
        new = edit_until_right(draft, board, run_editor, ask_again, there)
        if new is None:
            print("nothing has been changed")
            shutil.rmtree(folder)
            return
        with device:
            change = RigChange(device, new)
    except (ToolError, KeyboardInterrupt) as error:
        said = f"{error}\n" if isinstance(error, ToolError) else ""
        raise ToolError(
            f"{said}the board's rig file is as it was; "
            f"framestep rig edit {draft} goes on with the draft"
        ) from None
    given = parse(new, RIG_FILE)
    found = check(given, board, RIG_FILE)
    for warning in warnings(given, board):
        print(f"warning: {warning}")
    device.path = at_rate(device.path, found.settings["uart_baud"])
    try:
        print(greeting(*change.see(lambda: device, protocol, found.ports)))
    except Refused as error:
        raise ToolError(f"{error}; framestep rig edit {draft} goes on with the draft") from None
    shutil.rmtree(folder)


def report_rig(content: bytes | None, board: str, say: Callable[[str], None]) -> rig.Rig:
    """Say what is wrong with the board's rig file; return the settings that the board has with
    it."""
    from ..building.board_files import board_data
    from .repl_device import RIG_FILE

    data = board_data(board)
    if content is not None:
        try:
            return check(parse(content, RIG_FILE), data, RIG_FILE)
        except RigFileError as error:
            say(f"{error}")
            say("nothing moves until it is corrected: framestep rig edit")
    return rig.Rig(board=data)
