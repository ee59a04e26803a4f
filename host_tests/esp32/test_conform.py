"""The conformance kit on the simulated ESP32, through its UART, in virtual time: it sees the edges
behind the shift registers and presses the switches."""

import pytest

from framestep_tools.conform import kit
from framestep_tools.conform.checks import every_check
from framestep_tools.simulator.esp32_board import BOARD, PROCESSOR, RISC_V
from host_tests.conform.score import alarms, results_on

SHORT = {"framing", "lengths", "numbers"}
LONG = {check.subject for check in every_check()} - SHORT


@pytest.mark.parametrize(
    ("short", "processor"),
    [
        pytest.param(True, PROCESSOR, id="short"),
        pytest.param(False, PROCESSOR, marks=pytest.mark.repeats, id="long"),
        pytest.param(True, RISC_V, marks=pytest.mark.repeats, id="on a RISC-V"),
    ],
)
def test_it_conforms(short, processor):
    found = list(results_on(BOARD, SHORT if short else LONG, processor=processor))
    assert alarms(found) == []
    assert sum(result.verdict == kit.PASSED for result in found) > (90 if short else 500)
