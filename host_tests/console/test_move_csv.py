"""The page reads moves as the commands do."""

import json

import pytest

from framestep_tools.axes.axes_file import axes_of
from framestep_tools.axes.rig_axes import Axes
from framestep_tools.errors import ToolError
from framestep_tools.move.move_file import move_of
from framestep_tools.text.text_file import decoded
from host_tests.tools.conftest import LINEAR

READ = """async ([bytes, list]) => {
  const { moveText, parseMove, textOf } = await import('./move_csv.js');
  const { Axes } = await import('./axes.js');
  const axes = new Axes();
  axes.set(list);
  try {
    const text = await textOf(new File([new Uint8Array(bytes)], "f"));
    const move = parseMove(text, "f", axes);
    const { startFrame, motors, names, positions, fps, counted } = move;
    return { startFrame, motors, names, positions, fps, counted, again: moveText(move) };
  } catch (error) {
    return { error: error.message.replaceAll(/[“”]/g, "'") };
  }
}"""
AXES = [
    {"name": "track", "motor": 1, "steps_per_unit": 10, "unit": "mm"},
    {"name": "pan", "motor": 2, "steps_per_unit": 100, "unit": "deg"},
]


@pytest.fixture(scope="module")
def page(shared_stage):
    found = shared_stage.connected(shared_stage.console(shared_stage.simulated(motors=2).url).url)
    return found


def both(page, content, axes):
    """Return what the page and what the commands make of a file."""
    data = content if isinstance(content, bytes) else content.encode()
    here = page.evaluate(READ, [list(data), AXES if axes else []])
    known = Axes(axes_of(LINEAR, "axes.toml") if axes else (), "axes.toml")
    try:
        move = move_of(decoded(data, "f"), "f", known)
    except ToolError as error:
        return here, {"error": str(error)}
    there = {
        "startFrame": move.start_frame, "motors": list(move.positions),
        "names": list(move.names.values()), "positions": list(move.positions.values()),
        "fps": move.fps, "counted": move.counted,
    }  # fmt: skip
    return here, there


@pytest.mark.parametrize("axes", [False, True], ids=["no axes", "axes"])
@pytest.mark.parametrize(
    "content",
    [
        "frame,pan,track\n1,5,6\n2,7,8\n",
        "frame,2,1\n1,5,6\n2,7,8\n",
        "frame,motor 3,Motor 1\n1,5,6\n2,7,8\n",
        "frame,PAN\n1,5\n",
        "frame,pan (steps)\n1,5\n",
        "# fps: 23.976\nframe,track\n// more\n1,5\n# again\n2,6\n",
        "# 24000/1001 fps\nframe,track\n1,5\n",
        "# high fps\n# fps: 23,976\nframe,track\n1,5\n",
        "sep=;\nframe;track\n1;5\n",
        "\ufeffFrame\ttrack\tpan\r\n1\t5.0\t0\r\n2\t6\t1\r\n\t\t\r\n\x1a",
        "frame,track\r\n-1,1.000\r\n0,0.000\r\n",
        "frame,track\n1,5\n".encode("utf-16"),
        b"\xfe\xff" + "frame,track\n1,5\n".encode("utf-16-be"),
    ],
)
def test_the_page_reads_what_the_commands_read(page, content, axes):
    here, there = both(page, content, axes)
    again = here.pop("again")
    if there["fps"] and here["fps"]:
        assert here["fps"] == pytest.approx(there["fps"])
        here["fps"] = there["fps"]
    assert here == there
    rewritten, _ = both(page, again, axes)
    assert rewritten["motors"] == there["motors"]
    assert rewritten["positions"] == there["positions"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("frame,1,1\n1,5,6\n", "f, column '1': it is for motor 1, as is column '1'"),
        ("frame,pan,2\n1,5,6\n", "f, column '2': it is for motor 2, as is column 'pan'"),
        ("frame,boom\n1,5\n", "f, column 'boom': no axis has this name, and axes.toml calls"),
        ("frame,motor 33\n1,5\n", "f, column 'motor 33': expected a motor from 1 to 32"),
        ("frame,pan (deg)\n1,5\n", "this is in deg: framestep import converts it"),
        ("frame,track\n1,1.000\n", "f, line 2"),
        (
            "// a\n# fps: 25p\nframe,track\n1,1\n",
            "f, line 2: expected frames per second from 0.001",
        ),
        ("# fps = abc\nframe,track\n1,1\n", "such as 25 or 24000/1001, found 'abc'"),
        ("# fps: 0\nframe,track\n1,1\n", "such as 25 or 24000/1001, found '0'"),
        ("# 24 fps\n# fps: 25\nframe,track\n1,1\n", "f, line 2: comments say 24 and 25 frames"),
        ("frame,track\n1,1.234\n2,0.5\n", "f, line"),
        ("# a\n\nframe,track\n1,x\n", "f, line 4: expected a whole number for track"),
    ],
)
def test_the_page_refuses_what_the_commands_refuse(page, content, said):
    here, there = both(page, content, True)
    assert said in here["error"]
    assert said in there["error"]


def test_bytes_that_are_no_text(page):
    assert json.dumps(both(page, b"frame,\xe4\n1,5\n", False)[0]).count("is not text in UTF-8") == 1
