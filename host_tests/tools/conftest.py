"""What tests of moves share: a folder with an axes.toml, and moves in several formats."""

from pathlib import Path

import pytest

from framestep_tools import cli
from framestep_tools.move.move_file import Move, read_move


@pytest.fixture
def shot(tmp_path):
    """Return a folder with an axes.toml in it."""
    (tmp_path / "axes.toml").write_text(LINEAR)
    return tmp_path


@pytest.fixture
def refusal(shot, capsys):
    """Return refusal(*args): run a command that is refused; return the one sentence that says
    why."""

    def refused(*args, status=1):
        capsys.readouterr()  # what was said before
        assert run(shot, *args) == status
        said = capsys.readouterr().err
        assert len(said.splitlines()) == 1, said
        return said.rstrip()

    return refused


@pytest.fixture
def not_imported(shot, refusal):
    """Return not_imported(content, *options): import a file that is refused. Nothing is written."""

    def refused(content, *options, status=1, name="source", out="out"):
        source, before = shot / name, {shot / name, *shot.iterdir()}
        source.write_bytes(content if isinstance(content, bytes) else content.encode())
        line = refusal("import", str(source), "-o", str(shot / out), *options, status=status)
        assert {*shot.iterdir()} == before
        return line

    return refused


LINEAR = """
[[axis]]
name = "track"
motor = 1
steps_per_unit = 10
unit = "mm"
limits = [-5, 100]

[[axis]]
name = "pan"
motor = 2
steps_per_unit = 100
unit = "deg"
zero = 2
invert = true
"""

ARC = """<?xml version="1.0"?>
<scen:scene xmlns:scen="http://caliri.com/motion/scene" endframe="9">
  <scen:axis name="track" units="cm">
    <scen:points y="0" x="1"/>
    <scen:points y="8" x="9"/>
    <scen:controlPoints y="0" x="5"/>
    <scen:controlPoints y="8" x="5"/>
  </scen:axis>
  <scen:axis name="unused"/>
  <scen:axis name="pan" units="deg">
    <scen:points y="2" x="3"/>
    <scen:points y="3" x="5"/>
    <scen:controlPoints y="2.3333333333" x="3.6666666667"/>
    <scen:controlPoints y="2.6666666667" x="4.3333333333"/>
  </scen:axis>
</scen:scene>
"""

# Comments, a node without curves, what later versions write, and units that differ from the axes'
MAYA = """animVersion 1.1;
mayaVersion 2013 x64; // anything
timeUnit pal; linearUnit m; angularUnit deg; startTime 1; endTime 7;
anim camera1 0 2 0;
anim translate.translateX translateX track 0 1 0; # a comment
animData {
  input time;
  output linear;
  outputUnit cm;
  weighted 0;
  preInfinity constant;
  keys {
    1 0 auto linear 1 1 0;
    3 1 linear flat 1 1 0;
    6 9 flat clamped 1 1 0;
  }
}
anim rotate.rotateY rotateY camera1 0 1 0;
animData { input time; output angular; weighted 1; tangentAngleUnit deg;
  keys {
    1 2 step step 1 1 0;
    3 3 step linear 1 1 0;
    4 3 linear fixed 1 1 0 45 1;
  }
}
anim fStop fStop camera1 1 0 0;
animData {
  input time; output unitless; weighted 1;
  keys { 6 0 auto auto 1 1 0; 7 5 spline spline 1 1 0; }
}
"""


def run(shot: Path, *args: str) -> int:
    return cli.app.status([*args, "--axes", str(shot / "axes.toml")])


def named_in_file(track: str, pan: str) -> str:
    """Return an axes.toml whose axes have other names in files."""
    axes = LINEAR.replace('"track"\n', f'"track"\nin_file = "{track}"\n')
    return axes.replace('"pan"\n', f'"pan"\nin_file = "{pan}"\n')


def imported(shot: Path, text: str, *options: str, name: str = "source") -> Move:
    source, out = shot / name, shot / "move.csv"
    source.write_bytes(text.encode())
    assert run(shot, "import", str(source), "-o", str(out), *options) == 0
    return read_move(out)
