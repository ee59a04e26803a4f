"""`framestep prove`: verdicts, reports, what stamps mean. host_tests/board/test_prove.py has the
measuring itself."""

import json

import numpy as np
import pytest

from framestep_tools.cli import app
from framestep_tools.files import ROOT
from framestep_tools.prove import report
from framestep_tools.prove.board import Board
from framestep_tools.prove.figures import (
    AS_EMULATED,
    BETTER,
    FIGURES,
    LESS,
    MORE,
    NOT_MEASURED,
    SAME,
    WORSE,
    Figure,
)
from framestep_tools.prove.instrument import program, times_ns
from framestep_tools.prove.measure import HELD, RATES, trapezoids

HZ = 125_000_000


@pytest.mark.parametrize(
    "better, measured, verdict",
    [
        (LESS, 110, AS_EMULATED),
        (LESS, 89, BETTER),
        (LESS, 111, WORSE),
        (MORE, 111, BETTER),
        (MORE, 89, WORSE),
        (SAME, 89, WORSE),
        (SAME, 111, WORSE),
        (SAME, 90, AS_EMULATED),
        (LESS, None, NOT_MEASURED),
    ],
)
def test_verdicts(better, measured, verdict):
    assert Figure("figure", "µs", better, 2, 0.1, "").verdict(measured, 100) == verdict
    assert Figure("figure", "µs", better, 2, 0.1, "").verdict(measured, None) == NOT_MEASURED


def test_the_slack_holds_where_the_share_is_less():
    figure = Figure("figure", "µs", LESS, 2, 0.1, "")
    assert figure.verdict(3, 1) == AS_EMULATED
    assert figure.verdict(3.1, 1) == WORSE


def execute(words, level, cycles):
    """Run the program on a pin whose level at each cycle is level(cycle); what it pushes."""
    x, isr, at, pushed = 0xFFFFFFFF, 0, 6, []
    for cycle in range(cycles):
        word, following = words[at], 6 if at == 7 else at + 1  # the wrap
        if word == 0xA0C1:
            isr = x
        elif word == 0x8000:
            pushed.append(isr)
        elif word >> 13 == 0:
            taken = x != 0 if word >> 5 & 7 == 2 else level(cycle)
            assert word >> 5 & 7 in (2, 6)
            if word >> 5 & 7 == 2:
                x = (x - 1) & 0xFFFFFFFF
            following = word & 31 if taken else following
        else:
            assert word == 0xA042
        at = following
    return np.array(pushed, np.uint32)


@pytest.mark.parametrize("both", [True, False])
def test_stamps_are_within_the_loop(both):
    """The program, executed word by word, on pulses of all sorts of lengths."""
    lengths = np.random.default_rng(1).integers(5, 300, 200)
    edges = np.cumsum(lengths)
    stamps = execute(
        program(0, both),
        lambda cycle: bool(np.searchsorted(edges, cycle, side="right") & 1),
        edges[-1] + 20,
    )
    seen = edges if both else edges[::2]
    assert len(stamps) == len(seen)
    off = times_ns(stamps, both, 0, HZ) / 8 - seen
    assert np.ptp(off) <= 2
    later = times_ns(stamps[7:], both, 7, HZ)
    assert np.allclose(later, times_ns(stamps, both, 0, HZ)[7:])


@pytest.mark.parametrize("fps_milli", [23_976, 24_000, 60_000])
def test_the_motors_of_a_run_begin_and_end_at_rest(fps_milli):
    for rate, steps in zip(RATES, trapezoids(fps_milli), strict=True):
        assert len(set(steps[: HELD + 1])) == 1
        assert len(set(steps[-HELD - 1 :])) == 1
        assert np.diff(steps).min() >= 0
        assert np.diff(steps).max() * fps_milli / 1000 == pytest.approx(rate, rel=0.05)


def test_every_figure_is_known_of_the_emulated_board_and_explained():
    emulated = report.emulated_figures()
    assert set(emulated) == {figure.key for figure in FIGURES}
    page = (ROOT / "docs/hardware-reports.md").read_text()
    assert [f.key for f in FIGURES if f"`{f.key}`" not in page] == []


def a_report(**figures):
    emulated = report.emulated_figures()
    return report.Report(
        "pico", "emulated", HZ, "MicroPython", {**emulated, **figures}, [], emulated
    )


def test_a_report(tmp_path):
    found = a_report(late_us=100_000.0)
    assert found.worse == ["late_us"]
    data, page = found.write(tmp_path / "folder")
    assert json.loads(data.read_text())["verdicts"]["late_us"] == WORSE
    assert "| late_us | 100 000 | " in page.read_text()


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(report.ToolError, match="cannot write"):
        a_report().write(tmp_path / "file")


def test_figures_of_another_version_are_not_compared(tmp_path, monkeypatch):
    other = tmp_path / "emulated.json"
    other.write_text('{"framestep": "0.0.1", "figures": {}}')
    monkeypatch.setattr(report, "EMULATED", other)
    with pytest.raises(report.ToolError, match=r"of framestep 0\.0\.1"):
        report.emulated_figures()


def test_it_asks_before_pins_move(monkeypatch, capsys):
    """And says which drivers to unplug; no port is opened before."""
    asked = []
    monkeypatch.setattr("typer.confirm", lambda text, **_: asked.append(text))
    assert app.status(["prove", "/dev/none"]) == 130
    assert app.status(["prove", "/dev/none", "--with-drivers"]) == 130
    assert "enable pins" in asked[0]
    assert "motors turn" in asked[1]


class Silent:
    """A client and a REPL of a board that has four motors."""

    def request(self, _message):
        return None

    def run(self, code):
        if "dumps" in code:
            return '{"name": "a board", "chip": "rp2040", "step": [1, 2, 3, 4]}'
        return "1000"


def test_a_board_that_cannot_watch_itself():
    with pytest.raises(report.ToolError, match="eight motors"):
        Board(Silent(), Silent().run, {}, "here")
