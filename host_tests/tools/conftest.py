"""Fixtures that several files here use."""

import pytest

from host_tests.tools.move.move_samples import LINEAR


@pytest.fixture
def shot(tmp_path):
    """Return a folder with an axes.toml in it."""
    (tmp_path / "axes.toml").write_text(LINEAR)
    return tmp_path
