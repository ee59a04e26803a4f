"""Type checks: the host tools leniently, and the code that only runs on a board against MicroPython's type stubs."""

import subprocess
import sys
from pathlib import Path

from framestep_tools.files import CACHE, FIRMWARE, ROOT

MYPY = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), "--no-error-summary"]


def main() -> int:
    status = subprocess.run([*MYPY, "--cache-dir", CACHE / "mypy-host"], cwd=ROOT).returncode
    board_code = [p for chip in ("rp2", "esp32") for p in sorted((FIRMWARE / "framestep/hal").glob(f"{chip}*.py"))]
    if board_code:
        status |= subprocess.run(
            [*MYPY, "--cache-dir", CACHE / "mypy-board", "--no-site-packages", *board_code],
            cwd=ROOT,
            env={"MYPYPATH": f"{CACHE / 'stubs'}:{Path(FIRMWARE)}"},
        ).returncode
    return status


if __name__ == "__main__":
    sys.exit(main())
