"""The drawings in docs are what their script makes."""

import pytest

from framestep_tools.documents import coil_picture, rig_picture
from framestep_tools.documents.plot_virtuals import FILES, FOLDER, draw


def up_to_date(kept, drawn):
    assert drawn == kept.read_text(), f"{kept} is not what the source makes: run `make plots`"


@pytest.mark.parametrize("kind", FILES)
def test_drawing_is_up_to_date(kind, tmp_path):
    draw(kind, tmp_path / "drawn.svg")
    up_to_date(FOLDER / FILES[kind], (tmp_path / "drawn.svg").read_text())


@pytest.mark.parametrize("picture", [rig_picture, coil_picture], ids=["rig", "coils"])
def test_a_picture_is_up_to_date(picture):
    up_to_date(picture.PICTURE, picture.drawing())
