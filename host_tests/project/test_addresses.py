"""The web addresses of the repository and of its site are right in any clone and fork."""

import pytest

from framestep_tools import paths


@pytest.mark.parametrize(
    "remote, wanted",
    [
        ("git@github.com:somebody/fork.git", "https://github.com/somebody/fork"),
        ("https://github.com/somebody/fork", "https://github.com/somebody/fork"),
        ("https://me:secret@gitlab.example.org/a/b/c.git/", "https://gitlab.example.org/a/b/c"),
        ("ssh://git@git.example.org:2222/a/b.git", "https://git.example.org/a/b"),
        ("/home/me/framestep", None),
        ("../framestep", None),
        ("file:///srv/git/framestep.git", None),
        ("C:/framestep", None),
        ("", None),
    ],
)
def test_the_page_of_a_remote(remote, wanted):
    assert paths.web_address(remote) == wanted


@pytest.mark.parametrize(
    "variables, wanted",
    [
        ({"GITHUB_REPOSITORY": "Some-Body/fork"}, "https://some-body.github.io/fork/"),
        ({"GITHUB_REPOSITORY": "Body/body.github.io"}, "https://body.github.io/"),
        (
            {"GITHUB_REPOSITORY": "a/b", "GITHUB_SERVER_URL": "https://git.example.org"},
            None,
        ),
        ({"SITE_URL": "https://rigs.example.org/framestep"}, "https://rigs.example.org/framestep/"),
    ],
)
def test_the_site_of_a_repository(variables, wanted, monkeypatch):
    for name in ("GITHUB_REPOSITORY", "GITHUB_SERVER_URL", "SITE_URL"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert paths.site() == wanted
