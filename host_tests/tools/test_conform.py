"""The conformance kit: no alarm on sound devices, one on each seeded fault of a selection."""

import re

import pytest

from framestep_tools.conform import kit, report, score
from framestep_tools.conform.faults import FAULTS
from framestep_tools.files import ROOT

ALARMS = (kit.FAULT, kit.DEPARTS)


def alarms(results):
    return [report.line(result) for result in results if result.verdict in ALARMS]


def test_the_simulator_passes_and_there_are_enough_checks():
    results = score.judge()
    assert alarms(results) == []
    assert len(results) >= 300
    assert sum(result.verdict == kit.PASSED for result in results) >= 300


@pytest.mark.parametrize(("motors", "rig"), [(1, None), (2, {"dialect": "dmc-lite"})])
def test_variants_that_are_right_raise_no_alarm(motors, rig):
    assert alarms(score.judge(motors=motors, rig=rig)) == []


@pytest.mark.parametrize("fault", FAULTS[::6], ids=lambda fault: fault.name)
def test_faults_are_found(fault):
    assert score.found(fault)


def test_each_check_is_named_once_and_rests_on_something():
    checks = kit.every_check()
    names = [(check.subject, check.name) for check in checks]
    assert len(set(names)) == len(names)
    notes = (ROOT / "docs" / "protocol-notes.md").read_text()
    for check in checks:
        assert check.source
        for number in re.findall(r"note (\d+\.\d+)", check.source):
            assert f"**{number}**" in notes, check


def test_a_report_is_compared_with_an_earlier_one():
    check = kit.every_check()[0]
    before = report.as_json("one", [kit.Result(check, kit.PASSED)])
    assert report.changes(before, [kit.Result(check, kit.PASSED)]) == []
    (change,) = report.changes(before, [kit.Result(check, kit.FAULT, "<none>")])
    assert change.endswith("was passed, is fault")
    assert "&lt;none&gt;" in report.as_html("a & b", [kit.Result(check, kit.FAULT, "<none>")])
