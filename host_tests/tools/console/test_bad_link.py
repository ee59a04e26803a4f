"""The dead man's rules of a held jog over a bad link, in virtual time."""

import pytest

from framestep_tools.console.device import SILENCE_S
from host_tests.tools.console.bad_link import LATEST_S, LINKS, hold

JOG_TIMEOUT_S = 0.5
LOOK_S = 0.1  # the server looks this often
REACTION_S = 0.02  # of the board
BAD = LINKS["200 ms there and back, 5 % lost"]


@pytest.mark.parametrize("cut", [False, True], ids=["let go", "cut"])
@pytest.mark.parametrize("seed", range(4))
def test_the_device_ends_a_jog_that_is_not_repeated(cut, seed):
    ending = hold(BAD, seed, cut)
    assert ending.stop_s <= ending.jog_s + JOG_TIMEOUT_S + REACTION_S
    assert ending.stop_s <= SILENCE_S + LOOK_S + JOG_TIMEOUT_S + REACTION_S


@pytest.mark.parametrize("seed", range(4))
def test_the_server_ends_the_jog_of_a_silent_page(seed):
    """For a device that does not watch its jogs."""
    ending = hold(BAD, seed, cut=True, jog_timeout_ms=0)
    assert JOG_TIMEOUT_S < ending.stop_s <= ending.message_s + SILENCE_S + LOOK_S + REACTION_S


def test_without_either_rule_the_motor_goes_on():
    ending = hold(BAD, 0, cut=True, jog_timeout_ms=0, silence_s=LATEST_S * 2)
    assert ending.stop_s > LATEST_S - REACTION_S


def test_a_slow_link_alone_does_not_break_a_jog():
    ending = hold(LINKS["200 ms each way"], 0)
    assert ending.pauses == 0
    assert ending.stop_s <= 0.2 + REACTION_S
