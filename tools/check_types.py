"""Type checks: the host tools leniently, and all code of the board against MicroPython's type
stubs."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

from framestep_tools.building.board_files import CACHE, FIRMWARE, ROOT
from framestep_tools.building.kernels import is_kernel

MYPY = [
    sys.executable,
    "-m",
    "mypy",
    "--config-file",
    ROOT / "pyproject.toml",
    "--no-error-summary",
]


def check_host(root: Path = ROOT) -> int:
    """mypy itself fails if it finds no file."""
    return subprocess.run([*MYPY, "--cache-dir", CACHE / "mypy-host"], cwd=root).returncode


def foreign_lines(source: str) -> set[int]:
    """Return the numbers of the lines in PIO programs and kernels: functions in other languages,
    whose words and types mypy does not know."""
    lines: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if is_kernel(node) or _is_pio_program(node):
            lines.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return lines


def _is_pio_program(node: ast.AST) -> bool:
    match node:
        case ast.FunctionDef(decorator_list=[ast.Call(func=ast.Attribute(attr="asm_pio"))]):
            return True
    return False


def board_files(firmware: Path = FIRMWARE) -> list[Path]:
    """Return all modules of the firmware."""
    return sorted(firmware.rglob("*.py"))


def check_board(firmware: Path = FIRMWARE) -> int:
    files = board_files(firmware)
    if not files:
        print(f"no module to check in {firmware}")
        return 1
    result = subprocess.run(
        [
            *MYPY,
            "--cache-dir",
            CACHE / "mypy-board",
            "--no-site-packages",
            "--platform",
            "rp2",
            "--check-untyped-defs",
            "--no-strict-optional",  # None stands for what a later call sets
            "--warn-unused-ignores",
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
    foreign = {os.path.relpath(p, ROOT): foreign_lines(p.read_text()) for p in files}
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
