"""What the documents name exists: files, links, make targets, commands and their options, modules,
settings of the rig file."""

import ast
import importlib.util
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer.main

from framestep.rig import homes, servos, settings
from framestep_tools.building.board_files import ROOT
from framestep_tools.cli import app

DOCUMENTS = sorted(
    ROOT / name
    for name in subprocess.run(
        ["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, check=True, text=True
    ).stdout.split()
)
_PATH = re.compile(
    r"(?<![\w/.…<>$*-])((?:[\w<>*.-]+/)+[\w<>*-]+\.(?:py|mjs|md|json|svg|sh|txt|toml|yml|csv))\b"
)
_NAME = re.compile(r"^[\w<>*-]+\.(?:py|mjs|sh|toml)$")
# The bases of paths in the documents, besides the root and their own folder
_FOLDERS = ("firmware", "firmware/framestep", "tools", "tools/framestep_tools", "host_tests")
# Names of ours that mean something else in the documents
_OTHERS = ("chip", "emu", "micropython", "usb")
# What is made, or is on a board
_MADE = ("build/", ".cache/", "lib/")
# Next to .../blob/main, where GitHub shows the documents of any fork
RELEASES = {ROOT.parents[1] / "releases", ROOT.parents[1] / "releases/latest"}
_SETTINGS = (
    settings.SETTINGS, settings.MOTOR_SETTINGS, settings.DRIVER_SETTINGS, homes.HOME_SETTINGS,
    servos.SERVO_SETTINGS, settings.OUTPUT_SETTINGS, settings.INPUT_SETTINGS,
    settings.LIMIT_SETTINGS,
)  # fmt: skip


def code() -> Iterator[tuple[str, str]]:
    """Yield (document, text) of what is in backticks, and of lines of examples."""
    for document in DOCUMENTS:
        name, text = str(document.relative_to(ROOT)), document.read_text()
        for part in re.findall(r"`([^`\n]+)`", text):
            yield name, part
        for line in text.splitlines():
            if line.startswith("    "):
                yield name, line.strip()


def exists(document: Path, path: str) -> bool:
    pattern = re.sub(r"(<[^>]*>|\*)+", "*", path)
    if path.startswith(_MADE):
        return True
    return any(
        any(folder.glob(pattern))
        for folder in (ROOT, document.parent, *(ROOT / name for name in _FOLDERS))
    )


def slug(heading: str) -> str:
    """Return the anchor that GitHub makes of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_are_there(document):
    text = document.read_text()
    named = {path for path in _PATH.findall(re.sub(r"https?://\S+|/dev/\S+", "", text))}
    missing = sorted(path for path in named if not exists(document, path))
    every = {path.name for path in ROOT.glob("*")} | {
        Path(name).name
        for name in subprocess.run(
            ["git", "ls-files"], cwd=ROOT, capture_output=True, check=True, text=True
        ).stdout.splitlines()
    }
    alone = {found for found in re.findall(r"`([^`\s]+)`", text) if _NAME.match(found)}
    missing += sorted(name for name in alone if "*" not in name and name not in every)
    assert not missing, f"{document.relative_to(ROOT)} names files that are not there: {missing}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(document):
    for target in re.findall(r"\]\(([^)\s]+)\)", document.read_text()):
        if "://" in target:
            continue
        path, _, anchor = target.partition("#")
        file = document.parent / path if path else document
        if file.resolve() in RELEASES:
            continue
        assert file.exists(), f"{document.relative_to(ROOT)}: no {target}"
        if anchor:
            headings = re.findall(r"^#+ (.+)$", file.read_text(), re.MULTILINE)
            assert anchor in map(slug, headings), f"{document.relative_to(ROOT)}: no {target}"


def test_make_targets_are_there():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    count = 0
    for document, part in code():
        if found := re.match(r"make ([a-z-]+)", part):
            count += 1
            assert found[1] in targets, f"{document}: the Makefile has no target {found[1]}"
    assert count > 30, "the search has found next to nothing"


def test_commands_and_their_options_are_there():
    top = typer.main.get_command(app)
    count = 0
    for document, part in code():
        words = part.removeprefix(".cache/venv/bin/").split("#")[0].split()
        if not words or words[0] != "framestep" or len(words) < 2:
            continue
        where = f"{document}: {part}"
        command, options = top, {"--help"}
        for word in words[1:]:
            inner = getattr(command, "commands", None)
            options |= {o for p in command.params for o in (*p.opts, *p.secondary_opts)}
            if word.startswith("--"):
                assert word.split("=")[0] in options, f"{where}: no option {word}"
            elif inner is not None and re.fullmatch("[a-z0-9-]+", word):
                assert word in inner, f"{where}: no command {word}"
                command = inner[word]
                count += 1
    assert count > 20, "the search has found next to nothing"


def test_modules_are_there():
    for document, part in code():
        for name in re.findall(r"python -m ((?:framestep|host_tests)[\w.]*)", part):
            assert importlib.util.find_spec(name), f"{document}: no {name}"


def test_settings_are_there():
    known = {key for table in _SETTINGS for key in table}
    for table in _SETTINGS:
        for _, choices, *_ in table.values():
            known.update(choices if isinstance(choices, tuple) else ())
    count = 0
    for document in DOCUMENTS:
        text = document.read_text()
        if document.name == "rig-file.md":  # its tables are made from the settings
            text = re.sub(r"^\|.*$", "", text, flags=re.MULTILINE)
        named = re.findall(r'`"(\w+)"(?::[^`]*)?`', text)
        named += re.findall(r"settings?\s+`(\w+)`", text)
        for name in named:
            count += 1
            assert name in known, (
                f"{document.relative_to(ROOT)}: the rig file has no setting {name}; "
                "a document names one as soon as it exists"
            )
    assert count > 15, "the search has found next to nothing"


def names() -> dict[str, set[str]]:
    """Return {class or module: its names} of the core and the tools."""
    found: dict[str, set[str]] = {}
    for folder in ("firmware/framestep", "tools/framestep_tools"):
        for path in (ROOT / folder).rglob("*.py"):
            tree = ast.parse(path.read_text())
            for node in tree.body:
                if isinstance(node, ast.ClassDef):
                    found.setdefault(node.name, set()).update(defined(node))
            stem = path.parent.name if path.stem == "__init__" else path.stem
            found.setdefault(stem, set()).update(defined(tree))
            found.setdefault(path.parent.name, set()).add(path.stem)
    for name in _OTHERS:
        found.pop(name, None)
    return found


def defined(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name


def test_functions_are_there():
    """`Class.method` and `module.function`, if the class or the module is ours."""
    known = names()
    count = 0
    for document in DOCUMENTS:
        for part in re.findall(r"`([^`\n]+)`", document.read_text()):
            found = re.match(r"(?:[a-z_]+\.)*([A-Za-z]\w*)\.([A-Za-z_]\w*)(?:\(|$)", part)
            if not found or found[1] not in known or found[2] in ("py", "md", "json", "mpy", "bin"):
                continue
            count += 1
            assert found[2] in known[found[1]], (
                f"{document.relative_to(ROOT)}: {found[1]} has no {found[2]}: `{part}`"
            )
    assert count > 30, "the search has found next to nothing"


def sentences(text: str) -> list[int]:
    """Return the numbers of words of a page's sentences, without examples, tables and headings."""
    text = re.sub(r"^(?: {4}.*|\|.*|#.*)$", "", text, flags=re.MULTILINE)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", text)
    text = re.sub(r"\]\([^)]*\)", "]", text)
    return [
        len(words)
        for each in re.split(r"[.!?](?:\s|$)|\n\n|\n\* ", text)
        if (words := each.split())
    ]


def test_sentences_are_counted():
    assert sentences("# A\n\nOne two. Three [four](five.md)!\n\n    code\n\n* six\n* seven\n") == [
        2, 2, 1, 1,
    ]  # fmt: skip


def test_the_readme_is_short():
    """Who reads it for the first time has no patience. All else belongs to docs/."""
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) <= 110
    counts = sentences(text)
    assert sum(counts) / len(counts) <= 17, f"{sum(counts)} words in {len(counts)} sentences"
