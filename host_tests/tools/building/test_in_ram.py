"""tools/micropython/in_ram.sh: a build fails if a name there has no effect."""

import subprocess

import pytest

from framestep_tools.building.board_files import ROOT

SCRIPT = ROOT / "tools/micropython/in_ram.sh"


def names(array):
    code = f"source <(sed -n '/^{array}=(/,/^)/p' {SCRIPT}); printf '%s\\n' \"${{{array}[@]}}\""
    return subprocess.check_output(["bash", "-c", code], text=True).split()


@pytest.fixture
def build(tmp_path):
    """build(symbols, sources, missing): check an image with these symbols, without this file."""

    def check(change=(), sources="", missing=None):
        symbols = dict.fromkeys(names("FUNCTIONS"), "20001000")
        symbols |= dict.fromkeys(names("FROM_FLASH"), "10001000") | dict(change)
        listing = "".join(f"{at} T {name}\n" for name, at in symbols.items() if at)
        (tmp_path / "nm").write_text(f"#!/bin/sh\ncat <<END\n{listing}END\n")
        (tmp_path / "nm").chmod(0o755)
        for folder in ("py", "shared", "ports"):
            (tmp_path / folder).mkdir()
        (tmp_path / "shared/mpirq.c").write_text(sources)
        for name in {*names("FAST")} - {missing}:
            (tmp_path / f"{name}.c.o").touch()
        command = [SCRIPT, "--check", tmp_path / "nm", tmp_path, tmp_path]
        result = subprocess.run(command, capture_output=True, text=True)
        assert (result.returncode == 0) is (result.stderr == "")
        return result.stderr

    return check


def test_all_names_are_right(build):
    assert build() == ""


@pytest.mark.parametrize(
    ("change", "sources", "missing", "said"),
    [
        ({"mp_load_attr": None}, "", None, "mp_load_attr is not in the image"),
        ({"mp_load_attr": "10002000"}, "", None, "mp_load_attr is not in RAM"),
        ({"mutex_exit": "20002000"}, "", None, "mutex_exit is not in flash"),
        ({"mutex_exit": None}, "", None, "mutex_exit is not in the image"),
        ({}, "void mp_irq_dispatch(void) {}", None, "mp_irq_dispatch is not in the image"),
        ({}, "", "objtuple", "no file objtuple.c is compiled"),
    ],
)
def test_a_wrong_name_fails_the_build(build, change, sources, missing, said):
    assert said in build(change, sources, missing)
