"""The drawings in docs are what their script makes."""

import pytest

from framestep_tools.documents import coil_picture, rig_picture
from framestep_tools.documents.plot_virtuals import FILES, FOLDER, draw


@pytest.mark.parametrize("kind", FILES)
def test_drawing_is_up_to_date(kind, tmp_path):
    draw(kind, tmp_path / "drawn.svg")
    drawn = (tmp_path / "drawn.svg").read_text()
    assert drawn == (FOLDER / FILES[kind]).read_text(), (
        f"docs/use/{FILES[kind]} is not what the source makes: run `make plots`"
    )


def test_the_rig_in_readme_is_up_to_date():
    assert rig_picture.drawing() == rig_picture.PICTURE.read_text(), (
        "docs/rig.svg is not what the source makes: run `make plots`"
    )


def test_the_coils_of_a_motor_are_up_to_date():
    assert coil_picture.drawing() == coil_picture.PICTURE.read_text(), (
        "docs/start/coils.svg is not what the source makes: run `make plots`"
    )
