"""axes.toml: its mistakes, and the page that describes it."""

import pytest

from framestep_tools.axes.axes_file import KEYS, read_axes
from framestep_tools.axes.units import UNITS
from framestep_tools.building.board_files import ROOT
from framestep_tools.errors import ToolError
from framestep_tools.move.move_formats import FORMATS
from host_tests.tools.conftest import ARC, LINEAR


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[[axis]\n", "not valid TOML: "),
        ("", "expected an [[axis]] for each motor, found none"),
        ("axis = 3\n", "expected an [[axis]] for each motor, found none"),
        ("fps = 24\n", 'expected only [[axis]] and [camera] at the top, found "fps"'),
        (LINEAR + "step = 1\n", 'axis 2 (pan): no key "step"; there are name, motor'),
        (LINEAR + 'hold = "x"\n', "axis 2 (pan): \"hold\": expected a number, found 'x'"),
        (LINEAR.replace("motor = 1", "motor = 0"), '"motor": expected a whole number from 1 to 32'),
        (LINEAR.replace("motor = 1", "motor = true"), '"motor": expected a whole number'),
        (LINEAR.replace("motor = 1", "motor = 2"), '"motor": 2 occurs twice'),
        (LINEAR.replace("motor = 1", "motor = 3"),
         "there is no axis for motor 1, but one for motor 2"),
        (LINEAR.replace('"pan"', '"track"'), "\"name\": 'track' occurs twice"),
        (LINEAR + 'in_file = "track"\n', "\"in_file\": 'track' occurs twice"),
        (LINEAR.replace("= 10\n", "= 0\n"),
         'unit": expected a number from 1e-06 to 1e+09, found 0'),
        (LINEAR.replace("= 10\n", "= nan\n"), '"steps_per_unit": expected a number'),
        (LINEAR.replace("steps_per_unit = 10\n", ""),
         '(track): "steps_per_unit" is missing: a number'),
        (LINEAR.replace('"mm"', '"yard"'), '"unit": expected one of "mm", "cm"'),
        (LINEAR + 'file_unit = "mm"\n', '"file_unit": mm cannot be converted to deg'),
        (LINEAR.replace("[-5, 100]", "[100, -5]"),
         '"limits": expected two numbers [lowest, highest]'),
        (LINEAR.replace("true", "1"), '"invert": expected true or false, found 1'),
        (LINEAR.replace('name = "pan"', 'name = " "'),
         "axis 2: \"name\": expected a text, found ' '"),
    ],
)  # fmt: skip
def test_one_sentence_says_what_is_wrong_with_axes_toml(text, said, shot, not_imported):
    (shot / "axes.toml").write_text(text)
    assert said in not_imported("0 2\n")


def test_there_is_no_axes_toml(shot, not_imported):
    (shot / "axes.toml").unlink()
    for text, axes in ((ARC, "track in cm, pan in deg"), ("1 2\n", "column 1, column 2")):
        assert f"({axes}) to motors; docs/use/axes.md shows one" in not_imported(text)
    with pytest.raises(ToolError, match=r"cannot read the axes .*axes.toml: No such file"):
        read_axes(shot / "axes.toml")


def test_the_page_has_every_key_and_unit(tmp_path):
    page = (ROOT / "docs/use/axes.md").read_text(encoding="utf-8")
    for key in KEYS:
        assert f"\n| `{key}` |" in page
    for unit in UNITS:
        assert f"`{unit}`" in page
    example_file = page.split("## The file")[1].split("| key |")[0]
    (tmp_path / "axes.toml").write_text(
        "\n".join(line.strip() for line in example_file.splitlines() if line.startswith("    "))
    )
    assert [axis.name for axis in read_axes(tmp_path / "axes.toml")] == ["track", "pan"]


def test_the_page_has_every_format():
    page = (ROOT / "docs/use/formats.md").read_text(encoding="utf-8")
    for name, module in FORMATS.items():
        assert f"\n| `{name}` |" in page
        assert " ".join(module.ENDINGS) in page
