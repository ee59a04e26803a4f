"""The conformance kit: no alarm on sound devices, one on each seeded fault of a selection."""

import re

import pytest

from framestep_tools.building.board_files import ROOT
from framestep_tools.conform import kit, report
from framestep_tools.conform.checks import every_check
from host_tests.conform import score
from host_tests.conform.score import VARIANTS, Variant

# The checks that these tests run on each variant; `make conform` runs all of them.
_PARTS = {
    "DWORD acknowledgements, an acknowledged MOVE": ("framing", "numbers", "virtuals"),
    "HI of 49 bytes": ("framing",),
    "no lights": ("lengths", "lights"),
    "lights that no trace shows": ("lights",),
    "answers after 20 ms": ("shoot",),
    "each step at its frame's time": ("runs",),
    "S-curve ramps and play in the gears": ("edges", "couples", "virtuals"),
    "no inputs, outputs or switches": ("inputs", "lights"),
}


def test_the_simulator_passes_and_there_are_enough_checks():
    (two,) = [variant for variant in VARIANTS if variant.name == "two motors"]
    results = score.judge(two)
    assert score.alarms(results) == []
    assert sum(result.verdict == kit.PASSED for result in results) >= 600


def test_arms_on_as_many_motors_as_they_take():
    (all_of_them,) = [variant for variant in VARIANTS if variant.name == "as the simulator is"]
    results = score.judge(all_of_them, ("arms",))
    assert score.alarms(results) == []
    assert {result.verdict for result in results} == {kit.PASSED}
    assert len(results) >= 80


@pytest.mark.parametrize("name", _PARTS)
def test_devices_that_are_right_in_another_way_raise_no_alarm(name):
    (variant,) = [variant for variant in VARIANTS if variant.name == name]
    assert score.alarms(score.judge(variant, _PARTS[name])) == []


def test_a_check_of_a_jog_or_a_stop_waits_for_backlash_to_be_taken_up():
    """40 steps take a quarter of a second, in which the load does not move."""
    slow = Variant("much play", 2, {"motors": [{"jerk": 100, "backlash": 40}]})
    results = score.judge(slow, ("motors", "virtuals"))
    assert len(results) >= 90
    assert score.alarms(results) == []


@pytest.mark.parametrize(
    "fault",
    (*score.FAULTS[4::24], *[fault for fault in score.FAULTS if fault.subject == "arms"][:6:2]),
    ids=lambda fault: fault.name,
)
def test_faults_are_found(fault):
    assert score.found(fault)


def test_there_are_enough_faults_and_most_are_of_behaviour():
    names = [fault.name for fault in score.FAULTS]
    assert len(set(names)) == len(names) >= 170
    assert len(score.motion_faults.FAULTS) > len(names) / 2


@pytest.mark.parametrize("empty", ["VARIANTS", "FAULTS", "judge"])
def test_a_score_of_nothing_has_failed(monkeypatch, empty):
    monkeypatch.setattr(score, empty, (lambda variant: []) if empty == "judge" else ())
    with pytest.raises(SystemExit) as ended:
        score.main()
    assert "no " in str(ended.value)


def test_each_check_is_named_once_and_rests_on_something():
    checks = every_check()
    names = [(check.subject, check.name) for check in checks]
    assert len(set(names)) == len(names)
    notes = (ROOT / "docs/internals/protocol-notes.md").read_text()
    for check in checks:
        assert check.source
        for number in re.findall(r"note (\d+\.\d+)", check.source):
            assert f"**{number}**" in notes, check


def test_a_report_is_compared_with_an_earlier_one():
    check = every_check()[0]
    before = report.as_json("one", [kit.Result(check, kit.PASSED)])
    assert report.changes(before, [kit.Result(check, kit.PASSED)]) == []
    (change,) = report.changes(before, [kit.Result(check, kit.FAULT, "<none>")])
    assert change.endswith("was passed, is fault")
    assert "&lt;none&gt;" in report.as_html("a & b", [kit.Result(check, kit.FAULT, "<none>")])
