"""Type checks: the host tools leniently, and the code that only runs on a board against
MicroPython's type stubs."""

import ast
import os
import re
import subprocess
import sys

from framestep_tools.building.board_files import CACHE, FIRMWARE, ROOT

MYPY = [
    sys.executable,
    "-m",
    "mypy",
    "--config-file",
    ROOT / "pyproject.toml",
    "--no-error-summary",
]
# Functions in other languages, whose words and types mypy does not know.
FOREIGN = {"asm_pio", "viper"}


def check_host() -> int:
    return subprocess.run([*MYPY, "--cache-dir", CACHE / "mypy-host"], cwd=ROOT).returncode


def foreign_lines(source: str) -> set[int]:
    """Return the numbers of the lines in PIO programs and viper functions."""
    lines: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            names = [d.func if isinstance(d, ast.Call) else d for d in node.decorator_list]
            if any(isinstance(name, ast.Attribute) and name.attr in FOREIGN for name in names):
                lines.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def check_board() -> int:
    files = [
        p
        for chip in ("rp2", "esp32")
        for p in sorted((FIRMWARE / "framestep/hal").glob(f"{chip}*.py"))
    ]
    if not files:
        return 0
    result = subprocess.run(
        [
            *MYPY,
            "--cache-dir",
            CACHE / "mypy-board",
            "--no-site-packages",
            "--check-untyped-defs",
            *files,
        ],
        cwd=ROOT,
        env={**os.environ, "MYPYPATH": str(CACHE / "stubs")},
        stdout=subprocess.PIPE,
        text=True,
    )
    if result.returncode > 1:  # mypy itself failed
        print(result.stdout)
        return result.returncode
    foreign = {str(p.relative_to(ROOT)): foreign_lines(p.read_text()) for p in files}
    status = 0
    for message in result.stdout.splitlines():
        where = re.match(r"(.+?):(\d+): ", message)
        if where and int(where[2]) in foreign.get(where[1], ()):
            continue
        print(message)
        status = 1
    return status


if __name__ == "__main__":
    sys.exit(check_host() | check_board())
