"""Names and units on the command line: how they are read and written, and which file counts."""

import errno
from pathlib import Path

import pytest

from framestep_tools.axes import rig_axes
from framestep_tools.axes.axes_file import Axis
from framestep_tools.axes.rig_axes import Axes
from framestep_tools.errors import USAGE, ToolError
from host_tests.tools.conftest import LINEAR

RIG = Axes(
    [
        Axis("track", 1, 80, "mm", limits=(0, 1450)),
        Axis("pan", 2, 200, "deg", zero=-90, invert=True, limits=(-180, 180)),
        Axis("focus", 3, 1, "units"),
        Axis("raw", 5, 1, "steps"),
    ],
    "axes.toml",
)


def test_a_settings_folder_that_cannot_be_read_is_a_sentence(monkeypatch, tmp_path):
    def closed(path, **_):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.chdir(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "stat", closed)
        with pytest.raises(ToolError) as error:
            rig_axes.find()
    assert "Permission denied; name the file by --axes" in str(error.value)
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(rig_axes, "user_file", lambda: tmp_path / "file" / "axes.toml")
    assert rig_axes.find() is None


def test_a_motor_by_number_or_name():
    assert [RIG.motor(text) for text in ("2", "pan", "PAN", "32")] == [2, 2, 2, 32]
    with pytest.raises(
        ToolError, match=r"there is no axis 'tilt': axes.toml has track .motor 1., "
    ):
        RIG.motor("tilt")
    with pytest.raises(ToolError, match="expected a motor from 1 to 32, found 33"):
        RIG.motor("33")
    two = Axes([Axis("Pan", 1, 1), Axis("pan", 2, 1)])
    assert (two.motor("Pan"), two.motor("pan")) == (1, 2)
    with pytest.raises(ToolError, match="there is no axis 'PAN'"):
        two.motor("PAN")


@pytest.mark.parametrize(
    ("motor", "text", "steps"),
    [
        (1, "31000", 31_000),  # beyond the limits: steps are not compared with them
        (1, "-5", -5),
        (1, "-5steps", -5),
        (1, "10mm", 800),
        (1, "12.5 cm", 10_000),
        (1, ".5in", 1016),
        (1, '1"', 2032),
        (2, "-90deg", 0),
        (2, "-89.5°", -100),
        (2, "+0deg", -18_000),
        (3, "7units", 7),
        (4, "12", 12),
        (5, "12", 12),
    ],
)
def test_a_position(motor, text, steps):
    assert RIG.steps(motor, text) == steps


@pytest.mark.parametrize(
    ("motor", "text", "said"),
    [
        (1, "12.5", "a position of track in whole steps, or with a unit .mm, cm, m, in, ft. such"),
        (1, "10deg", "found '10deg'"),
        (1, "ten", "found 'ten'"),
        (1, "1e3mm", "found '1e3mm'"),
        (1, "1.2.3mm", "found '1.2.3mm'"),
        (1, "", "found ''"),
        (1, "-1mm", r"track: -1 mm is beyond its limits of 0 to 1450 mm \(axes.toml\)"),
        (2, "181deg", "pan: 181 deg is beyond its limits of -180 to 180 deg"),
        (3, "99999999999units", "positions have to fit 32 bits signed"),
        (4, "10mm", r"motor 4 in whole steps \(axes.toml has no axis for it\), found '10mm'"),
        (4, "2147483648", "positions have to fit 32 bits signed, found '2147483648'"),
        (5, "1.5", "raw in whole steps, found '1.5'"),
    ],
)
def test_a_wrong_position_gets_one_sentence_with_what_is_allowed(motor, text, said):
    with pytest.raises(ToolError, match=said) as caught:
        RIG.steps(motor, text)
    assert caught.value.status == USAGE
    assert "\n" not in str(caught.value)


def test_rates_and_distances():
    assert RIG.rate(2, "4444", "s") == 4444
    for text in ("20deg", "20deg/s", "20 °/s"):
        assert RIG.rate(2, text, "s") == 4000
    for text in ("40deg", "40deg/s²", "40deg/s2", "40deg/s^2"):
        assert RIG.rate(2, text, "s²") == 8000
    assert RIG.distance(2, "0.5deg", 100) == 100
    for wrong in ("0", "-5deg", "20deg/s²", "20mm/s"):
        with pytest.raises(ToolError, match="expected a velocity of "):
            RIG.rate(2, wrong, "s")
    with pytest.raises(ToolError, match="expected a distance of 1 to 100 steps, found '1deg'"):
        RIG.distance(2, "1deg", 100)


def test_limits_of_an_inverted_axis_in_units_and_in_steps():
    assert RIG.limits(2, "-90deg", "0deg") == (-18_000, 0)
    assert RIG.limits(2, "-18000", "0") == (-18_000, 0)
    assert RIG.limits(2, "", "0deg") == (-18_000, None)
    assert RIG.limits(1, "", "1cm") == (None, 800)


@pytest.mark.parametrize(
    ("motor", "steps", "shown", "length"),
    [
        (1, 10_040, "125.5 mm (10040)", "125.5 mm/s (10040 steps/s)"),
        (2, -100, "-89.5° (-100)", "-0.5°/s (-100 steps/s)"),
        (2, -18_000, "0° (-18000)", "-90°/s (-18000 steps/s)"),
        (3, 7, "7 (7)", "7/s (7 steps/s)"),
        (4, 7, "7", "7 steps/s"),
        (5, 7, "7", "7 steps/s"),
    ],
)
def test_what_is_shown(motor, steps, shown, length):
    assert RIG.position(motor, steps) == shown
    assert RIG.length(motor, steps, "s") == length


def test_what_is_shown_leads_back_to_the_same_step():
    for scale in (0.1, 1, 7, 80, 222.2222, 640, 12_345.678):
        axes = Axes([Axis("pan", 1, scale, "deg", zero=3.25)])
        for steps in (*range(-50, 50), 999_999):
            assert axes.steps(1, axes.value(1, steps)) == steps


def test_names_in_sentences():
    assert RIG.names([2, 4]) == "pan, motor 4"
    assert (Axes().names([2]), Axes().names([2, 4])) == ("motor 2", "motors 2, 4")
    assert RIG.named("at frame 2 of motor 2, motor 22") == "at frame 2 of pan, motor 22"


def test_which_file_counts(tmp_path, monkeypatch):
    user = tmp_path / "settings" / "axes.toml"
    folder = tmp_path / "folder"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setattr(rig_axes, "user_file", lambda: user)
    assert rig_axes.find() is None
    with pytest.raises(ToolError, match=r"there is no axis 'pan': no axes.toml is here or at "):
        rig_axes.load().motor("pan")
    user.parent.mkdir()
    user.write_text(LINEAR)
    assert rig_axes.load().motor("pan") == 2
    (folder / "axes.toml").write_text(LINEAR.replace("pan", "tilt"))
    assert rig_axes.load().motor("tilt") == 2
    (folder / "other.toml").write_text(LINEAR.replace("motor = 1", "motor = 4"))
    assert rig_axes.load(folder / "other.toml").motor("track") == 4, "gaps are for imports only"
    with pytest.raises(ToolError, match=r"cannot read the axes there.toml"):
        rig_axes.load(Path("there.toml"))
