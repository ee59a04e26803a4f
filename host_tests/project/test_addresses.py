"""The web addresses of the repository and of its site are right in any clone and fork."""

import re

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


def test_the_packages_page_leads_to_the_repository(monkeypatch):
    """The wheel's description is README, read where its relative links lead nowhere."""
    page = (paths.ROOT / "README.md").read_text()
    monkeypatch.setattr(paths, "repository", lambda: "https://github.com/some/fork")
    targets = re.findall(r"\]\(([^)]*)\)", paths.linked_outside(page))
    assert len(targets) == len(re.findall(r"\]\(([^)]*)\)", page)) > 40
    assert all(target.startswith("https://") for target in targets)
    assert "https://github.com/some/fork/releases/latest" in targets
    for target in targets:
        kind, _, path = target.removeprefix("https://github.com/some/fork/").partition("/v0.1.0/")
        if kind in ("blob", "raw"):
            assert (paths.ROOT / path.partition("#")[0]).is_file(), target
            assert (kind == "raw") == path.endswith(".svg")
    monkeypatch.setattr(paths, "repository", lambda: None)
    assert re.findall(r"\]\((?!https)", paths.linked_outside(page)) == []
    assert paths.linked_outside("![a](b.svg)[c [d]](e.md)[f](https://g)") == "c [d][f](https://g)"
