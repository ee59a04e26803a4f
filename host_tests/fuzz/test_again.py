"""Sessions again on 32-bit MicroPython: some of `make fuzz`, and faults that must be found."""

import pytest

from host_tests.recording import REPLAY, all_differences, growth, recorded, wrapping_at
from host_tests.script import parse
from host_tests.script_player import Player

from . import fuzz
from .again import Again
from .findings import Finding
from .sessions import Host, run

SEED = "again"


def played(again, host=None) -> None:
    """Judge a session with a run, in which the host returns three times."""
    host = host or Host({"motor_count": 2}, make=again.trial)
    run(host)
    for _ in range(6):
        host.trial.do("close")
        host.wait(700)
        host.trial.do("open")
        host.wait(700)
    again.judge(host.trial)


def with_a_fault(tmp_path, sound, faulty) -> Again:
    """Return an Again whose replay has `faulty` in place of `sound`."""
    source = REPLAY.read_text()
    assert source.count(sound) == 1
    script = tmp_path / "faulty.py"
    script.write_text(source.replace(sound, faulty))
    return Again(script)


def test_sessions_are_the_same():
    again = Again()
    played(again)
    for number in range(6):
        _, finding = fuzz.session(f"{SEED}/{number}", 300, again=again)
        assert finding is None, finding


def test_a_leak_of_16_bytes_is_found(tmp_path):
    """The least that the heap gives, leaked at every second opening of the port."""
    opened = "            hal.port.openings += 1\n"
    leaks = opened + (
        "            if hal.port.openings & 1:\n"
        "                hal.kept = (getattr(hal, 'kept', None),)\n"
    )
    with pytest.raises(Finding, match="the heap grows"):
        played(with_a_fault(tmp_path, opened, leaks))


@pytest.mark.parametrize("takes", ["[now]", "now + 0x3FFFFFFF"], ids=["list", "large number"])
def test_memory_that_a_pass_takes_is_found(takes, tmp_path):
    passes = "            self.controller.poll(now)\n"
    with pytest.raises(Finding, match="MemoryError"):
        played(with_a_fault(tmp_path, passes, passes + f"            {takes}\n"))


def test_another_byte_is_found(tmp_path):
    sent = "        notes.sent_count += count\n"
    wrong = sent + "        notes.sent[0] ^= self.openings\n"
    with pytest.raises(Finding, match="line 0"):
        played(with_a_fault(tmp_path, sent, wrong))


def test_of_many_sessions_those_that_differ_are_named(unix32f, tmp_path):
    """More than share a process."""
    with recorded() as recorders:
        for _ in range(32):
            Player(parse(["board pico", "5 open", "20 end"])).play()
    recordings = [each.finish() for each in recorders]
    for number in (1, 31):
        recordings[number].test = f"session {number}"
        recordings[number].did[0] += "0"
    found = all_differences(unix32f, recordings, tmp_path)
    assert [text.partition(":")[0] for text in found] == ["session 1", "session 31"]
    recordings[3].lines.append("R 0")  # no whole byte
    with pytest.raises(pytest.fail.Exception, match="non-hex digit") as failed:
        all_differences(unix32f, recordings, tmp_path)
    assert "\nat " not in str(failed.value), "what others printed"


@pytest.mark.parametrize(
    ("heap", "grows"),
    [
        ([7000, 7000, 7000], False),
        ([7000, 6968, 6968], False),  # something from the start was freed
        ([7000, 7016, 7032], True),
        ([7000, 7000, 7016], True),
        ([7000, 6968, 6984], True),
        ([7000, 7032, 7032, 7032], False),  # kept at the first use
        ([7000, 7032, 7032], True),  # perhaps it goes on
        ([7000, 7016, 7016, 7032, 7032, 7032], True),
    ],
)
def test_a_heap_that_grows_is_reported(heap, grows):
    assert bool(growth(heap)) is grows


def test_counters_wrap_at_a_moment_of_the_led():
    ticks, ms = wrapping_at(5000)
    assert (ticks + 4096) % 2**29 == (ms + 4096) % 2**30 == 0
